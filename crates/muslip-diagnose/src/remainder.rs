//! What no mechanism explains: by which variable it is located, whether it holds on runs left out, and the
//! correction that the repaired model carries for it.

use rayon::prelude::*;

use crate::data::Data;
use crate::fit::Problem;
use crate::mechanism::{Context, Id};
use crate::model::Model;
use crate::omnibus::{Action, Column, Group, Levers, Regression, Variable, group};
use crate::repaired::Correction;

/// An empirical dependence on one variable.
#[derive(Clone, Debug)]
pub struct Remainder {
    /// The contract's word for the variable.
    pub word: String,
    /// The variable; `None` for a periodic one.
    pub variable: Option<Variable>,
    /// Gain in nats on the data fitted.
    pub gain: f64,
    /// Gain in nats on runs left out in turn; the in-sample gain where there is one run only.
    pub held_out: f64,
    /// Independent columns.
    pub rank: usize,
    /// What the repaired model carries.
    pub correction: Correction,
    /// Steps of the model's own parameters that go with it.
    pub own: Vec<f64>,
}

impl Remainder {
    /// Gain less the price of its columns and of having looked at so many variables.
    #[must_use]
    pub fn worth(&self, count: usize) -> f64 {
        let price = 0.5 * self.rank as f64 * (count.max(2) as f64).ln() + 8.0;
        (self.gain - price).min(self.held_out)
    }
}

/// Number of hat functions of a variable.
fn resolution(variable: &Variable) -> usize {
    match variable {
        Variable::Slip => 14,
        Variable::Distance => 14,
        Variable::Time | Variable::SinceOnset => 9,
        _ => 7,
    }
}

/// Actions worth trying for a variable.
fn actions(variable: &Variable) -> &'static [Action] {
    match variable {
        Variable::SlipRate | Variable::NormalForceRate | Variable::VehicleSpeedRate => {
            &[Action::Friction, Action::Force]
        }
        Variable::Slip => &[Action::Friction],
        _ => &[Action::Friction, Action::Force, Action::CriticalSlip],
    }
}

/// All dependences on a variable that a model leaves over, strongest first.
#[must_use]
pub fn candidates(problem: &Problem<'_>, model: &Model) -> Vec<Remainder> {
    let data = problem.data;
    let levers = Levers::new(data, model);
    let regression = Regression::new(problem, model);
    let mut jobs: Vec<(Variable, Action)> = Vec::new();
    for variable in Variable::all(data) {
        for action in actions(&variable) {
            jobs.push((variable.clone(), *action));
        }
    }
    let mut found: Vec<Remainder> = jobs
        .par_iter()
        .filter_map(|(variable, action)| {
            let g = group(problem, &levers, variable, *action, resolution(variable))?;
            spline(problem, &regression, variable, &g)
        })
        .collect();
    found.extend(periodic(problem, &regression, &levers));
    let count = problem.count();
    found.sort_by(|a, b| b.worth(count).total_cmp(&a.worth(count)));
    found
}

fn spline(
    problem: &Problem<'_>,
    regression: &Regression,
    variable: &Variable,
    g: &Group,
) -> Option<Remainder> {
    let columns: Vec<&Column> = g.columns.iter().collect();
    let fit = regression.on(problem, &columns);
    if fit.rank == 0 || !fit.gain.is_finite() {
        return None;
    }
    Some(Remainder {
        word: variable.word(problem.data),
        variable: Some(variable.clone()),
        gain: fit.gain,
        held_out: fit.held_out,
        rank: fit.rank,
        correction: Correction {
            variable: variable.key(problem.data),
            acts_on: g.action.as_str().to_owned(),
            form: String::new(),
            knots: g.knots.clone(),
            values: fit.coefficients.clone(),
            harmonics: Vec::new(),
        },
        own: fit.own,
    })
}

/// Lines in the spectrum of what is left, over time, distance and wheel angle.
fn periodic(problem: &Problem<'_>, regression: &Regression, levers: &Levers) -> Vec<Remainder> {
    let data = problem.data;
    let mut found = Vec::new();
    for (word, action) in [
        ("time_s", Action::Force),
        ("time_s", Action::Friction),
        ("distance_m", Action::Friction),
        ("wheel_angle_rad", Action::Force),
        ("wheel_angle_rad", Action::Friction),
    ] {
        let phase = |run: usize| -> Vec<f64> {
            let s = &data.series[run];
            match word {
                "time_s" => s.time.iter().map(|t| t - s.time[0]).collect(),
                "distance_m" => s.distance.clone(),
                _ => s.angle.clone(),
            }
        };
        let Some(rate) = strongest_line(problem, regression, levers, action, &phase) else {
            continue;
        };
        // A phase of its own for each run: the start of a recording is no event of the rig.
        let mut columns: Vec<Column> = Vec::new();
        for own in problem.runs {
            for quadrature in [false, true] {
                columns.push(
                    (0..data.series.len())
                        .map(|run| {
                            if run != *own {
                                return vec![0.0; data.series[run].len()];
                            }
                            phase(run)
                                .iter()
                                .enumerate()
                                .map(|(k, u)| {
                                    let (sin, cos) = (rate * u).sin_cos();
                                    levers.of(data, action, run, k)
                                        * if quadrature { sin } else { cos }
                                })
                                .collect()
                        })
                        .collect(),
                );
            }
        }
        let references: Vec<&Column> = columns.iter().collect();
        let fit = regression.on(problem, &references);
        let amplitude = {
            let sum: f64 = fit.coefficients.iter().map(|c| c * c).sum();
            (sum / problem.runs.len() as f64).sqrt()
        };
        let form = match word {
            "time_s" => format!(
                "{:.4} * sin(2 pi {:.3} Hz t + phase of the run)",
                amplitude,
                rate / core::f64::consts::TAU
            ),
            "distance_m" => format!(
                "{:.4} * sin(2 pi x / {:.2} m + phase of the run)",
                amplitude,
                core::f64::consts::TAU / rate
            ),
            _ => format!("{amplitude:.4} * sin({rate:.3} wheel angle + phase of the run)"),
        };
        found.push(Remainder {
            word: word.to_owned(),
            variable: None,
            gain: fit.gain,
            // The frequency was looked for among many: a price of a few nats a run.
            held_out: fit.gain - (count_lines(problem) as f64).ln() - problem.runs.len() as f64,
            rank: fit.rank,
            correction: Correction {
                variable: word.to_owned(),
                acts_on: action.as_str().to_owned(),
                form,
                knots: Vec::new(),
                values: Vec::new(),
                // The phase of a run that was not fitted is unknown: nothing to carry over.
                harmonics: Vec::new(),
            },
            own: fit.own,
        });
    }
    found
}

fn count_lines(problem: &Problem<'_>) -> usize {
    problem.count().max(2)
}

/// Rate (rad per unit of the phase variable) at which the residual, seen through the lever of an action,
/// has most power over all runs: a coarse scan by Goertzel-like recursions on a common grid of rates.
fn strongest_line(
    problem: &Problem<'_>,
    regression: &Regression,
    levers: &Levers,
    action: Action,
    phase: &dyn Fn(usize) -> Vec<f64>,
) -> Option<f64> {
    let data = problem.data;
    // Residual times lever over variance, on a uniform grid of the phase variable, by run.
    let mut span: f64 = 0.0;
    let mut step = f64::INFINITY;
    let mut parts: Vec<(Vec<f64>, Vec<f64>, Vec<f64>)> = Vec::new();
    for (place, &run) in problem.runs.iter().enumerate() {
        let u = phase(run);
        let e = regression.innovations(place);
        let mut values = Vec::new();
        let mut at = Vec::new();
        let mut power = Vec::new();
        let order = problem.noise.whitener.ar.len();
        let mut i = 0;
        for segment in problem.segments(run) {
            for k in segment.clone().skip(order) {
                let lever = levers.of(data, action, run, k) / problem.noise.scale[run][k];
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
    let mut spectrum = vec![0.0; length / 2 + 1];
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
    spectrum.resize(total.len(), 0.0);
    // Slow variation is for the splines: at least six periods in the longest run, and below a third of the
    // sampling rate.
    let low = 12;
    let high = (total.len() as f64 * 0.6 * (bin / step).min(1.0)) as usize;
    let best = (low..high.max(low)).max_by(|a, b| total[*a].total_cmp(&total[*b]))?;
    Some(core::f64::consts::TAU * best as f64 / (2.0 * length as f64 * bin))
}

/// Mechanisms that say the same as a dependence on this variable.
#[must_use]
pub fn counterparts(variable: &str, context: &Context) -> &'static [Id] {
    let _ = context;
    match variable {
        "slip" => &[Id::CurveShape, Id::EffectiveRadius, Id::RollingResistance],
        "sliding_speed_m_s" => &[Id::SpeedSensitivity, Id::CurveShape, Id::ThermalFade],
        "vehicle_speed_m_s" => &[Id::SpeedSensitivity],
        "normal_force_n" => &[Id::LoadSensitivity, Id::LoadCrosstalk],
        "time_s" => &[Id::ZeroDrift, Id::ThermalFade, Id::WearDrift],
        "distance_m" => &[Id::SurfacePatch],
        "wheel_angle_rad" => &[Id::RunOut, Id::EncoderRipple],
        "slip_rate" => &[
            Id::SlipHysteresis,
            Id::RelaxationLength,
            Id::ForceLag,
            Id::ForceDelay,
        ],
        _ => &[],
    }
}
/// Columns of a remainder on the campaign, for joint regressions.
#[must_use]
pub fn applied(data: &Data, levers: &Levers, remainder: &Remainder) -> Column {
    (0..data.series.len())
        .map(|run| {
            remainder
                .correction
                .apply(data, levers, run)
                .unwrap_or_else(|_| vec![0.0; data.series[run].len()])
        })
        .collect()
}
