//! What came of predicting one run from the others.

/// A repaired model is worse where its mean squared error exceeds the base's by more than this share.
const WORSE: f64 = 0.01;

/// One run left out and predicted.
#[derive(Clone, Debug, Default)]
pub(super) struct Fold {
    /// The run left out.
    pub(super) run: String,
    /// What was said of the others.
    pub(super) told: String,
    /// Mean squared errors in N², not a number where nothing was predicted.
    pub(super) repaired: f64,
    pub(super) base: f64,
    /// Names that work through the force, surer than a half.
    pub(super) sure: usize,
}

impl Fold {
    /// Mean squared error of the repaired model over the base's.
    pub(super) fn ratio(&self) -> f64 {
        if self.repaired == 0.0 && self.base == 0.0 {
            1.0
        } else {
            self.repaired / self.base
        }
    }

    /// Also where one of the two predicts nothing.
    pub(super) fn worse(&self) -> bool {
        self.ratio().is_nan() || self.ratio() > 1.0 + WORSE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fold_is_worse_by_one_per_cent_or_without_a_prediction() {
        let fold = |repaired: f64, base: f64| Fold {
            repaired,
            base,
            ..Fold::default()
        };
        assert!(!fold(1.009, 1.0).worse());
        assert!(fold(1.011, 1.0).worse());
        assert!(fold(f64::NAN, 1.0).worse());
        assert!(!fold(0.0, 0.0).worse());
    }
}
