//! Both valves on TIM1, whose break takes them off: the proportional one on channel 1 (PA8), the dump valve on channel 2N
//! (PB0).

use core::convert::Infallible;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use stm32f4::stm32f405::TIM1;

use super::{bus::Bus, gpio};
use crate::bits::low_u16;
use crate::registers;
use crate::settings::VALVE_PWM_PERIOD;

const PERIOD: u16 = low_u16(VALVE_PWM_PERIOD);

/// The proportional valve's PWM.
pub struct ValvePwm(TIM1);

/// TIM1 at no duty and no pressure held, then the dump valve's pin on it.
pub fn start(timer: TIM1) -> (ValvePwm, DumpPin) {
    registers::set_up(&registers::VALVES, &mut Bus);
    gpio::dump_line_to_timer();
    (ValvePwm(timer), DumpPin)
}

impl pwm::ErrorType for ValvePwm {
    type Error = Infallible;
}

impl SetDutyCycle for ValvePwm {
    fn max_duty_cycle(&self) -> u16 {
        PERIOD
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0
            .ccr1()
            .write(|w| unsafe { w.bits(u32::from(duty) as _) });
        if duty == 0 {
            // The duty of 0 is taken at once (UG), then outputs are driven again that a break has switched off: not
            // before, and not while there is still a duty.
            self.0.egr().write(|w| unsafe { w.bits(1) });
            self.0
                .bdtr()
                .write(|w| unsafe { w.bits((registers::BREAK | registers::OUTPUTS_ON) as _) });
        }
        Ok(())
    }
}

/// The dump valve's pin.
pub struct DumpPin;

impl DumpPin {
    fn compare(value: u32) {
        // SAFETY: CCR2 is written whole and is this output's alone.
        unsafe { (*TIM1::ptr()).ccr2().write(|w| w.bits(value as _)) };
    }
}

impl digital::ErrorType for DumpPin {
    type Error = Infallible;
}

impl OutputPin for DumpPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Self::compare(0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Self::compare(registers::HOLDS);
        Ok(())
    }
}
