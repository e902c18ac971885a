//! A model at one place of its parameters, and the way to the best one.

use nalgebra::DVector;

use super::columns::{added_columns, bounds, linear, own_parameters, table_grams, table_of};
use super::judged::Judged;
use super::sizes::{Effort, SWEEPS, fit_in_turn, touches, with_sizes};
use super::unseen::unseen;
use crate::data::Data;
use crate::innovations::candidates::Table;
use crate::innovations::dependence::{Dependence, width};
use crate::innovations::estimate;
use crate::innovations::gram::{Gram, Solved, solve, total};
use crate::innovations::noise::{BalanceParts, Slopes, parts};
use crate::innovations::screen::precision;
use crate::mechanism::Balance;
use crate::model::Model;

/// Parameters whose step would gain less, in nats, are the best.
const SMALL_GAIN: f64 = 0.2;

/// A model at one place of its parameters under noise of some sizes.
pub struct Place {
    model: Model,
    noise: Vec<BalanceParts>,
    table: Table,
    grams: Vec<[Gram; 2]>,
    sum: Gram,
    /// With all columns: where the linear model would go from here.
    solved: Solved,
    /// Twice the negative log likelihood here, free dependences and the chain's nuisances fitted.
    here: f64,
}

impl Place {
    /// `sizes` are those of the noise; where there are none, the sensors' own. `fitted` has them fitted.
    pub fn new(
        data: &Data,
        model: Model,
        extra: &[Dependence],
        sizes: Option<&[BalanceParts]>,
        fitted: Option<Effort>,
    ) -> Option<Self> {
        let slopes = Slopes::new(data, &model);
        let fresh = parts(data, &slopes);
        let mut noise = match sizes {
            Some(old) => with_sizes(fresh, old),
            None => fresh,
        };
        let table = table_of(data, &model, &slopes, extra);
        if let Some(effort) = fitted {
            for _ in 0..SWEEPS {
                fit_in_turn(data, &table, &mut noise, &|_| true, false, effort);
            }
        }
        let prior = |i: usize| precision(&table, i);
        let grams = table_grams(data, &noise, &table);
        let sum = total(&grams);
        let chosen: Vec<usize> = (1..sum.products.nrows()).collect();
        let solved = solve(&sum.products, &chosen, &prior)?;
        let here = solve(&sum.products, &linear(&table, &model), &prior)?.rss + sum.log_variance;
        Some(Self {
            model,
            noise,
            table,
            grams,
            sum,
            solved,
            here,
        })
    }

    /// Nats that the linear model would still gain.
    fn to_gain(&self) -> f64 {
        0.5 * (self.here - self.solved.rss - self.sum.log_variance)
    }

    /// The same place with the noise fitted to it.
    pub fn refitted(
        mut self,
        data: &Data,
        extra: &[Dependence],
        effort: Effort,
        added: bool,
    ) -> Option<Self> {
        let columns = added_columns(&self.model, extra);
        let touched = |balance: Balance| {
            !added || touches(&self.table.columns[balance as usize], columns.clone())
        };
        fit_in_turn(data, &self.table, &mut self.noise, &touched, true, effort);
        Self::new(data, self.model, extra, Some(&self.noise), None)
    }

    /// At most so many steps towards the best parameters, none uphill.
    pub fn descended(self, data: &Data, extra: &[Dependence], steps: usize) -> Option<Self> {
        let mut place = self;
        let mut shrink = 1.0;
        for _ in 0..steps {
            if place.to_gain() < SMALL_GAIN {
                break;
            }
            let model = place.stepped(data, shrink);
            let next = Self::new(data, model, extra, Some(&place.noise), None)?;
            if next.here < place.here {
                place = next;
                shrink = f64::min(1.0, 2.0 * shrink);
            } else {
                shrink *= 0.3;
            }
        }
        Some(place)
    }

    fn stepped(&self, data: &Data, shrink: f64) -> Model {
        let bounds = bounds(data, &self.model);
        let mut p = self.model.vector();
        for (at, index) in own_parameters(&self.model).into_iter().enumerate() {
            let (low, high) = bounds[index];
            let most = if index < 2 {
                0.4
            } else if (high - low).is_finite() {
                0.25 * (high - low)
            } else {
                f64::INFINITY
            };
            let by = (shrink * self.solved.coefficients[at]).clamp(-most, most);
            if by.is_finite() {
                p[index] = (p[index] + by).clamp(low, high);
            }
        }
        self.model.with(&p)
    }

    /// What is to be said of the model here.
    pub fn judged(self, data: &Data, extra: &[Dependence]) -> Option<Judged> {
        let prior = |i: usize| precision(&self.table, i);
        let n = self.sum.products.nrows();
        // Free dependences are linear: at their best here.
        let linear = linear(&self.table, &self.model);
        let best = solve(&self.sum.products, &linear, &prior)?;
        let mut coefficients = DVector::zeros(n - 1);
        for (at, &i) in linear.iter().enumerate() {
            coefficients[i - 1] = best.coefficients[at];
        }
        let penalty: f64 = self.noise.iter().map(estimate::penalty).sum();
        let k = own_parameters(&self.model).len();
        Some(Judged {
            loss: 0.5 * (self.sum.log_variance + best.rss) + penalty,
            free: self.model.vector().len() - self.model.base.len() + width(extra),
            extra: extra.to_vec(),
            covariance: self.solved.covariance.view((0, 0), (k, k)).into_owned(),
            nuisances: self.table.nuisances.len(),
            prior: (0..n).map(prior).collect(),
            left: coefficients.clone(),
            unseen: unseen(data, &self.model, &self.table, &self.grams)?,
            model: self.model,
            parts: self.noise,
            grams: self.grams,
        })
    }
}
