//! The two valves behind their pins.

use embedded_hal::digital::OutputPin;
use embedded_hal::pwm::SetDutyCycle;
use muslip_control::brake::BrakeOutput;

use crate::bits::low_u16;

/// A proportional valve on a PWM and a dump valve on a pin that is high to hold pressure.
#[derive(Debug)]
pub struct Valves<P, D> {
    proportional: P,
    dump: D,
}

impl<P: SetDutyCycle, D: OutputPin> Valves<P, D> {
    /// Takes both and dumps.
    pub fn new(proportional: P, dump: D) -> Self {
        let mut valves = Self { proportional, dump };
        valves.set(BrakeOutput::DUMPED);
        valves
    }

    /// Sets both: the dump valve first when pressure must go, last when it may come. A pin that fails leaves
    /// the other one in its place, and a duty that fails opens the dump valve.
    pub fn set(&mut self, output: BrakeOutput) {
        if !output.hold_pressure {
            let _ = self.dump.set_low();
            let _ = self.proportional.set_duty_cycle(0);
            return;
        }
        let most = u32::from(self.proportional.max_duty_cycle());
        // Below 2^32: both factors have 16 bits.
        let duty = low_u16(u32::from(output.valve_duty) * most / u32::from(u16::MAX));
        let held = self.proportional.set_duty_cycle(duty).is_ok();
        let _ = if held {
            self.dump.set_high()
        } else {
            self.dump.set_low()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as OnPin};
    use embedded_hal_mock::eh1::pwm::{Mock as Pwm, Transaction as OnPwm};

    #[test]
    fn pressure_is_held_after_the_duty_is_set_and_dumped_before() {
        let mut pwm = Pwm::new(&[
            OnPwm::set_duty_cycle(0),
            OnPwm::max_duty_cycle(21_000),
            OnPwm::set_duty_cycle(10_500),
            OnPwm::max_duty_cycle(21_000),
            OnPwm::set_duty_cycle(21_000),
            OnPwm::set_duty_cycle(0),
        ]);
        let mut pin = Pin::new(&[
            OnPin::set(State::Low),
            OnPin::set(State::High),
            OnPin::set(State::High),
            OnPin::set(State::Low),
        ]);
        let mut valves = Valves::new(pwm.clone(), pin.clone());
        for valve_duty in [32_768, u16::MAX] {
            valves.set(BrakeOutput {
                valve_duty,
                hold_pressure: true,
            });
        }
        valves.set(BrakeOutput::DUMPED);
        pwm.done();
        pin.done();
    }
}
