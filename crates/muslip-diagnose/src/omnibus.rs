//! Columns that belong to no mechanism: what a residual may depend on, by variable. They serve three
//! ends: the noise is read off what they all leave over, a remainder is located by the variable whose
//! columns take it up, and a mechanism has to compete with them.

use rayon::prelude::*;

use nalgebra::{DMatrix, DVector};

use crate::data::Data;
use crate::fit::{Problem, dot};
use crate::model::{Model, tyre};
use crate::noise::weight;

/// How columns of a variable act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// On the friction, by a factor.
    Friction,
    /// On the force, added, in units of the mean load.
    Force,
    /// On the slip at the peak.
    CriticalSlip,
}

impl Action {
    /// Word used in files and sentences.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::Force => "force",
            Self::CriticalSlip => "critical_slip",
        }
    }
    /// Inverse of `as_str`.
    #[must_use]
    pub fn parse(word: &str) -> Option<Self> {
        [Self::Friction, Self::Force, Self::CriticalSlip]
            .into_iter()
            .find(|a| a.as_str() == word)
    }
}

/// A variable that a residual may depend on.
#[derive(Clone, Debug, PartialEq)]
pub enum Variable {
    /// Slip.
    Slip,
    /// Sliding speed s·v.
    SlidingSpeed,
    /// Vehicle speed.
    VehicleSpeed,
    /// Normal force.
    NormalForce,
    /// Time since the start of the run.
    Time,
    /// Time since the wheel last began to slip.
    SinceOnset,
    /// Distance run.
    Distance,
    /// Rate of change of slip.
    SlipRate,
    /// Rate of change of the normal force.
    NormalForceRate,
    /// Rate of change of the vehicle speed.
    VehicleSpeedRate,
    /// A recorded column, by its place in the campaign.
    Column(usize),
}

impl Variable {
    /// The contract's word (for a column: its header).
    #[must_use]
    pub fn word(&self, data: &Data) -> String {
        match self {
            Self::Slip => "slip".into(),
            Self::SlidingSpeed => "sliding_speed_m_s".into(),
            Self::VehicleSpeed | Self::VehicleSpeedRate => "vehicle_speed_m_s".into(),
            Self::NormalForce | Self::NormalForceRate => "normal_force_n".into(),
            Self::Time | Self::SinceOnset => "time_s".into(),
            Self::Distance => "distance_m".into(),
            Self::SlipRate => "slip_rate".into(),
            Self::Column(i) => data.extra_names.get(*i).cloned().unwrap_or_default(),
        }
    }

    /// A name that tells apart what the contract's word does not; stable, used in `model.toml`.
    #[must_use]
    pub fn key(&self, data: &Data) -> String {
        match self {
            Self::VehicleSpeedRate => "vehicle_speed_rate".into(),
            Self::NormalForceRate => "normal_force_rate".into(),
            Self::SinceOnset => "time_since_onset".into(),
            Self::Column(_) => format!("column:{}", self.word(data)),
            _ => self.word(data),
        }
    }

    /// All variables of a campaign.
    #[must_use]
    pub fn all(data: &Data) -> Vec<Self> {
        let mut all = vec![
            Self::Slip,
            Self::SlidingSpeed,
            Self::VehicleSpeed,
            Self::NormalForce,
            Self::Time,
            Self::SinceOnset,
            Self::Distance,
            Self::SlipRate,
            Self::NormalForceRate,
            Self::VehicleSpeedRate,
        ];
        all.extend((0..data.extra_names.len()).map(Self::Column));
        all
    }

    /// Its values on one run.
    #[must_use]
    pub fn values(&self, data: &Data, run: usize) -> Vec<f64> {
        let s = &data.series[run];
        let slip = || -> Vec<f64> {
            (0..s.len())
                .map(|k| s.slip(k, data.context.radius))
                .collect()
        };
        let start = s.time.first().copied().unwrap_or(0.0);
        match self {
            Self::Slip => slip(),
            Self::SlidingSpeed => slip()
                .iter()
                .zip(&s.speed.smooth)
                .map(|(a, v)| a * v)
                .collect(),
            Self::VehicleSpeed => s.speed.smooth.clone(),
            Self::NormalForce => s.load.smooth.clone(),
            Self::Time => s.time.iter().map(|t| t - start).collect(),
            Self::SinceOnset => {
                let slip = slip();
                let critical = data.context.nominal[1];
                let mut onset = None;
                (0..s.len())
                    .map(|k| {
                        // Begins when slip passes a quarter of the peak's, ends below an eighth.
                        if slip[k] > 0.25 * critical && onset.is_none() {
                            onset = Some(s.time[k]);
                        } else if slip[k] < 0.125 * critical {
                            onset = None;
                        }
                        onset.map_or(0.0, |t| s.time[k] - t)
                    })
                    .collect()
            }
            Self::Distance => s.distance.clone(),
            Self::SlipRate => (0..s.len())
                .map(|k| {
                    if !s.rolling[k] {
                        return 0.0;
                    }
                    let (v, omega) = (s.speed.smooth[k], s.wheel.smooth[k]);
                    data.context.radius * (omega * s.speed.rate[k] / v - s.wheel.rate[k]) / v
                })
                .collect(),
            Self::NormalForceRate => s.load.rate.clone(),
            Self::VehicleSpeedRate => s.speed.rate.clone(),
            Self::Column(i) => s
                .extra
                .get(*i)
                .cloned()
                .unwrap_or_else(|| vec![f64::NAN; s.len()]),
        }
    }
}

/// Columns by run and sample.
pub type Column = Vec<Vec<f64>>;

/// A group of columns.
pub struct Group {
    /// What it depends on; `None` for groups that are there for the noise only.
    pub variable: Option<Variable>,
    /// How it acts.
    pub action: Action,
    /// Knots of the hat functions.
    pub knots: Vec<f64>,
    /// The columns.
    pub columns: Vec<Column>,
}

/// Weights of the hat functions at `u`: the two neighbouring knots; outside, the nearest knot's.
#[must_use]
pub fn hat(knots: &[f64], u: f64) -> Option<(usize, f64)> {
    if !u.is_finite() || knots.len() < 2 {
        return None;
    }
    let last = knots.len() - 1;
    if u <= knots[0] {
        return Some((0, 0.0));
    }
    if u >= knots[last] {
        return Some((last - 1, 1.0));
    }
    let at = knots
        .partition_point(|k| *k <= u)
        .saturating_sub(1)
        .min(last - 1);
    Some((at, (u - knots[at]) / (knots[at + 1] - knots[at])))
}

/// One column for each hat function of a variable, times a lever; zero where either is not finite.
#[must_use]
pub fn hats(
    knots: &[f64],
    values: &[Vec<f64>],
    lever: &dyn Fn(usize, usize) -> f64,
) -> Vec<Column> {
    (0..knots.len())
        .map(|c| {
            values
                .iter()
                .enumerate()
                .map(|(run, u)| {
                    u.iter()
                        .enumerate()
                        .map(|(k, u)| {
                            let height = match hat(knots, *u) {
                                Some((at, w)) if at == c => 1.0 - w,
                                Some((at, w)) if at + 1 == c => w,
                                _ => return 0.0,
                            };
                            finite_or_zero(height * lever(run, k))
                        })
                        .collect()
                })
                .collect()
        })
        .collect()
}

/// A sample without a usable input takes no part in a column.
#[must_use]
pub fn finite_or_zero(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

/// Knots at quantiles of the variable where samples are used; fewer where values repeat.
#[must_use]
pub fn knots(problem: &Problem<'_>, values: &[Vec<f64>], count: usize) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for &run in problem.runs {
        for segment in problem.segments(run) {
            all.extend(
                values[run][segment.clone()]
                    .iter()
                    .step_by(3)
                    .filter(|v| v.is_finite()),
            );
        }
    }
    if all.len() < 10 {
        return Vec::new();
    }
    all.sort_by(f64::total_cmp);
    let quantile = |q: f64| all[((all.len() - 1) as f64 * q) as usize];
    let (low, high) = (quantile(0.005), quantile(0.995));
    if !(high > low) {
        return Vec::new();
    }
    let mut knots: Vec<f64> = Vec::new();
    let gap = (high - low) / (6.0 * count as f64);
    for i in 0..count {
        let share = i as f64 / (count - 1) as f64;
        // Half by quantile, half evenly: deep slip is rare and still matters.
        let even = low + share * (high - low);
        let knot = 0.5 * quantile(0.005 + 0.99 * share) + 0.5 * even;
        if knots.last().is_none_or(|k| knot - k > gap) {
            knots.push(knot);
        }
    }
    if knots.len() < 2 { Vec::new() } else { knots }
}

/// The current tyre model's force and what a relative change of the slip at the peak does to it.
pub struct Levers {
    /// Predicted contact force in N, by run.
    pub force: Column,
    /// Change of force per relative change of the slip at the peak, in N, by run.
    pub critical: Column,
    /// Predicted reading in N, by run.
    pub reading: Column,
}

impl Levers {
    /// Levers of a tyre model.
    #[must_use]
    pub fn new(data: &Data, model: &Model) -> Self {
        let p = model.vector();
        let mut levers = Self {
            force: Vec::new(),
            critical: Vec::new(),
            reading: Vec::new(),
        };
        for series in &data.series {
            let state = tyre(&data.catalogue, model, &p, series, &data.context);
            let critical = state.law.critical;
            levers.critical.push(
                (0..series.len())
                    .map(|k| {
                        let x = state.slip[k] / critical;
                        let h = 1e-4;
                        let slope =
                            (state.law.friction(x + h) - state.law.friction(x - h)) / (2.0 * h);
                        -slope * x * state.load[k]
                    })
                    .collect(),
            );
            levers
                .force
                .push(state.contact.clone().unwrap_or_else(|| state.force.clone()));
            levers.reading.push(state.force);
        }
        levers
    }

    /// The lever of an action.
    #[must_use]
    pub fn of(&self, data: &Data, action: Action, run: usize, k: usize) -> f64 {
        match action {
            Action::Friction => self.force[run][k],
            Action::Force => data.context.mean_load,
            Action::CriticalSlip => self.critical[run][k],
        }
    }
}

/// Hat columns of a variable with an action.
#[must_use]
pub fn group(
    problem: &Problem<'_>,
    levers: &Levers,
    variable: &Variable,
    action: Action,
    count: usize,
) -> Option<Group> {
    let data = problem.data;
    let values: Vec<Vec<f64>> = (0..data.series.len())
        .map(|run| {
            if problem.runs.contains(&run) {
                variable.values(data, run)
            } else {
                Vec::new()
            }
        })
        .collect();
    let knots = knots(problem, &values, count);
    if knots.len() < 2 {
        return None;
    }
    let columns = hats(&knots, &values, &|run, k| levers.of(data, action, run, k));
    Some(Group {
        variable: Some(variable.clone()),
        action,
        knots,
        columns,
    })
}

/// Linear regression of a model's innovations on further columns, its own parameters free alongside.
pub struct Regression {
    innovations: Vec<Vec<f64>>,
    weights: Vec<Vec<f64>>,
    own: Vec<Vec<Vec<f64>>>,
    own_information: DMatrix<f64>,
    own_gradient: DVector<f64>,
    /// The same by run.
    by_run: Vec<(DMatrix<f64>, DVector<f64>)>,
}

/// What a regression found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Drop of the loss in nats, beyond what the model's own parameters could gain.
    pub gain: f64,
    /// Steps of the model's own parameters that go with them.
    pub own: Vec<f64>,
    /// Coefficients of the columns.
    pub coefficients: Vec<f64>,
    /// Number of columns that were linearly independent of the rest.
    pub rank: usize,
    /// Gain in nats on each run when it is left out of the regression, summed; the in-sample gain where
    /// there are fewer than three runs.
    pub held_out: f64,
}

impl<'a> Regression {
    /// Linearises a model.
    #[must_use]
    pub fn new(problem: &'a Problem<'a>, model: &Model) -> Self {
        let parts: Vec<(Vec<f64>, Vec<Vec<f64>>)> = problem
            .runs
            .par_iter()
            .map(|&run| problem.jacobian(model, run))
            .collect();
        let mut innovations = Vec::new();
        let mut weights = Vec::new();
        let mut own = Vec::new();
        let count = model.vector().len();
        let mut total_information = DMatrix::zeros(count, count);
        let mut total_gradient = DVector::zeros(count);
        let mut by_run = Vec::new();
        for (e, columns) in parts {
            let w: Vec<f64> = e.iter().map(|e| weight(*e)).collect();
            let mut own_information = DMatrix::zeros(count, count);
            let mut own_gradient = DVector::zeros(count);
            for i in 0..count {
                let weighted: Vec<f64> = columns[i].iter().zip(&w).map(|(c, w)| c * w).collect();
                own_gradient[i] += dot(&weighted, &e);
                for j in 0..=i {
                    let value = dot(&weighted, &columns[j]);
                    own_information[(i, j)] += value;
                    if i != j {
                        own_information[(j, i)] += value;
                    }
                }
            }
            total_information += &own_information;
            total_gradient += &own_gradient;
            by_run.push((own_information, own_gradient));
            innovations.push(e);
            weights.push(w);
            own.push(columns);
        }
        let (own_information, own_gradient) = (total_information, total_gradient);
        Self {
            innovations,
            weights,
            own,
            own_information,
            own_gradient,
            by_run,
        }
    }

    /// Innovations of the run at this place among the problem's runs.
    #[must_use]
    pub fn innovations(&self, place: usize) -> &[f64] {
        &self.innovations[place]
    }

    /// Regresses on columns given in the residual's unit (a column adds to the prediction).
    #[must_use]
    pub fn on(&self, problem: &Problem<'_>, columns: &[&Column]) -> Found {
        let own = self.own_gradient.len();
        let total = own + columns.len();
        let partial: Vec<(DMatrix<f64>, DVector<f64>)> = problem
            .runs
            .par_iter()
            .enumerate()
            .map(|(place, &run)| {
                let mut cross = DMatrix::zeros(columns.len(), total);
                let mut g = DVector::zeros(columns.len());
                let white: Vec<Vec<f64>> = columns
                    .iter()
                    .map(|c| problem.whiten(&c[run], run))
                    .collect();
                for (i, column) in white.iter().enumerate() {
                    // The residual is measured minus predicted: a column enters it with a minus.
                    let weighted: Vec<f64> = column
                        .iter()
                        .zip(&self.weights[place])
                        .map(|(c, w)| -c * w)
                        .collect();
                    g[i] = dot(&weighted, &self.innovations[place]);
                    for j in 0..own {
                        cross[(i, j)] = dot(&weighted, &self.own[place][j]);
                    }
                    for j in 0..=i {
                        cross[(i, own + j)] = -dot(&weighted, &white[j]);
                    }
                }
                (cross, g)
            })
            .collect();
        let assemble = |leave_out: Option<usize>| {
            let mut information = DMatrix::zeros(total, total);
            let mut gradient = DVector::zeros(total);
            for (place, (cross, g)) in partial.iter().enumerate() {
                if leave_out == Some(place) {
                    continue;
                }
                let (own_part, own_slope) = &self.by_run[place];
                add_part(
                    &mut information,
                    &mut gradient,
                    own_part,
                    own_slope,
                    cross,
                    g,
                );
            }
            (information, gradient)
        };
        let (information, gradient) = assemble(None);
        let (drop_all, step, rank_all) = decrease(&information, &gradient);
        let (drop_own, _, rank_own) = decrease(&self.own_information, &self.own_gradient);
        let mut held_out = 0.0;
        if partial.len() >= 3 {
            for (place, (cross, own_columns)) in partial.iter().enumerate() {
                let (rest, slope) = assemble(Some(place));
                let (_, full, _) = decrease(&rest, &slope);
                let (_, short, _) = decrease(
                    &rest.view((0, 0), (own, own)).into_owned(),
                    &slope.rows(0, own).into_owned(),
                );
                let mut here = DMatrix::zeros(total, total);
                let mut here_slope = DVector::zeros(total);
                let (own_part, own_slope) = &self.by_run[place];
                add_part(
                    &mut here,
                    &mut here_slope,
                    own_part,
                    own_slope,
                    cross,
                    own_columns,
                );
                let change = |x: &DVector<f64>| here_slope.dot(x) + 0.5 * x.dot(&(&here * x));
                let mut padded = DVector::zeros(total);
                padded.rows_mut(0, own).copy_from(&short);
                held_out += change(&padded) - change(&full);
            }
        } else {
            held_out = drop_all - drop_own;
        }
        Found {
            held_out,
            gain: drop_all - drop_own,
            own: step.rows(0, own).iter().copied().collect(),
            coefficients: step.rows(own, columns.len()).iter().copied().collect(),
            rank: rank_all - rank_own,
        }
    }
}

/// Adds one run's share of the normal equations: the model's own block, and the columns' blocks.
fn add_part(
    information: &mut DMatrix<f64>,
    gradient: &mut DVector<f64>,
    own_part: &DMatrix<f64>,
    own_slope: &DVector<f64>,
    cross: &DMatrix<f64>,
    slope: &DVector<f64>,
) {
    let own = own_slope.len();
    for i in 0..own {
        gradient[i] += own_slope[i];
        for j in 0..own {
            information[(i, j)] += own_part[(i, j)];
        }
    }
    for i in 0..slope.len() {
        gradient[own + i] += slope[i];
        for j in 0..own {
            information[(own + i, j)] += cross[(i, j)];
            information[(j, own + i)] += cross[(i, j)];
        }
        for j in 0..=i {
            information[(own + i, own + j)] += cross[(i, own + j)];
            if i != j {
                information[(own + j, own + i)] += cross[(i, own + j)];
            }
        }
    }
}

/// Largest decrease of g·x + xᵀA x/2, where it is taken, and the numerical rank, by a pivoted Cholesky of
/// the scaled matrix: columns that depend on those before them are left out.
fn decrease(information: &DMatrix<f64>, gradient: &DVector<f64>) -> (f64, DVector<f64>, usize) {
    let n = gradient.len();
    let scale: Vec<f64> = (0..n)
        .map(|i| information[(i, i)].max(0.0).sqrt())
        .collect();
    let mut kept: Vec<usize> = Vec::new();
    let mut factor: Vec<Vec<f64>> = Vec::new();
    let mut forward: Vec<f64> = Vec::new();
    for i in 0..n {
        if scale[i] <= 0.0 {
            continue;
        }
        let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
        for (a, &j) in kept.iter().enumerate() {
            let mut value = information[(i, j)] / (scale[i] * scale[j]);
            for (x, y) in row.iter().zip(&factor[a]) {
                value -= x * y;
            }
            row.push(value / factor[a][a]);
        }
        let left = 1.0 - row.iter().map(|x| x * x).sum::<f64>();
        if left < 1e-5 {
            continue;
        }
        let pivot = left.sqrt();
        let mut y = -gradient[i] / scale[i];
        for (x, f) in row.iter().zip(&forward) {
            y -= x * f;
        }
        row.push(pivot);
        forward.push(y / pivot);
        factor.push(row);
        kept.push(i);
    }
    let drop = 0.5 * forward.iter().map(|y| y * y).sum::<f64>();
    let mut step = DVector::zeros(n);
    let mut solution = forward.clone();
    for a in (0..kept.len()).rev() {
        for b in a + 1..kept.len() {
            let upper = factor[b][a];
            solution[a] -= upper * solution[b];
        }
        solution[a] /= factor[a][a];
        step[kept[a]] = solution[a] / scale[kept[a]];
    }
    (drop, step, kept.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decrease_agrees_with_a_direct_solution_and_drops_dependent_columns() {
        let a = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 2.0, 1.0, 3.0, 0.5, 2.0, 0.5, 1.0]);
        // Third column is half the first: rank two in a consistent system.
        let g = DVector::from_column_slice(&[1.0, -2.0, 0.5]);
        let (drop, step, rank) = decrease(&a, &g);
        let two = a.view((0, 0), (2, 2)).into_owned();
        let solved = two
            .clone()
            .lu()
            .solve(&(-g.rows(0, 2).into_owned()))
            .unwrap();
        assert_eq!(rank, 2);
        assert!((step[0] - solved[0]).abs() < 1e-12 && (step[1] - solved[1]).abs() < 1e-12);
        assert!((drop - 0.5 * solved.dot(&(&two * &solved))).abs() < 1e-12);
    }

    #[test]
    fn hats_are_a_partition_of_unity_and_constant_outside() {
        let knots = [0.0, 1.0, 3.0];
        assert_eq!(hat(&knots, 2.0), Some((1, 0.5)));
        assert_eq!(hat(&knots, -5.0), Some((0, 0.0)));
        assert_eq!(hat(&knots, 9.0), Some((1, 1.0)));
        assert_eq!(hat(&knots, f64::NAN), None);
    }
}
