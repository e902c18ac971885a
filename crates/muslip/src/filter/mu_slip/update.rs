//! The arithmetic of one update, once, and the two free functions that use it.

use super::config::CovarianceForm;
use super::error::{Input, UpdateError};
use super::state::{Covariance, Estimate, State};
use crate::filter::Decision;
use crate::law::{Expansion, expand};
use crate::real::Real;

/// What one measurement did. All dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Fusion<T> {
    /// Slip s of the measurement.
    pub slip_ratio: T,
    /// Measured friction z.
    pub measured_friction: T,
    /// Predicted friction mu(s; x) at the prior state.
    pub predicted_friction: T,
    /// Innovation: measured minus predicted.
    pub innovation: T,
    /// R: the inflated measurement variance plus the pseudonoise.
    pub noise_variance: T,
    /// The pseudonoise alone; zero where it is switched off.
    pub pseudonoise_variance: T,
    /// H P Hᵀ with the covariance before the update.
    pub signal_before: T,
    /// H P Hᵀ with the covariance after the update and the same H; as before where rejected.
    pub signal_after: T,
    /// H P Hᵀ + R, the variance of the innovation.
    pub innovation_variance: T,
    /// K of peak friction.
    pub peak_friction_gain: T,
    /// K of critical slip.
    pub critical_slip_gain: T,
    /// Normalised innovation squared, innovation² / (H P Hᵀ + R).
    pub nis: T,
    /// Whether the measurement changed the estimate.
    pub decision: Decision,
}

/// The choices of configuration that change the arithmetic. Constants where they are known: the
/// compiler then drops what is not asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Choices {
    pub pseudonoise: bool,
    pub covariance_form: CovarianceForm,
}

/// The article's.
const ARTICLE: Choices = Choices {
    pseudonoise: true,
    covariance_form: CovarianceForm::Short,
};

/// One update, computed but not yet judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<T> {
    pub state: State<T>,
    pub covariance: Covariance<T>,
    pub fusion: Fusion<T>,
}

/// One measurement as the arithmetic takes it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Inputs<T> {
    pub state: State<T>,
    pub covariance: Covariance<T>,
    pub slip_ratio: T,
    /// The reading expected at `state`.
    pub expected: Expansion<T>,
    pub friction: T,
    /// (n σ)²
    pub measurement_variance: T,
}

impl<T: Real> Inputs<T> {
    /// A measurement that reads the law itself at a slip.
    #[inline(always)]
    pub(super) fn of_the_law(
        state: State<T>,
        covariance: Covariance<T>,
        slip_ratio: T,
        friction: T,
        measurement_variance: T,
    ) -> Self {
        Self {
            state,
            covariance,
            slip_ratio,
            expected: expand(state.peak_friction, state.critical_slip, slip_ratio),
            friction,
            measurement_variance,
        }
    }

    /// The equations of the module, unrolled. Two divisions, no calls.
    #[inline(always)]
    pub(super) fn step(&self, choices: Choices) -> Step<T> {
        let State {
            peak_friction,
            critical_slip,
        } = self.state;
        let Covariance { p00, p01, p11 } = self.covariance;
        let law = self.expected;
        let (h0, h1) = (law.by_peak_friction, law.by_critical_slip);

        let pseudonoise = if choices.pseudonoise {
            let second = T::HALF * law.by_critical_slip_twice;
            p11 * (law.by_both * law.by_both * p00 + second * second * p11)
        } else {
            T::ZERO
        };
        let noise = self.measurement_variance + pseudonoise;

        // g = P Hᵀ
        let g0 = p00 * h0 + p01 * h1;
        let g1 = p01 * h0 + p11 * h1;
        let signal = h0 * g0 + h1 * g1;
        let innovation_variance = signal + noise;
        let inverse = T::ONE / innovation_variance;
        let (k0, k1) = (g0 * inverse, g1 * inverse);

        let innovation = self.friction - law.friction;
        let state = State {
            peak_friction: peak_friction + k0 * innovation,
            critical_slip: critical_slip + k1 * innovation,
        };
        let covariance = match choices.covariance_form {
            // K H P = K gᵀ, which is symmetric. Both products on the diagonal are squares times a
            // positive number, so rounding cannot raise a variance.
            CovarianceForm::Short => Covariance {
                p00: p00 - k0 * g0,
                p01: p01 - k0 * g1,
                p11: p11 - k1 * g1,
            },
            CovarianceForm::Joseph => {
                // A = I - K H, M = A P, then M Aᵀ + K R Kᵀ
                let (a00, a01) = (T::ONE - k0 * h0, -(k0 * h1));
                let (a10, a11) = (-(k1 * h0), T::ONE - k1 * h1);
                let (m00, m01) = (a00 * p00 + a01 * p01, a00 * p01 + a01 * p11);
                let (m10, m11) = (a10 * p00 + a11 * p01, a10 * p01 + a11 * p11);
                Covariance {
                    p00: m00 * a00 + m01 * a01 + k0 * k0 * noise,
                    p01: m00 * a10 + m01 * a11 + k0 * k1 * noise,
                    p11: m10 * a10 + m11 * a11 + k1 * k1 * noise,
                }
            }
        };
        let fusion = Fusion {
            slip_ratio: self.slip_ratio,
            measured_friction: self.friction,
            predicted_friction: law.friction,
            innovation,
            noise_variance: noise,
            pseudonoise_variance: pseudonoise,
            signal_before: signal,
            // H (I - K H) P Hᵀ = signal (1 - signal/(signal + R)), without the cancellation
            signal_after: signal * noise * inverse,
            innovation_variance,
            peak_friction_gain: k0,
            critical_slip_gain: k1,
            nis: innovation * innovation * inverse,
            decision: Decision::Accepted,
        };
        Step {
            state,
            covariance,
            fusion,
        }
    }

    /// The step if state and covariance may be kept.
    ///
    /// Results are judged rather than inputs: an input that is not finite makes a result that is not
    /// finite, except a noise that is infinite, which shows in the innovation's variance. Only a
    /// refusal takes the time to find out why.
    #[inline(always)]
    pub(super) fn judged(&self, step: Step<T>) -> Result<Step<T>, UpdateError> {
        let variance = step.fusion.innovation_variance;
        let (definite, product) = step.covariance.pivots();
        // A sum is finite only if each term is.
        let all = step.state.peak_friction + step.state.critical_slip + variance + product;
        let sound = self.measurement_variance > T::ZERO
            && variance > T::ZERO
            && definite
            && all.is_finite();
        if sound { Ok(step) } else { Err(self.reason()) }
    }

    #[cold]
    #[inline(never)]
    fn reason(&self) -> UpdateError {
        let p = self.covariance;
        if !self.state.is_finite() {
            UpdateError::NonFinite(Input::State)
        } else if !(p.p00.is_finite() && p.p01.is_finite() && p.p11.is_finite()) {
            UpdateError::NonFinite(Input::Covariance)
        } else if !self.slip_ratio.is_finite() {
            UpdateError::NonFinite(Input::SlipRatio)
        } else if !self.friction.is_finite() {
            UpdateError::NonFinite(Input::Friction)
        } else if !self.measurement_variance.is_finite() {
            UpdateError::NonFinite(Input::Noise)
        } else if self.measurement_variance <= T::ZERO {
            UpdateError::NonPositiveNoise
        } else if !p.is_positive_definite() {
            UpdateError::PriorNotPositiveDefinite
        } else {
            let step = self.step(ARTICLE);
            if step.state.is_finite() && step.fusion.innovation_variance.is_finite() {
                UpdateError::PosteriorNotPositiveDefinite
            } else {
                UpdateError::Overflow
            }
        }
    }
}

/// Corrects state and covariance with one measured friction: the article's filter, lean.
///
/// | argument | symbol | unit | valid range |
/// |---|---|---|---|
/// | `state` | x = (mup, sp) | - | finite |
/// | `covariance` | P, 2×2 | - | positive definite |
/// | `slip_ratio` | s | - | finite; 0..=1 is meant |
/// | `friction` | z | - | finite |
/// | `measurement_variance` | (n σ)² | - | > 0; inflation included, pseudonoise not |
///
/// Equations: see the [module](crate::filter::mu_slip). Covariance: short form. Innovation is measured minus
/// predicted. Cost: two divisions, no loops, no calls.
///
/// # Errors
/// [`UpdateError`]; nothing is changed, as state and covariance are the caller's.
///
/// ```
/// use muslip::filter::mu_slip::{Range, update};
///
/// let (mut x, mut p) = (Range::Aircraft.initial_state(), Range::Aircraft.initial_covariance());
/// let variance = (3.0_f32 * 0.04) * (3.0 * 0.04);
/// for (slip, friction) in [(0.05, 0.21), (0.10, 0.32), (0.15, 0.35), (0.30, 0.28)] {
///     (x, p) = update(x, p, slip, friction, variance)?;
/// }
/// assert!((x.peak_friction - 0.35).abs() < 2.0 * p.peak_friction_std());
/// # Ok::<(), muslip::filter::mu_slip::UpdateError>(())
/// ```
#[inline]
pub fn update<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) -> Result<(State<T>, Covariance<T>), UpdateError> {
    let inputs = Inputs::of_the_law(
        state,
        covariance,
        slip_ratio,
        friction,
        measurement_variance,
    );
    let step = inputs.judged(inputs.step(ARTICLE))?;
    Ok((step.state, step.covariance))
}

/// [`update`] with one division and without a check, for the loop of a controller that checks its inputs.
///
/// All is scaled by powers of d = s² + sp², so that only the variance of the innovation is divided by:
/// with h = d² H, ½ d³ ∂²mu/∂sp² = c and b = d² ∂²mu/∂mup∂sp
///
/// ```text
/// S d⁶ = d² (h P hᵀ + b² P11 P22 + (n σ)² d⁴) + (c P22)²
/// ```
///
/// Equal to [`update`] but for rounding. In `f32` S d⁶ keeps its precision for s or sp above 1e-4.
/// Arguments and ranges are those of [`update`]; what is outside them spoils the result, and nothing
/// tells.
#[inline]
#[must_use]
pub fn update_unchecked<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) -> (State<T>, Covariance<T>) {
    let State {
        peak_friction: mup,
        critical_slip: sp,
    } = state;
    let Covariance { p00, p01, p11 } = covariance;
    // The order of the lines is the compiler's order, near enough: no result is used by the next
    // instruction, which on a Cortex-M4F costs a cycle each time (docs/design/0006). The law first.
    let ss = slip_ratio * slip_ratio;
    let twice = slip_ratio + slip_ratio;
    let arm = twice * sp;
    let pp = sp * sp;
    let difference = ss - pp;
    let twice_difference = difference + difference;
    let b = twice * difference;
    let h1 = mup * b;
    let p01_h1 = h1 * p01;
    let d = pp + ss;
    let h0 = d * arm;
    let b_p00 = b * p00;
    let p01_h0 = h0 * p01;
    let dd = d * d;
    let p00_h0 = p00 * h0;
    let scaled_friction = friction * dd;
    let p11_h1 = p11 * h1;
    let b_p11 = b * p11;
    let both = b_p00 * b_p11;
    let predicted = mup * h0;
    // sp² - 3 s² = -(d + 2 (s² - sp²)), and its sign is squared away.
    let bend = d + twice_difference;
    let arm_bend = arm * bend;
    let c = arm_bend * mup;
    let g1 = p11_h1 + p01_h0;
    let g0 = p01_h1 + p00_h0;
    let signal_0 = h0 * g0;
    let dddd = dd * dd;
    let noise = measurement_variance * dddd;
    let signal_1 = g1 * h1;
    let innovation = scaled_friction - predicted;
    let cp = c * p11;
    let scaled = dd * (((signal_1 + both) + signal_0) + noise) + cp * cp;
    let gain = dd / scaled;
    let (k1, k0) = (gain * g1, g0 * gain);
    let move_1 = k1 * innovation;
    let (less_01, less_11, less_00) = (g1 * k0, k1 * g1, k0 * g0);
    let move_0 = innovation * k0;
    (
        State {
            peak_friction: mup + move_0,
            critical_slip: sp + move_1,
        },
        Covariance {
            p00: p00 - less_00,
            p01: p01 - less_01,
            p11: p11 - less_11,
        },
    )
}

/// [`update`], bit for bit, with what it did.
///
/// # Errors
/// As for [`update`].
#[inline]
pub fn update_reporting<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) -> Result<(Estimate<T>, Fusion<T>), UpdateError> {
    let inputs = Inputs::of_the_law(
        state,
        covariance,
        slip_ratio,
        friction,
        measurement_variance,
    );
    let step = inputs.judged(inputs.step(ARTICLE))?;
    let estimate = Estimate {
        state: step.state,
        covariance: step.covariance,
    };
    Ok((estimate, step.fusion))
}

/// [`update_reporting`] of a measurement that does not read the law at its slip but something made of it
/// (behind a low-pass filter, say), which `expected` predicts at the prior state.
///
/// `slip_ratio` is reported and not computed with. With [`Rudd::expansion`](crate::law::Rudd::expansion)
/// of the prior state it is [`update_reporting`], bit for bit.
///
/// # Errors
/// As for [`update`]; [`UpdateError::NonFinite`] of [`Input::Expected`] if `expected` is not finite.
#[inline]
pub fn update_expecting<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    slip_ratio: T,
    expected: Expansion<T>,
    friction: T,
    measurement_variance: T,
) -> Result<(Estimate<T>, Fusion<T>), UpdateError> {
    if !expected.is_finite() {
        return Err(UpdateError::NonFinite(Input::Expected));
    }
    let inputs = Inputs {
        state,
        covariance,
        slip_ratio,
        expected,
        friction,
        measurement_variance,
    };
    let step = inputs.judged(inputs.step(ARTICLE))?;
    let estimate = Estimate {
        state: step.state,
        covariance: step.covariance,
    };
    Ok((estimate, step.fusion))
}
