//! Columns of everything that a linear decision weighs: base law, nuisances of the measuring chain, mechanisms.

use rayon::prelude::*;

use super::dependence::{Dependence, width};
use super::gram::Columns;
use super::noise::Slopes;
use super::rows::{Rows, Triple, quiet_force, rows, rows_of};
use crate::correction::Levers;
use crate::data::{Data, WIDTH};
use crate::mechanism::{Balance, Id, Residuals, Search};
use crate::model::{Model, Term};
use crate::number::{Dual, Number, finite_or_zero};
use crate::prepare::mean_twice_about;

/// A mechanism at one place of its nonlinear parameters, or a free dependence.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Entry of the catalogue; `None` for a free dependence.
    pub entry: Option<usize>,
    /// Its id; `None` for a free dependence.
    pub id: Option<Id>,
    /// Parameters at which the columns were taken.
    pub start: Vec<f64>,
    /// Parameters that the columns belong to; empty where the one column is the whole effect at the start.
    pub free: Vec<usize>,
    /// First of its columns, counted from the first candidate's, and their number.
    pub columns: core::ops::Range<usize>,
}

/// Columns of one run that every model has: residual, base and terms; nuisances.
type Fixed = (Vec<Triple>, Vec<(f64, Triple)>);
/// A mechanism's own columns: the parameters that they belong to, and the columns by run.
type Own = (Vec<usize>, Vec<Vec<Triple>>);

/// Everything that enters, by run: `[balance][run][column]`; the residual first, then base, nuisances, candidates.
pub struct Table {
    /// Columns by balance and run.
    pub columns: [Vec<Columns>; 3],
    /// Columns of the base law, of terms and of free dependences.
    pub base: usize,
    /// Those of free dependences among them, the last ones.
    pub free: usize,
    /// Prior standard deviations of the coefficients of the measuring chain's nuisances, one column each.
    pub nuisances: Vec<f64>,
    /// Mechanisms.
    pub candidates: Vec<Candidate>,
}

fn values(rows: Rows<f64>) -> Triple {
    [rows.tyre, rows.wheel, rows.vehicle]
}

fn plain(data: &Data, model: &Model, run: usize) -> Triple {
    values(rows_of(data, model, run))
}

/// Derivatives of the rows in the parameters `which` of the model's vector.
#[must_use]
pub fn slopes_in(data: &Data, model: &Model, run: usize, which: &[usize]) -> Vec<Triple> {
    let p = model.vector();
    let mut out = Vec::new();
    for chunk in which.chunks(WIDTH) {
        let dual: Vec<Dual<WIDTH>> = p
            .iter()
            .enumerate()
            .map(|(i, v)| {
                chunk
                    .iter()
                    .position(|c| *c == i)
                    .map_or(Dual::constant(*v), |at| Dual::variable(*v, at))
            })
            .collect();
        let all = rows(
            &data.catalogue,
            model,
            &dual,
            &data.series[run],
            &data.context,
        );
        for at in 0..chunk.len() {
            let take = |x: &[Dual<WIDTH>]| x.iter().map(|d| d.slope[at]).collect();
            out.push([take(&all.tyre), take(&all.wheel), take(&all.vehicle)]);
        }
    }
    out
}

/// Second derivative of a smoothed channel from its rate.
fn second(rate: &[f64], time: &[f64]) -> Vec<f64> {
    let n = rate.len();
    (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(2), (k + 2).min(n - 1));
            let d = (rate[b] - rate[a]) / (time[b] - time[a]).max(1e-9);
            finite_or_zero(d)
        })
        .collect()
}

/// Shortest lateness of a vehicle speed in s of which the shape matters: poles or a mere delay.
const LEAST_POLE_S: f64 = 5e-3;

/// What an impulse gains where a channel is late by so many equal poles and was taken to be late by a delay, in N s:
/// the force through the poles, brought forward by their delay, less the force, over time.
fn poles_for_delay(time: &[f64], dt: &[f64], force: &[f64], late: f64, poles: usize) -> Vec<f64> {
    let mut passed = force.to_vec();
    for _ in 0..poles {
        let mut out = passed.first().copied().unwrap_or(0.0);
        for (x, dt) in passed.iter_mut().zip(dt) {
            out += (1.0 - (-dt * poles as f64 / late).exp()) * (*x - out);
            *x = out;
        }
    }
    let early = at_times(time, &passed, late);
    let mut sum = 0.0;
    early
        .iter()
        .zip(force)
        .zip(dt)
        .map(|((early, force), dt)| {
            sum += (early - force) * dt.min(0.1);
            sum
        })
        .collect()
}

/// A column at so many s after each sample, the last value beyond its end.
fn at_times(time: &[f64], x: &[f64], after: f64) -> Vec<f64> {
    let last = time.len().saturating_sub(1);
    let mut at = 0;
    time.iter()
        .map(|t| {
            while at < last && time[at + 1] < t + after {
                at += 1;
            }
            let next = (at + 1).min(last);
            let span = time[next] - time[at];
            let share = if span > 0.0 {
                ((t + after - time[at]) / span).clamp(0.0, 1.0)
            } else {
                0.0
            };
            x[at] + share * (x[next] - x[at])
        })
        .collect()
}

/// Columns of the measuring chain's nuisances on one run, with the prior standard deviations of their coefficients.
fn nuisances(data: &Data, slopes: &Slopes, run: usize) -> Vec<(f64, Triple)> {
    let s = &data.series[run];
    let n = s.len();
    let (inertia, mass) = (data.context.inertia, data.context.mass);
    let wheel_rate: Vec<f64> = s.wheel.rate.iter().map(|x| finite_or_zero(*x)).collect();
    let speed_rate: Vec<f64> = s.speed.rate.iter().map(|x| finite_or_zero(*x)).collect();
    let wheel_second = second(&wheel_rate, &s.time);
    let speed_second = second(&speed_rate, &s.time);
    let column = |b: Balance, f: &dyn Fn(usize) -> f64| -> Vec<f64> {
        if s.segments(b).is_empty() {
            Vec::new()
        } else {
            (0..n).map(|k| finite_or_zero(f(k))).collect()
        }
    };
    let of_tyre = |f: &dyn Fn(usize) -> f64| -> Triple {
        [
            column(Balance::Tyre, f),
            column(Balance::Wheel, &|_| 0.0),
            column(Balance::Vehicle, &|_| 0.0),
        ]
    };
    let by_wheel = |u: &dyn Fn(usize) -> f64| -> Triple {
        [
            column(Balance::Tyre, &|k| -slopes.wheel[run][k] * u(k)),
            column(Balance::Wheel, &|k| inertia * u(k)),
            column(Balance::Vehicle, &|_| 0.0),
        ]
    };
    let by_speed = |u: &dyn Fn(usize) -> f64| -> Triple {
        [
            column(Balance::Tyre, &|k| -slopes.speed[run][k] * u(k)),
            column(Balance::Wheel, &|_| 0.0),
            column(Balance::Vehicle, &|k| mass * u(k)),
        ]
    };
    let mean = data.context.mean_wheel_speed;
    // Zero-phase: what inputs and reading differ by in bandwidth, and what smoothing leaves of the slip's noise.
    let by_force = |reach: f64| -> Triple {
        // As the readings say it: a lag that filters their noise must find that done already.
        let mut force = slopes.force[run].clone();
        for (force, beside) in force.iter_mut().zip(&s.beside_law) {
            *force -= beside;
        }
        let mean = mean_twice_about(&s.time, &force, &s.tyre, reach);
        of_tyre(&|k| force[k] - mean[k])
    };
    // A mean over noisy slip is not the law at the mean slip: half its second derivative times the noise's variance.
    let by_curvature = || -> Triple {
        let radius = data.context.radius;
        let curve = |k: usize| {
            if !s.rolling[k] {
                return 0.0;
            }
            let noise = (radius / s.speed.smooth[k] * s.wheel.sigma).powi(2)
                + (radius * s.wheel.smooth[k] / s.speed.smooth[k].powi(2) * s.speed.sigma).powi(2);
            -0.5 * slopes.curvature[run][k] * noise
        };
        of_tyre(&curve)
    };
    // The same of a slip that moves within a window of a sensor or of the smoother: half the second derivative times
    // the rate's square, by the window's variance in s².
    let by_motion = || -> Triple {
        let radius = data.context.radius;
        let curve = |k: usize| {
            if !s.rolling[k] {
                return 0.0;
            }
            let (v, omega) = (s.speed.smooth[k], s.wheel.smooth[k]);
            let rate = radius * (omega * speed_rate[k] / (v * v) - wheel_rate[k] / v);
            -0.5 * slopes.curvature[run][k] * rate * rate
        };
        of_tyre(&curve)
    };
    // The same of brake and drag where they are integrated.
    let by_integral = |reach: f64, brake: bool| -> Triple {
        let segments = if s.wheel_balance.is_empty() {
            &s.vehicle_balance
        } else {
            &s.wheel_balance
        };
        // A lag of the brake filters its reading's noise, and must find that done already; nothing does that to the drag's.
        let x = match (&s.torque, brake) {
            (_, false) => quiet_force(s, &slopes.force[run]),
            (Some(torque), true) => torque.smooth.clone(),
            (None, true) => vec![0.0; n],
        };
        let mean = mean_twice_about(&s.time, &x, segments, reach);
        let mut sum = 0.0;
        let level: Vec<f64> = (0..n)
            .map(|k| {
                let d = (x[k] - mean[k]) * s.dt[k].min(0.1);
                if d.is_finite() {
                    sum += d;
                }
                sum
            })
            .collect();
        let lever = if brake { 1.0 } else { -data.context.radius };
        [
            column(Balance::Tyre, &|_| 0.0),
            column(Balance::Wheel, &|k| lever * level[k]),
            column(Balance::Vehicle, &|k| if brake { 0.0 } else { level[k] }),
        ]
    };
    let by_poles = |poles: usize| -> Triple {
        let late = data.vehicle_late;
        let level = if late > LEAST_POLE_S && !s.vehicle_balance.is_empty() {
            let force = quiet_force(s, &slopes.force[run]);
            let force: Vec<f64> = force.into_iter().map(finite_or_zero).collect();
            poles_for_delay(&s.time, &s.dt, &force, late, poles)
        } else {
            vec![0.0; n]
        };
        [
            column(Balance::Tyre, &|_| 0.0),
            column(Balance::Wheel, &|_| 0.0),
            column(Balance::Vehicle, &|k| level[k]),
        ]
    };
    let torque = |k: usize| s.torque.as_ref().map_or(0.0, |t| t.smooth[k]);
    vec![
        // Wheel speed late.
        (data.timing_std.wheel, by_wheel(&|k| wheel_rate[k])),
        // Vehicle speed late.
        (data.timing_std.vehicle, by_speed(&|k| speed_rate[k])),
        // Brake late.
        (
            data.timing_std.brake,
            [
                column(Balance::Tyre, &|_| 0.0),
                column(Balance::Wheel, &torque),
                column(Balance::Vehicle, &|_| 0.0),
            ],
        ),
        // Wheel speed late by turn.
        (
            0.001,
            by_wheel(&|k| wheel_rate[k] * mean / s.wheel.smooth[k].abs().max(0.1 * mean)),
        ),
        // Force smoothed, 6 ms.
        (4.0, by_force(0.006)),
        // Force smoothed, 20 ms.
        (3.0, by_force(0.02)),
        // Force smoothed, 60 ms.
        (1.0, by_force(0.06)),
        // Brake smoothed, 6 ms.
        (4.0, by_integral(0.006, true)),
        // Brake smoothed, 20 ms.
        (3.0, by_integral(0.02, true)),
        // Drag smoothed, 20 ms.
        (3.0, by_integral(0.02, false)),
        // Law's curvature under slip noise.
        (1.0, by_curvature()),
        // Law's curvature under moving slip.
        (1e-4, by_motion()),
        // Vehicle speed low-passed.
        (3e-3, by_speed(&|k| -0.5 * speed_second[k])),
        // Vehicle speed late by one pole, by two, instead of by a delay.
        (1.0, by_poles(1)),
        (1.0, by_poles(2)),
        // Wheel speed low-passed.
        (3e-4, by_wheel(&|k| -0.5 * wheel_second[k])),
    ]
}

/// All columns of a campaign about a model.
#[must_use]
pub fn table(
    data: &Data,
    model: &Model,
    slopes: &Slopes,
    evidence: &[Residuals],
    extra: &[Dependence],
    free: &[Dependence],
    wanted: &dyn Fn(Id) -> bool,
) -> Table {
    let runs = data.series.len();
    let base: Vec<usize> = vec![0, 1];
    let own: Vec<usize> = (model.base.len()..model.vector().len()).collect();
    let mut fixed: Vec<usize> = base.clone();
    fixed.extend(&own);
    let levers = (extra.len() + free.len() > 0).then(|| Levers::new(data, model));
    let columns_of = |dependence: &Dependence, run: usize| {
        let levers = levers.as_ref();
        levers.map_or(Vec::new(), |levers| dependence.columns(data, levers, run))
    };
    let per_run: Vec<Fixed> = (0..runs)
        .into_par_iter()
        .map(|run| {
            let mut all = vec![plain(data, model, run)];
            all.extend(slopes_in(data, model, run, &fixed));
            for dependence in extra {
                all.extend(columns_of(dependence, run));
            }
            (all, nuisances(data, slopes, run))
        })
        .collect();
    let here: Vec<Triple> = per_run.iter().map(|(all, _)| all[0].clone()).collect();
    let mut columns: [Vec<Columns>; 3] = core::array::from_fn(|_| vec![Vec::new(); runs]);
    let mut listed = Vec::new();
    for (run, (fixed, nuisance)) in per_run.into_iter().enumerate() {
        for triple in fixed.into_iter().chain(nuisance.into_iter().map(|(n, t)| {
            if run == 0 {
                listed.push(n);
            }
            t
        })) {
            for (b, column) in triple.into_iter().enumerate() {
                columns[b][run].push(data.blocks[run][b].mean(&column));
            }
        }
    }
    let search = Search {
        context: &data.context,
        series: &data.series,
        residuals: evidence,
    };
    let entries: Vec<(usize, Vec<f64>)> = data
        .catalogue
        .entries()
        .iter()
        .enumerate()
        .filter(|(entry, m)| wanted(m.id()) && !model.terms.iter().any(|t| t.entry == *entry))
        .flat_map(|(entry, m)| m.starts(&search).into_iter().map(move |s| (entry, s)))
        .collect();
    let made: Vec<Option<Own>> = entries
        .par_iter()
        .map(|(entry, start)| column_of(data, model, *entry, start, &here))
        .collect();
    let mut candidates = Vec::new();
    let mut at = 0;
    for ((entry, start), made) in entries.into_iter().zip(made) {
        let Some((free, triples)) = made else {
            continue;
        };
        let width = triples[0].len();
        for (run, triples) in triples.into_iter().enumerate() {
            for triple in triples {
                for (b, column) in triple.into_iter().enumerate() {
                    columns[b][run].push(data.blocks[run][b].mean(&column));
                }
            }
        }
        candidates.push(Candidate {
            entry: Some(entry),
            id: Some(data.catalogue.get(entry).id()),
            start,
            free,
            columns: at..at + width,
        });
        at += width;
    }
    for dependence in free {
        let width = dependence.width();
        let by_run = (0..runs).map(|run| columns_of(dependence, run));
        for (run, triples) in by_run.enumerate() {
            for triple in triples {
                for (b, column) in triple.iter().enumerate() {
                    columns[b][run].push(data.blocks[run][b].mean(column));
                }
            }
        }
        candidates.push(Candidate {
            entry: None,
            id: None,
            start: Vec::new(),
            free: (0..width).collect(),
            columns: at..at + width,
        });
        at += width;
    }
    Table {
        columns,
        base: fixed.len() + width(extra),
        free: width(extra),
        nuisances: listed,
        candidates,
    }
}

/// Columns of one mechanism at one start, by run; `None` where it changes nothing.
fn column_of(
    data: &Data,
    model: &Model,
    entry: usize,
    start: &[f64],
    here: &[Triple],
) -> Option<Own> {
    let mut with = model.clone();
    with.terms.push(Term {
        entry,
        parameters: start.to_vec(),
    });
    let first = model.vector().len();
    let difference: Vec<Triple> = (0..data.series.len())
        .map(|run| {
            let (a, b) = (plain(data, &with, run), &here[run]);
            core::array::from_fn(|i| a[i].iter().zip(&b[i]).map(|(a, b)| a - b).collect())
        })
        .collect();
    let energy = |t: &[Triple]| {
        t.iter()
            .flat_map(|t| t.iter().flatten())
            .filter(|x| x.is_finite())
            .map(|x| x * x)
            .sum::<f64>()
    };
    if energy(&difference) > 0.0 {
        return Some((
            Vec::new(),
            difference.into_iter().map(|t| vec![t]).collect(),
        ));
    }
    let which: Vec<usize> = (first..first + start.len()).collect();
    let all: Vec<Vec<Triple>> = (0..data.series.len())
        .map(|run| slopes_in(data, &with, run, &which))
        .collect();
    let free: Vec<usize> = (0..start.len())
        .filter(|i| {
            all.iter()
                .any(|run| run[*i].iter().flatten().any(|x| x.is_finite() && *x != 0.0))
        })
        .collect();
    if free.is_empty() {
        return None;
    }
    let kept = all
        .into_iter()
        .map(|run| free.iter().map(|i| run[*i].clone()).collect())
        .collect();
    Some((free, kept))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_through_a_pole_ahead_of_its_delay_leaves_what_has_not_passed_yet() {
        let (step, late, size) = (1e-4, 0.05, 300.0);
        let time: Vec<f64> = (0..4000).map(|k| f64::from(k) * step).collect();
        let dt = vec![step; time.len()];
        let from = 0.1;
        let force: Vec<f64> = time
            .iter()
            .map(|t| if *t >= from { size } else { 0.0 })
            .collect();
        let found = poles_for_delay(&time, &dt, &force, late, 1);
        // From the step on: size late exp(-(t - from + late) / late).
        for k in [1000, 1300, 2000, 3000] {
            let expected = size * late * (-(time[k] - from + late) / late).exp();
            assert!(
                (found[k] - expected).abs() < 0.01 * size * late,
                "{k}: {} {expected}",
                found[k]
            );
        }
        // Whatever the number of poles, in the end all of the impulse has passed.
        let two = poles_for_delay(&time, &dt, &force, late, 2);
        assert!(two[3400].abs() < 0.01 * size * late, "{}", two[3400]);
    }
}
