//! Placebos: recordings changed so that something that could be said of them is no longer in them.
//!
//! A name given with the original and given again with a placebo that destroys what it claims was never read off
//! what it claims.

use serde_json::Value;

use super::recording::{DRAG, Recording, TIME};
use crate::contract::{list, number, text};
use crate::draw::Draw;

/// Seed of the random columns and of the shuffles: the same in every trial, so that answers can be compared.
const SEED: u64 = 0x91ac_eb00;
/// Header of the column that copies the drag.
pub(super) const COPY: &str = "copied_force_n";
/// Headers of the random columns.
pub(super) const RANDOM: [&str; 3] = ["random_white", "random_slow", "random_walk"];
/// Correlation time of the slow random column, s.
const SLOW: f64 = 1.0;
/// Samples that the copy comes late by.
const LATE: usize = 2;

/// One way to change recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Placebo {
    Reversed,
    Reordered,
    DragSwapped,
    /// Of two draws: one may fit by chance, or fail to.
    RandomColumns(Draws),
    CopiedDrag,
}

/// Which draw of the random columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Draws {
    First,
    Second,
}

pub(super) const ALL: [Placebo; 6] = [
    Placebo::Reversed,
    Placebo::Reordered,
    Placebo::DragSwapped,
    Placebo::RandomColumns(Draws::First),
    Placebo::RandomColumns(Draws::Second),
    Placebo::CopiedDrag,
];

/// Names that claim that something follows later than its cause, or depends on what went before.
///
/// `slip_hysteresis` is none of them. What it claims is that rising and falling slip follow different curves, whatever
/// the rate: a loop run through backwards is a loop still, of the same height. Only its sense turns, and of that its
/// figure says nothing: `loop_share`, half the loop's height over friction, is a size.
const AFTERWARDS: [&str; 6] = [
    "force_lag",
    "relaxation_length",
    "structural_resonance",
    "thermal_fade",
    "brake_lag",
    "brake_fade",
];
/// Names whose sign must turn where time does: what came late comes early.
const TURNS: [&str; 3] = ["force_delay", "vehicle_speed_delay", "wheel_speed_delay"];
/// Names of the tyre balance that two speeds alone can show, without the drag.
pub(super) const OF_SPEEDS: [&str; 4] = [
    "effective_radius",
    "encoder_ripple",
    "vehicle_speed_delay",
    "wheel_speed_delay",
];

/// What a placebo made of one name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// Given with the original, and again: a failure.
    Survives,
    /// Given with the placebo alone.
    Arises,
    /// Given with the original alone: as it must be.
    Gone,
}

impl Placebo {
    pub(super) fn name(self) -> &'static str {
        match self {
            Placebo::Reversed => "time reversed",
            Placebo::Reordered => "runs in another order",
            Placebo::DragSwapped => "drag swapped",
            Placebo::RandomColumns(Draws::First) => "random columns",
            Placebo::RandomColumns(Draws::Second) => "other random columns",
            Placebo::CopiedDrag => "copied drag",
        }
    }

    /// Name of its folder.
    pub(super) fn key(self) -> String {
        self.name().replace(' ', "-")
    }

    pub(super) fn what(self) -> &'static str {
        match self {
            Placebo::Reversed => {
                "rows backwards, time mirrored; `coasting = true` of the rig file becomes `false`, since a coast-down \
                 played backwards speeds up"
            }
            Placebo::Reordered => {
                "the same files, named and given in an order that neither rises nor falls"
            }
            Placebo::DragSwapped => {
                "each run has the next run's drag, second half first, stretched to its length; a single run has its own"
            }
            Placebo::RandomColumns(Draws::First) => {
                "three more columns: white noise, noise that is correlated over 1 s, a random walk"
            }
            Placebo::RandomColumns(Draws::Second) => "three such columns of another draw",
            Placebo::CopiedDrag => {
                "one more column: 1.02 times the drag, two samples late, with noise of 1 % of the drag's scatter"
            }
        }
    }

    pub(super) fn destroys_what(self) -> &'static str {
        match self {
            Placebo::Reversed => {
                "lag, relaxation, resonance, fade; the delay of the force or of a speed where its sign stays; \
                 `slip_hysteresis` is not judged"
            }
            Placebo::Reordered => "`wear_drift`; `zero_drift` is not judged",
            Placebo::DragSwapped => {
                "every name of the tyre balance but those that the speeds alone can show; `force_gain`, `vehicle_inertia`, and \
                 `wheel_inertia` where no brake torque moves"
            }
            Placebo::RandomColumns(_) | Placebo::CopiedDrag => {
                "nothing; the column explains nothing, and none may be named"
            }
        }
    }

    /// Why this placebo makes no sense for these runs.
    pub(super) fn senseless(self, runs: &[Recording]) -> Option<&'static str> {
        match self {
            Placebo::Reordered if runs.len() == 1 => Some("one run: no order"),
            Placebo::Reordered if runs.len() == 2 => Some("two runs: every order rises or falls"),
            Placebo::DragSwapped if !runs.iter().any(Recording::has_drag) => {
                Some("the drag is zero: nothing to swap")
            }
            Placebo::CopiedDrag if !runs.iter().any(Recording::has_drag) => {
                Some("the drag is zero: nothing to copy")
            }
            _ => None,
        }
    }

    /// Whether a mechanism claims what this placebo destroys in these runs.
    fn destroys(self, mechanism: &Value, runs: &[Recording]) -> bool {
        let id = text(mechanism, "id");
        match self {
            Placebo::Reversed => AFTERWARDS.contains(&id) || TURNS.contains(&id),
            // A zero that drifts in each run anew does so in any order, one that drifts through all of them does not;
            // no field of the contract tells the two apart, so `zero_drift` is not judged.
            Placebo::Reordered => id == "wear_drift",
            // A mass is the ratio of drag to deceleration; so is the wheel's inertia where no brake moves, whose torque
            // over the wheel's deceleration would give it without the drag.
            Placebo::DragSwapped => {
                ["force_gain", "vehicle_inertia"].contains(&id)
                    || (id == "wheel_inertia" && !runs.iter().any(Recording::has_brake))
                    || (text(mechanism, "balance") == "tyre" && !OF_SPEEDS.contains(&id))
            }
            Placebo::RandomColumns(_) | Placebo::CopiedDrag => false,
        }
    }

    /// What became of the names that it destroys: with the runs as recorded, their diagnosis, and its own.
    pub(super) fn fates(
        self,
        runs: &[Recording],
        original: &Value,
        changed: &Value,
    ) -> Vec<(String, Fate)> {
        let of = |diagnosis: &Value| -> Vec<Value> {
            list(diagnosis, "mechanisms")
                .iter()
                .filter(|m| self.destroys(m, runs))
                .cloned()
                .collect()
        };
        let (before, after) = (of(original), of(changed));
        let mut fates = Vec::new();
        for mechanism in &before {
            let id = text(mechanism, "id");
            let again = after
                .iter()
                .any(|m| text(m, "id") == id && !self.turned(mechanism, m));
            fates.push((
                id.to_owned(),
                if again { Fate::Survives } else { Fate::Gone },
            ));
        }
        for mechanism in &after {
            let id = text(mechanism, "id");
            if !before.iter().any(|m| text(m, "id") == id) {
                fates.push((id.to_owned(), Fate::Arises));
            }
        }
        fates
    }

    /// Whether a delay has turned with time, as it must.
    fn turned(self, before: &Value, after: &Value) -> bool {
        let delay = |m: &Value| {
            list(m, "parameters")
                .iter()
                .find(|p| text(p, "name") == "delay")
                .map_or(f64::NAN, |p| number(p, "value"))
        };
        self == Placebo::Reversed
            && TURNS.contains(&text(before, "id"))
            && delay(before) * delay(after) < 0.0
    }

    /// Columns that it adds.
    pub(super) fn columns(self) -> &'static [&'static str] {
        match self {
            Placebo::RandomColumns(_) => &RANDOM,
            Placebo::CopiedDrag => &[COPY],
            _ => &[],
        }
    }

    /// Where a diagnosis explains something by a column that the placebo has added.
    pub(super) fn used(self, diagnosis: &Value) -> Vec<String> {
        let mut found = Vec::new();
        for column in self.columns() {
            for place in ["unexplained", "regions"] {
                if list(diagnosis, place)
                    .iter()
                    .any(|entry| text(entry, "variable") == *column)
                {
                    found.push(format!("{place}: {column}"));
                }
            }
            for mechanism in list(diagnosis, "mechanisms") {
                if ["statement", "equation"]
                    .iter()
                    .any(|key| text(mechanism, key).contains(column))
                {
                    found.push(format!("{}: {column}", text(mechanism, "id")));
                }
            }
            // Noise leaks nothing.
            if matches!(self, Placebo::RandomColumns(_)) && leaks(diagnosis, column) {
                found.push(format!("leaks: {column}"));
            }
        }
        found
    }

    /// The changed recordings, in the order in which they are given, each with the place of the run that it was.
    pub(super) fn apply(self, runs: &[Recording]) -> Vec<(usize, Recording)> {
        let order = match self {
            Placebo::Reordered => order(runs.len()),
            _ => (0..runs.len()).collect(),
        };
        order
            .into_iter()
            .map(|k| {
                let changed = match self {
                    Placebo::Reversed => reversed(&runs[k]),
                    Placebo::Reordered => runs[k].clone(),
                    Placebo::DragSwapped => swapped(&runs[k], &runs[(k + 1) % runs.len()]),
                    Placebo::RandomColumns(draws) => with_random(&runs[k], k, draws),
                    Placebo::CopiedDrag => with_copy(&runs[k], k),
                };
                (k, changed)
            })
            .collect()
    }

    /// The rig file that goes with it.
    pub(super) fn rig(self, rig: &str) -> String {
        match self {
            Placebo::Reversed => rig.replace("coasting = true", "coasting = false"),
            _ => rig.to_owned(),
        }
    }
}

/// Whether `chain` says that a column reproduces the drag.
pub(super) fn leaks(diagnosis: &Value, column: &str) -> bool {
    list(diagnosis, "chain")
        .iter()
        .any(|f| text(f, "finding") == "leaks" && text(f, "channel") == column)
}

/// Correlation of an order with the rising one.
fn rise(order: &[usize]) -> f64 {
    let middle = (order.len() as f64 - 1.0) / 2.0;
    let (mut both, mut one) = (0.0, 0.0);
    for (place, k) in order.iter().enumerate() {
        both += (place as f64 - middle) * (*k as f64 - middle);
        one += (place as f64 - middle).powi(2);
    }
    both / one
}

/// Of many shuffles the one that rises or falls least.
fn order(runs: usize) -> Vec<usize> {
    let mut draw = Draw::new(SEED, &[1, runs as u64]);
    let mut best: Vec<usize> = (0..runs).collect();
    let mut next = best.clone();
    for _ in 0..200 {
        for k in (1..runs).rev() {
            next.swap(k, draw.whole(0, k));
        }
        if rise(&next).abs() < rise(&best).abs() - 1e-9 {
            best.clone_from(&next);
        }
    }
    best
}

fn reversed(run: &Recording) -> Recording {
    let mut out = run.clone();
    let (first, last) = run.ends();
    for column in out.channels_mut() {
        column.reverse();
    }
    out.columns[TIME] = run.columns[TIME]
        .iter()
        .rev()
        .map(|t| first + last - t)
        .collect();
    out
}

/// A run with the drag of another, half a run off: where all runs rise alike, as the circles do, the drag of another
/// at the same place is still the drag that belongs there.
fn swapped(run: &Recording, other: &Recording) -> Recording {
    let mut out = run.clone();
    let (first, length) = (run.ends().0, run.duration());
    let (begin, stretch) = (other.ends().0, other.duration());
    let (time, drag): (Vec<f64>, Vec<f64>) = other.columns[TIME]
        .iter()
        .zip(&other.columns[DRAG])
        .filter(|(_, f)| f.is_finite())
        .unzip();
    out.columns[DRAG] = run.columns[TIME]
        .iter()
        .map(|t| {
            let place = ((t - first) / length + 0.5).fract();
            at(&time, &drag, begin + place * stretch)
        })
        .collect();
    out
}

/// Linear between samples, constant beyond them.
fn at(time: &[f64], values: &[f64], wanted: f64) -> f64 {
    let later = time.partition_point(|t| *t < wanted);
    match (later.checked_sub(1), later < time.len()) {
        (_, _) if time.is_empty() => f64::NAN,
        (None, _) => values[0],
        (Some(before), false) => values[before],
        (Some(before), true) => {
            let share = (wanted - time[before]) / (time[later] - time[before]);
            values[before] + share * (values[later] - values[before])
        }
    }
}

fn with_random(run: &Recording, place: usize, draws: Draws) -> Recording {
    let mut out = run.clone();
    let time = &run.columns[TIME];
    for (kind, name) in RANDOM.iter().enumerate() {
        let mut draw = Draw::new(SEED + draws as u64, &[2, place as u64, kind as u64]);
        let mut value = if kind == 2 { 0.0 } else { draw.normal() };
        let column = (0..time.len())
            .map(|k| {
                let step = if k > 0 { time[k] - time[k - 1] } else { 0.0 };
                if k > 0 {
                    let fresh = draw.normal();
                    let keep = (-step / SLOW).exp();
                    value = match kind {
                        0 => fresh,
                        1 => keep * value + (1.0 - keep * keep).sqrt() * fresh,
                        _ => value + step.sqrt() * fresh,
                    };
                }
                value
            })
            .collect();
        out.others.push(((*name).to_owned(), column));
    }
    out
}

fn with_copy(run: &Recording, place: usize) -> Recording {
    let mut out = run.clone();
    let mut draw = Draw::new(SEED, &[3, place as u64]);
    let drag = &run.columns[DRAG];
    let known: Vec<f64> = drag.iter().copied().filter(|f| f.is_finite()).collect();
    let n = known.len().max(1) as f64;
    let mean = known.iter().sum::<f64>() / n;
    let scatter = (known.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / n).sqrt();
    let column = (0..drag.len())
        .map(|k| 1.02 * drag[k.saturating_sub(LATE)] + 0.01 * scatter * draw.normal())
        .collect();
    out.others.push((COPY.to_owned(), column));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A run whose drag rises with time and follows a ripple of the wheel by a quarter of a second, with a gap.
    fn run(phase: f64) -> Recording {
        let mut run = Recording::default();
        let mut extra = Vec::new();
        for k in 0..2000 {
            let time = 1.0 + 0.02 * f64::from(k) + if k > 800 { 1.5 } else { 0.0 };
            let ripple = |t: f64| (3.0 * t + phase).sin();
            let cells = [
                time,
                60.0 + ripple(time),
                2.0,
                5.0 + 0.2 * time + ripple(time - 0.25),
                16.4,
            ];
            for (column, cell) in run.columns.iter_mut().zip(cells) {
                column.push(cell);
            }
            extra.push(f64::from(k));
        }
        run.others.push(("yaw".to_owned(), extra));
        run
    }

    fn correlation(a: &[f64], b: &[f64]) -> f64 {
        let n = a.len() as f64;
        let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
        let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            a.iter().zip(b).map(|(x, y)| f(x - ma, y - mb)).sum()
        };
        sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
    }

    /// Delay at which the drag follows the wheel best, s.
    fn best_delay(run: &Recording) -> f64 {
        let part = run.stretches().pop().unwrap();
        let (time, drag) = (&run.columns[0][part.clone()], &run.columns[3][part.clone()]);
        let wheel = &run.columns[1][part];
        let score = |delay: f64| {
            let moved: Vec<f64> = time[50..time.len() - 50]
                .iter()
                .map(|t| at(time, wheel, t - delay))
                .collect();
            // Steps, so that the rise says nothing.
            let steps = |x: &[f64]| x.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>();
            correlation(&steps(&moved), &steps(&drag[50..time.len() - 50]))
        };
        (-25..=25)
            .map(|k| 0.02 * f64::from(k))
            .max_by(|a, b| score(*a).total_cmp(&score(*b)))
            .unwrap()
    }

    #[test]
    fn reversal_keeps_each_row_and_turns_what_follows_into_what_goes_before() {
        let before = run(0.0);
        let after = Placebo::Reversed.apply(std::slice::from_ref(&before))[0]
            .1
            .clone();
        assert!(after.columns[0].windows(2).all(|w| w[1] > w[0]));
        assert_eq!(before.ends(), after.ends());
        let n = before.len();
        for k in [0, 7, 800, 801, n - 1] {
            assert_eq!(before.columns[3][k], after.columns[3][n - 1 - k]);
            assert_eq!(before.others[0].1[k], after.others[0].1[n - 1 - k]);
        }
        assert!((best_delay(&before) - 0.25).abs() < 0.021);
        assert!((best_delay(&after) + 0.25).abs() < 0.021);
        assert!(
            Placebo::Reversed
                .rig("coasting = true # rolls")
                .contains("coasting = false")
        );
    }

    #[test]
    fn another_order_keeps_the_runs_and_has_no_trend() {
        for n in [4, 5, 6, 8, 10] {
            let order = order(n);
            assert!(rise(&order).abs() < 0.21, "{order:?}");
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..n).collect::<Vec<_>>());
        }
        let runs: Vec<Recording> = (0..5).map(|k| run(f64::from(k))).collect();
        for (k, changed) in Placebo::Reordered.apply(&runs) {
            assert_eq!(runs[k], changed);
        }
        assert!(Placebo::Reordered.senseless(&runs[..2]).is_some());
        assert!(Placebo::Reordered.senseless(&runs[..1]).is_some());
        assert!(Placebo::Reordered.senseless(&runs).is_none());
    }

    #[test]
    fn swapped_drag_has_the_size_of_drag_and_follows_its_own_run_no_more() {
        // All runs rise alike, as the circles do.
        for runs in [vec![run(0.0), run(1.0), run(2.0)], vec![run(0.0)]] {
            for (k, changed) in Placebo::DragSwapped.apply(&runs) {
                let (own, now) = (&runs[k].columns[3], &changed.columns[3]);
                assert!(correlation(own, now) < 0.2, "{}", correlation(own, now));
                let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
                assert!((mean(own) - mean(now)).abs() < 0.3);
                for place in [0, 1, 2, 4] {
                    assert_eq!(runs[k].columns[place], changed.columns[place]);
                }
                assert_eq!(runs[k].others, changed.others);
            }
        }
        let mut still = run(0.0);
        still.columns[3].fill(0.0);
        assert!(Placebo::DragSwapped.senseless(&[still]).is_some());
    }

    #[test]
    fn random_columns_are_what_they_are_called_and_follow_nothing() {
        let before = run(0.0);
        let drawn = |draws: Draws| {
            let (_, after) = Placebo::RandomColumns(draws)
                .apply(std::slice::from_ref(&before))
                .remove(0);
            after
        };
        let neighbours = |x: &[f64]| correlation(&x[1..], &x[..x.len() - 1]);
        for draws in [Draws::First, Draws::Second] {
            let after = drawn(draws);
            assert_eq!(before.columns, after.columns);
            assert_eq!(after.others.len(), 4);
            let [white, slow, walk] = [1, 2, 3].map(|k| after.others[k].1.clone());
            assert!(neighbours(&white).abs() < 0.1);
            assert!((0.95..0.995).contains(&neighbours(&slow)));
            assert!(neighbours(&walk) > 0.99);
            assert!(correlation(&white, &before.columns[3]).abs() < 0.1);
            assert_eq!(after, drawn(draws));
        }
        // The two draws have nothing to do with each other.
        let (first, second) = (drawn(Draws::First), drawn(Draws::Second));
        assert!(correlation(&first.others[1].1, &second.others[1].1).abs() < 0.1);
    }

    #[test]
    fn the_copy_follows_the_drag_two_samples_late_and_all_else_stays() {
        let before = run(0.0);
        let after = Placebo::CopiedDrag.apply(std::slice::from_ref(&before))[0]
            .1
            .clone();
        assert_eq!(before.columns, after.columns);
        let copy = &after.others[1].1;
        let drag = &before.columns[3];
        let n = drag.len();
        assert!(correlation(&copy[2..], &drag[..n - 2]) > 0.999);
        assert!(
            correlation(&copy[2..], &drag[..n - 2]) > correlation(&copy[..n - 2], &drag[..n - 2])
        );
    }

    fn named(id: &str, balance: &str, delay: f64) -> Value {
        json!({"mechanisms": [{"id": id, "balance": balance, "statement": "some",
               "parameters": [{"name": "delay", "value": delay}]}]})
    }

    #[test]
    fn a_name_survives_arises_or_goes() {
        let fates = |placebo: Placebo, a: &Value, b: &Value| placebo.fates(&[], a, b);
        let (lag, none) = (named("force_lag", "tyre", 0.1), json!({"mechanisms": []}));
        let one = |fate| vec![("force_lag".to_owned(), fate)];
        assert_eq!(fates(Placebo::Reversed, &lag, &lag), one(Fate::Survives));
        assert_eq!(fates(Placebo::Reversed, &lag, &none), one(Fate::Gone));
        assert_eq!(fates(Placebo::DragSwapped, &none, &lag), one(Fate::Arises));
        assert_eq!(fates(Placebo::Reordered, &lag, &lag), []);
    }

    #[test]
    fn a_delay_that_turns_with_time_was_read_off_the_recording() {
        let fate = |placebo: Placebo, id: &str, before: f64, after: f64| {
            let (before, after) = (named(id, "tyre", before), named(id, "tyre", after));
            placebo.fates(&[], &before, &after)
        };
        for id in TURNS {
            assert_eq!(fate(Placebo::Reversed, id, 0.08, -0.08)[0].1, Fate::Gone);
            assert_eq!(fate(Placebo::Reversed, id, 0.08, 0.08)[0].1, Fate::Survives);
            assert_eq!(
                fate(Placebo::Reversed, id, -0.02, -0.01)[0].1,
                Fate::Survives
            );
        }
        // The speeds show theirs without the drag.
        let swapped = |id| fate(Placebo::DragSwapped, id, 0.08, 0.08).len();
        assert_eq!(TURNS.map(swapped), [1, 0, 0]);
    }

    #[test]
    fn a_loop_run_through_backwards_is_a_loop_still() {
        let hysteresis = named("slip_hysteresis", "tyre", f64::NAN);
        let fates = |placebo: Placebo| placebo.fates(&[], &hysteresis, &hysteresis);
        assert_eq!(fates(Placebo::Reversed), []);
        assert_eq!(fates(Placebo::DragSwapped)[0].1, Fate::Survives);
    }

    #[test]
    fn a_swapped_drag_takes_the_inertia_that_rests_on_it() {
        let survivors = |id: &str, balance: &str, runs: &[Recording]| {
            let said = named(id, balance, f64::NAN);
            Placebo::DragSwapped.fates(runs, &said, &said).len()
        };
        let mut braked = run(0.0);
        let torque = (0..braked.len()).map(|k| (0.01 * k as f64).sin()).collect();
        braked.others.push(("brake_torque_nm".to_owned(), torque));
        let mut held = run(0.0);
        held.others
            .push(("brake_torque_nm".to_owned(), vec![0.0; held.len()]));
        for runs in [[run(0.0)], [held], [braked.clone()]] {
            assert_eq!(survivors("vehicle_inertia", "vehicle", &runs), 1);
            assert_eq!(survivors("force_gain", "vehicle", &runs), 1);
            assert_eq!(survivors("grade_or_drive", "vehicle", &runs), 0);
            let moves = runs[0] == braked;
            assert_eq!(
                survivors("wheel_inertia", "wheel", &runs),
                usize::from(!moves)
            );
        }
    }

    #[test]
    fn another_order_takes_the_wear_and_leaves_the_drift_of_a_zero_alone() {
        let survivors = |id: &str| {
            let said = named(id, "tyre", f64::NAN);
            Placebo::Reordered.fates(&[], &said, &said).len()
        };
        assert_eq!((survivors("wear_drift"), survivors("zero_drift")), (1, 0));
    }

    #[test]
    fn a_column_that_explains_nothing_must_not_be_used() {
        let diagnosis = json!({
            "mechanisms": [{"id": "speed_sensitivity", "statement": "with random_walk", "equation": ""}],
            "unexplained": [{"variable": "random_white"}],
            "regions": [{"variable": "copied_force_n"}],
            "chain": [{"finding": "leaks", "channel": "copied_force_n"}],
        });
        for draws in [Draws::First, Draws::Second] {
            assert_eq!(Placebo::RandomColumns(draws).used(&diagnosis).len(), 2);
        }
        assert_eq!(Placebo::CopiedDrag.used(&diagnosis).len(), 1);
        assert!(leaks(&diagnosis, COPY));
        assert!(Placebo::Reversed.used(&diagnosis).is_empty());
    }
}
