//! Proportional valve on TIM1's channel 1 (PA8), dump valve on PB0.

use core::convert::Infallible;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};
use stm32f4::stm32f405::{GPIOB, RCC, TIM1};

use crate::bits::low_u16;
use crate::dump::DUMP_LINE;
use crate::settings::{CORE_HZ, VALVE_PWM_HZ};

/// TIM1's clock divided by this keeps a period of the PWM within 16 bits.
const PRESCALER: u32 = 4;
const PERIOD: u16 = low_u16(CORE_HZ / PRESCALER / VALVE_PWM_HZ);

/// The proportional valve's PWM.
pub struct ValvePwm(TIM1);

/// PWM mode 1 on channel 1 at no duty (17.4: CCMR1, CCER, BDTR, CR1).
pub fn start_pwm(rcc: &RCC, timer: TIM1) -> ValvePwm {
    rcc.apb2enr().modify(|r, w| unsafe { w.bits(r.bits() | 1) });
    timer
        .psc()
        .write(|w| unsafe { w.bits((PRESCALER - 1) as _) });
    timer
        .arr()
        .write(|w| unsafe { w.bits(u32::from(PERIOD - 1) as _) });
    timer.ccr1().write(|w| unsafe { w.bits(0) });
    // OC1M = 110, OC1PE: the duty changes at the end of a period.
    timer
        .ccmr1_output()
        .write(|w| unsafe { w.bits(0b110 << 4 | 1 << 3) });
    timer.ccer().write(|w| unsafe { w.bits(1) });
    timer.bdtr().write(|w| unsafe { w.bits(1 << 15) });
    timer.egr().write(|w| unsafe { w.bits(1) });
    timer.cr1().write(|w| unsafe { w.bits(1 << 7 | 1) });
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
