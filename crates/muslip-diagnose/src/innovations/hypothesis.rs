//! A model judged with everything that it may claim: its parameters, the chain's nuisances and the noise are fitted
//! with it, so that two models are compared each at its own best.

use nalgebra::{DMatrix, DVector};

use super::candidates::{Table, table};
use super::dependence::{Dependence, width};
use super::estimate::{self, Readings};
use super::gram::{Columns, Gram, Solved, grams, solve, total};
use super::noise::{BalanceParts, Slopes, parts};
use super::screen::precision;
use crate::correction::Levers;
use crate::data::Data;
use crate::mechanism::Balance;
use crate::model::{Model, TYRE_BASE};
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
    pub covariance: nalgebra::DMatrix<f64>,
}

/// How likely a model makes what it was not fitted to, in nats.
#[derive(Clone)]
pub struct Unseen {
    /// Negative log likelihood of each run under parameters from all others.
    pub runs: Vec<f64>,
    /// The same of each half run under parameters from all other halves.
    pub halves: Vec<f64>,
}

impl Judged {
    /// What it says of unseen runs where this were the noise.
    #[must_use]
    pub fn unseen_under(&self, data: &Data, noise: &[BalanceParts]) -> Option<Unseen> {
        let slopes = Slopes::new(data, &self.model);
        let table = table_of(data, &self.model, &slopes, &self.extra);
        let grams = table_grams(data, noise, &table);
        unseen(data, &self.model, &table, &grams)
    }

    /// Coefficients of each free dependence.
    #[must_use]
    pub fn dependences(&self) -> Vec<(&Dependence, Vec<f64>)> {
        let mut at = own_parameters(&self.model).len();
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
            .map(|(own, coefficients)| own.correction(data, &coefficients))
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

/// How much work a judgement may be.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Steps towards the best parameters.
    pub steps: usize,
    /// Steps towards the best sizes of the noise.
    pub noise_steps: usize,
    /// Every so many blocks are read for the sizes of the noise.
    pub noise_stride: usize,
}

/// Parameters whose step would gain less, in nats, are the best.
const SMALL_GAIN: f64 = 0.2;
/// What is known of a parameter without any reading: its standard deviation as a share of its range.
const SHARE_OF_RANGE: f64 = 0.3;
/// Blocks of one balance that are enough for the sizes of its noise.
const ENOUGH_BLOCKS: usize = 6000;

/// Every so many blocks are enough for the sizes of the noise.
#[must_use]
pub fn noise_stride(data: &Data) -> usize {
    let count = |balance: usize| {
        let blocks = data.blocks.iter().map(|b| b[balance].time.len());
        blocks.sum::<usize>()
    };
    let most = (0..3).map(count).max().unwrap_or(0);
    most.div_ceil(ENOUGH_BLOCKS).max(1)
}

fn bounds(data: &Data, model: &Model) -> Vec<(f64, f64)> {
    let mut all = vec![(f64::NEG_INFINITY, f64::INFINITY); model.base.len()];
    let [peak, critical] = data.context.nominal;
    all[0] = ((0.05 * peak).ln(), (10.0 * peak).ln());
    all[1] = ((0.05 * critical).ln(), (10.0 * critical).ln());
    for term in &model.terms {
        all.extend(
            data.catalogue
                .get(term.entry)
                .parameters(&data.context)
                .iter()
                .map(|p| (p.low, p.high)),
        );
    }
    all
}

/// Inner products of all columns of a table under this noise, summed over the balances, by run and half.
#[must_use]
pub fn table_grams(data: &Data, parts: &[BalanceParts], table: &Table) -> Vec<[Gram; 2]> {
    let width = 1
        + table.base
        + table.nuisances.len()
        + table.candidates.last().map_or(0, |c| c.columns.end);
    let mut by_run = vec![[Gram::empty(width), Gram::empty(width)]; data.series.len()];
    for part in parts {
        for (into, own) in
            by_run
                .iter_mut()
                .zip(grams(data, part, &table.columns[part.balance as usize], 1))
        {
            for (into, own) in into.iter_mut().zip(own) {
                into.add(&own);
            }
        }
    }
    by_run
}

/// The noise with every part at most as large as the sensors make plausible.
#[must_use]
pub fn capped(parts: &[BalanceParts]) -> Vec<BalanceParts> {
    let mut all = parts.to_vec();
    for source in all.iter_mut().flat_map(|p| &mut p.sources) {
        source.log_std = source.log_std.min(source.log_cap);
    }
    all
}

/// Sizes of the noise carried over to gains taken about another model.
fn with_sizes(mut fresh: Vec<BalanceParts>, old: &[BalanceParts]) -> Vec<BalanceParts> {
    for (new, old) in fresh.iter_mut().zip(old) {
        for (new, old) in new.sources.iter_mut().zip(&old.sources) {
            new.log_std = old.log_std;
        }
    }
    fresh
}

/// Columns of a model that nothing is to be added to.
fn table_of(data: &Data, model: &Model, slopes: &Slopes, extra: &[Dependence]) -> Table {
    let none = vec![crate::mechanism::Residuals::default(); data.series.len()];
    table(data, model, slopes, &none, extra, &[], &|_| false)
}

/// A model at one place of its parameters under noise of some sizes.
struct Place {
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
    fn new(
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
        fit_in_turn(data, &self.table, &mut self.noise, &touched, true, effort);
        Self::new(data, self.model, extra, Some(&self.noise), None)
    }

    /// At most so many steps towards the best parameters, none uphill.
    fn descended(self, data: &Data, extra: &[Dependence], steps: usize) -> Option<Self> {
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

/// Places in the model's vector of what is fitted: the base law's two parameters and all of the terms.
fn own_parameters(model: &Model) -> Vec<usize> {
    let n = model.vector().len();
    [0, 1].into_iter().chain(TYRE_BASE..n).collect()
}

/// How often the noise of every balance is fitted in turn where nothing is known of any.
const SWEEPS: usize = 2;

/// Fits the noise of one balance after the other, by the likelihood of all: they share the coefficients. `carried` is
/// whether it was fitted to another model.
fn fit_in_turn(
    data: &Data,
    table: &Table,
    noise: &mut [BalanceParts],
    touched: &dyn Fn(Balance) -> bool,
    carried: bool,
    effort: Effort,
) {
    let prior = |i: usize| precision(table, i);
    let own = |part: &BalanceParts| {
        total(&grams(data, part, &table.columns[part.balance as usize], 1)).products
    };
    let mut products: Vec<DMatrix<f64>> = noise.iter().map(own).collect();
    for at in 0..noise.len() {
        let part = &mut noise[at];
        if !touched(part.balance) {
            continue;
        }
        let mut others = DMatrix::zeros(products[at].nrows(), products[at].ncols());
        for (_, own) in products.iter().enumerate().filter(|(i, _)| *i != at) {
            others += own;
        }
        let readings = Readings {
            data,
            columns: &table.columns[part.balance as usize],
            precision: &prior,
            others: &others,
            stride: effort.noise_stride,
        };
        if carried {
            fit_from_both(&readings, part, effort.noise_steps);
        } else {
            estimate::fit(&readings, part, effort.noise_steps);
        }
        products[at] = own(part);
    }
}

/// Columns of what was added last: the last dependence's, or the last term's.
fn added_columns(model: &Model, extra: &[Dependence]) -> core::ops::Range<usize> {
    let terms = 1 + own_parameters(model).len();
    match extra.split_last() {
        Some((_, before)) => terms + width(before)..terms + width(extra),
        None => {
            let own = model.terms.last().map_or(0, |t| t.parameters.len());
            terms - own..terms
        }
    }
}

/// Whether any of these columns is more than nothing in a balance.
fn touches(columns: &[Columns], which: core::ops::Range<usize>) -> bool {
    columns
        .iter()
        .filter(|run| run.len() >= which.end)
        .any(|run| run[which.clone()].iter().flatten().any(|x| *x != 0.0))
}

/// Columns whose coefficients are at their best wherever the model stands: free dependences and the chain's nuisances.
fn linear(table: &Table, model: &Model) -> Vec<usize> {
    let first = 1 + own_parameters(model).len();
    (first..1 + table.base + table.nuisances.len()).collect()
}

/// Fits the sizes of a balance's noise from what they are and, where they were fitted to another model, from the
/// sensors' own as well: what swallowed an effect before it was in the model must be let go of.
fn fit_from_both(readings: &Readings<'_>, part: &mut BalanceParts, steps: usize) {
    let mut anew = part.clone();
    let carried_on = estimate::fit(readings, part, steps);
    for source in &mut anew.sources {
        source.log_std = source.log_start;
    }
    if estimate::fit(readings, &mut anew, steps) < carried_on {
        *part = anew;
    }
}

/// A first guess of the noise.
#[derive(Clone, Copy)]
pub struct Guess<'a> {
    /// As it was fitted to another model.
    pub parts: &'a [BalanceParts],
    /// Whether that model lacks the last term or dependence and nothing else: then the noise of a balance that this
    /// one does not touch stays what it is.
    pub added: bool,
}

impl<'a> Guess<'a> {
    /// That of a model that differs in more than its last term.
    #[must_use]
    pub fn of(parts: &'a [BalanceParts]) -> Self {
        Self {
            parts,
            added: false,
        }
    }

    /// That of a model to which something is added.
    #[must_use]
    pub fn beside(judged: &'a Judged) -> Self {
        Self {
            parts: &judged.parts,
            added: true,
        }
    }
}

/// Fits and judges a model from this start under a first guess of the noise.
#[must_use]
pub fn judge(
    data: &Data,
    start: &Model,
    extra: &[Dependence],
    guess: Option<Guess<'_>>,
    effort: Effort,
) -> Option<Judged> {
    let first = (guess.is_none()).then_some(effort);
    let added = guess.is_some_and(|g| g.added);
    Place::new(data, start.clone(), extra, guess.map(|g| g.parts), first)?
        .descended(data, extra, effort.steps)?
        .refitted(data, extra, effort, added)?
        .descended(data, extra, effort.steps.div_ceil(2))?
        .judged(data, extra)
}

/// What a model says of every run and half run that it were not fitted to.
fn unseen(data: &Data, model: &Model, table: &Table, grams: &[[Gram; 2]]) -> Option<Unseen> {
    let sum = total(grams);
    let chosen: Vec<usize> = (1..sum.products.nrows()).collect();
    let bounds = bounds(data, model);
    let own = own_parameters(model);
    let wide = |i: usize| match own.get(i - 1) {
        Some(&p) => (SHARE_OF_RANGE * (bounds[p].1 - bounds[p].0)).powi(-2),
        None => precision(table, i),
    };
    let all = solve(&sum.products, &chosen, &wide)?;
    let of = |own: &Gram| outside(own, &sum, &all, &chosen, &wide);
    let runs = grams
        .iter()
        .map(|run| of(&total(core::slice::from_ref(run))));
    let halves = grams.iter().flatten().map(of);
    Some(Unseen {
        runs: runs.collect::<Option<_>>()?,
        halves: halves.collect::<Option<_>>()?,
    })
}

/// Negative log likelihood of a part of the readings, given all others: parameters that the others do not know are as
/// wide as these leave them.
fn outside(
    own: &Gram,
    sum: &Gram,
    all: &Solved,
    chosen: &[usize],
    prior: &dyn Fn(usize) -> f64,
) -> Option<f64> {
    let rest = solve(&(&sum.products - &own.products), chosen, prior)?;
    Some(0.5 * (own.log_variance + all.rss - rest.rss + all.log_det - rest.log_det))
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    /// Inner products of a residual and its columns, unit white noise.
    fn gram(residual: &DVector<f64>, columns: &DMatrix<f64>) -> Gram {
        let n = residual.len();
        let all = DMatrix::from_fn(1 + columns.ncols(), n, |i, k| match i {
            0 => residual[k],
            _ => columns[(k, i - 1)],
        });
        Gram {
            products: &all * all.transpose(),
            log_variance: 0.0,
            count: n,
        }
    }

    /// Minus the log density of a residual whose coefficients have this prior precision, without the constant.
    fn dense(residual: &DVector<f64>, columns: &DMatrix<f64>, precision: f64) -> f64 {
        let n = residual.len();
        let covariance = DMatrix::identity(n, n) + columns * columns.transpose() / precision;
        let factor = covariance.cholesky().unwrap();
        let log_det: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        log_det + 0.5 * residual.dot(&factor.solve(residual))
    }

    #[test]
    fn a_likelihood_never_falls_by_a_term_that_may_be_nothing() {
        use crate::innovations::toy::{CRITICAL, Noise, PEAK, stop};
        use crate::mechanism::Id;
        use crate::model::Term;
        let data = stop(Noise::TYPICAL, 4);
        let effort = Effort {
            steps: 8,
            noise_steps: 20,
            noise_stride: 1,
        };
        let law = Model::of_law(PEAK, CRITICAL);
        let mut base = judge(&data, &law, &[], None, effort).unwrap();
        for _ in 0..3 {
            let guess = Some(Guess::of(&base.parts));
            base = judge(&data, &base.model, &[], guess, effort).unwrap();
        }
        let mut tried = 0;
        for (entry, mechanism) in data.catalogue.entries().iter().enumerate() {
            let nothing = match mechanism.id() {
                Id::WearDrift if mechanism.form() == "energy" => vec![0.0],
                Id::RollingResistance if mechanism.form() == "constant" => vec![0.0],
                Id::InertialReaction | Id::WheelInertia => vec![0.0],
                _ => continue,
            };
            let mut model = base.model.clone();
            model.terms.push(Term {
                entry,
                parameters: nothing,
            });
            let Some(with) = judge(&data, &model, &[], Some(Guess::beside(&base)), effort) else {
                continue;
            };
            tried += 1;
            assert!(
                with.loss < base.loss + 0.5,
                "{:?}: {} beside {}",
                mechanism.id(),
                with.loss,
                base.loss
            );
        }
        assert!(tried >= 3, "{tried}");
    }

    #[test]
    fn what_others_leave_unknown_widens_the_prediction_of_a_run() {
        // The second column is hardly seen in the first run: dense conditioning says what the second costs.
        let wave = |k: usize, f: f64| (f * k as f64 + 0.3).sin();
        let x = DMatrix::from_fn(12, 2, |k, i| match (k < 6, i) {
            (_, 0) => wave(k, 0.7),
            (true, _) => 0.05 * wave(k, 1.3),
            (false, _) => 2.0 * wave(k, 1.3),
        });
        let e = DVector::from_fn(12, |k, _| {
            1.5 * wave(k, 0.7) - 2.0 * x[(k, 1)] + wave(k, 5.1)
        });
        let part = |from: usize| (e.rows(from, 6).into_owned(), x.rows(from, 6).into_owned());
        let ((e1, x1), (e2, x2)) = (part(0), part(6));
        let (first, second) = (gram(&e1, &x1), gram(&e2, &x2));
        let mut sum = first;
        sum.add(&second);
        let prior = |_: usize| 0.5;
        let all = solve(&sum.products, &[1, 2], &prior).unwrap();
        let found = outside(&second, &sum, &all, &[1, 2], &prior).unwrap();
        let expected = dense(&e, &x, 0.5) - dense(&e1, &x1, 0.5);
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        // With its parameters taken for certain it would cost far more.
        let certain = solve(&(&sum.products - &second.products), &[1, 2], &prior).unwrap();
        let left = &e2 + &x2 * &certain.coefficients;
        assert!(0.5 * left.norm_squared() > found);
    }
}
