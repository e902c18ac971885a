//! Interlocks: what dumps the brake, checked on every sample before anything else.
//!
//! A condition counts from the first sample on which it is true as written here; the brake is dumped on
//! that same sample.
//!
//! | fault | condition |
//! |---|---|
//! | `EmergencyStop` | one of its channels is open |
//! | `WheelLocked` | wheel surface below 3 % of a vehicle speed above 5 m/s for more than 0.2 s, counted from the last pulse |
//! | `Overspeed` | vehicle or wheel above its limit |
//! | `WheelSensorLost` | no pulse for so long that the wheel would have slowed faster than brake and tyre can |
//! | `WheelSensorOutOfRange` | speed changed faster than that with pulses, or is backwards |
//! | `VehicleSensorLost`, `VehicleSensorOutOfRange` | the same of the vehicle, which cannot change by more than 30 m/s² |
//! | `BridgeLost` | no answer, wrong checksum, or the converter reset itself |
//! | `BridgeFrozen` | no conversion since the last sample, both codes the same for the fifth time, or one for the 25th |
//! | `BridgeOutOfRange` | code within 0.4 % of the end of the scale, force beyond its limit, or its third change by more than half of that limit within 25 samples |
//! | `NormalForceLost` | below its limit |
//! | `LinkSilent` | no whole frame with a number of its own from the host for 250 ms |
//! | `EstimatorFault` | the filter refused an update or is not finite |
//! | `DeadlineMissed` | a sample was not taken in time, or its work took longer than a sample |
//! | `BrownOut` | supply of the valves below its limit |
//! | `Watchdog` | the independent watchdog or a fault handler caused the last reset; until cleared |
//! | `Clock` | the core does not run at its full clock; for good |
//! | `Timeout` | a state lasted longer than it may, see [`sequence`](crate::sequence) |
//! | `SetUp` | a register of the chip does not hold what start-up wrote to it; for good |
//! | `StopChannels` | one channel of the emergency stop is open and the other is not, for more than 100 ms |
//! | `DumpOutput` | the dump valve's output is not what it was told, at the second sample |
//! | `SpeedsDisagree` | brake dumped, vehicle above 5 m/s, slip beyond ±0.05, for more than 2 s |
//! | `PressureLost` | the pressure transmitter below half of its reading without pressure, or at the end of the scale |
//! | `PressureWrong` | pressure for ten samples off what the valves can have made of the demand, see [`pressure`](crate::pressure) |
//! | `BrakeHot` | Σ demand · full torque · wheel speed · dt, less what has cooled, above its limit |

use muslip_record::{Fault, Parameters};

use crate::board::{BridgeQuality, RawSample};
use crate::conversion::Converted;
use crate::encoder::Speed;
pub use crate::fault_set::FaultSet;
use crate::number::nearest;
use crate::pressure::BrakeLine;
use crate::rates::Rates;
use crate::stop::EmergencyStop;

/// Vehicle speed in m/s above which a locked wheel is a fault.
pub const LOCK_SPEED_M_S: f32 = 5.0;
/// Slip within which a wheel rolls freely.
pub const ROLLING_SLIP: f32 = 0.05;
/// How long a wheel may be locked in s. A locked aircraft tyre blows after about a third of a second.
pub const LOCK_TIME_S: f32 = 0.2;
/// Share of the vehicle speed below which the wheel's surface counts as locked.
pub const LOCKED_SHARE: f32 = 0.03;
/// Time in ms without a whole frame after which the link is silent.
pub const SILENT_MS: u32 = 250;
/// The same pair of 24-bit codes this often is no measurement.
pub const FROZEN_SAMPLES: u8 = 5;
/// One channel's code the same this often.
pub const STUCK_SAMPLES: u8 = 25;
/// Samples within which a third jump of a force is one too many.
pub const JUMP_SAMPLES: u8 = 25;
/// Time in ms for which a freely rolling wheel may differ from the vehicle.
pub const DISAGREEING_MS: u32 = 2_000;
/// Samples for which the dump valve's output may be other than it was told.
const DUMP_SAMPLES: u8 = 2;
/// Magnitude of a code from which a channel is at the end of its scale.
pub const LARGEST_CODE: u32 = 0x7F_8000;
/// Change of speed in a sample that noise and the quantum of one pulse may make, in rad/s.
const SPEED_NOISE_RAD_S: f32 = 5.0;
/// Fastest change of a vehicle's speed in m/s².
const VEHICLE_CHANGE_M_S2: f32 = 30.0;
/// Backward speed that is still noise, in rad/s.
const BACKWARD_RAD_S: f32 = 1.0;

/// What the controller knows beside the sample.
#[derive(Debug, Clone, Copy, Default)]
pub struct Circumstances {
    /// Samples since the last whole frame from the host.
    pub silent_samples: u32,
    /// The filter failed on the sample before.
    pub estimator_failed: bool,
    /// The sample before took longer than a sample.
    pub overran: bool,
    /// The watchdog caused the reset and nobody has cleared that yet.
    pub watchdog_reset: bool,
    /// The core does not run at its full clock.
    pub slow_clock: bool,
    /// A register does not hold what start-up wrote to it.
    pub set_up_failed: bool,
    /// A state lasted too long.
    pub timed_out: bool,
    /// Share of the brake's full torque that was demanded on the sample before.
    pub demand: f32,
}

/// The interlocks' limits and memory.
#[derive(Debug, Clone, Copy)]
pub struct Interlocks {
    parameters: Parameters,
    rates: Rates,
    /// Fastest change of the wheel's speed in rad/s².
    wheel_change_rad_s2: f32,
    vehicle_change_rad_s2: f32,
    locked_s: f32,
    last_wheel_rad_s: Option<f32>,
    last_vehicle_rad_s: Option<f32>,
    last_codes: [i32; 2],
    /// How often each channel's code has been the same.
    repeats: [u8; 2],
    last_forces_n: [f32; 2],
    jumps: u8,
    disagreeing: u32,
    dump_wrong: u8,
    stop: EmergencyStop,
    line: BrakeLine,
    brake_energy_j: f32,
}

impl Interlocks {
    /// With these parameters' limits.
    pub fn new(parameters: &Parameters, rates: Rates) -> Self {
        Self {
            parameters: *parameters,
            rates,
            wheel_change_rad_s2: wheel_change_rad_s2(parameters),
            vehicle_change_rad_s2: VEHICLE_CHANGE_M_S2 / parameters.vehicle_encoder_radius_m,
            locked_s: 0.0,
            last_wheel_rad_s: None,
            last_vehicle_rad_s: None,
            last_codes: [i32::MIN; 2],
            repeats: [0; 2],
            last_forces_n: [0.0; 2],
            // The first forces come out of nothing.
            jumps: 0,
            disagreeing: 0,
            dump_wrong: 0,
            stop: EmergencyStop::new(rates),
            line: BrakeLine::new(rates),
            brake_energy_j: 0.0,
        }
    }

    /// With other parameters' limits; the brake is as hot and the emergency stop as proven as before.
    pub fn take(&mut self, parameters: &Parameters) {
        *self = Self {
            stop: self.stop,
            brake_energy_j: self.brake_energy_j,
            ..Self::new(parameters, self.rates)
        };
    }

    /// With this energy in the brake in J: as hot as before a reset.
    #[must_use]
    pub fn heated(self, brake_energy_j: u32) -> Self {
        Self {
            brake_energy_j: nearest(brake_energy_j),
            ..self
        }
    }

    /// Energy in the brake in J.
    pub fn brake_energy_j(&self) -> f32 {
        self.brake_energy_j
    }

    /// Whether the emergency stop has been seen to work since the start.
    pub fn stop_is_proven(&self) -> bool {
        self.stop.is_proven()
    }

    /// Every condition that holds at this sample, whatever the state.
    pub fn check(
        &mut self,
        raw: &RawSample,
        converted: &Converted,
        circumstances: &Circumstances,
    ) -> FaultSet {
        let mut faults = FaultSet::default();
        faults.add_if(raw.emergency_stop != [false; 2], Fault::EmergencyStop);
        self.stop.update(raw.emergency_stop);
        faults.add_if(self.stop.disagrees(), Fault::StopChannels);
        let told = circumstances.demand > 0.0;
        self.dump_wrong = if raw.holds == told {
            0
        } else {
            self.dump_wrong.saturating_add(1)
        };
        faults.add_if(self.dump_wrong >= DUMP_SAMPLES, Fault::DumpOutput);
        self.line.check(
            raw.pressure_mv,
            circumstances.demand,
            &self.parameters.pressure,
            &mut faults,
        );
        self.heat(converted, circumstances.demand, &mut faults);
        self.speeds(converted, &mut faults);
        self.free_rolling(converted, told, &mut faults);
        self.bridge(raw, converted, &mut faults);
        faults.add_if(
            circumstances.silent_samples > self.rates.samples(SILENT_MS),
            Fault::LinkSilent,
        );
        faults.add_if(circumstances.estimator_failed, Fault::EstimatorFault);
        faults.add_if(circumstances.overran || raw.late, Fault::DeadlineMissed);
        let supply_v = f32::from(raw.supply_mv) * 0.001;
        faults.add_if(
            supply_v < self.parameters.limits.minimum_supply_v,
            Fault::BrownOut,
        );
        faults.add_if(circumstances.watchdog_reset, Fault::Watchdog);
        faults.add_if(circumstances.slow_clock, Fault::Clock);
        faults.add_if(circumstances.timed_out, Fault::Timeout);
        faults.add_if(circumstances.set_up_failed, Fault::SetUp);
        faults
    }

    fn speeds(&mut self, converted: &Converted, faults: &mut FaultSet) {
        let limits = &self.parameters.limits;
        let wheel_rad_s = converted.wheel.rad_s;
        let vehicle_m_s = converted.sample.vehicle_speed_m_s;

        let surface_m_s = wheel_rad_s * self.parameters.wheel.effective_radius_m;
        if vehicle_m_s > LOCK_SPEED_M_S && surface_m_s < LOCKED_SHARE * vehicle_m_s {
            self.locked_s = (self.locked_s + self.rates.sample_s()).max(converted.wheel.age_s);
        } else {
            self.locked_s = 0.0;
        }
        faults.add_if(self.locked_s > LOCK_TIME_S, Fault::WheelLocked);

        faults.add_if(
            vehicle_m_s > limits.maximum_vehicle_speed_m_s
                || wheel_rad_s > limits.maximum_wheel_speed_rad_s,
            Fault::Overspeed,
        );

        let wheel = plausible(
            &converted.wheel,
            self.last_wheel_rad_s,
            self.wheel_change_rad_s2,
            self.rates.sample_s(),
        );
        faults.add_if(wheel == Plausible::Lost, Fault::WheelSensorLost);
        faults.add_if(wheel == Plausible::OutOfRange, Fault::WheelSensorOutOfRange);
        self.last_wheel_rad_s = Some(wheel_rad_s);
        let vehicle = plausible(
            &converted.vehicle,
            self.last_vehicle_rad_s,
            self.vehicle_change_rad_s2,
            self.rates.sample_s(),
        );
        faults.add_if(vehicle == Plausible::Lost, Fault::VehicleSensorLost);
        faults.add_if(
            vehicle == Plausible::OutOfRange,
            Fault::VehicleSensorOutOfRange,
        );
        self.last_vehicle_rad_s = Some(converted.vehicle.rad_s);
    }

    /// What the brake takes up at the torque that it is told, which a low friction of its lining only lowers.
    fn heat(&mut self, converted: &Converted, demand: f32, faults: &mut FaultSet) {
        let heat = &self.parameters.brake_heat;
        let sample_s = self.rates.sample_s();
        let torque_nm = demand * self.parameters.brake.torque_at_full_nm;
        let power_w = torque_nm * converted.wheel.rad_s.max(0.0);
        let cooled = self.brake_energy_j * (1.0 - sample_s / heat.cooling_time_s);
        self.brake_energy_j = cooled + power_w * sample_s;
        faults.add_if(self.brake_energy_j > heat.maximum_energy_j, Fault::BrakeHot);
    }

    /// A wheel that rolls freely turns as the vehicle moves: a wrong factor in either encoder, a wrong radius, a brake
    /// that drags or a tyre that does not touch.
    fn free_rolling(&mut self, converted: &Converted, brakes: bool, faults: &mut FaultSet) {
        let vehicle_m_s = converted.sample.vehicle_speed_m_s;
        let surface_m_s = converted.wheel.rad_s * self.parameters.wheel.effective_radius_m;
        let off = (surface_m_s - vehicle_m_s).abs() > ROLLING_SLIP * vehicle_m_s;
        self.disagreeing = if !brakes && vehicle_m_s > LOCK_SPEED_M_S && off {
            self.disagreeing.saturating_add(1)
        } else {
            0
        };
        faults.add_if(
            self.disagreeing > self.rates.samples(DISAGREEING_MS),
            Fault::SpeedsDisagree,
        );
    }

    fn bridge(&mut self, raw: &RawSample, converted: &Converted, faults: &mut FaultSet) {
        let limits = &self.parameters.limits;
        let codes = raw.bridge.codes;
        for ((repeats, last), code) in self.repeats.iter_mut().zip(self.last_codes).zip(codes) {
            *repeats = if code == last {
                repeats.saturating_add(1)
            } else {
                1
            };
        }
        self.last_codes = codes;
        let [a, b] = self.repeats;
        faults.add_if(raw.bridge.quality == BridgeQuality::Bad, Fault::BridgeLost);
        faults.add_if(
            raw.bridge.quality == BridgeQuality::Stale
                || a.min(b) >= FROZEN_SAMPLES
                || a.max(b) >= STUCK_SAMPLES,
            Fault::BridgeFrozen,
        );
        let ends = codes.iter().any(|code| code.unsigned_abs() >= LARGEST_CODE);
        let sample = &converted.sample;
        let beyond = [sample.drag_force_n, sample.normal_force_n]
            .iter()
            .any(|force| force.abs() > limits.maximum_force_n);
        let forces_n = [sample.drag_force_n, sample.normal_force_n];
        let jumped = forces_n
            .iter()
            .zip(self.last_forces_n)
            .any(|(now, last)| (now - last).abs() > 0.5 * limits.maximum_force_n);
        self.last_forces_n = forces_n;
        // Each counts for a time; a glitch is one there and one back.
        self.jumps = if jumped {
            self.jumps.saturating_add(JUMP_SAMPLES)
        } else {
            self.jumps.saturating_sub(1)
        };
        let chatters = self.jumps > 2 * JUMP_SAMPLES;
        faults.add_if(ends || beyond || chatters, Fault::BridgeOutOfRange);
        faults.add_if(
            sample.normal_force_n < limits.minimum_normal_force_n,
            Fault::NormalForceLost,
        );
    }
}

/// Fastest change of the wheel's speed in rad/s²: brake at full torque with half as much again, and the tyre at a
/// friction of 1.5.
pub fn wheel_change_rad_s2(parameters: &Parameters) -> f32 {
    let wheel = &parameters.wheel;
    1.5 * (parameters.brake.torque_at_full_nm
        + parameters.limits.maximum_force_n * wheel.effective_radius_m)
        / wheel.inertia_kg_m2
}

#[derive(PartialEq, Eq)]
enum Plausible {
    Yes,
    Lost,
    OutOfRange,
}

/// Whether a speed can have come from the one a sample before it by a change of at most `change_rad_s2`.
fn plausible(
    speed: &Speed,
    last_rad_s: Option<f32>,
    change_rad_s2: f32,
    sample_s: f32,
) -> Plausible {
    if !speed.pulsed {
        // Noise of 5 rad/s and a tenth cover the quantum of a coarse tone ring.
        let slowest =
            0.9 * speed.at_last_pulse_rad_s - SPEED_NOISE_RAD_S - change_rad_s2 * speed.age_s;
        return if speed.rad_s < slowest {
            Plausible::Lost
        } else {
            Plausible::Yes
        };
    }
    // The pulses span up to one sample more than the samples they are read at.
    let changed = last_rad_s.is_some_and(|last_rad_s| {
        let largest = SPEED_NOISE_RAD_S + 0.1 * last_rad_s.abs() + change_rad_s2 * 2.0 * sample_s;
        (speed.rad_s - last_rad_s).abs() > largest
    });
    if changed || speed.rad_s < -BACKWARD_RAD_S {
        Plausible::OutOfRange
    } else {
        Plausible::Yes
    }
}
