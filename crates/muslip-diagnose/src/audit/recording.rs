//! A run as the audit uses it: cleaned channels as functions of time, and the stretches in which it moves.

use core::ops::Range;

use super::constants::{SLOWEST_M_S, SLOWEST_SHARE};
use super::hold::{Hold, hold, renewals};
use super::signal::Signal;
use crate::campaign::{Rig, Run};
use crate::cleaning::clean;
use crate::smooth::median_in_place;

/// A cleaned channel.
#[derive(Clone, Debug, Default)]
pub struct Column {
    /// Readings without outliers, gaps bridged.
    pub clean: Vec<f64>,
    /// The same as a function of time; of a held channel its renewals, joined by straight lines.
    pub signal: Signal,
    /// How it is held.
    pub hold: Option<Hold>,
    /// Whether it was measured less often than recorded, and lines drawn or readings held in between.
    pub coarse: bool,
}

impl Column {
    /// Whether it has fewer readings than the recording has rows, by what it shows or by what is known of it.
    #[must_use]
    pub fn is_coarse(&self) -> bool {
        self.coarse || self.hold.is_some()
    }
}

/// A run made ready.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// The run's name.
    pub name: String,
    /// Time in s.
    pub time: Vec<f64>,
    /// Typical step in s.
    pub step: f64,
    /// Wheel speed in rad/s.
    pub wheel: Column,
    /// Vehicle speed in m/s.
    pub speed: Column,
    /// Drag in N.
    pub drag: Column,
    /// Normal force in N.
    pub load: Column,
    /// Brake torque in N m, measured or commanded, with its column's name.
    pub brake: Option<(&'static str, Column)>,
    /// Stretches of samples without gaps in which the vehicle moves.
    pub moving: Vec<Range<usize>>,
}

fn channel(time: &[f64], values: &[f64], name: &str) -> Column {
    if values.len() != time.len() || time.is_empty() {
        return Column::default();
    }
    let (clean, _) = clean("", name, time, values, &mut Vec::new());
    let hold = hold(time, values);
    let signal = if let Some(hold) = hold {
        renewed(time, &clean, hold.period_s)
    } else {
        Signal::new(time, &clean)
    };
    Column {
        clean,
        signal,
        hold,
        coarse: false,
    }
}

/// Renewals of a held channel joined by straight lines; where a renewal brought nothing new, it is there all the same.
fn renewed(time: &[f64], clean: &[f64], period: f64) -> Signal {
    let (mut times, mut values): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for k in renewals(clean) {
        if let (Some(&last), Some(&value)) = (times.last(), values.last()) {
            let (last, value): (f64, f64) = (last, value);
            let missed = ((time[k] - last) / period).round() as usize;
            for i in 1..missed.min(10_000) {
                times.push(last + i as f64 * period);
                values.push(value);
            }
        }
        times.push(time[k]);
        values.push(clean[k]);
    }
    Signal::new(&times, &values)
}

fn brake(rig: &Rig, run: &Run) -> Option<(&'static str, Column)> {
    if let (Some(pressure), Some(gain)) = (&run.brake_pressure_pa, rig.torque_per_pressure_nm_pa)
        && pressure.iter().any(|x| x.is_finite())
    {
        let torque: Vec<f64> = pressure.iter().map(|p| p * gain).collect();
        return Some((
            "brake_pressure_pa",
            channel(&run.time_s, &torque, "brake_pressure_pa"),
        ));
    }
    let torque = run.brake_torque_nm.as_ref()?;
    torque.iter().any(|x| x.is_finite()).then(|| {
        (
            "brake_torque_nm",
            channel(&run.time_s, torque, "brake_torque_nm"),
        )
    })
}

/// Makes a run ready.
#[must_use]
pub fn recording(rig: &Rig, run: &Run) -> Recording {
    let time = &run.time_s;
    let mut steps: Vec<f64> = time
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0)
        .collect();
    let step = if steps.is_empty() {
        1.0
    } else {
        median_in_place(&mut steps)
    };
    let mut out = Recording {
        name: run.name.clone(),
        time: time.clone(),
        step,
        wheel: channel(time, &run.wheel_speed_rad_s, "wheel_speed_rad_s"),
        speed: channel(time, &run.vehicle_speed_m_s, "vehicle_speed_m_s"),
        drag: channel(time, &run.drag_force_n, "drag_force_n"),
        load: channel(time, &run.normal_force_n, "normal_force_n"),
        brake: brake(rig, run),
        moving: Vec::new(),
    };
    for one in run.resampled.iter().filter(|one| one.is_coarse()) {
        match one.column.as_str() {
            "wheel_speed_rad_s" => out.wheel.coarse = true,
            "vehicle_speed_m_s" => out.speed.coarse = true,
            "drag_force_n" => out.drag.coarse = true,
            "normal_force_n" => out.load.coarse = true,
            _ => {}
        }
    }
    let complete = [&out.wheel, &out.speed, &out.drag, &out.load]
        .iter()
        .all(|c| !c.signal.is_empty());
    // What never changes has no delay.
    if complete && varies(&out.drag.clean) && varies(&out.wheel.clean) {
        out.moving = moving(&out);
    }
    out
}

fn varies(values: &[f64]) -> bool {
    let (low, high) = values
        .iter()
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(*x), h.max(*x))
        });
    high - low > 1e-9 * high.abs().max(low.abs())
}

fn moving(run: &Recording) -> Vec<Range<usize>> {
    let mut speeds: Vec<f64> = run
        .speed
        .clean
        .iter()
        .copied()
        .filter(|v| *v > SLOWEST_M_S)
        .collect();
    if speeds.is_empty() {
        return Vec::new();
    }
    let slowest = SLOWEST_M_S.max(SLOWEST_SHARE * median_in_place(&mut speeds));
    let n = run.time.len();
    let longest = (8.0 * run.step).max(0.05);
    let breaks: Vec<bool> = (0..n)
        .map(|k| k > 0 && run.time[k] - run.time[k - 1] > longest)
        .collect();
    let finite = |k: usize| {
        [&run.wheel, &run.speed, &run.drag, &run.load]
            .iter()
            .all(|c| c.clean[k].is_finite())
    };
    crate::cleaning::stretches(|k| finite(k) && run.speed.clean[k] > slowest, &breaks, 20)
}

/// A piece of a run on an even grid.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Index of the run.
    pub run: usize,
    /// First point in s.
    pub start: f64,
    /// Number of points.
    pub count: usize,
}

/// Stretches in which the vehicle moves, over all runs: the run's position, start and end in s.
#[must_use]
pub fn spans(runs: &[Recording]) -> Vec<(usize, f64, f64)> {
    runs.iter()
        .enumerate()
        .flat_map(|(r, run)| {
            run.moving
                .iter()
                .map(move |m| (r, run.time[m.start], run.time[m.end - 1]))
        })
        .collect()
}

/// Even pieces of the stretches, `margin` s inside each (before, after), so many over all runs that their spread says something.
#[must_use]
pub fn blocks(
    stretches: &[(usize, f64, f64)],
    step: f64,
    margin: (f64, f64),
    (fewest, longest_s, shortest_s): (usize, f64, f64),
) -> Vec<Block> {
    let spans: Vec<(usize, f64, f64)> = stretches
        .iter()
        .map(|&(run, from, to)| (run, from + margin.0, to - margin.1))
        .filter(|(_, from, to)| to - from >= shortest_s)
        .collect();
    let whole: f64 = spans.iter().map(|(_, from, to)| to - from).sum();
    let length = longest_s.min(whole / fewest as f64).max(shortest_s);
    let mut out = Vec::new();
    for (run, from, to) in spans {
        let pieces = ((to - from) / length).round().max(1.0);
        let each = (to - from) / pieces;
        for piece in 0..pieces as usize {
            out.push(Block {
                run,
                start: from + piece as f64 * each + 0.5 * step,
                count: (each / step).floor() as usize,
            });
        }
    }
    out
}
