//! Which parts of the slip axis hold an outlier.

use super::bins::Bins;
use crate::real::{QUARTER_BINADES, Real};

/// Most samples of a bin that may be left out for an outlier among them: of more, the good ones are worth
/// more than the outlier costs.
pub(super) const MOST_SAMPLES: f64 = 8.0;
/// Residual, in noise variances, beyond which the only sample of a bin is an outlier.
const CONVICTED: f64 = 15.0;
/// The same where the noise is larger than declared noise can be: then outliers are certain.
const CONVICTED_IF_CONTAMINATED: f64 = 9.0;
/// Learnt over declared noise variance from which outliers are certain: noise is declared to ±50 %, a factor
/// of four in variance, and 41 samples scatter by the rest.
const CONTAMINATED: f64 = 5.5;
/// More for each other sample of the bin.
const CONVICTED_MORE: f64 = 3.0;
/// Mean of the chi-square distribution of one degree of freedom over its median.
const MEAN_OVER_MEDIAN: f64 = 2.2;
/// Noise over declared noise that the judgement allows.
const NOISE_FACTORS: (f64, f64) = (0.15, 4.0);

/// Leaves out the bins whose residual is beyond what noise makes, and takes in again those whose is not.
///
/// The noise is read off the median over bins, of which outliers would have to be half to spoil it.
/// `noise_factor` is the learnt noise variance over the declared one, `unit`.
#[cold]
#[inline(never)]
pub(super) fn judge<T: Real>(
    bins: &mut Bins<T>,
    peak_friction: T,
    critical_slip: T,
    noise_factor: T,
    unit: T,
) {
    let mut residuals = [T::ZERO; QUARTER_BINADES];
    let mut sorted = [T::ZERO; QUARTER_BINADES];
    let (mut seen, mut terms) = (0, T::ZERO);
    let twice = peak_friction * (critical_slip + critical_slip);
    let square = critical_slip * critical_slip;
    for (index, kept) in residuals.iter_mut().enumerate() {
        let bin = bins.get(index);
        if bin.count <= T::ZERO {
            continue;
        }
        let middle = T::middle_of_quarter_binade(index);
        *kept = bin.residual(twice / (middle * middle + square));
        insert(&mut sorted, seen, *kept / bin.count);
        seen += 1;
        terms += T::ONE;
    }
    let Some(&median) = sorted.get(seen / 2) else {
        return;
    };
    // The median of few is uncertain.
    let few = T::ONE + T::TWO / terms.max(T::ONE);
    let (least, most) = NOISE_FACTORS;
    let noise = (T::from_f64(MEAN_OVER_MEDIAN) * few * median)
        .max(T::from_f64(least) * unit)
        .min(T::from_f64(most) * unit);
    let alone = if noise_factor > T::from_f64(CONTAMINATED) {
        CONVICTED_IF_CONTAMINATED
    } else {
        CONVICTED
    };
    bins.left_out = 0;
    for (index, &residual) in residuals.iter().enumerate() {
        let count = bins.get(index).count;
        let allowed = T::from_f64(alone) + T::from_f64(CONVICTED_MORE) * (count - T::ONE);
        if count <= T::from_f64(MOST_SAMPLES) && residual > noise * allowed {
            bins.left_out |= 1 << index;
        }
    }
}

/// Inserts a value into the first `length` values, which are in rising order.
fn insert<T: Real>(sorted: &mut [T], length: usize, value: T) {
    let mut place = length;
    while let Some([before, here]) = place
        .checked_sub(1)
        .and_then(|low| sorted.get_mut(low..=place))
    {
        *here = value;
        if *before <= value {
            return;
        }
        core::mem::swap(before, here);
        place -= 1;
    }
    if let Some(first) = sorted.first_mut() {
        *first = value;
    }
}
