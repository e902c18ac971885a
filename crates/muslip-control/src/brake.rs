//! From a demand to the valves.

use muslip_record::BrakeParameters;
use serde::{Deserialize, Serialize};

use crate::number::whole_u16;

/// What the valves are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct BrakeOutput {
    /// Duty of the proportional valve in 1/65535.
    pub valve_duty: u16,
    /// True energises the dump valve, which closes it: without power it is open and the brake is free.
    pub hold_pressure: bool,
}

impl BrakeOutput {
    /// No pressure, dump valve open: what every fault ends in, and a board without power.
    pub const DUMPED: Self = Self {
        valve_duty: 0,
        hold_pressure: false,
    };

    /// A share of full pressure, held within 0..=1; a demand of 0 or NaN dumps.
    pub fn for_demand(demand: f32, brake: &BrakeParameters) -> Self {
        if demand > 0.0 {
            let share = demand.min(1.0);
            let duty = brake.duty_at_zero + (brake.duty_at_full - brake.duty_at_zero) * share;
            Self {
                valve_duty: whole_u16(duty * f32::from(u16::MAX)),
                hold_pressure: true,
            }
        } else {
            Self::DUMPED
        }
    }
}

#[cfg(test)]
mod tests {
    use super::BrakeOutput;
    use muslip_record::Parameters;

    #[test]
    fn duty_spans_the_calibrated_range_and_nothing_else() {
        let brake = Parameters::default().brake;
        let duty = |demand| BrakeOutput::for_demand(demand, &brake);
        assert_eq!(duty(0.0), BrakeOutput::DUMPED);
        assert_eq!(duty(-1.0), BrakeOutput::DUMPED);
        assert_eq!(duty(f32::NAN), BrakeOutput::DUMPED);
        assert_eq!(duty(1.0).valve_duty, (0.9 * 65535.0_f32) as u16);
        assert_eq!(duty(7.0), duty(1.0));
        assert_eq!(duty(0.5).valve_duty, 32767);
        assert!(duty(1e-6).hold_pressure);
    }
}
