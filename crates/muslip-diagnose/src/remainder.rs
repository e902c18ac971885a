//! What no mechanism explains: by which variable it is located, whether it holds on runs left out, and the
//! correction that the repaired model carries for it.

use rayon::prelude::*;

use crate::data::Data;
use crate::fit::Problem;
use crate::lines::{self, Line, PLACES, phase_of, strongest};
use crate::mechanism::Id;
use crate::model::Model;
use crate::omnibus::{Action, Column, Group, Levers, group};
use crate::regression::{Found, Regression};
use crate::repaired::Correction;
use crate::variable::Variable;

/// An empirical dependence on one variable.
#[derive(Clone, Debug)]
pub struct Remainder {
    /// The contract's word for the variable.
    pub word: String,
    /// The variable; `None` for a periodic one.
    pub variable: Option<Variable>,
    /// Gain in nats on the data fitted.
    pub gain: f64,
    /// Gain in nats on runs left out in turn; the in-sample gain where there are fewer than three.
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
        (self.gain - price).min(LEFT_OUT_SHARE * self.held_out)
    }

    /// Whether it depends on a column that the contract does not name.
    #[must_use]
    pub fn recorded(&self) -> bool {
        matches!(self.variable, Some(Variable::Column(_)))
    }
}

/// A dependence on what hardly changes within a run has to extrapolate to the run left out: it may gain that much
/// less there.
const LEFT_OUT_SHARE: f64 = 1.6;

/// Number of hat functions of a variable.
pub(crate) fn resolution(variable: &Variable) -> usize {
    match variable {
        Variable::Slip | Variable::SlipRate => 14,
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

pub(crate) fn spline(
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
    for (word, action) in PLACES {
        let phase = |run: usize| phase_of(data, word, run);
        let left: Vec<&[f64]> = (0..problem.runs.len())
            .map(|place| regression.innovations(place))
            .collect();
        let lever = |run: usize, k: usize| levers.of(data, action, run, k);
        let Some(Line { rate, .. }) = strongest(problem, &left, &lever, &phase) else {
            continue;
        };
        let columns = lines::columns(problem, rate, &lever, &phase);
        let references: Vec<&Column> = columns.iter().collect();
        let fit = regression.on(problem, &references);
        if fit.rank == 0 || !fit.gain.is_finite() {
            continue;
        }
        let amplitude = {
            let sum: f64 = fit.coefficients.iter().map(|c| c * c).sum();
            (sum / problem.runs.len() as f64).sqrt()
        };
        let common = (word == "distance_m")
            .then(|| same_everywhere(problem, regression, rate, &lever, &phase, &fit))
            .flatten();
        let form = match (word, &common) {
            (_, Some(([rate, cosine, sine], _))) => format!(
                "{:.4} * sin(2 pi x / {:.2} m + {:.2})",
                cosine.hypot(*sine),
                core::f64::consts::TAU / rate,
                cosine.atan2(*sine)
            ),
            ("time_s", _) => format!(
                "{:.4} * sin(2 pi {:.3} Hz t + phase of the run)",
                amplitude,
                rate / core::f64::consts::TAU
            ),
            ("distance_m", _) => format!(
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
            held_out: fit.gain - (problem.count().max(2) as f64).ln() - problem.runs.len() as f64,
            rank: fit.rank,
            correction: Correction {
                variable: word.to_owned(),
                acts_on: action.as_str().to_owned(),
                form,
                knots: Vec::new(),
                values: Vec::new(),
                // Where every run has a phase of its own, that of a run that was not fitted is unknown: nothing to
                // carry over.
                harmonics: common.iter().map(|(harmonic, _)| *harmonic).collect(),
            },
            own: common.map_or(fit.own, |(_, own)| own),
        });
    }
    found
}

/// Share of the gain with a phase for each run that one phase for all of them must reach.
const COMMON_SHARE: f64 = 0.8;
/// Rates tried on either side of the spectrum's, in sixteenths of a period over the longest run.
const FINER: i32 = 8;

/// A wave of the track lies at the same place in every run: its rate with one cosine and sine for all of them, and
/// the steps of the model's own parameters that go with it.
fn same_everywhere(
    problem: &Problem<'_>,
    regression: &Regression,
    rate: f64,
    lever: &dyn Fn(usize, usize) -> f64,
    phase: &dyn Fn(usize) -> Vec<f64>,
    free: &Found,
) -> Option<([f64; 3], Vec<f64>)> {
    let span = problem
        .runs
        .iter()
        .filter_map(|run| phase(*run).last().copied())
        .fold(0.0, f64::max);
    let finest = core::f64::consts::TAU / (16.0 * span);
    (-FINER..=FINER)
        .map(|step| rate + f64::from(step) * finest)
        .map(|rate| {
            let columns = lines::common_columns(problem, rate, lever, phase);
            (
                rate,
                regression.on(problem, &columns.iter().collect::<Vec<_>>()),
            )
        })
        .filter(|(_, found)| found.rank == 2 && found.gain >= COMMON_SHARE * free.gain)
        .max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))
        .map(|(rate, found)| {
            (
                [rate, found.coefficients[0], found.coefficients[1]],
                found.own,
            )
        })
}

/// Mechanisms that say the same as a dependence on this variable.
#[must_use]
pub fn counterparts(variable: &str) -> &'static [Id] {
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
