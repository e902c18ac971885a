//! The base law's two parameters by plain least squares: on the channels as recorded, beside named terms, or next to
//! another model.

use rayon::prelude::*;

use crate::campaign::Rig;
use crate::data::Data;
use crate::innovations::derivatives::tyre_slopes_in;
use crate::innovations::rows::tyre_row_of;
use crate::model::Model;
use crate::series::{LawProducts, Series};

/// Steps to the best parameters.
const STEPS: usize = 8;
/// Halvings of a step that comes no closer.
const HALVINGS: usize = 4;
/// Largest step of a logarithm.
const MOST: f64 = 0.2;
/// A step that matters no more.
const SMALL: f64 = 1e-5;

/// The model with the law's parameters at which its readings come closest to these, one vector a run.
pub(crate) fn closest(data: &Data, start: &Model, readings: &[Vec<f64>]) -> Model {
    let square = |model: &Model| -> f64 { squares(data, model, readings).iter().sum() };
    let mut model = start.clone();
    let mut least = square(&model);
    for _ in 0..STEPS {
        let Some(step) = step(data, &model, readings) else {
            break;
        };
        let mut share = 1.0;
        let closer = (0..=HALVINGS).find_map(|_| {
            let mut next = model.clone();
            for (base, step) in next.base.iter_mut().zip(step) {
                *base += (share * step).clamp(-MOST, MOST);
            }
            share *= 0.5;
            let value = square(&next);
            (value < least).then_some((next, value))
        });
        let Some((next, value)) = closer else {
            break;
        };
        (model, least) = (next, value);
        if step.iter().all(|s| s.abs() < SMALL) {
            break;
        }
    }
    model
}

/// Sum of squares of what a model leaves of these readings of the drag, by run.
pub(crate) fn squares(data: &Data, model: &Model, readings: &[Vec<f64>]) -> Vec<f64> {
    let runs = data.series.par_iter().enumerate();
    runs.map(|(run, s)| s.tyre_square(&left_of(data, model, run, &readings[run])))
        .collect()
}

/// The same, and where each run has a peak friction of its own: runs differ in it.
pub(crate) fn squares_and_within_runs(
    data: &Data,
    model: &Model,
    readings: &[Vec<f64>],
) -> [Vec<f64>; 2] {
    let runs = data.series.par_iter().enumerate();
    let of_run = |(run, s): (usize, &Series)| {
        let left = left_of(data, model, run, &readings[run]);
        let slopes = (!left.is_empty()).then(|| tyre_slopes_in(data, model, run, &[0]));
        let all = s.tyre_square(&left);
        match slopes.as_deref() {
            Some([of_peak]) => (all, square_beside(s, of_peak, &left)),
            _ => (all, all),
        }
    };
    let (all, within): (Vec<f64>, Vec<f64>) = runs.map(of_run).unzip();
    [all, within]
}

/// Sum of squares of what the best multiple of a column leaves of a row, over the usable samples of the tyre's balance.
fn square_beside(s: &Series, column: &[f64], left: &[f64]) -> f64 {
    let (mut xx, mut xe, mut ee) = (0.0, 0.0, 0.0);
    for k in s.tyre.iter().flat_map(Clone::clone) {
        let (x, e) = (column[k], left[k]);
        if (x + e).is_finite() {
            xx += x * x;
            xe += x * e;
            ee += e * e;
        }
    }
    // What nothing is left of is all rounding.
    f64::max(ee - if xx > 0.0 { xe * xe / xx } else { 0.0 }, 1e-12 * ee)
}

/// What a model leaves of these readings of the drag on one run, in N; empty where it is not recorded.
fn left_of(data: &Data, model: &Model, run: usize, readings: &[f64]) -> Vec<f64> {
    let rows = tyre_row_of(data, model, run);
    let drag = &data.series[run].drag;
    let shifted = rows.iter().zip(drag).zip(readings);
    shifted.map(|((e, own), y)| e - own + y).collect()
}

/// The Gauss-Newton step of the law's two parameters; `None` where the samples do not tell them apart.
fn step(data: &Data, model: &Model, readings: &[Vec<f64>]) -> Option<[f64; 2]> {
    let left_and_slopes = |run: usize| {
        let left = left_of(data, model, run, &readings[run]);
        let slopes = (!left.is_empty()).then(|| tyre_slopes_in(data, model, run, &[0, 1]));
        (left, slopes.unwrap_or_default())
    };
    let runs = 0..data.series.len();
    let by_run: Vec<_> = runs.into_par_iter().map(left_and_slopes).collect();
    let (mut a, mut b, mut c, mut u, mut v) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (s, (e, slopes)) in data.series.iter().zip(&by_run) {
        let [x, y] = slopes.as_slice() else { continue };
        for k in s.tyre.iter().flat_map(Clone::clone) {
            let (x, y) = (x[k], y[k]);
            if (x + y + e[k]).is_finite() {
                a += x * x;
                b += x * y;
                c += y * y;
                u -= x * e[k];
                v -= y * e[k];
            }
        }
    }
    let determinant = a * c - b * b;
    (determinant > 1e-9 * a * c)
        .then(|| [(c * u - b * v) / determinant, (a * v - b * u) / determinant])
}

/// A law by plain least squares.
pub(crate) struct Plain {
    /// The law alone.
    pub(crate) model: Model,
    /// Mean square of what it leaves of the drag, in N²; infinite where no peak fits.
    pub(crate) left: f64,
}

/// The law fitted to the runs given, their channels as they are: the best peak friction at each slip at the peak, and
/// the best of these on ever finer grids.
pub(crate) fn plain(rig: &Rig, series: &[Series]) -> Plain {
    let square = |log_critical: f64| -> (f64, f64) {
        let LawProducts { xx, xy, yy, count } =
            LawProducts::of(series, rig.radius_m, log_critical.exp());
        if xx > 0.0 {
            ((yy - xy * xy / xx) / count, xy / xx)
        } else {
            (f64::INFINITY, rig.peak_friction)
        }
    };
    let mut best = (f64::INFINITY, rig.critical_slip.ln(), rig.peak_friction);
    let mut width = 1.6;
    for _ in 0..5 {
        let centre = best.1;
        for i in -6..=6 {
            let at = centre + width * f64::from(i) / 6.0;
            let (value, peak) = square(at);
            if value < best.0 && peak > 0.0 {
                best = (value, at, peak);
            }
        }
        width /= 4.0;
    }
    Plain {
        model: Model::of_law(best.2, best.1.exp()),
        left: best.0,
    }
}

#[cfg(test)]
mod tests {
    use core::ops::Range;

    use super::*;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, stop};

    #[test]
    fn another_peak_friction_of_a_run_is_no_error_within_it() {
        let data = stop(Noise::TYPICAL, 4);
        let model = Model::of_law(PEAK, CRITICAL);
        let s = &data.series[0];
        let law: Vec<f64> = left_of(&data, &model, 0, &vec![0.0; s.len()])
            .iter()
            .map(|left| -left)
            .collect();
        let reading = |k: usize, beside: f64| 1.3 * law[k] + beside * (k as f64).cos();
        let of = |beside: f64| {
            vec![
                (0..s.len())
                    .map(|k| reading(k, beside))
                    .collect::<Vec<f64>>(),
            ]
        };
        let all = squares(&data, &model, &of(0.0))[0];
        let both = squares_and_within_runs(&data, &model, &of(0.0));
        assert!((both[0][0] / all - 1.0).abs() < 1e-12);
        let within = |beside: f64| squares_and_within_runs(&data, &model, &of(beside))[1][0];
        assert!(within(0.0) < 1e-9 * all, "{} {all}", within(0.0));
        // What is beside it is left: half of 40 N squared a sample.
        let count: usize = s.tyre.iter().map(Range::len).sum();
        let share = within(40.0) / (800.0 * count as f64);
        assert!((share - 1.0).abs() < 0.02, "{share}");
    }
}
