//! Figures that registers are set from.

use muslip_control::rates::Rates;

/// Core clock in Hz once the PLL runs.
pub const CORE_HZ: u32 = 168_000_000;
/// Core clock in Hz of the internal oscillator, before that and where the crystal fails.
pub const HSI_HZ: u32 = 16_000_000;
/// Clock of APB1's peripherals at full core clock, in Hz.
pub const APB1_HZ: u32 = 42_000_000;
/// Clock of APB2's peripherals at full core clock, in Hz.
pub const APB2_HZ: u32 = 84_000_000;
/// Bits a second of the log on USART1.
pub const LOG_BAUD: u32 = 921_600;
/// Frequency of the proportional valve's PWM in Hz.
pub const VALVE_PWM_HZ: u32 = 2_000;
/// TIM1's clock divided by this keeps a period of that PWM within 16 bits.
pub const VALVE_PWM_PRESCALER: u32 = 4;
/// Steps of a period of that PWM.
pub const VALVE_PWM_PERIOD: u32 = CORE_HZ / VALVE_PWM_PRESCALER / VALVE_PWM_HZ;
/// A thousand samples a second; edges are stamped by timers of APB1, which run at twice its clock.
pub const RATES: Rates = Rates::new(1_000, 2 * APB1_HZ);
/// Core cycles from one sample to the next.
pub const CYCLES_PER_SAMPLE: u32 = CORE_HZ / RATES.sample_hz();

/// ADC_CCR's ADCPRE (RM0090, 13.13.16): APB2 divided by 4. By 2 it would be above the converter's limit.
pub const ADC_DIVIDER_BITS: u32 = 0b01;

/// PLL from an 8 MHz crystal: M, N, P, Q.
pub const PLL: [u32; 4] = [8, 336, 2, 7];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stm32::baud_divisor;

    #[test]
    fn the_pll_makes_the_core_clock_and_48_mhz_within_its_limits() {
        let [m, n, p, q] = PLL;
        let input = 8_000_000 / m;
        assert!((1_000_000..=2_000_000).contains(&input));
        let vco = input * n;
        assert!((100_000_000..=432_000_000).contains(&vco));
        assert_eq!(vco / p, CORE_HZ);
        assert_eq!(vco / q, 48_000_000);
        assert_eq!(CORE_HZ / 4, APB1_HZ);
        assert_eq!(CORE_HZ / 2, APB2_HZ);
    }

    #[test]
    fn both_uarts_come_near_their_baud_also_on_the_internal_oscillator() {
        for (clock, most) in [(APB1_HZ, 0.01), (APB2_HZ, 0.01), (HSI_HZ, 0.022)] {
            let actual = f64::from(clock) / f64::from(baud_divisor(clock, 921_600));
            assert!((actual / 921_600.0 - 1.0).abs() < most, "{actual}");
        }
        // A mantissa of 0 is none.
        assert!(baud_divisor(HSI_HZ, 921_600) >= 16);
    }

    #[test]
    fn the_supplys_converter_runs_within_its_limits() {
        // Data sheet DS8626, table 67: 0.6 to 36 MHz at 3.3 V.
        let divider = 2 * (ADC_DIVIDER_BITS + 1);
        assert!((600_000..=36_000_000).contains(&(APB2_HZ / divider)));
    }
}
