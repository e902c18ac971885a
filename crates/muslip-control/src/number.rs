//! Conversions between numbers that may lose something, each with what it loses.

/// The nearest `f32`: exact below 2^24, within one part in 2^24 above.
#[expect(
    clippy::cast_precision_loss,
    reason = "loses what the name says, which no use of it can see"
)]
pub const fn nearest(value: u32) -> f32 {
    value as f32
}

/// The same of a number with sign. Codes of 24 bits and their differences are exact.
#[expect(
    clippy::cast_precision_loss,
    reason = "loses what the name says, which no use of it can see"
)]
pub const fn nearest_signed(value: i32) -> f32 {
    value as f32
}

/// The whole part, held within 0..=65,535; NaN is 0.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a conversion from f32 saturates"
)]
pub const fn whole_u16(value: f32) -> u16 {
    value as u16
}

/// The whole part, held within 0..=2^32 - 1; NaN is 0.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a conversion from f32 saturates"
)]
pub const fn whole_u32(value: f32) -> u32 {
    value as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_from_f32_saturate_and_nan_is_0() {
        for (value, expected) in [
            (-1.0, 0),
            (0.9, 0),
            (65_534.9, 65_534),
            (1e9, u16::MAX),
            (f32::NAN, 0),
        ] {
            assert_eq!(whole_u16(value), expected);
        }
        assert_eq!(whole_u32(-1.0), 0);
        assert_eq!(whole_u32(f32::INFINITY), u32::MAX);
        assert_eq!(nearest_signed(-(1 << 24)), -16_777_216.0);
        assert_eq!(nearest(84_000_000), 84e6);
    }
}
