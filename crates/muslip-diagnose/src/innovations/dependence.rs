//! A free dependence on one variable: what is said where no mechanism of the vocabulary accounts for a mismatch, and
//! what every mechanism has to compete with.

use std::sync::Arc;

use rayon::prelude::*;

use super::rows::Triple;
use crate::correction::{Action, Levers, hat, knots_among};
use crate::data::Data;
use crate::mechanism::{Balance, resolves_angle};
use crate::number::finite_or_zero;
use crate::repaired::Correction;
use crate::series::Series;
use crate::variable::Variable;

/// Hat functions of a dependence.
const KNOTS: usize = 7;
/// Fewest of them: two are a straight line, which is no shape.
const LEAST_KNOTS: usize = 3;
/// Fewest values that knots are set among.
const LEAST_SAMPLES: usize = 30;

/// A dependence of one balance on one variable, as columns.
#[derive(Clone)]
pub struct Dependence {
    /// The balance that it is in.
    pub balance: Balance,
    /// What it depends on.
    pub variable: Variable,
    /// How it acts (in the tyre balance).
    pub action: Action,
    shape: Shape,
    /// The variable by run and sample.
    values: Arc<Vec<Vec<f64>>>,
}

/// What stands for the function of the variable.
#[derive(Clone)]
enum Shape {
    /// Hat functions.
    Hats {
        /// Their knots.
        knots: Vec<f64>,
        /// The knot at which a dependence of the law is nothing: its own parameters hold there. The fullest one.
        reference: Option<usize>,
    },
    /// A wave once a turn of the wheel, for each run from an angle of its own: where the wheel stood at the start is not
    /// known. Of the brake's torque, for it is a disc or a drum that turns.
    Wave {
        /// The runs that show it.
        runs: Vec<usize>,
    },
}

/// Columns of these dependences together.
#[must_use]
pub fn width(all: &[Dependence]) -> usize {
    all.iter().map(Dependence::width).sum()
}

/// Knots between the variable's extremes, half by quantile, half evenly: what is rare still matters.
fn knots(data: &Data, values: &[Vec<f64>], balance: Balance, count: usize) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for (s, u) in data.series.iter().zip(values) {
        let used = s.segments(balance).iter();
        all.extend(
            used.flat_map(|g| u[g.clone()].iter().step_by(3))
                .filter(|v| v.is_finite()),
        );
    }
    if all.len() < LEAST_SAMPLES {
        return Vec::new();
    }
    let knots = knots_among(all, count);
    if knots.len() < LEAST_KNOTS.min(count) {
        Vec::new()
    } else {
        knots
    }
}

/// The knot that most samples of the tyre's balance are about: beside one that nothing is known of, the law could be
/// anything. Along the slip a wheel that stands says nothing.
fn fullest(data: &Data, values: &[Vec<f64>], action: Action, knots: &[f64]) -> usize {
    let along_slip = matches!(action, Action::CriticalSlip | Action::Slip);
    let mut about = vec![0.0; knots.len()];
    for (s, u) in data.series.iter().zip(values) {
        let used = s.segments(Balance::Tyre).iter().flat_map(Clone::clone);
        for k in used.filter(|k| s.rolling[*k] || !along_slip) {
            if let Some((at, w)) = hat(knots, u[k]) {
                about[at] += 1.0 - w;
                if let Some(next) = about.get_mut(at + 1) {
                    *next += w;
                }
            }
        }
    }
    let fullest = (0..knots.len()).max_by(|a, b| about[*a].total_cmp(&about[*b]));
    fullest.unwrap_or(0)
}

/// All dependences that a campaign can show.
#[must_use]
pub fn all(data: &Data) -> Vec<Dependence> {
    Variable::all(data)
        .into_par_iter()
        .flat_map_iter(|variable| on(data, &variable))
        .collect()
}

/// All dependences on one variable.
fn on(data: &Data, variable: &Variable) -> Vec<Dependence> {
    let mut out = Vec::new();
    let runs = 0..data.series.len();
    let values: Vec<Vec<f64>> = runs.map(|run| variable.values(data, run)).collect();
    let values = Arc::new(values);
    for balance in [Balance::Tyre, Balance::Wheel, Balance::Vehicle] {
        if !data.forms(balance) || holds_own_noise(variable, balance) {
            continue;
        }
        if *variable == Variable::WheelAngle {
            out.extend(wave(data, balance, &values));
            continue;
        }
        // What was recorded beside the rig's channels may well act in proportion, and differ by run alone.
        let recorded = matches!(variable, Variable::Column(_));
        let counts: &[usize] = if recorded { &[KNOTS, 2] } else { &[KNOTS] };
        let shapes: Vec<Vec<f64>> = counts
            .iter()
            .map(|&count| knots(data, &values, balance, count))
            .filter(|knots| !knots.is_empty())
            .collect();
        let mut actions = vec![Action::Force];
        if balance == Balance::Tyre {
            actions.push(Action::Friction);
            actions.extend(along_slip(variable));
        }
        for (action, knots) in actions
            .into_iter()
            .flat_map(|a| shapes.iter().map(move |k| (a, k)))
        {
            let reference =
                (action != Action::Force).then(|| fullest(data, &values, action, knots));
            out.push(Dependence {
                balance,
                variable: variable.clone(),
                action,
                shape: Shape::Hats {
                    knots: knots.clone(),
                    reference,
                },
                values: Arc::clone(&values),
            });
        }
    }
    out
}

/// What varies with the wheel's angle in a balance: of the brake, where samples and runs show it. The tyre's and the
/// wheel speed's have names.
fn wave(data: &Data, balance: Balance, angles: &Arc<Vec<Vec<f64>>>) -> Option<Dependence> {
    let shown = |run: &usize| !data.series[*run].segments(balance).is_empty();
    let runs: Vec<usize> = (0..data.series.len()).filter(shown).collect();
    let of_brake = balance == Balance::Wheel && resolves_angle(&data.context, 1);
    (of_brake && runs.len() > 1).then(|| Dependence {
        balance,
        variable: Variable::WheelAngle,
        action: Action::Force,
        shape: Shape::Wave { runs },
        values: Arc::clone(angles),
    })
}

/// How a variable acts along the slip, if it may: what changes the tyre moves its peak, and a speed may be read wrongly.
/// Over slip itself, or what goes with it, that is another curve, which friction by slip says already; distance says here
/// what time says.
fn along_slip(variable: &Variable) -> Option<Action> {
    match variable {
        Variable::NormalForce | Variable::Time | Variable::Column(_) => Some(Action::CriticalSlip),
        Variable::VehicleSpeed => Some(Action::Slip),
        Variable::Slip
        | Variable::SlidingSpeed
        | Variable::SinceOnset
        | Variable::Distance
        | Variable::WheelAngle
        | Variable::SlipRate
        | Variable::NormalForceRate
        | Variable::VehicleSpeedRate => None,
    }
}

/// Whether a variable holds the noise of a balance's own level: a rate of the level's speed, integrated again, is
/// that speed, noise and all, and a dependence on it would buy it away.
fn holds_own_noise(variable: &Variable, balance: Balance) -> bool {
    match variable {
        Variable::SlipRate => balance != Balance::Tyre,
        Variable::VehicleSpeedRate => balance == Balance::Vehicle,
        _ => false,
    }
}

/// What a rate has come to by each sample, in their order; as the rows integrate; what is no number, or a gap, adds little.
fn integral<'a>(
    series: &'a Series,
    rate: impl Fn(usize) -> f64 + 'a,
) -> impl FnMut(usize) -> f64 + 'a {
    let (mut sum, mut before) = (0.0, 0.0);
    move |k| {
        let now = finite_or_zero(rate(k));
        if k > 0 {
            sum += 0.5 * (now + before) * series.dt[k].min(0.1);
        }
        before = now;
        sum
    }
}

impl Dependence {
    /// Its columns.
    #[must_use]
    pub fn width(&self) -> usize {
        match &self.shape {
            Shape::Hats { knots, reference } => knots.len() - usize::from(reference.is_some()),
            Shape::Wave { runs } => 2 * runs.len(),
        }
    }

    /// Whether what it is belongs to each run alone.
    #[must_use]
    pub fn is_per_run(&self) -> bool {
        matches!(self.shape, Shape::Wave { .. })
    }

    /// Columns on one run beside the model that the levers are of: minus the lever times each function in the tyre's
    /// row, integrated in the others.
    #[must_use]
    pub fn columns(&self, data: &Data, levers: &Levers, run: usize) -> Vec<Triple> {
        match &self.shape {
            Shape::Hats { knots, reference } => self.of_hats(data, levers, run, knots, *reference),
            Shape::Wave { runs } => self.of_wave(data, runs, run),
        }
    }

    fn of_hats(
        &self,
        data: &Data,
        levers: &Levers,
        run: usize,
        knots: &[f64],
        reference: Option<usize>,
    ) -> Vec<Triple> {
        let (s, u) = (&data.series[run], &self.values[run]);
        let hats: Vec<Option<(usize, f64)>> = u.iter().map(|u| hat(knots, *u)).collect();
        let height = |c: usize, k: usize| match hats[k] {
            Some((at, w)) if at == c => 1.0 - w,
            Some((at, w)) if at + 1 == c => w,
            _ => 0.0,
        };
        let of_wheel = self.balance == Balance::Wheel;
        let arm = if of_wheel { data.context.radius } else { 1.0 };
        let acting = arm * data.context.mean_load;
        (0..knots.len())
            .filter(|c| reference != Some(*c))
            .map(|c| match self.balance {
                Balance::Tyre => {
                    let added = |k: usize| -height(c, k) * levers.of(data, self.action, run, k);
                    self.triple(s, |k| finite_or_zero(added(k)))
                }
                Balance::Wheel | Balance::Vehicle => {
                    self.triple(s, integral(s, |k| height(c, k) * acting))
                }
            })
            .collect()
    }

    /// Cosine and sine of each run's own wave: nothing on the others.
    fn of_wave(&self, data: &Data, runs: &[usize], run: usize) -> Vec<Triple> {
        let (s, angle) = (&data.series[run], &self.values[run]);
        let mut all = vec![Triple::default(); self.width()];
        let place = runs.iter().position(|own| *own == run);
        if let (Some(place), Some(torque)) = (place, &s.torque) {
            for (own, part) in all[2 * place..].iter_mut().zip([f64::cos, f64::sin]) {
                *own = self.triple(s, integral(s, |k| part(angle[k]) * torque.smooth[k]));
            }
        }
        all
    }

    /// A column of its balance, where that is formed.
    fn triple(&self, series: &Series, at: impl FnMut(usize) -> f64) -> Triple {
        let formed = !series.segments(self.balance).is_empty();
        let samples = if formed { series.len() } else { 0 };
        let mut triple = Triple::default();
        triple[self.balance as usize] = (0..samples).map(at).collect();
        triple
    }

    /// The correction of a repaired model, from the columns' coefficients; none for what is no function of the variable.
    #[must_use]
    pub fn correction(&self, data: &Data, coefficients: &[f64]) -> Option<Correction> {
        let Shape::Hats { knots, reference } = &self.shape else {
            return None;
        };
        let mut values = coefficients.to_vec();
        if let Some(reference) = reference {
            values.insert(*reference, 0.0);
        }
        Some(Correction {
            variable: self.variable.key(data),
            acts_on: self.action.as_str().to_owned(),
            form: String::new(),
            knots: knots.clone(),
            values,
            harmonics: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::rows::rows_of;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, stop};
    use crate::model::Model;

    #[test]
    fn a_wave_s_columns_are_what_a_torque_that_varies_with_the_wheel_s_angle_changes() {
        let mut data = stop(Noise::NONE, 4);
        // A brake that is read without noise needs no smoothing.
        if let Some(torque) = &mut data.series[0].torque {
            torque.smooth.clone_from(&torque.raw);
        }
        data.series.push(data.series[0].clone());
        let model = Model::of_law(PEAK, CRITICAL);
        let levers = Levers::new(&data, &model);
        let waves = on(&data, &Variable::WheelAngle);
        let [wave] = waves.as_slice() else {
            panic!("of the wheel's balance alone: {}", waves.len());
        };
        assert_eq!((wave.balance, wave.width()), (Balance::Wheel, 4));
        let columns = wave.columns(&data, &levers, 1);
        assert!(columns[..2].iter().flatten().all(Vec::is_empty));
        let before = rows_of(&data, &model, 1).wheel;
        let (cos, sin) = (0.1, -0.05);
        let series = &mut data.series[1];
        let angle = series.angle.clone();
        for (torque, angle) in series.torque.iter_mut().flat_map(|t| &mut t.raw).zip(angle) {
            *torque *= 1.0 + cos * angle.cos() + sin * angle.sin();
        }
        let after = rows_of(&data, &model, 1).wheel;
        let by = |k: usize| cos * columns[2][1][k] + sin * columns[3][1][k];
        let largest = (0..before.len()).map(|k| by(k).abs()).fold(0.0, f64::max);
        for k in 0..before.len() {
            let off = after[k] - before[k] - by(k);
            assert!(off.abs() < 1e-9 * largest, "{k}: {off} of {largest}");
        }
    }

    #[test]
    fn one_run_shows_no_wave_of_a_phase_of_its_own() {
        let mut data = stop(Noise::TYPICAL, 4);
        assert!(on(&data, &Variable::WheelAngle).is_empty());
        // Nor does one beside another whose wheel's balance is not formed.
        let mut silent = data.series[0].clone();
        silent.wheel_balance.clear();
        data.series.insert(0, silent);
        assert!(on(&data, &Variable::WheelAngle).is_empty());
        data.series.push(data.series[1].clone());
        assert_eq!(on(&data, &Variable::WheelAngle)[0].width(), 4);
    }
}
