//! Slip held by the PI controller on the quarter-car filter's estimates.
//!
//! The filter takes all four channels of the rig on a road that it does not know; where a drum's speed is held,
//! the measured vehicle speed overrules the model's deceleration. Its slip is what is held, and the tyre's torque
//! as estimated is fed forward.
//!
//! The filter leaves out a reading that is far off, five of a channel in a row at most. A channel that keeps being
//! left out is no glitch: either it or the filter is wrong, and slip must not be held by what is left.

use muslip::filter::Decision;
use muslip::sample::RigSample;
use muslip_quarter_car::filter::{self, Channel, Filter, Measurement, Road, StateStd, Vehicle};
use muslip_quarter_car::slip_control::{self, SlipController};
use muslip_record::{Parameters, QuarterCar};

use crate::rates::Rates;

/// Standard gravity in m/s2 (3rd General Conference on Weights and Measures, 1901).
const GRAVITY_M_S2: f32 = 9.806_65;
/// Vehicle speed in m/s below which the controller's gain falls no further.
const SLOWEST_M_S: f32 = 2.0;
/// Standard deviation of the wheel's and the vehicle's speed: pulses are stamped within 12 ns, what is left is
/// the encoder's own unevenness.
const WHEEL_STD_RAD_S: f32 = 0.05;
const VEHICLE_STD_M_S: f32 = 0.01;
/// Standard deviation of the normal force as a share of it.
const NORMAL_STD: f32 = 0.01;

/// Readings of one channel left out, less those taken, from which the filter has lost it: after 75 samples where one in six
/// is taken because five before it were not.
const LOST_READINGS: u8 = 50;

/// Filter or controller refused, or a channel is lost: the estimate is not to be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refused;

/// Filter and controller of one application.
#[derive(Debug, Clone, Copy)]
pub struct SlipHold {
    filter: Filter<f32>,
    controller: SlipController<f32>,
    torque_at_full_nm: f32,
    friction_std: f32,
    gates: [Gate; 4],
}

/// What became of one channel's readings.
#[derive(Debug, Clone, Copy, Default)]
struct Gate {
    /// Left out, in all.
    rejected: u16,
    /// Left out, less those taken.
    balance: u8,
}

impl Gate {
    fn count(&mut self, decision: Decision) {
        match decision {
            Decision::Rejected => {
                self.rejected = self.rejected.saturating_add(1);
                self.balance = self.balance.saturating_add(1);
            }
            Decision::Accepted => self.balance = self.balance.saturating_sub(1),
        }
    }
}

impl SlipHold {
    /// From a wheel that rolls freely.
    ///
    /// # Errors
    /// [`Refused`] where the sample or checked parameters make no filter or controller.
    pub fn new(
        parameters: &Parameters,
        target_slip: f32,
        sample: &RigSample<f32>,
        rates: Rates,
    ) -> Result<Self, Refused> {
        let sample_s = rates.sample_s();
        let wheel = &parameters.wheel;
        let control = &parameters.slip_control;
        let vehicle = Vehicle {
            radius_m: wheel.effective_radius_m,
            inertia_kg_m2: wheel.inertia_kg_m2,
            gravity_m_s2: GRAVITY_M_S2,
        };
        let tuned = filter::Config::tuned(vehicle, Road::Unknown, sample.vehicle_speed_m_s);
        let filter = filter::Config {
            sample_time_s: sample_s,
            initial_mass_kg: sample.normal_force_n / GRAVITY_M_S2,
            process_std: StateStd {
                // The model's deceleration where the speed is held: friction of 1 for a sample.
                vehicle_speed_m_s: 2.0 * sample_s * GRAVITY_M_S2,
                slip_ratio: 0.002,
                friction: 0.01,
                ..tuned.process_std
            },
            // Two samples may well see the same pulse.
            refuses_repeats: false,
            ..tuned
        };
        let controller = slip_control::Config {
            setpoint_slip: target_slip,
            bandwidth_rad_s: control.bandwidth_rad_s,
            integral_time_s: control.integral_time_s,
            sample_time_s: sample_s,
            radius_m: wheel.effective_radius_m,
            inertia_kg_m2: wheel.inertia_kg_m2,
            maximum_torque_nm: parameters.brake.torque_at_full_nm,
            maximum_torque_rate_nm_s: control.maximum_torque_rate_nm_s,
            minimum_vehicle_speed_m_s: SLOWEST_M_S,
        };
        Ok(Self {
            filter: filter.build().map_err(|_| Refused)?,
            controller: controller.build().map_err(|_| Refused)?,
            torque_at_full_nm: parameters.brake.torque_at_full_nm,
            friction_std: parameters.estimator.friction_std,
            gates: [Gate::default(); 4],
        })
    }

    /// One sample: the share of full pressure to demand.
    ///
    /// # Errors
    /// [`Refused`].
    pub fn step(&mut self, sample: &RigSample<f32>) -> Result<f32, Refused> {
        self.filter
            .predict(self.controller.brake_torque_nm())
            .map_err(|_| Refused)?;
        let normal_n = sample.normal_force_n;
        let measured = [
            (
                Channel::WheelSpeed,
                sample.wheel_speed_rad_s,
                WHEEL_STD_RAD_S,
            ),
            (
                Channel::VehicleSpeed,
                sample.vehicle_speed_m_s,
                VEHICLE_STD_M_S,
            ),
            (
                Channel::DragForce,
                sample.drag_force_n,
                self.friction_std * normal_n,
            ),
            (Channel::NormalForce, normal_n, NORMAL_STD * normal_n),
        ];
        for ((channel, value, std), gate) in measured.into_iter().zip(&mut self.gates) {
            let measurement = Measurement {
                channel,
                value,
                variance: std * std,
            };
            let fusion = self.filter.update(&measurement).map_err(|_| Refused)?;
            gate.count(fusion.decision);
            if gate.balance >= LOST_READINGS {
                return Err(Refused);
            }
        }
        let input = slip_control::Input {
            slip_ratio: self.filter.slip_ratio(),
            vehicle_speed_m_s: self.filter.estimate().state.vehicle_speed_m_s,
            tyre_torque_nm: self.filter.tyre_torque_nm(),
        };
        let output = self.controller.step(&input).map_err(|_| Refused)?;
        Ok(output.brake_torque_nm / self.torque_at_full_nm)
    }

    /// As it is sent.
    pub fn report(&self, tick: u32) -> QuarterCar {
        let estimate = self.filter.estimate();
        let mut covariance = [0.0; 15];
        let upper = estimate
            .covariance
            .rows()
            .into_iter()
            .enumerate()
            .flat_map(|(row, values)| values.into_iter().skip(row));
        for (place, value) in covariance.iter_mut().zip(upper) {
            *place = value;
        }
        QuarterCar {
            tick,
            state: estimate.state.to_array(),
            covariance,
            rejected: self.gates.map(|gate| gate.rejected),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: Rates = Rates::new(1_000, 84_000_000);

    /// A wheel on a drum whose speed is held, braked as the hold demands, on a road of peak 0.85 at slip 0.14.
    struct Wheel {
        hold: SlipHold,
        speed_rad_s: f32,
        slip_ratio: f32,
    }

    impl Wheel {
        fn rolling() -> Self {
            let mut wheel = Self {
                hold: SlipHold::new(&Parameters::default(), 0.1, &Self::at(0.0, 0.0), RATES)
                    .unwrap(),
                speed_rad_s: 20.0 / 0.31,
                slip_ratio: 0.0,
            };
            for _ in 0..500 {
                wheel.step(0.0).unwrap();
            }
            assert!(
                (wheel.slip_ratio - 0.1).abs() < 0.03,
                "{}",
                wheel.slip_ratio
            );
            wheel
        }

        fn at(slip_ratio: f32, drag_force_n: f32) -> RigSample<f32> {
            RigSample {
                wheel_speed_rad_s: 20.0 * (1.0 - slip_ratio) / 0.31,
                vehicle_speed_m_s: 20.0,
                drag_force_n,
                normal_force_n: 4120.0,
            }
        }

        /// A sample whose drag is read wrong by so many N.
        fn step(&mut self, wrong_n: f32) -> Result<(), Refused> {
            self.slip_ratio = 1.0 - self.speed_rad_s * 0.31 / 20.0;
            let share = self.slip_ratio / 0.14;
            let drag_n = 4120.0 * 0.85 * 2.0 * share / (1.0 + share * share);
            let demand = self
                .hold
                .step(&Self::at(self.slip_ratio, drag_n + wrong_n))?;
            self.speed_rad_s += RATES.sample_s() * (0.31 * drag_n - 2000.0 * demand) / 1.25;
            Ok(())
        }
    }

    /// Far off in either direction, so that the filter cannot settle on it.
    fn off(sample: u32) -> f32 {
        if sample.is_multiple_of(2) { 1e5 } else { -1e5 }
    }

    #[test]
    fn a_channel_that_stays_off_ends_the_hold_though_the_others_are_well() {
        let mut wheel = Wheel::rolling();
        let before = wheel.hold.report(0).rejected;
        let lost = (0..200).find(|&sample| wheel.step(off(sample)).is_err());
        // Five of six are left out: a balance of 50 after 75.
        assert!(
            lost.is_some_and(|lost| (49..80).contains(&lost)),
            "{lost:?}"
        );
        let after = wheel.hold.report(0).rejected;
        assert!(after[2] >= before[2] + 50, "{before:?} {after:?}");
    }

    #[test]
    fn glitches_are_left_out_counted_and_no_fault() {
        let mut wheel = Wheel::rolling();
        let before = wheel.hold.report(0).rejected;
        for sample in 0..2_000 {
            let wrong_n = if sample % 100 < 4 { off(sample) } else { 0.0 };
            assert!(wheel.step(wrong_n).is_ok());
        }
        let mut expected = before;
        expected[2] += 20 * 4;
        assert_eq!(wheel.hold.report(0).rejected, expected);
        assert!(
            (wheel.slip_ratio - 0.1).abs() < 0.01,
            "{}",
            wheel.slip_ratio
        );
    }
}
