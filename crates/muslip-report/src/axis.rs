//! Axes: what range they cover and where they are ticked.

/// How values are laid out along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By their logarithm; values at or below zero are left out.
    Logarithmic,
}

/// What range an axis covers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Extent {
    /// All that is drawn, less outliers among the points.
    #[default]
    Automatic,
    /// As [`Extent::Automatic`], and at least down or up to this value.
    Including(f64),
    /// Exactly this.
    Fixed(f64, f64),
}

/// An axis of a figure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// What is along the axis, with its unit.
    pub label: String,
    /// Range covered.
    pub extent: Extent,
    /// Even or logarithmic.
    pub scale: Scale,
}

impl Axis {
    /// An even axis over whatever is drawn.
    pub fn new(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// The same axis over another range.
    pub fn over(self, extent: Extent) -> Self {
        Self { extent, ..self }
    }

    /// The same axis, logarithmic.
    pub fn logarithmic(self) -> Self {
        Self {
            scale: Scale::Logarithmic,
            ..self
        }
    }

    /// A value's position before scaling to the paper; `None` where the axis has no place for it.
    pub(super) fn position(&self, value: f64) -> Option<f64> {
        match self.scale {
            Scale::Linear => Some(value),
            Scale::Logarithmic => (value > 0.0).then(|| value.log10()),
        }
        .filter(|position| position.is_finite())
    }

    /// The values at two positions.
    pub(super) fn values(&self, (low, high): (f64, f64)) -> (f64, f64) {
        match self.scale {
            Scale::Linear => (low, high),
            Scale::Logarithmic => (10f64.powf(low), 10f64.powf(high)),
        }
    }
}

/// Ticks of an axis from `low` to `high` (positions), about `count` of them, with their labels.
pub(super) fn ticks(scale: Scale, low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    match scale {
        Scale::Linear => linear_ticks(low, high, count),
        Scale::Logarithmic => logarithmic_ticks(low, high, count),
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let rough = (high - low) / count.max(1) as f64;
    let magnitude = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|multiple| multiple * magnitude)
        .find(|step| *step >= 0.999 * rough)
        .unwrap_or(rough);
    let sound = step.is_finite() && step > 0.0 && low.is_finite() && high.is_finite();
    if !sound {
        return Vec::new();
    }
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let large = low.abs().max(high.abs()) >= 1e6;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last)
        .map(|index| {
            let value = index as f64 * step;
            let label = if large {
                format!("{value:e}")
            } else {
                format!("{value:.decimals$}").replace('-', "\u{2212}")
            };
            (value, label)
        })
        .collect()
}

/// Powers of ten, thinned where there are many; 2 and 5 between where there are few.
fn logarithmic_ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let decades = high - low;
    let stride = (decades / count.max(1) as f64).ceil().max(1.0) as i32;
    let multiples: &[f64] = if decades < 2.2 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let (first, last) = (low.floor() as i32, high.ceil() as i32);
    (first..=last)
        .filter(|decade| decade.rem_euclid(stride) == 0)
        .flat_map(|decade| {
            multiples
                .iter()
                .map(move |multiple| multiple * 10f64.powi(decade))
        })
        .map(|value| (value.log10(), value))
        .filter(|(position, _)| (low - 1e-9..=high + 1e-9).contains(position))
        .map(|(position, value)| {
            let label = if (1e-4..1e7).contains(&value) {
                format!("{value}")
            } else {
                format!("{value:e}")
            };
            (position, label)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, low: f64, high: f64, count: usize) -> Vec<String> {
        ticks(scale, low, high, count)
            .into_iter()
            .map(|(_, label)| label)
            .collect()
    }

    #[test]
    fn linear_ticks_are_round_and_within_the_range() {
        assert_eq!(
            labels(Scale::Linear, 0.0, 1.0, 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            labels(Scale::Linear, -0.05, 0.31, 4),
            ["0.0", "0.1", "0.2", "0.3"]
        );
        assert_eq!(
            labels(Scale::Linear, -12.0, 12.0, 4),
            ["\u{2212}10", "0", "10"]
        );
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        assert_eq!(
            labels(Scale::Logarithmic, 0.0, 3.2, 5),
            ["1", "10", "100", "1000"]
        );
        assert_eq!(
            labels(Scale::Logarithmic, 0.0, 1.6, 6),
            ["1", "2", "5", "10", "20"]
        );
    }

    #[test]
    fn ranges_without_sense_have_no_ticks_and_do_not_hang() {
        for (low, high) in [
            (0.0, 0.0),
            (f64::NAN, 1.0),
            (0.0, f64::INFINITY),
            (1.0, 0.0),
        ] {
            assert!(ticks(Scale::Linear, low, high, 5).len() < 3);
        }
    }
}
