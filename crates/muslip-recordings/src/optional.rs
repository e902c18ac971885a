//! Optional columns that say nothing: all values missing, or one value throughout.
//!
//! They are told as faults of the data. A brake column that says nothing is also left out, because the
//! wheel balance would take it at its word; only one that reads zero throughout a run, and moves in
//! another run, is kept: that run was not braked.

use muslip_diagnose::campaign::Run;
use muslip_diagnose::outcome::Fault;

use crate::recording::Channel;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Content {
    Nothing,
    Constant(f64),
    Values,
}

fn content(values: &[f64]) -> Content {
    let mut known = values.iter().filter(|value| !value.is_nan());
    let Some(&first) = known.next() else {
        return Content::Nothing;
    };
    // A single value is no column that stands still.
    match known.next() {
        None => Content::Values,
        Some(second) if *second == first && known.all(|value| *value == first) => {
            Content::Constant(first)
        }
        Some(_) => Content::Values,
    }
}

type Slot = fn(&mut Run) -> &mut Option<Vec<f64>>;

/// Brake columns and where a run holds them.
const BRAKE: [(Channel, Slot); 2] = [
    (Channel::BrakeTorque, |run| &mut run.brake_torque_nm),
    (Channel::BrakePressure, |run| &mut run.brake_pressure_pa),
];

/// Finds optional columns without information, drops those that would mislead, and lists both.
#[must_use]
pub fn screen(runs: &mut [Run]) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (channel, slot) in BRAKE {
        let contents: Vec<Option<Content>> = runs
            .iter_mut()
            .map(|run| slot(run).as_deref().map(content))
            .collect();
        let moves_somewhere = contents.contains(&Some(Content::Values));
        for (run, content) in runs.iter_mut().zip(contents) {
            let what = match content {
                None | Some(Content::Values) => continue,
                Some(Content::Nothing) => "all values missing: left out".to_owned(),
                Some(Content::Constant(0.0)) if moves_somewhere => {
                    "zero throughout: a run without braking".to_owned()
                }
                Some(Content::Constant(value)) => format!("constant at {value}: left out"),
            };
            if !what.starts_with("zero") {
                *slot(run) = None;
            }
            faults.push(fault(run, channel.name(), what));
        }
    }
    for run in runs.iter() {
        for (name, values) in &run.extra {
            // The engine tells of those without any value.
            if let Content::Constant(value) = content(values) {
                faults.push(fault(
                    run,
                    name,
                    format!("constant at {value}: explains nothing"),
                ));
            }
        }
    }
    faults
}

fn fault(run: &Run, channel: &str, what: String) -> Fault {
    let time = |stamp: Option<&f64>| stamp.copied().unwrap_or(0.0);
    Fault {
        recording: run.name.clone(),
        channel: channel.to_owned(),
        start_s: time(run.time_s.first()),
        end_s: time(run.time_s.last()),
        what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(torque: Option<[f64; 3]>) -> Run {
        Run {
            name: "run.csv".into(),
            time_s: vec![0.0, 1.0, 2.0],
            brake_torque_nm: torque.map(Vec::from),
            ..Run::default()
        }
    }

    #[test]
    fn a_brake_column_that_says_nothing_is_left_out_and_told() {
        let nan = f64::NAN;
        let mut runs = [
            run(Some([nan; 3])),
            run(Some([5.0, 5.0, nan])),
            run(Some([0.0; 3])),
            run(Some([0.0, 1.0, 0.0])),
            run(None),
        ];
        let faults = screen(&mut runs);
        let kept: Vec<bool> = runs
            .iter()
            .map(|run| run.brake_torque_nm.is_some())
            .collect();
        assert_eq!(kept, [false, false, true, true, false]);
        let told: Vec<&str> = faults.iter().map(|fault| fault.what.as_str()).collect();
        assert_eq!(
            told,
            [
                "all values missing: left out",
                "constant at 5: left out",
                "zero throughout: a run without braking"
            ]
        );
    }

    #[test]
    fn a_brake_that_never_moves_in_any_run_is_no_brake() {
        let mut runs = [run(Some([0.0; 3])), run(Some([0.0; 3]))];
        assert_eq!(screen(&mut runs).len(), 2);
        assert!(runs.iter().all(|run| run.brake_torque_nm.is_none()));
    }

    #[test]
    fn another_column_that_stands_still_is_told_and_kept() {
        let mut one = run(None);
        one.extra = vec![("temperature".into(), vec![3.0; 3])];
        let mut runs = [one];
        let faults = screen(&mut runs);
        assert_eq!(
            (faults.len(), faults[0].channel.as_str()),
            (1, "temperature")
        );
        assert_eq!(runs[0].extra.len(), 1);
    }
}
