//! The noise of a balance, read off what a saturated model leaves over.
//!
//! A residual that still holds the mismatch would inflate the noise by the very thing that is looked
//! for. So the residual is first regressed on everything that it may depend on (Mallows' argument), and
//! only the rest is called noise: its size by operating region (heteroscedastic) and its colour.

use crate::data::Data;
use crate::fit::{BalanceNoise, Fitted, Problem};
use crate::lines::{self, PLACES, phase_of, strongest};
use crate::mechanism::Balance;
use crate::model::Model;
use crate::noise::{NoiseSize, Whitener, robust_sigma};
use crate::omnibus::{Action, Column, Levers, group};
use crate::regression::Regression;
use crate::variable::Variable;

/// Times in s by which the predicted force is held back to stand for anything the chain may do.
const TAPS_S: [f64; 8] = [0.002, 0.005, 0.010, 0.016, 0.024, 0.036, 0.055, 0.085];
/// Moving-average roots tried for the balances that contain a differenced speed.
const ROOTS: [f64; 12] = [
    0.0, 0.3, 0.5, 0.7, 0.8, 0.88, 0.93, 0.96, 0.98, 0.99, 0.995, 0.999,
];

/// First guess of the noise, from sample-to-sample differences and the propagated slip noise.
#[must_use]
pub fn first_guess(data: &Data, balance: Balance) -> BalanceNoise {
    let scale = data
        .series
        .iter()
        .map(|s| match balance {
            Balance::Tyre => {
                let floor = s.drag_sigma.max(1e-6 * data.context.max_drag);
                (0..s.len())
                    .map(|k| {
                        let slip = s.slip_force_noise(k, &data.context);
                        (floor * floor + slip * slip).sqrt()
                    })
                    .collect()
            }
            _ => vec![1.0; s.len()],
        })
        .collect();
    BalanceNoise {
        whitener: Whitener {
            block: block(data, balance),
            ..Whitener::unit()
        },
        scale,
        size: None,
    }
}

/// Span in s over which the wheel's imbalance is averaged, and the vehicle's, which changes more slowly.
const WHEEL_BLOCK_S: f64 = 0.008;
const VEHICLE_BLOCK_S: f64 = 0.024;

fn block(data: &Data, balance: Balance) -> usize {
    let span = match balance {
        Balance::Tyre => return 1,
        Balance::Wheel => WHEEL_BLOCK_S,
        Balance::Vehicle => VEHICLE_BLOCK_S,
    };
    ((span / data.context.dt) as usize).max(1)
}

/// Columns that together stand for whatever a tyre residual may depend on.
fn tyre_columns(problem: &Problem<'_>, model: &Model) -> Vec<Column> {
    let data = problem.data;
    let levers = Levers::new(data, model);
    let mut columns: Vec<Column> = Vec::new();
    let mut add = |variable: Variable, action: Action, count: usize| {
        if let Some(g) = group(problem, &levers, &variable, action, count) {
            columns.extend(g.columns);
        }
    };
    add(Variable::Slip, Action::Friction, 10);
    add(Variable::SlidingSpeed, Action::Friction, 5);
    add(Variable::VehicleSpeed, Action::Friction, 4);
    add(Variable::NormalForce, Action::Friction, 3);
    add(Variable::NormalForce, Action::Force, 3);
    add(Variable::Time, Action::Friction, 5);
    add(Variable::Time, Action::Force, 5);
    add(Variable::Distance, Action::Friction, 12);
    add(Variable::SlipRate, Action::CriticalSlip, 3);
    add(Variable::SlipRate, Action::Friction, 3);
    add(Variable::SinceOnset, Action::Friction, 4);
    add(Variable::NormalForceRate, Action::Friction, 3);
    for i in 0..data.extra_names.len().min(4) {
        add(Variable::Column(i), Action::Friction, 4);
        add(Variable::Column(i), Action::CriticalSlip, 3);
        add(Variable::Column(i), Action::Force, 3);
    }
    // A slip read too high or too low, by load and by speed: a wrong radius.
    for variable in [Variable::NormalForce, Variable::VehicleSpeed] {
        if let Some(g) = group(problem, &levers, &variable, Action::CriticalSlip, 3) {
            for mut column in g.columns {
                for (values, s) in column.iter_mut().zip(&data.series) {
                    for (k, x) in values.iter_mut().enumerate() {
                        // The lever of the critical slip holds the slip as a factor.
                        let slip = s.slip(k, data.context.radius);
                        let least = 0.02 * data.context.nominal[1];
                        *x *= data.context.nominal[1] / slip.abs().max(least).copysign(slip);
                    }
                }
                columns.push(column);
            }
        }
    }
    let each = |f: &dyn Fn(usize, usize) -> f64| -> Column {
        data.series
            .iter()
            .enumerate()
            .map(|(run, s)| (0..s.len()).map(|k| f(run, k)).collect())
            .collect()
    };
    // The reading held back: lags, delays, ringing.
    for tap in TAPS_S {
        if tap < 0.6 * data.context.dt {
            continue;
        }
        columns.push(each(&|run, k| {
            let back = (tap / data.series[run].typical_dt).round() as usize;
            levers.reading[run][k.saturating_sub(back)]
        }));
    }
    columns.push(each(&|run, k| data.series[run].wheel.rate[k]));
    // Every run may sit a little higher or lower.
    for own in problem.runs {
        columns.push(each(&|run, k| {
            if run == *own {
                levers.force[run][k]
            } else {
                0.0
            }
        }));
        columns.push(each(&|run, _| {
            if run == *own {
                data.context.mean_load
            } else {
                0.0
            }
        }));
    }
    if data.context.dt * data.context.mean_wheel_speed < 1.5 {
        for order in [1.0, 2.0] {
            columns.push(each(&|run, k| {
                levers.force[run][k] * (order * data.series[run].angle[k]).sin()
            }));
            columns.push(each(&|run, k| {
                levers.force[run][k] * (order * data.series[run].angle[k]).cos()
            }));
            columns.push(each(&|run, k| {
                levers.critical[run][k] * (order * data.series[run].angle[k]).sin()
            }));
            columns.push(each(&|run, k| {
                levers.critical[run][k] * (order * data.series[run].angle[k]).cos()
            }));
        }
    }
    columns
}

fn wheel_columns(data: &Data) -> Vec<Column> {
    let each = |f: &dyn Fn(&crate::prepare::Series, usize) -> f64| -> Column {
        data.series
            .iter()
            .map(|s| (0..s.len()).map(|k| f(s, k)).collect())
            .collect()
    };
    let torque = |s: &crate::prepare::Series, k: usize, back_s: f64| {
        let back = (back_s / s.typical_dt).round() as usize;
        s.torque
            .as_ref()
            .map_or(0.0, |t| t.smooth[k.saturating_sub(back)])
    };
    let scale = data.context.mean_load * data.context.radius;
    let mut columns = vec![
        // Not the drag: with it, torque and acceleration the columns would hold the smoothed residual itself,
        // and take its slow noise for an effect. A wrong scale of the drag shows in the torque as well.
        each(&|s, k| s.wheel.rate[k]),
        each(&|_, _| scale),
        each(&|s, k| s.wheel.smooth[k]),
        each(&|s, k| s.load.smooth[k]),
    ];
    for tap in [0.0, 0.01, 0.03, 0.08, 0.2] {
        columns.push(each(&|s, k| torque(s, k, tap)));
    }
    for i in 0..4 {
        columns.push(each(&|s, k| {
            let share = k as f64 / s.len().max(1) as f64;
            torque(s, k, 0.0) * (share * f64::from(i) * core::f64::consts::PI).cos()
        }));
    }
    columns
}

fn vehicle_columns(data: &Data) -> Vec<Column> {
    let each = |f: &dyn Fn(&crate::prepare::Series, usize) -> f64| -> Column {
        data.series
            .iter()
            .map(|s| (0..s.len()).map(|k| f(s, k)).collect())
            .collect()
    };
    let scale = data.context.mean_load;
    vec![
        each(&|_, _| scale),
        each(&|s, k| s.speed.smooth[k]),
        each(&|s, k| s.speed.smooth[k].powi(2)),
        each(&|s, k| s.speed.rate[k]),
        each(&|s, k| scale * (k as f64 / s.len().max(1) as f64)),
    ]
}

/// Columns for whatever wheel or vehicle may have wrong themselves.
#[must_use]
pub fn free_columns(data: &Data, balance: Balance) -> Vec<Column> {
    let mut columns = match balance {
        Balance::Wheel => wheel_columns(data),
        _ => vehicle_columns(data),
    };
    for i in 0..data.extra_names.len().min(4) {
        let all = data.series.iter().flat_map(|s| &s.extra[i]).copied();
        let (low, high) = all
            .filter(|x| x.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
                (a.min(x), b.max(x))
            });
        if !(high > low) {
            continue;
        }
        for power in [1, 2] {
            columns.push(
                data.series
                    .iter()
                    .map(|s| {
                        s.extra[i]
                            .iter()
                            .map(|x| {
                                data.context.mean_load
                                    * data.context.radius
                                    * (2.0 * (x - low) / (high - low) - 1.0).powi(power)
                            })
                            .collect()
                    })
                    .collect(),
            );
        }
    }
    for x in columns.iter_mut().flatten().flatten() {
        *x = if x.is_finite() { *x } else { 0.0 };
    }
    columns
}

/// Whether slow noise that the colour does not describe is added to the noise's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slow {
    /// No: while mechanisms are looked for, it may be one of them.
    Ignored,
    /// Yes: once the best explanation is at hand, what is left of it is noise.
    Counted,
}

/// Noise of a balance given a fitted model: regresses its residual on everything, reads size and colour
/// off the rest.
#[must_use]
pub fn estimate(guessed: &Problem<'_>, fitted: &Fitted, slow: Slow) -> BalanceNoise {
    if guessed.balance == Balance::Tyre {
        return estimate_once(guessed, fitted, slow);
    }
    // What is regressed under the wrong colour leaves slow effects behind, which then pass for slow noise: the
    // noise of a differenced speed is assumed first, and what is found then taken in its place.
    let mut noise = guessed.noise.clone();
    noise.whitener.theta = 0.98;
    for pass in 0..DYNAMIC_PASSES {
        let problem = Problem {
            noise: &noise,
            ..*guessed
        };
        let slow = if pass + 1 == DYNAMIC_PASSES {
            slow
        } else {
            Slow::Ignored
        };
        noise = estimate_once(&problem, fitted, slow);
    }
    noise
}

/// Times that the noise of wheel and vehicle is estimated, each under the colour found before.
const DYNAMIC_PASSES: usize = 3;

fn estimate_once(guessed: &Problem<'_>, fitted: &Fitted, slow: Slow) -> BalanceNoise {
    let (data, balance, runs, guess) = (guessed.data, guessed.balance, guessed.runs, guessed.noise);
    // The tyre's is regressed in the guessed scale but without its colour, so that columns keep their full weight.
    let white = BalanceNoise {
        whitener: if balance == Balance::Tyre {
            Whitener {
                sigma: guess.whitener.sigma.max(1e-300),
                ..Whitener::unit()
            }
        } else {
            guess.whitener.clone()
        },
        scale: guess.scale.clone(),
        size: None,
    };
    let problem = Problem {
        data,
        balance,
        noise: &white,
        runs,
        segments: guessed.segments,
        chain: guessed.chain,
    };
    let mut columns = match balance {
        Balance::Tyre => tyre_columns(&problem, &fitted.model),
        _ => free_columns(data, balance),
    };
    columns.truncate((problem.count() / 12).max(2));
    let regression = Regression::new(&problem, &fitted.model);
    let mut rest = left_over(&problem, &regression, fitted, &columns);
    if balance == Balance::Tyre {
        let lines = lines_in(&problem, fitted, &rest);
        if !lines.is_empty() {
            columns.extend(lines);
            rest = left_over(&problem, &regression, fitted, &columns);
        }
    }
    let (scale, size) = match balance {
        Balance::Tyre => {
            let (scale, size) = tyre_scale(data, &problem, fitted, &rest, runs);
            (scale, Some(size))
        }
        _ => (guess.scale.clone(), None),
    };
    let mut joined = Vec::new();
    let mut segments = Vec::new();
    for &run in runs {
        let offset = joined.len();
        joined.extend(rest[run].iter().zip(&scale[run]).map(|(r, s)| r / s));
        segments.extend(
            problem
                .segments(run)
                .iter()
                .map(|s| s.start + offset..s.end + offset),
        );
    }
    let roots: &[f64] = if balance == Balance::Tyre {
        &[0.0]
    } else {
        &ROOTS
    };
    let block = block(data, balance);
    let candidates: Vec<(Whitener, f64)> = roots
        .iter()
        .map(|theta| {
            let whitener = Whitener::fit(&joined, &segments, block, *theta);
            let slow = slow_excess(
                &whitener,
                &joined,
                &segments,
                data.context.dt,
                columns.len(),
            );
            (whitener, slow)
        })
        .collect();
    let smallest = candidates
        .iter()
        .map(|(w, _)| w.sigma)
        .fold(f64::INFINITY, f64::min);
    // Among roots that describe the noise about as well, the one that describes its slow part.
    let (mut whitener, excess) = candidates
        .into_iter()
        .filter(|(w, _)| w.sigma <= 1.03 * smallest)
        .min_by(|a, b| a.1.ln().abs().total_cmp(&b.1.ln().abs()))
        .unwrap_or_else(|| (Whitener::unit(), 1.0));
    // The tyre's colour is fitted at full rate and holds; the slow level of a differenced speed's noise is read here.
    let least = if balance == Balance::Tyre { 1.0 } else { 0.5 };
    let most = if slow == Slow::Counted {
        f64::INFINITY
    } else {
        1.0
    };
    whitener.sigma *= excess.clamp(least, most);
    BalanceNoise {
        whitener,
        scale,
        size,
    }
}

/// What is left of a residual when it is regressed on columns, the model's own parameters free alongside; by run.
fn left_over(
    problem: &Problem<'_>,
    regression: &Regression,
    fitted: &Fitted,
    columns: &[Column],
) -> Vec<Vec<f64>> {
    let references: Vec<&Column> = columns.iter().collect();
    let found = regression.on(problem, &references);
    let mut rest: Vec<Vec<f64>> = vec![Vec::new(); problem.data.series.len()];
    for &run in problem.runs {
        let (mut residual, own_columns) = problem.slopes(&fitted.model, run);
        for (column, c) in own_columns.iter().zip(&found.own) {
            for (r, x) in residual.iter_mut().zip(column) {
                *r += c * x;
            }
        }
        for (column, c) in columns.iter().zip(&found.coefficients) {
            for (r, x) in residual.iter_mut().zip(&column[run]) {
                *r -= c * x;
            }
        }
        rest[run] = residual;
    }
    rest
}

/// Columns of the lines that stand out of what is left: an autoregression would take them for colour.
fn lines_in(problem: &Problem<'_>, fitted: &Fitted, rest: &[Vec<f64>]) -> Vec<Column> {
    let data = problem.data;
    let levers = Levers::new(data, &fitted.model);
    let left: Vec<Vec<f64>> = problem
        .runs
        .iter()
        .map(|&run| {
            problem
                .segments(run)
                .iter()
                .flat_map(Clone::clone)
                .map(|k| rest[run][k] / problem.noise.scale[run][k])
                .collect()
        })
        .collect();
    let left: Vec<&[f64]> = left.iter().map(Vec::as_slice).collect();
    let mut found = Vec::new();
    for (word, action) in PLACES {
        let lever = |run: usize, k: usize| levers.of(data, action, run, k);
        let phase = |run: usize| phase_of(data, word, run);
        if let Some(line) = strongest(problem, &left, &lever, &phase)
            && line.significant
        {
            found.extend(lines::columns(problem, line.rate, &lever, &phase));
        }
    }
    found
}

/// Spans in s over which innovations are summed to see whether slow noise is left in them.
const SLOW_S: [f64; 3] = [0.06, 0.2, 0.6];
/// Fewest sums from which their variance is read.
const FEWEST_SUMS: usize = 24;

/// Standard deviation of sums of innovations over a while against that of white ones; one where there are too few. The fast noise
/// of a differenced speed decides the colour's fit, but the effects that are looked for are slow: what counts
/// is the level there.
fn slow_excess(
    whitener: &Whitener,
    x: &[f64],
    segments: &[core::ops::Range<usize>],
    dt: f64,
    columns: usize,
) -> f64 {
    let mut e = Vec::with_capacity(x.len());
    whitener.apply(x, segments, &mut e);
    for v in &mut e {
        *v = v.clamp(-3.5, 3.5);
    }
    let mut most: f64 = 0.0;
    for span in SLOW_S {
        let length = (span / (dt * whitener.block as f64)).round() as usize;
        if length < 4 || e.len() / length < FEWEST_SUMS {
            continue;
        }
        let sums: Vec<f64> = e
            .chunks_exact(length)
            .map(|c| c.iter().sum::<f64>() / (length as f64).sqrt())
            .collect();
        // The columns have taken part of the slow noise with them.
        let freedom = (sums.len() as f64 - columns as f64).max(0.4 * sums.len() as f64);
        let variance = sums.iter().map(|s| s * s).sum::<f64>() / freedom;
        most = most.max(variance);
    }
    if most > 0.0 { most.sqrt() } else { 1.0 }
}

/// Size of the tyre noise by sample: a constant, a share of the force, and the propagated slip noise.
fn tyre_scale(
    data: &Data,
    problem: &Problem<'_>,
    fitted: &Fitted,
    rest: &[Vec<f64>],
    runs: &[usize],
) -> (Vec<Vec<f64>>, NoiseSize) {
    let levers = Levers::new(data, &fitted.model);
    let mut features: Vec<[f64; 3]> = Vec::new();
    let mut squares: Vec<f64> = Vec::new();
    let mut all = Vec::new();
    for &run in runs {
        for segment in problem.segments(run) {
            for k in segment.clone() {
                features.push([
                    1.0,
                    levers.force[run][k].powi(2),
                    data.series[run].slip_force_noise(k, &data.context).powi(2),
                ]);
                squares.push(rest[run][k]);
                all.push(rest[run][k]);
            }
        }
    }
    let typical = robust_sigma(&all).max(1e-300);
    let mut parts = [typical * typical, 0.0, 0.0];
    // Three passes of weighted least squares on clipped squares, each part held non-negative.
    for _ in 0..4 {
        let mut a = nalgebra::Matrix3::<f64>::zeros();
        let mut b = nalgebra::Vector3::<f64>::zeros();
        for (f, r) in features.iter().zip(&squares) {
            let variance =
                (parts[0] * f[0] + parts[1] * f[1] + parts[2] * f[2]).max(1e-4 * typical * typical);
            let weight = 1.0 / (variance * variance);
            let square = (r * r).min(10.0 * variance);
            for i in 0..3 {
                b[i] += weight * f[i] * square;
                for j in 0..3 {
                    a[(i, j)] += weight * f[i] * f[j];
                }
            }
        }
        let mut active = [true; 3];
        for _ in 0..3 {
            let places: Vec<usize> = (0..3).filter(|i| active[*i] && a[(*i, *i)] > 0.0).collect();
            let matrix = nalgebra::DMatrix::from_fn(places.len(), places.len(), |i, j| {
                let value = a[(places[i], places[j])]
                    / (a[(places[i], places[i])] * a[(places[j], places[j])]).sqrt();
                if i == j { value + 1e-9 } else { value }
            });
            let right = nalgebra::DVector::from_fn(places.len(), |i, _| {
                b[places[i]] / a[(places[i], places[i])].sqrt()
            });
            let Some(solved) = matrix.cholesky().map(|c| c.solve(&right)) else {
                break;
            };
            parts = [0.0; 3];
            let mut negative = false;
            for (i, &place) in places.iter().enumerate() {
                let value = solved[i] / a[(place, place)].sqrt();
                if value < 0.0 {
                    active[place] = false;
                    negative = true;
                } else {
                    parts[place] = value;
                }
            }
            if !negative {
                break;
            }
        }
    }
    let size = NoiseSize {
        parts,
        least: 0.05 * typical * typical,
        typical,
    };
    let scale = data
        .series
        .iter()
        .zip(&levers.force)
        .map(|(series, force)| {
            force
                .iter()
                .enumerate()
                .map(|(k, f)| size.sigma(*f, series.slip_force_noise(k, &data.context)))
                .collect()
        })
        .collect();
    (scale, size)
}
