//! The brake line's pressure beside what the valves were told: a valve that is stuck shows here, and not only in a wheel
//! that does not roll again.
//!
//! The line follows the demand within a time that is a parameter. Between the demand and the pressure therefore lies a
//! band: its upper edge goes up with the demand at once and comes down no faster than the line can, its lower edge the
//! other way round. A pressure outside the band, by more than what calibration and noise can make, is not of these
//! valves.

use muslip_record::{Fault, PressureParameters};

use crate::fault_set::FaultSet;
use crate::rates::Rates;

/// Share of full pressure by which a reading may be off the band.
pub const TOLERANCE: f32 = 0.15;
/// Time in ms for which it may be further off: hammer in the line, a glitch.
pub const WRONG_MS: u32 = 10;
/// Volt above which the converter is at the end of its scale.
const LARGEST_V: f32 = 3.2;

/// What the line's pressure may be.
#[derive(Debug, Clone, Copy)]
pub struct BrakeLine {
    sample_s: f32,
    /// Edges of the band as shares of full pressure.
    upper: f32,
    lower: f32,
    /// Samples from which on a pressure is wrong, and how many it has been.
    tolerated: u32,
    wrong: u32,
}

impl BrakeLine {
    /// Without pressure, and none asked for.
    #[must_use]
    pub const fn new(rates: Rates) -> Self {
        Self {
            sample_s: rates.sample_s(),
            upper: 0.0,
            lower: 0.0,
            tolerated: rates.samples(WRONG_MS),
            wrong: 0,
        }
    }

    /// Takes the transmitter's mV at a sample, and the demand of the sample before as a share of full pressure.
    pub fn check(
        &mut self,
        pressure_mv: u16,
        demand: f32,
        parameters: &PressureParameters,
        faults: &mut FaultSet,
    ) {
        let step = self.sample_s / parameters.response_s;
        self.upper = (self.upper - step).max(demand);
        self.lower = (self.lower + step).min(demand);
        let volt = f32::from(pressure_mv) * 0.001;
        let zero = parameters.volt_at_zero;
        // Without a live zero there is no transmitter, and what it reads is no pressure.
        let lost = volt < 0.5 * zero || volt > LARGEST_V;
        faults.add_if(lost, Fault::PressureLost);
        let share = (volt - zero) / (parameters.volt_at_full - zero);
        let off = share > self.upper + TOLERANCE || share < self.lower - TOLERANCE;
        self.wrong = if off && !lost {
            self.wrong.saturating_add(1)
        } else {
            0
        };
        faults.add_if(self.wrong >= self.tolerated, Fault::PressureWrong);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use muslip_record::Parameters;

    const RATES: Rates = Rates::new(1_000, 84_000_000);

    /// A line with a first-order lag, valves that may be stuck, and the faults of its last sample.
    struct Line {
        checked: BrakeLine,
        share: f32,
        lag_s: f32,
        faults: FaultSet,
    }

    impl Line {
        fn new(lag_s: f32) -> Self {
            Self {
                checked: BrakeLine::new(RATES),
                share: 0.0,
                lag_s,
                faults: FaultSet::default(),
            }
        }

        fn read(&mut self, share: f32, demand: f32) -> bool {
            let pressure = &Parameters::default().pressure;
            let span = pressure.volt_at_full - pressure.volt_at_zero;
            let mv = (1000.0 * (pressure.volt_at_zero + span * share)) as u16;
            self.faults = FaultSet::default();
            self.checked.check(mv, demand, pressure, &mut self.faults);
            self.faults != FaultSet::default()
        }

        /// A sample of a line whose valves do as they are told.
        fn follow(&mut self, demand: f32) -> bool {
            self.share += (demand - self.share) * RATES.sample_s() / self.lag_s;
            self.read(self.share, demand)
        }
    }

    /// Steps, ramps and dumps of a program, a second of each.
    fn program(sample: u32) -> f32 {
        let into = (sample % 1000) as f32 / 1000.0;
        match sample / 1000 {
            0 => into,
            1 => 0.0,
            2 => 1.0,
            3 if sample.is_multiple_of(2) => 1.0,
            3 => 0.0,
            4 => 0.5,
            _ => 0.0,
        }
    }

    #[test]
    fn a_line_that_follows_its_valves_is_never_wrong() {
        // Response is 0.2 s: to within 2 % after 50 ms of lag.
        for lag_s in [0.002, 0.015, 0.05] {
            let mut line = Line::new(lag_s);
            for sample in 0..6_000 {
                let off = line.follow(program(sample));
                assert!(!off, "lag {lag_s}, sample {sample}: {:?}", line.faults);
            }
        }
    }

    #[test]
    fn a_line_that_keeps_its_pressure_after_a_dump_is_wrong_within_its_response() {
        for share in [0.2, 0.5, 1.0] {
            let mut line = Line::new(0.015);
            for _ in 0..1_000 {
                assert!(!line.follow(share));
            }
            let wrong = (1..400).find(|_| line.read(share, 0.0)).unwrap();
            assert!(line.faults.contains(Fault::PressureWrong));
            // The tolerance's share of 200 ms, and ten samples.
            assert!((38..=42).contains(&wrong), "{share}: {wrong}");
        }
    }

    #[test]
    fn a_line_without_the_pressure_that_was_asked_for_is_wrong() {
        let mut line = Line::new(0.015);
        let wrong = (1..400).find(|_| line.read(0.0, 1.0)).unwrap();
        assert!((38..=42).contains(&wrong), "{wrong}");
        // And one with more than was ever asked for, by its tenth sample.
        let mut line = Line::new(0.015);
        let wrong = (1..400).find(|_| line.read(0.5, 0.3)).unwrap();
        assert_eq!(wrong, 10);
        let mut line = Line::new(0.015);
        assert!((1..400).all(|_| !line.read(0.44, 0.3)));
    }

    #[test]
    fn a_transmitter_without_its_live_zero_or_at_its_end_is_lost_at_once_and_tells_no_pressure() {
        for mv in [0, 166, 3_201, u16::MAX] {
            let mut checked = BrakeLine::new(RATES);
            for _ in 0..50 {
                let mut faults = FaultSet::default();
                let pressure = &Parameters::default().pressure;
                checked.check(mv, 0.0, pressure, &mut faults);
                assert!(faults.contains(Fault::PressureLost), "{mv}");
                assert!(!faults.contains(Fault::PressureWrong), "{mv}");
            }
        }
    }

    #[test]
    fn hammer_of_nine_samples_is_no_fault() {
        let mut line = Line::new(0.015);
        for _ in 0..5 {
            assert!((0..9).all(|_| !line.read(0.9, 0.0)));
            assert!(!line.read(0.05, 0.0));
        }
    }
}
