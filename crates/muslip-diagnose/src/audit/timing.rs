//! Which speed is late, and by how much, from all balances.

use super::constants::{
    DRAG_OF_SLIP, FORM_S, FORM_SHARE, LEAST_DELAY_S, SPREAD_FACTOR, STEP_SHARE, TOLD_SIGMAS,
    UNKNOWN_DELAY_S,
};
use super::finding::{Finding, Timing, Word};
use super::hold::Hold;
use super::law;
use super::recording::Recording;
use super::rolling::{Rolling, rolling};
use super::squares::Solution;
use super::vehicle::vehicle;
use super::wheel::wheel;
use crate::campaign::Rig;
use crate::series::LawProducts;
use crate::slip::{brakes, slip};
use crate::smooth::median_in_place;

/// Delays against the drag, and by what filter channels are slower than it.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// Of the wheel speed.
    pub wheel: Timing,
    /// Of the vehicle speed.
    pub vehicle: Timing,
    /// Of the brake column.
    pub brake: Timing,
    /// Second moment by which the vehicle speed is slower than the drag, s², and its standard deviation.
    pub vehicle_moment: Option<(f64, f64)>,
    /// What the speeds say where nothing brakes.
    pub rolling: Option<Rolling>,
    /// What the law says of a filter of the drag.
    pub drag_pole: Option<law::Pole>,
    /// What each balance said, for a closer look: vehicle, wheel, law.
    pub estimates: [Option<Solution>; 3],
}

/// An estimate's unknown as a delay, with its waiting where the channel is held and at least the sampler's doubt.
fn delay(estimate: &Solution, place: usize, held: f64, step: f64) -> Timing {
    let std = (SPREAD_FACTOR * estimate.std[place])
        .hypot(STEP_SHARE * step)
        .hypot(FORM_SHARE * estimate.unknowns[place])
        .hypot(FORM_S);
    if !(std < UNKNOWN_DELAY_S) || !estimate.unknowns[place].is_finite() {
        return Timing::UNKNOWN;
    }
    Timing {
        value: estimate.unknowns[place] + held,
        std,
    }
}

/// Median of a figure over runs.
pub(super) fn median_of(runs: &[Recording], pick: impl Fn(&Recording) -> f64) -> f64 {
    let mut values: Vec<f64> = runs.iter().map(pick).collect();
    if values.is_empty() {
        0.0
    } else {
        median_in_place(&mut values)
    }
}

/// By how much a held channel is later than its renewals as they are seen, s: half a period, less the half sampling step
/// by which a renewal is seen too late.
fn waiting(run: &Recording, hold: Option<Hold>) -> f64 {
    hold.map_or(0.0, |hold| 0.5 * (hold.period_s - run.step))
}

/// Whether the tyre's law is a clock: the wheel is braked or driven hard, and the drag is mostly what the rig file's law makes
/// of slip, be its sign the other one.
fn speaks_of_slip(rig: &Rig, runs: &[Recording]) -> bool {
    let mut friction = Vec::new();
    let mut sums = LawProducts::default();
    for run in runs {
        for k in run.moving.iter().flat_map(Clone::clone) {
            let (drag, load) = (run.drag.clean[k], run.load.clean[k]);
            let slip = slip(rig.radius_m, run.wheel.clean[k], run.speed.clean[k]);
            friction.push((drag / load).abs());
            sums.add(load, slip / rig.critical_slip, drag);
        }
    }
    let LawProducts { xx, xy, yy, .. } = sums;
    brakes(friction, rig.peak_friction) && xy * xy > DRAG_OF_SLIP * xx * yy
}

/// All delays.
#[must_use]
pub fn timings(rig: &Rig, runs: &[Recording]) -> Timings {
    let mut out = Timings::default();
    let step = median_of(runs, |run| run.step);
    let held_wheel = median_of(runs, |run| waiting(run, run.wheel.hold));
    let held_speed = median_of(runs, |run| waiting(run, run.speed.hold));
    if rig.coasting
        && let Some(estimate) = vehicle(runs, rig.mass_kg)
    {
        out.vehicle = delay(&estimate, 1, held_speed, step);
        out.vehicle_moment = Some((estimate.unknowns[2], estimate.std[2]));
        out.estimates[0] = Some(estimate);
    }
    let known = Timing {
        value: out.vehicle.value - held_speed,
        ..out.vehicle
    };
    let moment = out.vehicle_moment.map_or(0.0, |m| m.0);
    if !speaks_of_slip(rig, runs) {
        let mut rolling = rolling(rig, runs);
        // What is held waits, as with the others.
        rolling.vehicle_late.value += held_speed - held_wheel;
        out.rolling = Some(rolling);
    } else if let Some(law::Told { estimate, pole }) = law::law(rig, runs, known, moment) {
        out.drag_pole = pole;
        out.wheel = out
            .wheel
            .with(delay(&estimate, law::WHEEL, held_wheel, step));
        if !out.vehicle.std.is_finite() {
            out.vehicle = delay(&estimate, law::VEHICLE, held_speed, step);
        }
        out.estimates[2] = Some(estimate);
    }
    let known = Timing {
        value: out.wheel.value - held_wheel,
        ..out.wheel
    };
    if let Some(estimate) = wheel(rig, runs, known) {
        out.wheel = out.wheel.with(delay(&estimate, 2, held_wheel, step));
        out.brake = delay(&estimate, 3, 0.0, step);
        out.estimates[1] = Some(estimate);
    }
    out
}

/// The delays that are worth a sentence.
#[must_use]
pub fn findings(timings: &Timings, brake: &str) -> Vec<Finding> {
    [
        ("wheel_speed_rad_s", timings.wheel),
        ("vehicle_speed_m_s", timings.vehicle),
        (brake, timings.brake),
    ]
    .into_iter()
    .filter(|(channel, timing)| {
        !channel.is_empty()
            && timing.std.is_finite()
            && timing.value.abs() > LEAST_DELAY_S.max(TOLD_SIGMAS * timing.std)
    })
    .map(|(channel, timing)| {
        let how = if timing.value > 0.0 { "late" } else { "early" };
        let said = format!(
            "The channel {channel} is {:.1} ms {how} against the drag channel.",
            1e3 * timing.value.abs()
        );
        Finding {
            relative_to: "drag_force_n".to_owned(),
            ..Finding::of(channel, Word::Late, (timing.value, timing.std), "s").saying(said)
        }
    })
    .collect()
}
