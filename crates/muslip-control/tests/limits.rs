//! Every interlock at its limit and just beyond: on the limit nothing is wrong, beyond it everything is.

use muslip::sample::RigSample;
use muslip_control::board::{BridgeQuality, BridgeReading, EncoderReading, RawSample};
use muslip_control::conversion::Converted;
use muslip_control::encoder::Speed;
use muslip_control::interlock::{
    Circumstances, FROZEN_SAMPLES, FaultSet, Interlocks, JUMP_SAMPLES, LARGEST_CODE,
    LOCK_SPEED_M_S, LOCKED_SHARE, ROLLING_SLIP, STUCK_SAMPLES, wheel_change_rad_s2,
};
use muslip_control::rates::Rates;
use muslip_record::{Fault, Parameters};

const RATES: Rates = Rates::new(1_000, 84_000_000);
/// Radii that make speeds exact.
const RADIUS_M: f32 = 0.5;

fn parameters() -> Parameters {
    let mut parameters = Parameters::default();
    parameters.wheel.effective_radius_m = RADIUS_M;
    parameters
}

/// A sample as the interlocks see it, of a wheel that rolls freely.
#[derive(Clone, Copy)]
struct Seen {
    raw: RawSample,
    converted: Converted,
    circumstances: Circumstances,
}

fn turning(rad_s: f32) -> Speed {
    Speed {
        rad_s,
        at_last_pulse_rad_s: rad_s,
        age_s: 0.0,
        pulsed: true,
    }
}

impl Seen {
    fn rolling(vehicle_m_s: f32) -> Self {
        Self {
            raw: RawSample {
                wheel: EncoderReading::default(),
                vehicle: EncoderReading::default(),
                bridge: BridgeReading {
                    codes: [1, 2],
                    quality: BridgeQuality::Fresh,
                },
                supply_mv: 24_000,
                pressure_mv: 333,
                emergency_stop: [false; 2],
                holds: false,
                confirm: false,
                late: false,
            },
            converted: Converted {
                sample: RigSample {
                    wheel_speed_rad_s: vehicle_m_s / RADIUS_M,
                    vehicle_speed_m_s: vehicle_m_s,
                    drag_force_n: 0.0,
                    normal_force_n: 4_000.0,
                },
                wheel: turning(vehicle_m_s / RADIUS_M),
                vehicle: turning(vehicle_m_s),
            },
            circumstances: Circumstances::default(),
        }
    }

    fn vehicle(&mut self, m_s: f32) {
        self.converted.sample.vehicle_speed_m_s = m_s;
        self.converted.vehicle = turning(m_s);
    }
}

/// Interlocks that saw a freely rolling wheel before.
struct Checked {
    interlocks: Interlocks,
    samples: i32,
}

impl Checked {
    fn after(vehicle_m_s: f32) -> Self {
        let interlocks = Interlocks::new(&parameters(), RATES);
        let mut checked = Self {
            interlocks,
            samples: 0,
        };
        checked.check(Seen::rolling(vehicle_m_s));
        checked
    }

    /// Codes are new each time, unless they were set.
    fn check(&mut self, mut seen: Seen) -> FaultSet {
        self.samples += 1;
        if seen.raw.bridge.codes == [1, 2] {
            seen.raw.bridge.codes = [1000 + self.samples, 2000 + self.samples];
        }
        self.interlocks
            .check(&seen.raw, &seen.converted, &seen.circumstances)
    }

    /// Samples until a fault, of so many.
    fn until(&mut self, fault: Fault, most: u32, seen: Seen) -> Option<u32> {
        (1..=most).find(|_| self.check(seen).contains(fault))
    }
}

/// Whether a sample that was changed like this has a fault.
fn has(fault: Fault, change: impl FnOnce(&mut Seen)) -> bool {
    let mut seen = Seen::rolling(20.0);
    change(&mut seen);
    Checked::after(20.0).check(seen).contains(fault)
}

/// The next number above, or below, in single precision.
fn above(x: f32) -> f32 {
    f32::from_bits(if x < 0.0 {
        x.to_bits() - 1
    } else {
        x.to_bits() + 1
    })
}

#[test]
fn a_freely_rolling_wheel_has_no_fault() {
    let mut checked = Checked::after(20.0);
    for _ in 0..5_000 {
        assert_eq!(checked.check(Seen::rolling(20.0)), FaultSet::default());
    }
}

#[test]
fn limits_of_one_sample_are_the_last_values_that_are_taken() {
    let limits = parameters().limits;
    let fastest = limits.maximum_vehicle_speed_m_s;
    for (speed, wrong) in [(fastest, false), (above(fastest), true)] {
        assert_eq!(has(Fault::Overspeed, |s| s.vehicle(speed)), wrong);
    }
    let fastest = limits.maximum_wheel_speed_rad_s;
    for (speed, wrong) in [(fastest, false), (above(fastest), true)] {
        let turns = |s: &mut Seen| s.converted.wheel = turning(speed);
        assert_eq!(has(Fault::Overspeed, turns), wrong);
    }
    for (supply_mv, wrong) in [(20_000, false), (19_999, true)] {
        assert_eq!(has(Fault::BrownOut, |s| s.raw.supply_mv = supply_mv), wrong);
    }
    let largest = limits.maximum_force_n;
    for force in [largest, -largest] {
        for (beyond, wrong) in [(false, false), (true, true)] {
            let force = if beyond {
                force.signum() * above(force.abs())
            } else {
                force
            };
            let drags = |s: &mut Seen| s.converted.sample.drag_force_n = force;
            assert_eq!(has(Fault::BridgeOutOfRange, drags), wrong, "{force}");
        }
    }
    let presses = |s: &mut Seen| s.converted.sample.normal_force_n = above(largest);
    assert!(has(Fault::BridgeOutOfRange, presses));
    let least = limits.minimum_normal_force_n;
    for (force, wrong) in [(least, false), (least.next_down(), true)] {
        let presses = |s: &mut Seen| s.converted.sample.normal_force_n = force;
        assert_eq!(has(Fault::NormalForceLost, presses), wrong);
    }
    let end = i32::try_from(LARGEST_CODE).unwrap_or(i32::MAX);
    for (code, wrong) in [
        (end - 1, false),
        (end, true),
        (1 - end, false),
        (-end, true),
    ] {
        for codes in [[code, 5], [5, code]] {
            let reads = |s: &mut Seen| s.raw.bridge.codes = codes;
            assert_eq!(has(Fault::BridgeOutOfRange, reads), wrong, "{codes:?}");
        }
    }
    for (silent, wrong) in [(250, false), (251, true)] {
        let waits = |s: &mut Seen| s.circumstances.silent_samples = silent;
        assert_eq!(has(Fault::LinkSilent, waits), wrong);
    }
}

#[test]
fn a_wheel_is_locked_below_three_percent_of_a_vehicle_above_five_metres_a_second_for_two_tenths() {
    let vehicle = 20.0;
    let edge = LOCKED_SHARE * vehicle / RADIUS_M;
    for (wheel, locked) in [(edge, false), (edge.next_down(), true), (0.0, true)] {
        let mut checked = Checked::after(vehicle);
        let mut seen = Seen::rolling(vehicle);
        seen.converted.wheel = turning(wheel);
        let after = checked.until(Fault::WheelLocked, 1_000, seen);
        // The sum of 200 thousandths is a little less or more than 0.2 in single precision.
        assert_eq!(
            after.is_some_and(|n| (200..=201).contains(&n)),
            locked,
            "{wheel}: {after:?}"
        );
        assert_eq!(after.is_some(), locked);
    }
    for (vehicle, locked) in [(LOCK_SPEED_M_S, false), (above(LOCK_SPEED_M_S), true)] {
        let mut seen = Seen::rolling(vehicle);
        seen.converted.wheel = turning(0.0);
        let after = Checked::after(vehicle).until(Fault::WheelLocked, 1_000, seen);
        assert_eq!(after.is_some(), locked);
    }
    // Counted from the last pulse.
    for (age_s, locked) in [(0.2, false), (above(0.2), true)] {
        let stands = |s: &mut Seen| {
            s.converted.wheel = Speed {
                age_s,
                pulsed: false,
                ..turning(0.0)
            };
        };
        assert_eq!(has(Fault::WheelLocked, stands), locked);
    }
    // One sample at which it turns begins the time again.
    let mut checked = Checked::after(vehicle);
    let mut stands = Seen::rolling(vehicle);
    stands.converted.wheel = turning(0.0);
    assert_eq!(checked.until(Fault::WheelLocked, 190, stands), None);
    checked.check(Seen::rolling(vehicle));
    assert_eq!(checked.until(Fault::WheelLocked, 190, stands), None);
}

#[test]
fn speeds_disagree_beyond_a_slip_of_a_twentieth_for_more_than_two_seconds_without_the_brake() {
    let vehicle = 16.0;
    let rolls = |slip: f32, vehicle: f32, brakes: bool| {
        let mut seen = Seen::rolling(vehicle);
        seen.converted.wheel = turning(vehicle * (1.0 - slip) / RADIUS_M);
        seen.circumstances.demand = if brakes { 0.1 } else { 0.0 };
        seen.raw.holds = brakes;
        Checked::after(vehicle).until(Fault::SpeedsDisagree, 4_000, seen)
    };
    for slip in [0.049, -0.049, 0.02] {
        assert_eq!(rolls(slip, vehicle, false), None, "{slip}");
    }
    for slip in [0.051, -0.051, 0.5, -0.5] {
        assert_eq!(rolls(slip, vehicle, false), Some(2_001), "{slip}");
    }
    // At a speed of which that slip is exact in single precision.
    let exact = |vehicle: &f32| {
        let off = ROLLING_SLIP * vehicle;
        ((vehicle + off) - vehicle).to_bits() == off.to_bits()
    };
    let vehicle = (0..1_000).map(|i| 8.0 + i as f32 / 1_048_576.0).find(exact);
    let vehicle = vehicle.unwrap_or(f32::NAN);
    let surface = vehicle + ROLLING_SLIP * vehicle;
    for (surface, after) in [(surface, None), (above(surface), Some(2_001))] {
        let mut seen = Seen::rolling(vehicle);
        seen.converted.wheel = turning(surface / RADIUS_M);
        let disagree = Checked::after(vehicle).until(Fault::SpeedsDisagree, 4_000, seen);
        assert_eq!(disagree, after, "{vehicle} {surface}");
    }
    assert_eq!(rolls(0.5, vehicle, true), None);
    assert_eq!(rolls(0.5, LOCK_SPEED_M_S, false), None);
    assert_eq!(rolls(0.5, above(LOCK_SPEED_M_S), false), Some(2_001));
}

#[test]
fn a_brake_is_hot_beyond_its_energy_which_grows_with_its_work_and_falls_with_time() {
    let mut parameters = parameters();
    // So slow that a sample takes nothing off.
    parameters.brake_heat.cooling_time_s = 1e9;
    let largest = parameters.brake_heat.maximum_energy_j as u32;
    for (energy_j, wrong) in [(largest, false), (largest + 1, true)] {
        let mut interlocks = Interlocks::new(&parameters, RATES).heated(energy_j);
        let seen = Seen::rolling(20.0);
        let faults = interlocks.check(&seen.raw, &seen.converted, &seen.circumstances);
        assert_eq!(faults.contains(Fault::BrakeHot), wrong);
    }
    // Half of 2,000 N m at 40 rad/s for a second are 40 kJ; a wheel that turns backwards gives none back.
    for (rad_s, energy_j) in [(40.0, 40_000.0), (-40.0, 0.0)] {
        let mut interlocks = Interlocks::new(&parameters, RATES);
        let mut seen = Seen::rolling(20.0);
        seen.converted.wheel = turning(rad_s);
        seen.circumstances.demand = 0.5;
        for _ in 0..1_000 {
            interlocks.check(&seen.raw, &seen.converted, &seen.circumstances);
        }
        assert!((interlocks.brake_energy_j() - energy_j).abs() < 40.0);
    }
    // In its cooling time it falls to 1/e.
    let mut parameters = self::parameters();
    parameters.brake_heat.cooling_time_s = 5.0;
    let mut interlocks = Interlocks::new(&parameters, RATES).heated(1_000_000);
    let seen = Seen::rolling(20.0);
    for _ in 0..5_000 {
        interlocks.check(&seen.raw, &seen.converted, &seen.circumstances);
    }
    let left = interlocks.brake_energy_j() / 1_000_000.0;
    assert!((left - (-1.0_f32).exp()).abs() < 1e-3, "{left}");
}

#[test]
fn a_bridge_is_frozen_at_its_fifth_same_pair_or_one_channel_s_twenty_fifth() {
    let mut seen = Seen::rolling(20.0);
    seen.raw.bridge.codes = [7, 9];
    let frozen = Checked::after(20.0).until(Fault::BridgeFrozen, 100, seen);
    assert_eq!(frozen, Some(u32::from(FROZEN_SAMPLES)));
    for channel in [0, 1] {
        let mut checked = Checked::after(20.0);
        let stuck = (1..=100).find(|_| {
            let mut seen = Seen::rolling(20.0);
            seen.raw.bridge.codes = [3000 + checked.samples, 4000 + checked.samples];
            seen.raw.bridge.codes[channel] = 7;
            checked.check(seen).contains(Fault::BridgeFrozen)
        });
        assert_eq!(stuck, Some(i32::from(STUCK_SAMPLES)));
    }
    for (quality, fault) in [
        (BridgeQuality::Stale, Fault::BridgeFrozen),
        (BridgeQuality::Bad, Fault::BridgeLost),
    ] {
        assert!(has(fault, |s| s.raw.bridge.quality = quality));
    }
}

#[test]
fn a_force_s_third_jump_by_more_than_half_of_its_limit_within_25_samples_is_one_too_many() {
    let half = 0.5 * parameters().limits.maximum_force_n;
    // Up and down, the second jump so many samples after the first, the third right after.
    let chatter = |height: f32, apart: u8| {
        let mut checked = Checked::after(20.0);
        let mut force = 0.0;
        let mut wrong = false;
        for sample in 0..=apart + 1 {
            if sample == 0 || sample >= apart {
                force = height - force;
            }
            let mut seen = Seen::rolling(20.0);
            seen.converted.sample.drag_force_n = force;
            wrong |= checked.check(seen).contains(Fault::BridgeOutOfRange);
        }
        wrong
    };
    assert!(!chatter(half, 1));
    assert!(chatter(above(half), 1));
    assert!(chatter(above(half), JUMP_SAMPLES - 2));
    assert!(!chatter(above(half), JUMP_SAMPLES + 1));
}

#[test]
fn the_dump_valve_s_output_is_wrong_at_the_second_sample_that_it_is_not_what_it_was_told() {
    for told in [false, true] {
        let mut seen = Seen::rolling(20.0);
        seen.circumstances.demand = if told { 0.5 } else { 0.0 };
        seen.raw.holds = !told;
        let wrong = Checked::after(20.0).until(Fault::DumpOutput, 10, seen);
        assert_eq!(wrong, Some(2));
        seen.raw.holds = told;
        assert_eq!(
            Checked::after(20.0).until(Fault::DumpOutput, 10, seen),
            None
        );
    }
}

#[test]
fn a_speed_changes_no_faster_than_brake_and_tyre_can_change_it() {
    let parameters = parameters();
    // (2,000 N m + 15,000 N * 0.5 m) / 1.25 kg m2, and half as much again.
    let change = wheel_change_rad_s2(&parameters);
    assert!((change - 11_400.0).abs() < 1e-2, "{change}");
    // 5 rad/s, a tenth of 40 rad/s, and two samples of that change.
    let largest = 5.0 + 4.0 + 0.002 * change;
    for (by, wrong) in [(largest - 0.01, false), (largest + 0.01, true)] {
        for sign in [1.0, -1.0] {
            let turns = |s: &mut Seen| s.converted.wheel = turning(40.0 + sign * by);
            assert_eq!(
                has(Fault::WheelSensorOutOfRange, turns),
                wrong,
                "{by} {sign}"
            );
        }
    }
    // The vehicle: 5 rad/s, a tenth, two samples of 30 m/s2 on a radius of 1 m.
    for (by, wrong) in [(7.05, false), (7.07, true)] {
        let moves = |s: &mut Seen| s.converted.vehicle = turning(20.0 + by);
        assert_eq!(has(Fault::VehicleSensorOutOfRange, moves), wrong, "{by}");
    }
    // Backwards is noise down to -1 rad/s.
    for (rad_s, wrong) in [(-1.0, false), (-1.01, true)] {
        let mut seen = Seen::rolling(0.0);
        seen.converted.wheel = turning(rad_s);
        let faults = Checked::after(0.0).check(seen);
        assert_eq!(faults.contains(Fault::WheelSensorOutOfRange), wrong);
    }
}

#[test]
fn a_sensor_is_lost_once_its_silence_says_less_than_brake_and_tyre_can_have_left() {
    let change = wheel_change_rad_s2(&parameters());
    // 0.9 of 40 rad/s less 5 rad/s and the change since the last pulse.
    let age_s = 0.001;
    let slowest = 0.9 * 40.0 - 5.0 - change * age_s;
    for (rad_s, wrong) in [(slowest + 0.01, false), (slowest - 0.01, true)] {
        let silent = |s: &mut Seen| {
            s.converted.wheel = Speed {
                rad_s,
                at_last_pulse_rad_s: 40.0,
                age_s,
                pulsed: false,
            };
        };
        assert_eq!(has(Fault::WheelSensorLost, silent), wrong, "{rad_s}");
        assert!(!has(Fault::WheelSensorOutOfRange, silent));
    }
    let slowest = 0.9 * 20.0 - 5.0 - 30.0 * 0.01;
    for (rad_s, wrong) in [(slowest + 0.01, false), (slowest - 0.01, true)] {
        let silent = |s: &mut Seen| {
            s.converted.vehicle = Speed {
                rad_s,
                at_last_pulse_rad_s: 20.0,
                age_s: 0.01,
                pulsed: false,
            };
        };
        assert_eq!(has(Fault::VehicleSensorLost, silent), wrong, "{rad_s}");
    }
}
