//! How large an effect on wheel or vehicle is beside the noise.
//!
//! Sample by sample a differenced speed is all noise, and its slow noise is so small that effects far below anything
//! that matters would be significant: sizes are compared as means over [`EFFECT_SPAN_S`].

use crate::fit::Problem;

/// Span of the means in s.
const EFFECT_SPAN_S: f64 = 0.05;
/// Smallest effect worth naming, root mean square, in standard deviations of such means.
pub const LEAST_EFFECT: f64 = 0.15;

/// Means over [`EFFECT_SPAN_S`] of a column on the usable stretches of a problem.
#[must_use]
pub fn means(part: &Problem<'_>, of: impl Fn(usize) -> Vec<f64>) -> Vec<f64> {
    let mut out = Vec::new();
    for &run in part.runs {
        let column = of(run);
        let length = ((EFFECT_SPAN_S / part.data.series[run].typical_dt) as usize).max(1);
        for segment in part.segments(run) {
            out.extend(
                column[segment.clone()]
                    .chunks_exact(length)
                    .map(|c| c.iter().sum::<f64>() / length as f64),
            );
        }
    }
    out
}

/// Root mean square; zero of nothing.
#[must_use]
pub fn root_mean_square(all: &[f64]) -> f64 {
    (all.iter().map(|x| x * x).sum::<f64>() / all.len().max(1) as f64).sqrt()
}
