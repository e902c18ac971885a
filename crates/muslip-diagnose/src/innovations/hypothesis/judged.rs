//! A model at its best, and what it says of every run.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::columns::{table_grams, table_of};
use super::filtered::Noise;
use super::unseen::{Unseen, unseen};
use crate::correction::Levers;
use crate::data::Data;
use crate::innovations::candidates::Table;
use crate::innovations::dependence::Dependence;
use crate::innovations::gram::Gram;
use crate::innovations::noise::{BalanceParts, Slopes};
use crate::mechanism::Balance;
use crate::model::Model;
use crate::number::finite_or_zero;
use crate::repaired::Correction;

/// A model at its best, and what it says of every run.
#[derive(Clone)]
pub struct Judged {
    /// Base law and terms.
    pub model: Model,
    /// Free dependences beside them.
    pub extra: Vec<Dependence>,
    /// Noise under it.
    pub parts: Vec<BalanceParts>,
    /// Negative log likelihood at the best, the noise's prior included, in nats.
    pub loss: f64,
    /// Number of free parameters beside base and nuisances.
    pub free: usize,
    /// Inner products of base, terms and nuisances by half run: `[run][half]`.
    pub grams: Vec<[Gram; 2]>,
    /// What it says of runs that it was not fitted to.
    pub unseen: Unseen,
    /// Nuisances of the chain among the columns, the last ones.
    pub nuisances: usize,
    /// Prior precision by column of the grams.
    pub prior: Vec<f64>,
    /// Coefficients still left at the end: base, terms, nuisances.
    pub left: DVector<f64>,
    /// Covariance of base and terms' parameters, in the model's order.
    pub covariance: DMatrix<f64>,
    /// Its columns, as long as more is to be asked of them.
    pub(super) table: Option<Arc<Table>>,
}

impl Judged {
    /// What it says of unseen runs where this were the noise.
    #[must_use]
    pub fn unseen_under(&self, data: &Data, noise: &Noise) -> Option<Unseen> {
        let table = self.table.clone().unwrap_or_else(|| {
            let slopes = Slopes::new(data, &self.model);
            Arc::new(table_of(data, &self.model, &slopes, &self.extra))
        });
        let grams = table_grams(data, noise, &table);
        unseen(data, &self.model, &table, &grams)
    }

    /// The same without its columns, which take much room.
    #[must_use]
    pub fn without_columns(self) -> Self {
        Self {
            table: None,
            ..self
        }
    }

    /// Coefficients of each free dependence.
    #[must_use]
    pub fn dependences(&self) -> Vec<(&Dependence, Vec<f64>)> {
        let mut at = self.model.free_places().len();
        self.extra
            .iter()
            .map(|own| {
                let from = at;
                at += own.width();
                let own_part = (from..at).map(|i| finite_or_zero(self.left[i]));
                (own, own_part.collect())
            })
            .collect()
    }

    /// Free dependences of the tyre's balance as corrections.
    #[must_use]
    pub fn corrections(&self, data: &Data) -> Vec<Correction> {
        self.dependences()
            .into_iter()
            .filter(|(own, _)| own.balance == Balance::Tyre)
            .filter_map(|(own, coefficients)| own.correction(data, &coefficients))
            .collect()
    }

    /// What the corrections add to the model's reading in N, by run.
    #[must_use]
    pub fn corrected(&self, data: &Data) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = data.series.iter().map(|s| vec![0.0; s.len()]).collect();
        let corrections = self.corrections(data);
        if corrections.is_empty() {
            return all;
        }
        let levers = Levers::new(data, &self.model);
        for correction in &corrections {
            for (run, sum) in all.iter_mut().enumerate() {
                let added = correction.apply(data, &levers, run).unwrap_or_default();
                for (sum, added) in sum.iter_mut().zip(added) {
                    *sum += added;
                }
            }
        }
        all
    }

    /// The drag as recorded less what the corrections add, in N, by run: what is left to law and terms.
    #[must_use]
    pub fn drag_to_explain(&self, data: &Data) -> Vec<Vec<f64>> {
        let mut drags: Vec<Vec<f64>> = data.series.iter().map(|s| s.drag.clone()).collect();
        for (drag, corrected) in drags.iter_mut().zip(self.corrected(data)) {
            for (drag, corrected) in drag.iter_mut().zip(corrected) {
                *drag -= corrected;
            }
        }
        drags
    }
}
