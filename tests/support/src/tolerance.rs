//! How close two numbers must be, in one form everywhere: `absolute + relative * magnitude`.

/// A tolerance; the magnitude is the larger of the two numbers compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// In the unit of what is compared.
    pub absolute: f64,
    /// Dimensionless.
    pub relative: f64,
}

impl Tolerance {
    /// Absolute alone.
    pub const fn absolute(absolute: f64) -> Self {
        Self {
            absolute,
            relative: 0.0,
        }
    }

    /// Relative alone.
    pub const fn relative(relative: f64) -> Self {
        Self {
            absolute: 0.0,
            relative,
        }
    }

    /// True where the two are equal or within the tolerance; false where either is NaN.
    pub fn holds(self, got: f64, expected: f64) -> bool {
        let magnitude = got.abs().max(expected.abs());
        got == expected || (got - expected).abs() <= self.absolute + self.relative * magnitude
    }

    /// Fails the test unless the two are within the tolerance.
    ///
    /// # Panics
    /// Naming `what` and both numbers.
    #[track_caller]
    pub fn check(self, what: &str, got: f64, expected: f64) {
        assert!(
            self.holds(got, expected),
            "{what}: got {got:e}, expected {expected:e}, off by {:e}, allowed {self:?}",
            (got - expected).abs(),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::Tolerance;

    #[test]
    fn nan_is_close_to_nothing() {
        let loose = Tolerance {
            absolute: 1e9,
            relative: 1.0,
        };
        assert!(!loose.holds(f64::NAN, f64::NAN));
        assert!(!loose.holds(1.0, f64::NAN));
    }

    #[test]
    fn the_two_parts_add() {
        let both = Tolerance {
            absolute: 0.5,
            relative: 0.01,
        };
        assert!(both.holds(101.4, 100.0));
        assert!(!both.holds(101.6, 100.0));
    }
}
