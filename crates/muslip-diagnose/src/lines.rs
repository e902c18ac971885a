//! Lines in the spectrum of a residual: what repeats with time, with distance or with the wheel's angle.

use crate::data::Data;
use crate::fit::Problem;
use crate::omnibus::{Action, Column, finite_or_zero};
use crate::smooth::median_in_place;

/// Where lines are looked for: the variable's word, and how they act.
pub const PLACES: [(&str, Action); 5] = [
    ("time_s", Action::Force),
    ("time_s", Action::Friction),
    ("distance_m", Action::Friction),
    ("wheel_angle_rad", Action::Force),
    ("wheel_angle_rad", Action::Friction),
];

/// Nats beyond the number of bins that a line needs to be more than chance.
const CHANCE_NATS: f64 = 9.0;
/// Bins on either side from which the level around a line is read.
const NEAR: usize = 200;

/// A line.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Rate in rad per unit of the variable.
    pub rate: f64,
    /// Whether it stands out of the noise around it.
    pub significant: bool,
}

/// The variable of a line on one run, from zero at its start (rad, s or m).
#[must_use]
pub fn phase_of(data: &Data, word: &str, run: usize) -> Vec<f64> {
    let s = &data.series[run];
    match word {
        "time_s" => s.time.iter().map(|t| t - s.time[0]).collect(),
        "distance_m" => s.distance.clone(),
        _ => s.angle.clone(),
    }
}

/// Cosine and sine columns of a line, with a phase of their own in each run: the start of a recording is no event
/// of the rig.
#[must_use]
pub fn columns(
    problem: &Problem<'_>,
    rate: f64,
    lever: &dyn Fn(usize, usize) -> f64,
    phase: &dyn Fn(usize) -> Vec<f64>,
) -> Vec<Column> {
    let mut columns: Vec<Column> = Vec::new();
    for own in problem.runs {
        let [cosine, sine] = quadratures(rate, *own, lever, &phase(*own));
        for wave in [cosine, sine] {
            columns.push(
                problem
                    .data
                    .series
                    .iter()
                    .enumerate()
                    .map(|(run, s)| {
                        if run == *own {
                            wave.clone()
                        } else {
                            vec![0.0; s.len()]
                        }
                    })
                    .collect(),
            );
        }
    }
    columns
}

/// The same with one phase for all runs.
#[must_use]
pub fn common_columns(
    problem: &Problem<'_>,
    rate: f64,
    lever: &dyn Fn(usize, usize) -> f64,
    phase: &dyn Fn(usize) -> Vec<f64>,
) -> [Column; 2] {
    let mut both = [Column::new(), Column::new()];
    for run in 0..problem.data.series.len() {
        for (column, wave) in both
            .iter_mut()
            .zip(quadratures(rate, run, lever, &phase(run)))
        {
            column.push(wave);
        }
    }
    both
}

/// Cosine and sine of a line on one run.
fn quadratures(
    rate: f64,
    run: usize,
    lever: &dyn Fn(usize, usize) -> f64,
    at: &[f64],
) -> [Vec<f64>; 2] {
    at.iter()
        .enumerate()
        .map(|(k, u)| {
            let (sin, cos) = (rate * u).sin_cos();
            let lever = lever(run, k);
            (finite_or_zero(lever * cos), finite_or_zero(lever * sin))
        })
        .unzip::<f64, f64, Vec<f64>, Vec<f64>>()
        .into()
}

/// The rate at which a residual, seen through a lever, has most power over all runs: by fast Fourier transform on a
/// common grid of rates. `left` holds what is left over of each run at its usable samples, in standard deviations.
#[must_use]
pub fn strongest(
    problem: &Problem<'_>,
    left: &[&[f64]],
    lever: &dyn Fn(usize, usize) -> f64,
    phase: &dyn Fn(usize) -> Vec<f64>,
) -> Option<Line> {
    // Residual times lever over variance, on a uniform grid of the phase variable, by run.
    let mut span: f64 = 0.0;
    let mut step = f64::INFINITY;
    let mut parts: Vec<(Vec<f64>, Vec<f64>, Vec<f64>)> = Vec::new();
    for (place, &run) in problem.runs.iter().enumerate() {
        let u = phase(run);
        let e = left[place];
        let mut values = Vec::new();
        let mut at = Vec::new();
        let mut power = Vec::new();
        let order = problem.noise.whitener.ar.len();
        let mut i = 0;
        for segment in problem.segments(run) {
            for k in segment.clone().skip(order) {
                let lever = lever(run, k) / problem.noise.scale[run][k];
                at.push(u[k]);
                values.push(e[i].clamp(-4.0, 4.0) * lever);
                power.push(lever * lever);
                i += 1;
            }
        }
        let (Some(first), Some(last)) = (at.first(), at.last()) else {
            continue;
        };
        if last > first {
            span = span.max(last - first);
            step = step.min((last - first) / at.len() as f64);
            parts.push((at, values, power));
        }
    }
    if !(span > 0.0) || parts.is_empty() || !step.is_finite() {
        return None;
    }
    // Bins a little finer than the samples, a power of two long.
    let length = ((span / step) as usize + 1)
        .next_power_of_two()
        .min(1 << 17);
    let bin = span / (length - 1) as f64;
    let mut planner = realfft::RealFftPlanner::<f64>::new();
    let plan = planner.plan_fft_forward(2 * length);
    let mut input = plan.make_input_vec();
    let mut output = plan.make_output_vec();
    let mut total = vec![0.0; length + 1];
    for (at, values, power) in &parts {
        input.fill(0.0);
        let origin = at[0];
        for (u, v) in at.iter().zip(values) {
            let b = (((u - origin) / bin) as usize).min(length - 1);
            input[b] += v;
        }
        plan.process(&mut input, &mut output).ok()?;
        let own: f64 = power.iter().sum();
        if own > 0.0 {
            for (t, c) in total.iter_mut().zip(&output) {
                *t += c.norm_sqr() / own;
            }
        }
    }
    // Slow variation is for the splines: at least six periods in the longest run, and below a third of the
    // sampling rate.
    let low = 12;
    let high = (total.len() as f64 * 0.6 * (bin / step).min(1.0)) as usize;
    let band = low..high.max(low);
    let best = band
        .clone()
        .max_by(|a, b| total[*a].total_cmp(&total[*b]))?;
    // Of noise, a bin's power summed over the runs has a gamma distribution; this bounds the largest of all bins.
    let runs = parts.len() as f64;
    let chance = (band.len() as f64).ln() + CHANCE_NATS;
    let most = runs + (2.0 * runs * chance).sqrt() + chance;
    let near = best.saturating_sub(NEAR).max(band.start)..(best + NEAR).min(band.end);
    let median = median_in_place(&mut total[near].to_vec());
    Some(Line {
        rate: core::f64::consts::TAU * best as f64 / (2.0 * length as f64 * bin),
        significant: total[best] * (runs - 0.33) > most * median,
    })
}
