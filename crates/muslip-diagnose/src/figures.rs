//! What a mechanism reports, with standard deviations: by the parameters' covariance and by what its form leaves open.

use nalgebra::DMatrix;

use crate::data::{Data, Listed, WIDTH};
use crate::mechanism::{Fitted, Law, Reported};
use crate::model::Model;
use crate::number::{Dual, Number};

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

/// A mechanism's figures with their gradient in all parameters of the model.
fn figures_in<T: Listed>(data: &Data, model: &Model, p: &[T], place: usize) -> Vec<Reported<T>> {
    let own = &p[model.places_of(place)];
    let fitted = Fitted {
        law: &Law::rudd(p[0].exp(), p[1].exp()),
        context: &data.context,
        series: &data.series,
    };
    T::entry(&data.catalogue, model.terms[place].entry).report(own, &fitted)
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
            let own = g.dot(&(covariance * &g)).max(0.0).sqrt();
            let std = with_form(own, &reported, data);
            let std = if std.is_finite() {
                std
            } else {
                reported.value.abs()
            };
            (reported, std)
        })
        .collect()
}

/// Standard deviation of a figure: its own, and what its form leaves open.
#[must_use]
pub fn with_form(own: f64, reported: &Reported<f64>, data: &Data) -> f64 {
    own.hypot(form_share(reported.name) * deviation(reported, data))
}

/// By how many standard deviations a figure differs from what it would be if nothing were missing; a place has no such value.
#[must_use]
pub fn stds_from_none(reported: &Reported<f64>, std: f64, data: &Data) -> f64 {
    if reported.name == "start" {
        f64::INFINITY
    } else {
        deviation(reported, data) / std.max(1e-12)
    }
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
