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
use crate::variable::Variable;

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
            let force = noise.force_of_levels(&slopes);
            Arc::new(table_of(data, &self.model, (&slopes, force), &self.extra))
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
        self.added(data, &self.corrections(data))
    }

    /// What some corrections add to it.
    fn added(&self, data: &Data, corrections: &[Correction]) -> Vec<Vec<f64>> {
        let mut all: Vec<Vec<f64>> = data.series.iter().map(|s| vec![0.0; s.len()]).collect();
        if corrections.is_empty() {
            return all;
        }
        let levers = Levers::new(data, &self.model);
        for correction in corrections {
            for (run, sum) in all.iter_mut().enumerate() {
                let added = correction.apply(data, &levers, run).unwrap_or_default();
                for (sum, added) in sum.iter_mut().zip(added) {
                    *sum += added;
                }
            }
        }
        all
    }

    /// Whether law and terms make more of the model's reading, in the mean square, than is added to it by anything but the slip.
    /// What outweighs the law it is beside has taken its place: by the slip that is another curve, by anything else it draws
    /// the recordings that it was made from, and says nothing of the next.
    #[must_use]
    pub fn law_outweighs_corrections(&self, data: &Data) -> bool {
        let sum_of_squares = |all: &[Vec<f64>]| {
            let all = all.iter().flatten().filter(|x| x.is_finite());
            all.map(|x| x * x).sum::<f64>()
        };
        let mut corrections = self.corrections(data);
        corrections.retain(|own| own.variable != Variable::Slip.key(data));
        let added = sum_of_squares(&self.added(data, &corrections));
        added == 0.0 || added < sum_of_squares(&Levers::new(data, &self.model).force)
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

#[cfg(test)]
mod tests {
    use crate::correction::Action;
    use crate::innovations::dependence;
    use crate::innovations::hypothesis::{Guess, judge};
    use crate::innovations::toy::{EFFORT, Noise, settled, stop};
    use crate::variable::Variable;

    #[test]
    fn what_adds_more_than_the_law_takes_its_place() {
        let data = stop(Noise::TYPICAL, 4);
        let base = settled(&data);
        assert!(base.law_outweighs_corrections(&data), "none to outweigh");
        let free = |variable: &Variable| {
            let mut all = dependence::all(&data).into_iter();
            all.find(|own| own.variable == *variable && own.action == Action::Friction)
                .unwrap()
        };
        // The same share of the law's own force throughout, but at the knot that stands for all of it.
        let outweighs = |variable: &Variable, share: f64| {
            let extra = [free(variable)];
            let mut judged = judge(&data, &base.model, &extra, Guess::None, EFFORT).unwrap();
            let from = judged.model.free_places().len();
            judged.left.rows_mut(from, extra[0].width()).fill(share);
            !judged.law_outweighs_corrections(&data)
        };
        assert!(!outweighs(&Variable::Time, 0.9) && !outweighs(&Variable::Time, -0.9));
        assert!(outweighs(&Variable::Time, 3.0));
        assert!(!outweighs(&Variable::Slip, 3.0), "another curve");
    }
}
