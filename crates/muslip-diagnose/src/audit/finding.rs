//! What is said of the measuring chain: one entry of `chain`.

use serde::Serialize;

/// The contract's word for what a channel does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// Reports later than another channel.
    Late,
    /// Passes a filter slower than the other channels'.
    LowPassed,
    /// Errs with a memory.
    ColouredNoise,
    /// Errs together with another channel.
    CommonNoise,
    /// Moves in steps.
    Quantised,
    /// Is renewed more slowly than recorded.
    Held,
    /// Is off by a factor.
    Scale,
    /// Is off by a constant.
    Zero,
    /// Moves though nothing happens.
    Drifts,
    /// Carries a narrow line.
    Hum,
    /// Varies with the wheel's angle.
    Ripple,
    /// Has a clock of its own.
    Clock,
    /// Reproduces the drag without the tyre law.
    Leaks,
}

/// One finding of `chain` in `diagnosis.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Path of the recording, `*` for all.
    pub recording: String,
    /// Header of the column that it is about.
    pub channel: String,
    /// Header of the column that it is stated against; empty where there is none.
    pub relative_to: String,
    /// The contract's word.
    pub finding: Word,
    /// Size, in `unit`.
    pub value: f64,
    /// Standard deviation of `value`.
    pub std: f64,
    /// Unit, in ASCII.
    pub unit: String,
    /// One sentence for an engineer.
    pub statement: String,
}

impl Finding {
    /// A finding of all recordings, stated against nothing.
    #[must_use]
    pub fn of(channel: &str, finding: Word, (value, std): (f64, f64), unit: &str) -> Self {
        Self {
            recording: "*".to_owned(),
            channel: channel.to_owned(),
            relative_to: String::new(),
            finding,
            value,
            std,
            unit: unit.to_owned(),
            statement: String::new(),
        }
    }

    /// The same with its sentence.
    #[must_use]
    pub fn saying(mut self, statement: String) -> Self {
        self.statement = statement;
        self
    }
}

/// By how much a channel is later than the drag channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Delay in s, positive later.
    pub value: f64,
    /// Standard deviation in s; infinite where nothing is known.
    pub std: f64,
}

impl Default for Timing {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

impl Timing {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self {
        value: 0.0,
        std: f64::INFINITY,
    };

    /// Two statements of one delay as one; where they contradict each other, as uncertain as they differ.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        if !(self.std.is_finite() && other.std.is_finite()) {
            return if self.std.is_finite() { self } else { other };
        }
        let (a, b) = (self.std.powi(-2), other.std.powi(-2));
        let value = (a * self.value + b * other.value) / (a + b);
        // Birge's ratio of two: their difference against what it should be.
        let ratio = (self.value - other.value).abs() / self.std.hypot(other.std);
        Self {
            value,
            std: (a + b).powf(-0.5) * ratio.max(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_that_agree_are_surer_and_two_that_do_not_are_not() {
        let at = |value: f64| Timing { value, std: 1e-3 };
        let agree = at(0.010).with(at(0.0105));
        assert!((agree.value - 0.01025).abs() < 1e-9 && agree.std < 1e-3);
        assert!(at(0.010).with(at(0.030)).std > 5e-3);
        assert_eq!(at(0.01).with(Timing::UNKNOWN), at(0.01));
    }
}
