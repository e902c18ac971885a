//! The lower bits of a register, where the rest is reserved or not asked for.

/// The lower 16.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the lower bits are what is asked for"
)]
pub const fn low_u16(bits: u32) -> u16 {
    bits as u16
}

/// The lower 8.
#[cfg(all(target_os = "none", feature = "stm32f405"))]
pub const fn low_u8(bits: u16) -> u8 {
    low_byte(bits as u32)
}

/// The lower 8 of a wider register.
#[cfg(target_os = "none")]
#[expect(
    clippy::cast_possible_truncation,
    reason = "the lower bits are what is asked for"
)]
pub const fn low_byte(bits: u32) -> u8 {
    bits as u8
}
