//! How a dependence that no mechanism accounts for acts on the drag: by hat functions of its variable, on the friction,
//! the force, the slip at the peak or the slip that is read.

use rayon::prelude::*;

use crate::data::Data;
use crate::model::{Model, friction_about, tyre};
use crate::series::Series;

/// How columns of a variable act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// On the friction, by a factor.
    Friction,
    /// On the force, added, in units of the mean load.
    Force,
    /// On the slip at the peak, by a factor.
    CriticalSlip,
    /// On the slip that is read, added.
    Slip,
}

impl Action {
    /// All of them.
    const ALL: [Self; 4] = [Self::Friction, Self::Force, Self::CriticalSlip, Self::Slip];

    /// Word used in files and sentences.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::Force => "force",
            Self::CriticalSlip => "critical_slip",
            Self::Slip => "slip",
        }
    }
    /// Inverse of `as_str`.
    #[must_use]
    pub fn parse(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|a| a.as_str() == word)
    }
}

/// Columns by run and sample.
pub type Column = Vec<Vec<f64>>;

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

/// Knots at quantiles of these values; fewer where values repeat.
#[must_use]
pub fn knots_among(mut all: Vec<f64>, count: usize) -> Vec<f64> {
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

/// The current tyre model's force and what changes of the slip at the peak and of the slip that is read do to it.
pub struct Levers {
    /// Predicted contact force in N, by run.
    pub force: Column,
    /// Change of force per relative change of the slip at the peak, in N, by run.
    pub critical: Column,
    /// Change of force per slip that is read too little, in N, by run.
    pub slip: Column,
}

impl Levers {
    /// Levers of a tyre model.
    #[must_use]
    pub fn new(data: &Data, model: &Model) -> Self {
        let p = model.vector();
        let of_run = |series: &Series| {
            let state = tyre(&data.catalogue, model, &p, series, &data.context);
            let ([before, _, after], step) =
                friction_about(&data.catalogue, model, &p, series, &data.context);
            // A wheel that stands has no slip to be misread.
            let by_slip = |k: usize| {
                let slope = state.load[k] * (after[k] - before[k]) / (2.0 * step);
                if series.rolling[k] { slope } else { 0.0 }
            };
            let slip: Vec<f64> = (0..state.slip.len()).map(by_slip).collect();
            let critical = slip
                .iter()
                .zip(&state.slip)
                .map(|(by_slip, slip)| -by_slip * slip)
                .collect();
            [state.contact.unwrap_or(state.force), critical, slip]
        };
        let mut levers = Self {
            force: Vec::new(),
            critical: Vec::new(),
            slip: Vec::new(),
        };
        let by_run: Vec<[Vec<f64>; 3]> = data.series.par_iter().map(of_run).collect();
        for [force, critical, slip] in by_run {
            levers.force.push(force);
            levers.critical.push(critical);
            levers.slip.push(slip);
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
            Action::Slip => self.slip[run][k],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, entry_of, stop};
    use crate::mechanism::Id;
    use crate::model::Term;

    #[test]
    fn every_action_has_a_word_of_its_own() {
        for action in Action::ALL {
            assert_eq!(Action::parse(action.as_str()), Some(action));
        }
        assert_eq!(Action::parse("hope"), None);
    }

    #[test]
    fn levers_are_what_the_force_changes_by_and_nothing_where_the_wheel_stands() {
        let mut data = stop(Noise::NONE, 4);
        let still = data.series[0].len() / 2;
        data.series[0].rolling[still] = false;
        let wears = Term {
            entry: entry_of(&data, Id::WearDrift),
            parameters: vec![0.2],
        };
        let levers = |critical| {
            let mut model = Model::of_law(PEAK, critical);
            model.terms.push(wears.clone());
            Levers::new(&data, &model)
        };
        let (here, h) = (levers(CRITICAL), 1e-5);
        let largest = |of: &[f64]| of.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let longer = levers(CRITICAL * (1.0 + h));
        let series = &data.series[0];
        for k in 0..series.len() {
            let changed = (longer.force[0][k] - here.force[0][k]) / h;
            assert!((changed - here.critical[0][k]).abs() < 1e-3 * largest(&here.critical[0]));
            // As much more slip leaves as much less of a longer curve.
            if series.rolling[k] {
                let slip = series.slip(k, data.context.radius);
                assert!((here.critical[0][k] + slip * here.slip[0][k]).abs() < 1e-6);
            }
        }
        assert!(largest(&here.critical[0]) > 0.1 * largest(&here.force[0]));
        assert!(here.slip[0][still] == 0.0);
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
