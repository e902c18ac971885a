//! What the STM32 boards share: peripherals that are the same in all of them, at the addresses of their tables.
//!
//! Sections are RM0090's (STM32F4); RM0440 (STM32G4) has the same registers with the same bits.

#[cfg(target_os = "none")]
pub mod bridge;
#[cfg(target_os = "none")]
pub mod bus;
pub mod encoders;
pub mod flash;
pub mod outputs;
#[cfg(target_os = "none")]
pub mod rig;
pub mod watchdog;

/// Calls `condition` until it holds, at most `limit` times; whether it did. Every wait on hardware is one of
/// these: QEMU lacks bits that silicon has, and silicon fails.
pub fn wait_for(limit: u32, mut condition: impl FnMut() -> bool) -> bool {
    (0..limit).any(|_| condition())
}

/// Value of a USART's BRR at 16-fold oversampling (RM0090, 30.3.4): clock / baud, rounded; its lower four bits are
/// the fraction. Receivers allow some 3 %.
pub const fn baud_divisor(clock_hz: u32, baud: u32) -> u16 {
    crate::bits::low_u16((clock_hz + baud / 2) / baud)
}

/// Voltage in mV behind a converter's 12 bits, whose full scale is so many mV.
pub const fn millivolt(code: u16, full_scale_mv: u32) -> u16 {
    crate::bits::low_u16(code as u32 * full_scale_mv / 4096)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_ends_with_its_condition_or_its_limit() {
        let mut calls = 0;
        assert!(wait_for(10, || {
            calls += 1;
            calls == 4
        }));
        assert_eq!(calls, 4);
        assert!(!wait_for(10, || false));
    }

    #[test]
    fn converters_read_in_millivolts() {
        assert_eq!(millivolt(0, 36_300), 0);
        assert_eq!(millivolt(2708, 36_300), 23_999);
        assert!(millivolt(4095, 36_300) < 36_300);
        assert_eq!(millivolt(2048, 3_300), 1_650);
        assert_eq!(millivolt(4095, 3_300), 3_299);
    }
}
