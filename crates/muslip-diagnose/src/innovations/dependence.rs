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
        /// The knots at which it is nothing, for the law's own parameters hold there, in their order.
        held: Vec<usize>,
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

/// How much of the tyre's balance is about each knot, by what a sample counts.
fn about(
    data: &Data,
    values: &[Vec<f64>],
    knots: &[f64],
    counts: impl Fn(&Series, usize) -> f64,
) -> Vec<f64> {
    let mut about = vec![0.0; knots.len()];
    for (s, u) in data.series.iter().zip(values) {
        for k in s.segments(Balance::Tyre).iter().flat_map(Clone::clone) {
            if let Some((at, w)) = hat(knots, u[k]) {
                let count = finite_or_zero(counts(s, k));
                about[at] += (1.0 - w) * count;
                if let Some(next) = about.get_mut(at + 1) {
                    *next += w * count;
                }
            }
        }
    }
    about
}

/// The knot that most is about.
fn fullest(about: &[f64]) -> usize {
    let all = 0..about.len();
    all.max_by(|a, b| about[*a].total_cmp(&about[*b]))
        .unwrap_or(0)
}

/// The knots at which a dependence of the tyre's balance is nothing, in their order: beside one that nothing is known of, the
/// law could be anything.
///
/// Along the slip it is another curve: there the law's peak and the slip of it hold at a knot each, where they matter most, or
/// its form makes up for any of the two. A law twice as steep with half the friction at its beginning is the same curve, but
/// not to the chain's nuisances.
fn held(
    data: &Data,
    variable: &Variable,
    values: &[Vec<f64>],
    action: Action,
    knots: &[f64],
) -> Vec<usize> {
    if *variable == Variable::Slip {
        let [peak, mut slip] = [0, 1].map(|parameter| {
            about(data, values, knots, |s, k| {
                let x = s.slip(k, data.context.radius) / data.context.nominal[1];
                let bottom = 1.0 + x * x;
                // By how much the law changes with the logarithm of either, but for a factor.
                [x / bottom, x * (1.0 - x * x) / (bottom * bottom)][parameter].powi(2)
            })
        });
        let first = fullest(&peak);
        slip[first] = -1.0;
        let mut held = vec![first, fullest(&slip)];
        held.sort_unstable();
        return held;
    }
    if action == Action::Force {
        return Vec::new();
    }
    // Along the slip a wheel that stands says nothing.
    let along_slip = matches!(action, Action::CriticalSlip | Action::Slip);
    let counts = |s: &Series, k: usize| f64::from(s.rolling[k] || !along_slip);
    vec![fullest(&about(data, values, knots, counts))]
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
            let held = match balance {
                Balance::Tyre => held(data, variable, &values, action, knots),
                Balance::Wheel | Balance::Vehicle => Vec::new(),
            };
            out.push(Dependence {
                balance,
                variable: variable.clone(),
                action,
                shape: Shape::Hats {
                    knots: knots.clone(),
                    held,
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
            Shape::Hats { knots, held } => knots.len() - held.len(),
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
            Shape::Hats { knots, held } => self.of_hats(data, levers, run, knots, held),
            Shape::Wave { runs } => self.of_wave(data, runs, run),
        }
    }

    fn of_hats(
        &self,
        data: &Data,
        levers: &Levers,
        run: usize,
        knots: &[f64],
        held: &[usize],
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
            .filter(|c| !held.contains(c))
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
        let Shape::Hats { knots, held } = &self.shape else {
            return None;
        };
        let mut values = coefficients.to_vec();
        for knot in held {
            values.insert(*knot, 0.0);
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
    fn a_dependence_along_the_curve_leaves_the_law_its_peak_and_the_slip_of_it() {
        let data = stop(Noise::TYPICAL, 4);
        let levers = Levers::new(&data, &Model::of_law(PEAK, CRITICAL));
        let blocks = &data.blocks[0][Balance::Tyre as usize];
        // Least share of what a mixture of both changes of the law is, that the dependence's columns do not make.
        let left = |own: &Dependence| {
            let columns = own.columns(&data, &levers, 0);
            let columns: Vec<Vec<f64>> = columns.iter().map(|c| blocks.mean(&c[0])).collect();
            let of =
                |c: &[Vec<f64>]| nalgebra::DMatrix::from_fn(c[0].len(), c.len(), |k, i| c[i][k]);
            let mut law = of(&[&levers.force, &levers.critical].map(|c| blocks.mean(&c[0])));
            for mut column in law.column_iter_mut() {
                column.normalize_mut();
            }
            let all = of(&columns);
            let products = all.transpose() * &all;
            let fitted = products.pseudo_inverse(1e-9).unwrap() * (all.transpose() * &law);
            let rest = &law - &all * fitted;
            let [whole, rest] = [&law, &rest].map(|x| x.transpose() * x);
            let root = whole.cholesky().unwrap().inverse();
            (root * rest).eigenvalues().unwrap().min()
        };
        let mut along = on(&data, &Variable::Slip);
        along.retain(|own| own.balance == Balance::Tyre);
        assert_eq!(along.len(), 2);
        for own in &along {
            let left = left(own);
            assert!(left > 0.03, "{:?}: {left}", own.action);
            let told = own.correction(&data, &vec![1.0; own.width()]).unwrap();
            let nothing = told.values.iter().filter(|value| **value == 0.0).count();
            assert_eq!((nothing, told.values.len()), (2, told.knots.len()));
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
