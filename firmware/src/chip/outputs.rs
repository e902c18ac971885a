//! Proportional valve on TIM1's channel 1 (PA8), dump valve on PB0.

use core::convert::Infallible;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use stm32f4::stm32f405::{GPIOB, TIM1};

use super::bus::Bus;
use crate::bits::low_u16;
use crate::dump::DUMP_LINE;
use crate::registers;
use crate::settings::VALVE_PWM_PERIOD;

const PERIOD: u16 = low_u16(VALVE_PWM_PERIOD);

/// The proportional valve's PWM.
pub struct ValvePwm(TIM1);

/// The valve's PWM at no duty.
pub fn start_pwm(timer: TIM1) -> ValvePwm {
    registers::set_up(&registers::VALVE, &mut Bus);
    ValvePwm(timer)
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
    fn write(bits: u32) {
        // SAFETY: BSRR is written whole and touches this line only.
        unsafe { (*GPIOB::ptr()).bsrr().write(|w| w.bits(bits)) };
    }
}

impl digital::ErrorType for DumpPin {
    type Error = Infallible;
}

impl OutputPin for DumpPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Self::write(1 << (DUMP_LINE + 16));
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Self::write(1 << DUMP_LINE);
        Ok(())
    }
}
