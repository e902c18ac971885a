//! The article's statements about its equations, asked of the core crate.

use muslip::filter::mu_slip::{Covariance, State, UpdateError, update_reporting};
use muslip::law::{LawError, Rudd, TyreLaw};
use muslip_analysis::fit::Curve;

/// H = (∂mu/∂mup, ∂mu/∂sp) of the core's law.
///
/// # Errors
/// [`LawError`] where the curve is no tyre's.
pub fn gradient(curve: Curve, slip_ratio: f64) -> Result<(f64, f64), LawError> {
    let law = Rudd::new(curve.peak_friction, curve.critical_slip)?;
    let [by_peak, by_slip] = law.gradient(slip_ratio);
    Ok((by_peak, by_slip))
}

/// The two slips, below and above the peak, where |∂mu/∂mup| = |∂mu/∂sp|:
/// sp √((mup - sp)/(mup + sp)) and its mirror image about sp. None where mup <= sp.
pub fn equal_sensitivity_slips(curve: Curve) -> Option<(f64, f64)> {
    let Curve {
        peak_friction: mup,
        critical_slip: sp,
    } = curve;
    (mup > sp).then(|| {
        let ratio = ((mup - sp) / (mup + sp)).sqrt();
        (sp * ratio, sp / ratio)
    })
}

/// The slip below the peak where ∂mu/∂sp is most negative: (√2 - 1) sp.
pub fn slip_of_extremum(curve: Curve) -> f64 {
    (std::f64::consts::SQRT_2 - 1.0) * curve.critical_slip
}

/// One update in which a single state is measured directly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectMeasurement {
    /// H P Hᵀ over R.
    pub signal_to_noise: f64,
    /// Gain of the state measured.
    pub gain: f64,
    /// Its variance after the update over that before.
    pub shrinkage: f64,
    /// The other state's variance after the update over that before.
    pub other_shrinkage: f64,
}

/// Measures at the peak of an estimate whose states are not correlated: there H = (1, 0), so that peak
/// friction is measured directly.
///
/// `variance` is that of peak friction before; `measurement_variance` includes the inflation.
///
/// # Errors
/// [`UpdateError`] where a variance is out of range.
pub fn direct_measurement(
    curve: Curve,
    variance: f64,
    measurement_variance: f64,
) -> Result<DirectMeasurement, UpdateError> {
    let prior = Covariance {
        p00: variance,
        p01: 0.0,
        p11: 0.04 * curve.critical_slip * curve.critical_slip,
    };
    let state = State {
        peak_friction: curve.peak_friction,
        critical_slip: curve.critical_slip,
    };
    let (posterior, fusion) = update_reporting(
        state,
        prior,
        curve.critical_slip,
        curve.peak_friction,
        measurement_variance,
    )?;
    Ok(DirectMeasurement {
        signal_to_noise: fusion.signal_before / fusion.noise_variance,
        gain: fusion.peak_friction_gain,
        shrinkage: posterior.covariance.p00 / prior.p00,
        other_shrinkage: posterior.covariance.p11 / prior.p11,
    })
}
