//! Figures that registers are set from.

use muslip_control::rates::Rates;

/// Core clock in Hz once the PLL runs; no bus is divided.
pub const CORE_HZ: u32 = 170_000_000;
/// Core clock in Hz of the internal oscillator, before that and where the crystal fails.
pub const HSI_HZ: u32 = 16_000_000;
/// A thousand samples a second; edges are stamped at the core's clock.
pub const RATES: Rates = Rates::new(1_000, CORE_HZ);
/// Core cycles from one sample to the next.
pub const CYCLES_PER_SAMPLE: u32 = CORE_HZ / RATES.sample_hz();
/// Bits a second of the log on USART1.
pub const LOG_BAUD: u32 = 921_600;
/// Frequency of the proportional valve's PWM in Hz.
pub const VALVE_PWM_HZ: u32 = 2_000;
/// TIM1's clock divided by this keeps a period of that PWM within 16 bits.
pub const VALVE_PWM_PRESCALER: u32 = 4;
/// Steps of a period of that PWM.
pub const VALVE_PWM_PERIOD: u32 = CORE_HZ / VALVE_PWM_PRESCALER / VALVE_PWM_HZ;

/// PLL from an 8 MHz crystal: M, N, R.
pub const PLL: [u32; 3] = [2, 85, 2];

/// The converters' clock: AHB divided by this.
pub const ADC_DIVIDER: u32 = 4;

/// Wait states of the flash at 170 MHz in range 1 boost (RM0440, table 29: one for each 34 MHz).
pub const FLASH_WAIT_STATES: u32 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stm32::baud_divisor;
    use muslip_record::LINK_BAUD;

    #[test]
    fn the_pll_makes_the_core_clock_within_its_limits() {
        // DS12288, table 46: input 2.66 to 16 MHz, VCO 96 to 344 MHz.
        let [m, n, r] = PLL;
        let input = 8_000_000 / m;
        assert!((2_660_000..=16_000_000).contains(&input));
        let vco = input * n;
        assert!((96_000_000..=344_000_000).contains(&vco));
        assert_eq!(vco / r, CORE_HZ);
        const { assert!(CORE_HZ <= (FLASH_WAIT_STATES + 1) * 34_000_000) };
    }

    #[test]
    fn both_uarts_come_near_their_baud_also_on_the_internal_oscillator() {
        for (clock, most) in [(CORE_HZ, 0.003), (HSI_HZ, 0.022)] {
            let actual = f64::from(clock) / f64::from(baud_divisor(clock, LINK_BAUD));
            assert!(
                (actual / f64::from(LINK_BAUD) - 1.0).abs() < most,
                "{actual}"
            );
            // Fewer than 16 clocks a bit are none (RM0440, 37.5.8).
            assert!(baud_divisor(clock, LINK_BAUD) >= 16);
        }
    }

    #[test]
    fn the_converters_run_within_their_limits_and_are_done_within_a_sample() {
        // DS12288, table 66: up to 52 MHz with all converters at work; 640.5 + 12.5 periods a conversion.
        let clock_hz = CORE_HZ / ADC_DIVIDER;
        assert!((140_000..=52_000_000).contains(&clock_hz));
        assert!(653 * RATES.sample_hz() < clock_hz);
    }
}
