//! How sure a name is: weights of the sets that were tried, spreads of the figures, and what else fits.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::choose::{Candidate, Search};
use crate::data::{Data, Listed, WIDTH};
use crate::fit::{Fitted, Joint, dot};
use crate::mechanism::{Id, Law, Reported};
use crate::model::Model;
use crate::noise::weight;
use crate::number::{Dual, Number};

/// Softness of the weights in nats: models of this kind are never exactly true, so differences of a few nats,
/// or of a few percent of what is explained, decide nothing.
const SOFTNESS: f64 = 3.0;
/// The same as a share of what is explained.
const SOFT_SHARE: f64 = 0.012;
/// Standard deviation that the form of a mechanism leaves in its figure, as a share of the figure: measured on
/// campaigns made by other forms of the same physics (`cargo xtask trial`).
fn form_share(figure: &str) -> f64 {
    match figure {
        // What rings is seldom one mode with viscous damping.
        "damping_ratio" => 0.3,
        // A slope at the mean of what is seldom a straight line.
        "friction_change_per_m_s" => 0.12,
        // States that relax in several steps, or not at one rate.
        "time_constant" | "length" | "amplitude" | "full_skid_ratio" | "friction_loss"
        | "torque_loss" => 0.08,
        _ => 0.05,
    }
}
/// Alternatives under this probability are not worth a line.
const LEAST_ALTERNATIVE: f64 = 0.01;

/// Posterior weights of the sets of the chosen size.
fn weights(search: &Search) -> Vec<(&Candidate, f64)> {
    let size = search.chosen.ids.len();
    let explained = (search.base.criterion - search.chosen.criterion).max(0.0);
    let softness = SOFTNESS + SOFT_SHARE * explained;
    let mut all: Vec<(&Candidate, f64)> = search
        .tried
        .iter()
        .filter(|c| c.ids.len() == size && c.ids != search.chosen.ids)
        .map(|c| {
            (
                c,
                (-(c.criterion - search.chosen.criterion) / softness)
                    .min(0.0)
                    .exp(),
            )
        })
        .collect();
    all.push((&search.chosen, 1.0));
    let total: f64 = all.iter().map(|(_, w)| w).sum();
    for (_, w) in &mut all {
        *w /= total;
    }
    all
}

/// Probability of each mechanism to belong to the set, over the sets of the chosen size.
#[must_use]
pub fn membership(search: &Search) -> BTreeMap<Id, f64> {
    let mut sums = BTreeMap::new();
    for (candidate, weight) in weights(search) {
        for id in &candidate.ids {
            *sums.entry(*id).or_insert(0.0) += weight;
        }
    }
    sums
}

/// What else a chosen mechanism could be: other mechanisms in its place, strongest first.
#[must_use]
pub fn alternatives(search: &Search, id: Id) -> Vec<(Id, f64)> {
    let mut sums: BTreeMap<Id, f64> = BTreeMap::new();
    for (candidate, weight) in weights(search) {
        if candidate.ids.contains(&id) {
            continue;
        }
        for other in candidate
            .ids
            .iter()
            .filter(|i| !search.chosen.ids.contains(i))
        {
            *sums.entry(*other).or_insert(0.0) += weight;
        }
    }
    let mut all: Vec<(Id, f64)> = sums
        .into_iter()
        .filter(|(_, w)| *w >= LEAST_ALTERNATIVE)
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    all
}

/// Covariance of a fitted model's parameters: the inverse information, widened where blocks of about a second
/// scatter more than their innovations say (a sandwich, Huber 1967).
#[must_use]
pub fn covariance(joint: &Joint<'_>, fitted: &Fitted) -> DMatrix<f64> {
    let n = fitted.model.vector().len();
    let inverse = inverse(&fitted.information);
    let mut meat = DMatrix::zeros(n, n);
    let mut blocks = 0;
    for part in &joint.parts {
        for &run in part.runs {
            let (e, columns) = part.jacobian(&fitted.model, run);
            let step = part.data.series[run].typical_dt * part.noise.whitener.block as f64;
            let length = (1.0 / step).clamp(20.0, 5000.0) as usize;
            let score: Vec<f64> = e.iter().map(|e| e * weight(*e)).collect();
            for from in (0..e.len()).step_by(length) {
                let to = (from + length).min(e.len());
                let g: Vec<f64> = columns
                    .iter()
                    .map(|c| dot(&c[from..to], &score[from..to]))
                    .collect();
                blocks += 1;
                for i in 0..n {
                    for j in 0..n {
                        meat[(i, j)] += g[i] * g[j];
                    }
                }
            }
        }
    }
    if blocks <= 2 * n || n == 0 {
        return inverse;
    }
    meat *= blocks as f64 / (blocks - n) as f64;
    let sandwich = &inverse * meat * &inverse;
    // The wider of the two in each parameter, correlations of the plain inverse kept.
    let widen: Vec<f64> = (0..n)
        .map(|i| {
            let plain = inverse[(i, i)].max(1e-300);
            (sandwich[(i, i)] / plain).clamp(1.0, 100.0).sqrt()
        })
        .collect();
    DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * widen[i] * widen[j])
}

/// Inverse of an information matrix; directions without information get a wide but finite variance.
#[must_use]
pub fn inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
    let n = information.nrows();
    let scale: Vec<f64> = (0..n)
        .map(|i| information[(i, i)].max(1e-12).sqrt())
        .collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let value = information[(i, j)] / (scale[i] * scale[j]);
        if i == j { value + 1e-9 } else { value }
    });
    match scaled.cholesky() {
        Some(factor) => {
            let inverse = factor.inverse();
            DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (scale[i] * scale[j]))
        }
        None => DMatrix::from_fn(n, n, |i, j| {
            if i == j {
                1.0 / (scale[i] * scale[i])
            } else {
                0.0
            }
        }),
    }
}

/// A mechanism's figures with their gradient in all parameters of the model.
fn figures_in<T: Listed>(data: &Data, model: &Model, p: &[T], place: usize) -> Vec<Reported<T>> {
    let mut at = model.base.len();
    for term in &model.terms[..place] {
        at += term.parameters.len();
    }
    let own = &p[at..at + model.terms[place].parameters.len()];
    let law = if model.base.len() >= 2 {
        Law::rudd(p[0].exp(), p[1].exp())
    } else {
        Law::rudd(T::constant(1.0), T::constant(0.1))
    };
    T::entry(&data.catalogue, model.terms[place].entry).report(
        own,
        &law,
        &data.context,
        &data.series,
    )
}

/// A mechanism's figures by the contract with standard deviations: by the parameters' covariance (delta
/// method) and a share for form.
#[must_use]
pub fn figures(
    data: &Data,
    model: &Model,
    covariance: &DMatrix<f64>,
    place: usize,
) -> Vec<(Reported<f64>, f64)> {
    let p = model.vector();
    let plain = figures_in(data, model, &p, place);
    let mut gradients = vec![vec![0.0; p.len()]; plain.len()];
    for from in (0..p.len()).step_by(WIDTH) {
        let dual: Vec<Dual<WIDTH>> = p
            .iter()
            .enumerate()
            .map(|(i, v)| {
                if i >= from && i < from + WIDTH {
                    Dual::variable(*v, i - from)
                } else {
                    Dual::constant(*v)
                }
            })
            .collect();
        for (gradient, reported) in gradients
            .iter_mut()
            .zip(figures_in(data, model, &dual, place))
        {
            for (i, slope) in reported.value.slope.iter().enumerate().take(p.len() - from) {
                gradient[from + i] = *slope;
            }
        }
    }
    plain
        .into_iter()
        .zip(gradients)
        .map(|(reported, gradient)| {
            let g = nalgebra::DVector::from_vec(gradient);
            let variance = g.dot(&(covariance * &g)).max(0.0);
            let form = form_share(reported.name) * deviation(&reported, data);
            let std = (variance + form * form).sqrt();
            let std = if std.is_finite() {
                std
            } else {
                reported.value.abs()
            };
            (reported, std)
        })
        .collect()
}

/// Size of a figure against what it would be if nothing were missing: a radius of 0.313 m for one of 0.310 m is
/// a small deviation of a large figure.
fn deviation(reported: &Reported<f64>, data: &Data) -> f64 {
    let null = match reported.name {
        "radius" => data.context.radius,
        "mass" => data.context.mass,
        "inertia" => data.context.inertia,
        "gain" => 1.0,
        _ => 0.0,
    };
    (reported.value - null).abs()
}
