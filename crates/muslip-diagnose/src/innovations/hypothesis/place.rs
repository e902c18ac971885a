//! A model at one place of its parameters, and the way to the best one.

use std::sync::Arc;

use nalgebra::DVector;

use super::columns::{added_columns, bounds, grams_by_balance, linear, over_balances, table_of};
use super::filtered::Noise;
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

/// Share of its range by which a parameter may lie within its bound and be at it.
const AT_BOUND: f64 = 1e-9;

/// A model at one place of its parameters under noise of some sizes.
#[derive(Clone)]
pub struct Place {
    model: Model,
    noise: Noise,
    table: Arc<Table>,
    /// Inner products by balance, run and half.
    by_balance: Vec<Vec<[Gram; 2]>>,
    /// Their sum over the balances.
    grams: Vec<[Gram; 2]>,
    sum: Gram,
    /// With all columns.
    solved: Solved,
    /// Where the linear model would go from here within the bounds, and how far each own parameter would go.
    within: Within,
    /// Twice the negative log likelihood here, free dependences and the chain's nuisances fitted.
    here: f64,
    /// By what the noise and nuisances of the levels enter is another model's, whatever this one is.
    noise_held: bool,
}

/// The linear model's best among the places within the bounds, as nearly as parameters that are held one after the other
/// come to it.
#[derive(Clone)]
struct Within {
    /// Sum of squares there.
    rss: f64,
    /// The way of each own parameter.
    steps: Vec<f64>,
    /// Which own parameters stay where they are.
    held: Vec<bool>,
}

impl Within {
    /// Parameters at a bound that would leave it stay where they are, and the others go as if these were known: the way
    /// together with them would lead elsewhere.
    fn new(
        data: &Data,
        model: &Model,
        sum: &Gram,
        prior: &dyn Fn(usize) -> f64,
        free: &Solved,
    ) -> Option<Self> {
        let bounds = bounds(data, model);
        let own = model.free_places();
        let p = model.vector();
        // By how much of its range a parameter at a bound would leave it.
        let outwards = |i: usize, step: f64| {
            let (low, high) = bounds[own[i]];
            let (range, p) = (high - low, p[own[i]]);
            let leaves = p - low <= AT_BOUND * range && step < 0.0
                || high - p <= AT_BOUND * range && step > 0.0;
            if leaves { step.abs() / range } else { 0.0 }
        };
        let mut within = Self {
            rss: free.rss,
            steps: free.coefficients.iter().copied().take(own.len()).collect(),
            held: vec![false; own.len()],
        };
        loop {
            let free = (0..own.len()).filter(|i| !within.held[*i]);
            let by = free.map(|i| (i, outwards(i, within.steps[i])));
            let Some((farthest, _)) = by
                .filter(|(_, by)| *by > 0.0)
                .max_by(|a, b| a.1.total_cmp(&b.1))
            else {
                return Some(within);
            };
            // One at a time: without it the others may not leave.
            within.held[farthest] = true;
            let moves = |column: &usize| within.held.get(column - 1) != Some(&true);
            let chosen: Vec<usize> = (1..sum.products.nrows()).filter(moves).collect();
            let solved = solve(&sum.products, &chosen, prior)?;
            within.rss = solved.rss;
            within.steps = vec![0.0; own.len()];
            for (at, column) in chosen.iter().enumerate() {
                if let Some(step) = within.steps.get_mut(column - 1) {
                    *step = solved.coefficients[at];
                }
            }
        }
    }
}

/// What is known of the noise.
#[derive(Clone, Copy)]
pub enum Known<'a> {
    /// Nothing: the sensors' own sizes to start from, fitted with this effort.
    Nothing(Effort),
    /// Its sizes; by what it enters is the model's own.
    Sizes(&'a [BalanceParts]),
    /// Its sizes and by what it enters.
    Noise(&'a Noise),
}

impl Place {
    pub fn new(data: &Data, model: Model, extra: &[Dependence], known: Known<'_>) -> Option<Self> {
        let slopes = Slopes::new(data, &model);
        let mut noise = match known {
            Known::Nothing(_) => Noise::new(data, parts(data, &slopes)),
            Known::Sizes(old) => Noise::new(data, with_sizes(parts(data, &slopes), old)),
            Known::Noise(old) => old.clone(),
        };
        let force = noise.force_of_levels(&slopes);
        let table = Arc::new(table_of(data, &model, (&slopes, force), extra));
        let mut by_balance = grams_by_balance(&noise, &table);
        if let Known::Nothing(effort) = known {
            for _ in 0..SWEEPS {
                let all = &|_: Balance| true;
                let own = &mut by_balance;
                fit_in_turn(data, &table, &mut noise, own, &[], all, effort);
            }
        }
        let noise_held = matches!(known, Known::Noise(_));
        Self::at(data, model, table, noise, by_balance, noise_held)
    }

    /// The model with its table and what the noise makes of that.
    fn at(
        data: &Data,
        model: Model,
        table: Arc<Table>,
        noise: Noise,
        by_balance: Vec<Vec<[Gram; 2]>>,
        noise_held: bool,
    ) -> Option<Self> {
        let prior = |i: usize| precision(&table, i);
        let grams = over_balances(data, &table, &by_balance);
        let sum = total(&grams);
        let chosen: Vec<usize> = (1..sum.products.nrows()).collect();
        let solved = solve(&sum.products, &chosen, &prior)?;
        let here = solve(&sum.products, &linear(&table, &model), &prior)?.rss + sum.log_variance;
        let within = Within::new(data, &model, &sum, &prior, &solved)?;
        Some(Self {
            model,
            noise,
            table,
            by_balance,
            grams,
            sum,
            solved,
            within,
            here,
            noise_held,
        })
    }

    /// Another place under this one's noise.
    fn another(&self, data: &Data, model: Model, extra: &[Dependence]) -> Option<Self> {
        let known = if self.noise_held {
            Known::Noise(&self.noise)
        } else {
            Known::Sizes(self.noise.parts())
        };
        Self::new(data, model, extra, known)
    }

    /// The same place under another model's noise.
    pub fn under(self, data: &Data, noise: &Noise) -> Option<Self> {
        let by_balance = grams_by_balance(noise, &self.table);
        Self::at(
            data,
            self.model,
            self.table,
            noise.clone(),
            by_balance,
            true,
        )
    }

    /// Nats that the linear model would still gain.
    fn to_gain(&self) -> f64 {
        0.5 * (self.here - self.within.rss - self.sum.log_variance)
    }

    /// Negative logarithm of the prior of the noise's sizes.
    fn penalty(&self) -> f64 {
        self.noise.parts().iter().map(estimate::penalty).sum()
    }

    /// Negative restricted log likelihood here: not at the best of the linear model, by which the noise's sizes are fitted
    /// and which may be nowhere near.
    fn restricted_loss(&self) -> f64 {
        0.5 * (self.here + self.solved.log_det) + self.penalty()
    }

    /// The same place with the noise fitted to it: its columns, and by what the noise enters, stay what they are.
    fn refitted(
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
        let (noise, own) = (&mut self.noise, &mut self.by_balance);
        let known = &self.within.held;
        fit_in_turn(data, &self.table, noise, own, known, &touched, effort);
        let (noise, own) = (self.noise, self.by_balance);
        Self::at(data, self.model, self.table, noise, own, self.noise_held)
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
            let next = place.another(data, model, extra)?;
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
        let own = self.model.free_places();
        // Parameters that go together go together: the whole way is cut, not the way of one.
        let share = own.iter().zip(&self.within.steps);
        let share = share
            .map(|(&index, by)| most_of_step(index, bounds[index]) / by.abs())
            .filter(|share| share.is_finite())
            .fold(shrink, f64::min);
        let mut p = self.model.vector();
        for (&index, by) in own.iter().zip(&self.within.steps) {
            let (low, high) = bounds[index];
            if by.is_finite() {
                p[index] = (p[index] + share * by).clamp(low, high);
            }
        }
        self.model.with(&p)
    }

    /// What is to be said of the model once the noise, then its parameters are at their best beside where they have been
    /// sought; without these two where they are worse: sizes of the noise that are the best of part of the blocks need not be the
    /// best of all. `added` is whether only the noise of balances that its last term touches may change.
    pub fn at_its_best(
        self,
        data: &Data,
        extra: &[Dependence],
        effort: Effort,
        added: bool,
    ) -> Option<Judged> {
        let refitted = self
            .clone()
            .refitted(data, extra, effort, added)
            .and_then(|place| place.descended(data, extra, effort.steps.div_ceil(2)));
        match refitted {
            Some(refitted) if refitted.restricted_loss() < self.restricted_loss() => refitted,
            _ => self.descended(data, extra, effort.steps)?,
        }
        .judged(data, extra)
    }

    /// What is to be said of the model here.
    fn judged(self, data: &Data, extra: &[Dependence]) -> Option<Judged> {
        let prior = |i: usize| precision(&self.table, i);
        let n = self.sum.products.nrows();
        // Free dependences are linear: at their best here.
        let linear = linear(&self.table, &self.model);
        let best = solve(&self.sum.products, &linear, &prior)?;
        let mut coefficients = DVector::zeros(n - 1);
        for (at, &i) in linear.iter().enumerate() {
            coefficients[i - 1] = best.coefficients[at];
        }
        let k = self.model.free_places().len();
        Some(Judged {
            loss: 0.5 * (self.sum.log_variance + best.rss) + self.penalty(),
            free: self.model.vector().len() - self.model.base.len() + width(extra),
            extra: extra.to_vec(),
            covariance: self.solved.covariance.view((0, 0), (k, k)).into_owned(),
            nuisances: self.table.nuisances.len(),
            prior: (0..n).map(prior).collect(),
            left: coefficients.clone(),
            unseen: unseen(data, &self.model, &self.table, &self.grams)?,
            table: Some(self.table),
            model: self.model,
            parts: self.noise.into_parts(),
            grams: self.grams,
        })
    }
}

/// The most that a parameter goes in one step.
fn most_of_step(index: usize, (low, high): (f64, f64)) -> f64 {
    if index < 2 { 0.4 } else { 0.25 * (high - low) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{self, EFFORT, settled, stop, with_term};
    use crate::mechanism::Id;

    /// A stop of a vehicle that is six times as heavy as the rig file says, where more than three times is not plausible,
    /// and noise to be held.
    fn heavy() -> (Data, Judged, Noise) {
        let mut data = stop(toy::Noise::TYPICAL, 4);
        data.context.mass /= 6.0;
        data.tell_law_error(&settled(&data).parts);
        let base = settled(&data);
        let noise = Noise::new(&data, base.parts.clone());
        (data, base, noise)
    }

    /// A grade beside an error of the mass.
    fn place(data: &Data, base: &Judged, noise: &Noise, grade: f64, mass: f64) -> Place {
        let mut model = with_term(data, base, Id::GradeOrDrive, grade);
        let second = with_term(data, base, Id::VehicleInertia, mass);
        model.terms.extend(second.terms);
        Place::new(data, model, &[], Known::Noise(noise)).unwrap()
    }

    #[test]
    fn with_a_parameter_at_its_bound_the_others_are_at_their_best() {
        let (data, base, noise) = heavy();
        for start in [0.0, 1.0, 2.0] {
            let start = place(&data, &base, &noise, 0.0, start);
            let best = start.descended(&data, &[], EFFORT.steps).unwrap();
            let [grade, mass] = [0, 1].map(|i| best.model.terms[i].parameters[0]);
            assert_eq!(mass, 2.0);
            assert!(best.to_gain() < SMALL_GAIN, "{}", best.to_gain());
            let std = best.solved.covariance[(2, 2)].sqrt();
            for by in [-std, std] {
                let beside = place(&data, &base, &noise, grade + by, mass).here;
                assert!(beside > best.here, "{beside} {}", best.here);
            }
        }
    }

    #[test]
    fn noise_is_fitted_as_if_a_parameter_at_its_bound_were_known() {
        let (data, base, noise) = heavy();
        let sought = place(&data, &base, &noise, 0.0, 2.0);
        let sought = sought.descended(&data, &[], EFFORT.steps).unwrap();
        let before = sought.restricted_loss();
        let refitted = sought.refitted(&data, &[], EFFORT, false).unwrap();
        let after = refitted.restricted_loss();
        assert!(after < before, "{after} {before}");
        // The most that a few readings' fit may be off by.
        assert!(refitted.to_gain() < 5.0, "{}", refitted.to_gain());
    }

    #[test]
    fn nuisances_of_the_wheel_s_level_held_to_one_model_are_alike_beside_another() {
        let data = stop(toy::Noise::FINE_WHEEL, 4);
        let base = settled(&data);
        let mut other = base.model.clone();
        other.base[0] += 0.05;
        let squares = |model: &Model, noise: &Noise| -> Vec<f64> {
            let place = Place::new(&data, model.clone(), &[], Known::Noise(noise)).unwrap();
            let mut parts = noise.parts().iter();
            let wheel = parts.position(|own| own.balance == Balance::Wheel).unwrap();
            let products = total(&place.by_balance[wheel]).products;
            let nuisances = linear(&place.table, model).into_iter();
            nuisances.map(|i| products[(i, i)]).collect()
        };
        let free = Noise::new(&data, base.parts.clone());
        let held = free.clone().held_to(&data, &base.model);
        assert_eq!(squares(&other, &held), squares(&base.model, &held));
        assert_ne!(squares(&other, &free), squares(&base.model, &free));
    }
}
