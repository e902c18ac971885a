//! Joint non-linear fit: Levenberg-Marquardt on whitened, robustly weighted innovations, with exact
//! derivatives and with every parameter held inside its physical range.

use core::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::data::{Data, Listed, NARROW, WIDTH};
use crate::mechanism::Balance;
use crate::model::{Model, TYRE_BASE, tyre, vehicle, wheel};
use crate::noise::{NoiseSize, Whitener, loss, weight};
use crate::number::{Dual, Number};

/// Noise of one balance: a scale for each sample and one colour.
#[derive(Clone, Debug)]
pub struct BalanceNoise {
    /// Colour and size of what is left after scaling.
    pub whitener: Whitener,
    /// Standard deviation of each sample before whitening, by run; in the residual's unit.
    pub scale: Vec<Vec<f64>>,
    /// What the scale follows, once it is known (tyre balance).
    pub size: Option<NoiseSize>,
}

/// A balance of a campaign with its noise: what a model is fitted to.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The campaign.
    pub data: &'a Data,
    /// Which balance.
    pub balance: Balance,
    /// Its noise.
    pub noise: &'a BalanceNoise,
    /// Runs that take part, by position.
    pub runs: &'a [usize],
    /// Usable stretches of every run, by position.
    pub segments: &'a [Vec<Range<usize>>],
    /// Reading minus contact force by run, from the tyre model, for wheel and vehicle.
    pub chain: Option<&'a [Vec<f64>]>,
}

/// Standard deviations of the weak prior on the three input shares: they are corrections.
const SHARE_PRIOR: f64 = 0.5;

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The model at its best parameters.
    pub model: Model,
    /// Robust loss in nats, prior included.
    pub loss: f64,
    /// Normal matrix at the end, in the parameters' order.
    pub information: DMatrix<f64>,
}

impl Problem<'_> {
    /// Usable stretches of a run.
    #[must_use]
    pub fn segments(&self, run: usize) -> &[Range<usize>] {
        &self.segments[run]
    }

    /// Unscaled residual of one run: measured minus predicted (tyre), or the imbalance.
    #[must_use]
    pub fn residual<T: Listed>(&self, model: &Model, p: &[T], run: usize) -> Vec<T> {
        let Data {
            catalogue,
            series,
            context,
            ..
        } = self.data;
        let series = &series[run];
        let chain = self.chain.map(|c| c[run].as_slice());
        match self.balance {
            Balance::Tyre => {
                let mut force = tyre(catalogue, model, p, series, context).force;
                for (f, y) in force.iter_mut().zip(&series.drag) {
                    *f = -*f + *y;
                }
                force
            }
            Balance::Wheel => wheel(catalogue, model, p, series, context, chain),
            Balance::Vehicle => vehicle(catalogue, model, p, series, context, chain),
        }
    }

    /// Innovations of one run at these parameters.
    #[must_use]
    pub fn innovations(&self, model: &Model, run: usize) -> Vec<f64> {
        let residual = self.residual(model, &model.vector(), run);
        self.whiten(&residual, run)
    }

    /// Scales and whitens a column of one run.
    #[must_use]
    pub fn whiten(&self, column: &[f64], run: usize) -> Vec<f64> {
        let scaled: Vec<f64> = column
            .iter()
            .zip(&self.noise.scale[run])
            .map(|(r, s)| r / s)
            .collect();
        let mut out = Vec::with_capacity(column.len());
        self.noise
            .whitener
            .apply(&scaled, self.segments(run), &mut out);
        out
    }

    /// Number of innovations over all runs.
    #[must_use]
    pub fn count(&self) -> usize {
        self.runs
            .iter()
            .map(|&r| self.noise.whitener.count(self.segments(r)))
            .sum()
    }

    /// Loss of a model in nats by run (without prior).
    #[must_use]
    pub fn losses(&self, model: &Model) -> Vec<f64> {
        self.runs
            .iter()
            .map(|&r| self.innovations(model, r).iter().map(|e| loss(*e)).sum())
            .collect()
    }

    fn prior(&self, p: &[f64]) -> f64 {
        if self.balance == Balance::Tyre {
            p[2..TYRE_BASE]
                .iter()
                .map(|s| 0.5 * (s / SHARE_PRIOR).powi(2))
                .sum()
        } else {
            0.0
        }
    }

    /// Loss of a model in nats, prior included.
    #[must_use]
    pub fn loss(&self, model: &Model) -> f64 {
        self.losses(model).iter().sum::<f64>() + self.prior(&model.vector())
    }

    /// Innovations of a run and their derivatives in all parameters (columns).
    #[must_use]
    pub fn jacobian(&self, model: &Model, run: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
        let (residual, columns) = self.slopes(model, run);
        let columns = columns.iter().map(|c| self.whiten(c, run)).collect();
        (self.whiten(&residual, run), columns)
    }

    /// Residual of a run and its derivatives in all parameters, in the residual's unit.
    #[must_use]
    pub fn slopes(&self, model: &Model, run: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
        self.slopes_from::<WIDTH>(model, run, 0)
    }

    /// The same with the derivatives in the parameters from `first` on only, `N` in one pass.
    fn slopes_from<const N: usize>(
        &self,
        model: &Model,
        run: usize,
        first: usize,
    ) -> (Vec<f64>, Vec<Vec<f64>>)
    where
        Dual<N>: Listed,
    {
        let p = model.vector();
        let mut values = Vec::new();
        let mut columns = Vec::with_capacity(p.len() - first.min(p.len()));
        for from in (first..p.len().max(first + 1)).step_by(N) {
            let dual: Vec<Dual<N>> = p
                .iter()
                .enumerate()
                .map(|(i, v)| {
                    if i >= from && i < from + N {
                        Dual::variable(*v, i - from)
                    } else {
                        Dual::constant(*v)
                    }
                })
                .collect();
            let residual = self.residual(model, &dual, run);
            if from == first {
                values = residual.iter().map(|r| r.value).collect();
            }
            for i in 0..N.min(p.len().saturating_sub(from)) {
                columns.push(residual.iter().map(|r| r.slope[i]).collect());
            }
        }
        (values, columns)
    }

    /// Normal equations: information matrix, gradient and loss, summed over the runs.
    #[must_use]
    pub fn normal(&self, model: &Model) -> (DMatrix<f64>, DVector<f64>, f64) {
        let p = model.vector();
        let n = p.len();
        let mut information = DMatrix::zeros(n, n);
        let mut gradient = DVector::zeros(n);
        let mut total = self.prior(&p);
        for &run in self.runs {
            let (own, slope, loss) = self.normal_of(model, run);
            information += own;
            gradient += slope;
            total += loss;
        }
        if self.balance == Balance::Tyre {
            for i in 2..TYRE_BASE {
                information[(i, i)] += SHARE_PRIOR.powi(-2);
                gradient[i] += p[i] / SHARE_PRIOR.powi(2);
            }
        }
        (information, gradient, total)
    }

    /// The same of one run, without the prior.
    fn normal_of(&self, model: &Model, run: usize) -> (DMatrix<f64>, DVector<f64>, f64) {
        let (e, columns) = self.jacobian(model, run);
        let weights: Vec<f64> = e.iter().map(|e| weight(*e)).collect();
        let total = e.iter().map(|e| loss(*e)).sum::<f64>();
        let (information, gradient) = weighted_normal(&e, &weights, &columns);
        (information, gradient, total)
    }
}

/// Information matrix and gradient of weighted innovations and their derivatives.
#[must_use]
pub fn weighted_normal(
    innovations: &[f64],
    weights: &[f64],
    columns: &[Vec<f64>],
) -> (DMatrix<f64>, DVector<f64>) {
    let n = columns.len();
    let mut information = DMatrix::zeros(n, n);
    let mut gradient = DVector::zeros(n);
    let mut weighted = vec![0.0; innovations.len()];
    for i in 0..n {
        for ((w, c), h) in weighted.iter_mut().zip(&columns[i]).zip(weights) {
            *w = c * h;
        }
        gradient[i] = dot(&weighted, innovations);
        for j in 0..=i {
            let value = dot(&weighted, &columns[j]);
            information[(i, j)] = value;
            information[(j, i)] = value;
        }
    }
    (information, gradient)
}

/// Balances that are fitted together by one model: the tyre's alone, or wheel and vehicle.
pub struct Joint<'a> {
    /// The balances.
    pub parts: Vec<Problem<'a>>,
}

impl Joint<'_> {
    /// The campaign.
    #[must_use]
    pub fn data(&self) -> &Data {
        self.parts[0].data
    }

    /// Whether this is the tyre balance.
    #[must_use]
    pub fn is_tyre(&self) -> bool {
        self.parts[0].balance == Balance::Tyre
    }

    /// Number of innovations over all balances and runs.
    #[must_use]
    pub fn count(&self) -> usize {
        self.parts.iter().map(Problem::count).sum()
    }

    /// Loss of a model in nats, prior included.
    #[must_use]
    pub fn loss(&self, model: &Model) -> f64 {
        self.parts.iter().map(|part| part.loss(model)).sum()
    }

    /// Normal equations: information matrix, gradient and loss, summed over balances and runs.
    #[must_use]
    pub fn normal(&self, model: &Model) -> (DMatrix<f64>, DVector<f64>, f64) {
        let n = model.vector().len();
        let mut sum = (DMatrix::zeros(n, n), DVector::zeros(n), 0.0);
        for part in &self.parts {
            let (information, gradient, loss) = part.normal(model);
            sum.0 += information;
            sum.1 += gradient;
            sum.2 += loss;
        }
        sum
    }

    /// Runs that take part.
    #[must_use]
    pub fn runs(&self) -> &[usize] {
        self.parts[0].runs
    }

    /// Information matrix and gradient of one run over all balances, without the prior.
    #[must_use]
    pub fn normal_of(&self, model: &Model, run: usize) -> (DMatrix<f64>, DVector<f64>) {
        let n = model.vector().len();
        let mut sum = (DMatrix::zeros(n, n), DVector::zeros(n));
        for part in &self.parts {
            let (information, gradient, _) = part.normal_of(model, run);
            sum.0 += information;
            sum.1 += gradient;
        }
        sum
    }

    /// Loss of a model on one run in nats, without the prior.
    #[must_use]
    pub fn loss_of(&self, model: &Model, run: usize) -> f64 {
        self.parts
            .iter()
            .flat_map(|part| part.innovations(model, run))
            .map(loss)
            .sum()
    }

    /// Bounds of all parameters of a model.
    #[must_use]
    pub fn bounds(&self, model: &Model) -> Vec<(f64, f64)> {
        let mut bounds = Vec::new();
        if self.is_tyre() {
            let [peak, critical] = self.data().context.nominal;
            if self.data().rig.law_fixed {
                bounds.extend([(peak.ln(), peak.ln()), (critical.ln(), critical.ln())]);
            } else {
                bounds.extend([(0.005f64.ln(), 5f64.ln()), (0.004f64.ln(), 1.5f64.ln())]);
            }
            bounds.extend([(-0.3, 1.0), (-0.5, 1.0), (-0.3, 1.2)]);
        }
        for term in &model.terms {
            let parameters = self
                .data()
                .catalogue
                .get(term.entry)
                .parameters(&self.data().context);
            bounds.extend(parameters.iter().map(|p| (p.low, p.high)));
        }
        bounds
    }

    /// Fits all parameters from where the model stands.
    #[must_use]
    pub fn fit(&self, start: &Model, max_iterations: usize) -> Fitted {
        let bounds = self.bounds(start);
        let mut p = start.vector();
        for (x, (low, high)) in p.iter_mut().zip(&bounds) {
            *x = x.clamp(*low, *high);
        }
        let mut model = start.with(&p);
        let (mut information, mut gradient, mut loss) = self.normal(&model);
        let mut damping = 1e-3;
        for _ in 0..max_iterations {
            let mut improved = None;
            for _ in 0..6 {
                let Some(step) = bounded_step(&information, &gradient, damping, &p, &bounds) else {
                    damping *= 10.0;
                    continue;
                };
                let trial = moved(&p, step.as_slice(), 1.0, &bounds);
                let candidate = start.with(&trial);
                let value = self.loss(&candidate);
                if value.is_finite() && value < loss {
                    improved = Some((candidate, trial, value));
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
                damping = (damping * 8.0).max(1e-4);
            }
            let Some((candidate, trial, value)) = improved else {
                break;
            };
            let gain = loss - value;
            model = candidate;
            p = trial;
            (information, gradient, loss) = self.normal(&model);
            if gain < 0.02 + 1e-7 * loss.abs() {
                break;
            }
        }
        Fitted {
            model,
            loss,
            information,
        }
    }

    /// Whitened derivatives of a model in its own parameters, kept for judging what may be added to it.
    #[must_use]
    pub fn linearised(&self, model: &Model) -> Linearised {
        let n = model.vector().len();
        let mut information = DMatrix::zeros(n, n);
        let columns = self
            .parts
            .iter()
            .map(|part| {
                let (own, _, _) = part.normal(model);
                information += own;
                part.runs
                    .iter()
                    .map(|&run| part.jacobian(model, run).1)
                    .collect()
            })
            .collect();
        Linearised {
            columns,
            information,
        }
    }

    /// Loss that one undamped step from here is predicted to reach, and that step. `known` is the model without
    /// its last term: only the last term's own derivatives are taken here.
    #[must_use]
    pub fn outlook(&self, known: &Linearised, model: &Model) -> (f64, Vec<f64>) {
        let p = model.vector();
        let first = known.information.nrows();
        let n = p.len();
        let mut information = DMatrix::zeros(n, n);
        information
            .view_mut((0, 0), (first, first))
            .copy_from(&known.information);
        let mut gradient = DVector::zeros(n);
        let mut total = 0.0;
        for (part, by_run) in self.parts.iter().zip(&known.columns) {
            total += part.prior(&p);
            if part.balance == Balance::Tyre {
                for i in 2..TYRE_BASE {
                    gradient[i] += p[i] / SHARE_PRIOR.powi(2);
                }
            }
            for (&run, base) in part.runs.iter().zip(by_run) {
                let (residual, slopes) = if n - first <= NARROW {
                    part.slopes_from::<NARROW>(model, run, first)
                } else {
                    part.slopes_from::<WIDTH>(model, run, first)
                };
                let e = part.whiten(&residual, run);
                total += e.iter().map(|e| loss(*e)).sum::<f64>();
                let weights: Vec<f64> = e.iter().map(|e| weight(*e)).collect();
                let score: Vec<f64> = e.iter().zip(&weights).map(|(e, w)| e * w).collect();
                for (i, column) in base.iter().enumerate() {
                    gradient[i] += dot(column, &score);
                }
                let own: Vec<Vec<f64>> = slopes.iter().map(|c| part.whiten(c, run)).collect();
                for (i, column) in own.iter().enumerate() {
                    gradient[first + i] += dot(column, &score);
                    let weighted: Vec<f64> =
                        column.iter().zip(&weights).map(|(c, w)| c * w).collect();
                    for (j, other) in base.iter().chain(&own[..=i]).enumerate() {
                        let value = dot(&weighted, other);
                        information[(first + i, j)] += value;
                        if first + i != j {
                            information[(j, first + i)] += value;
                        }
                    }
                }
            }
        }
        let bounds = self.bounds(model);
        match bounded_step(&information, &gradient, 1e-6, &p, &bounds) {
            Some(step) => {
                let moved = moved(&p, step.as_slice(), 1.0, &bounds);
                let limited =
                    DVector::from_iterator(p.len(), moved.iter().zip(&p).map(|(x, from)| x - from));
                let predicted =
                    total + gradient.dot(&limited) + 0.5 * limited.dot(&(&information * &limited));
                (predicted, moved)
            }
            None => (total, p),
        }
    }
}

/// A model's whitened derivatives by balance, run and parameter, and its normal matrix.
pub struct Linearised {
    columns: Vec<Vec<Vec<Vec<f64>>>>,
    information: DMatrix<f64>,
}

/// Dot product in four lanes: fixed order, so results do not depend on the machine's threads.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let mut rest: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a4.zip(b4) {
        for i in 0..4 {
            lanes[i] += x[i] * y[i];
        }
    }
    rest += lanes[0] + lanes[1] + lanes[2] + lanes[3];
    rest
}

/// Parameters moved by a share of a step, held inside their bounds.
#[must_use]
pub fn moved(p: &[f64], step: &[f64], share: f64, bounds: &[(f64, f64)]) -> Vec<f64> {
    p.iter()
        .zip(step)
        .zip(bounds)
        .map(|((x, d), (low, high))| (x + share * d).clamp(*low, *high))
        .collect()
}

/// Damped Gauss-Newton step; parameters pushed against a bound are held there and the rest solved again.
pub(crate) fn bounded_step(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
    p: &[f64],
    bounds: &[(f64, f64)],
) -> Option<DVector<f64>> {
    let n = p.len();
    let mut held: Vec<bool> = (0..n)
        .map(|i| bounds[i].0 >= bounds[i].1 || information[(i, i)] <= 0.0)
        .collect();
    for _ in 0..3 {
        let free: Vec<usize> = (0..n).filter(|&i| !held[i]).collect();
        let mut step = DVector::zeros(n);
        if !free.is_empty() {
            let scale: Vec<f64> = free.iter().map(|&i| information[(i, i)].sqrt()).collect();
            let matrix = DMatrix::from_fn(free.len(), free.len(), |a, b| {
                let value = information[(free[a], free[b])] / (scale[a] * scale[b]);
                if a == b {
                    value * (1.0 + damping) + 1e-10
                } else {
                    value
                }
            });
            let right = DVector::from_fn(free.len(), |a, _| -gradient[free[a]] / scale[a]);
            let solved = matrix.cholesky()?.solve(&right);
            for (a, &i) in free.iter().enumerate() {
                step[i] = solved[a] / scale[a];
            }
        }
        if step.iter().any(|d| !d.is_finite()) {
            return None;
        }
        let mut again = false;
        for i in 0..n {
            let (low, high) = bounds[i];
            let at_low = p[i] <= low && step[i] < 0.0;
            let at_high = p[i] >= high && step[i] > 0.0;
            if !held[i] && (at_low || at_high) {
                held[i] = true;
                again = true;
            }
        }
        if !again {
            return Some(step);
        }
    }
    None
}
