//! The arithmetic of one update: in full, with what is told of it, and lean.

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

    /// The equations of the module, unrolled, with all that is told of them. Two divisions, no calls.
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

/// One update by [`lean`], computed but not yet judged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lean<T> {
    pub state: State<T>,
    pub covariance: Covariance<T>,
    /// P11' S d⁶.
    positive: T,
    /// P12'² and the smallest product; NaN where a state or P11' S d⁶ is not finite.
    least_product: T,
    /// P11' P22' less its rounding.
    safe_product: T,
}

/// The article's choices with one division.
///
/// All is scaled by powers of d = s² + sp², so that only the variance of the innovation is divided by:
/// with h = d² H, ½ d³ ∂²mu/∂sp² = c and b = d² ∂²mu/∂mup∂sp
///
/// ```text
/// S d⁶ = d² (h P hᵀ + b² P11 P22 + (n σ)² d⁴) + (c P22)²
/// ```
///
/// Equal to [`Inputs::step`] but for rounding, as long as S d⁶ is a number of full precision: in `f32` for s or sp
/// above some 0.01. Below, the step in full takes over.
#[inline(always)]
pub(super) fn lean<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) -> Lean<T> {
    let State {
        peak_friction: mup,
        critical_slip: sp,
    } = state;
    let Covariance { p00, p01, p11 } = covariance;
    let least = Covariance::<T>::smallest_product();
    let margin = Covariance::<T>::margin();
    // The order of the lines is the compiler's order, near enough: few results are used by the next
    // instruction, which on a Cortex-M4F costs a cycle each time (docs/design/0006).
    let ss = slip_ratio * slip_ratio;
    let twice = slip_ratio + slip_ratio;
    let pp = sp * sp;
    let difference = ss - pp;
    let b = twice * difference;
    let h1 = mup * b;
    let d = pp + ss;
    let twice_difference = difference + difference;
    let p01_h1 = h1 * p01;
    let b_p11 = b * p11;
    let arm = twice * sp;
    let h0 = d * arm;
    let p00_h0 = p00 * h0;
    let dd = d * d;
    let predicted = mup * h0;
    let p11_h1 = p11 * h1;
    let scaled_friction = friction * dd;
    let innovation = scaled_friction - predicted;
    // sp² - 3 s² = -(d + 2 (s² - sp²)), and its sign is squared away.
    let bend = d + twice_difference;
    let dddd = dd * dd;
    let arm_bend = arm * bend;
    let b_p00 = b * p00;
    let both = b_p00 * b_p11;
    let c = arm_bend * mup;
    let p01_h0 = h0 * p01;
    let g1 = p11_h1 + p01_h0;
    let signal_1 = g1 * h1;
    let g0 = p01_h1 + p00_h0;
    let signal_and_both = signal_1 + both;
    let signal_0 = h0 * g0;
    let signal_and_pseudonoise = signal_and_both + signal_0;
    let noise = measurement_variance * dddd;
    let variance = signal_and_pseudonoise + noise;
    let scaled_variance = dd * variance;
    let cp = c * p11;
    let cp_cp = cp * cp;
    let scaled = scaled_variance + cp_cp;
    let gain = dd / scaled;
    let k1 = gain * g1;
    let k0 = g0 * gain;
    let less_01 = g1 * k0;
    let less_11 = k1 * g1;
    let next_p11 = p11 - less_11;
    let less_00 = k0 * g0;
    let next_p00 = p00 - less_00;
    let product = next_p00 * next_p11;
    let move_0 = innovation * k0;
    let next_p01 = p01 - less_01;
    let move_1 = k1 * innovation;
    let square = next_p01 * next_p01;
    let above_square = square + least;
    let next_mup = mup + move_0;
    let positive = next_p00 * scaled;
    let next_sp = sp + move_1;
    let states = next_mup + next_sp;
    let all = states + positive;
    let zero = all.zero_if_finite();
    let least_product = above_square + zero;
    let safe_product = product * margin;
    Lean {
        state: State {
            peak_friction: next_mup,
            critical_slip: next_sp,
        },
        covariance: Covariance {
            p00: next_p00,
            p01: next_p01,
            p11: next_p11,
        },
        positive,
        least_product,
        safe_product,
    }
}

impl<T: Real> Lean<T> {
    /// Whether it may be kept, of a prior that might be and a noise that is a positive number.
    ///
    /// What is not sound may still be so by [`Inputs::step`], which scales nothing. What is sound is so there, but for
    /// rounding: of a prior that is finite and positive definite
    ///
    /// | what is refused | where it shows |
    /// |---|---|
    /// | slip or noise not finite, or so large that a power of d overflows | S d⁶ is not finite |
    /// | friction not finite, a state that overflows | a state is not finite |
    /// | S not positive, or S d⁶ so small that it has lost digits | P11' S d⁶ is not above the smallest: with S < 0 variances grow, so that the two are never negative at once |
    /// | P11' not positive | the same, as S is |
    /// | P' not positive definite | as in [`Covariance::is_positive_definite`]; P11' P22' is finite as variances do not grow |
    #[inline(always)]
    pub(super) fn is_sound(&self) -> bool {
        self.least_product < self.safe_product
            && self.positive > Covariance::<T>::smallest_product()
    }
}

/// One update by the lean arithmetic without a check, for the cost table and the throughput example: an
/// input outside the ranges of [`Inputs`] makes the result wrong without an error.
#[doc(hidden)]
#[inline]
#[must_use]
pub fn update_unchecked<T: Real>(
    state: State<T>,
    covariance: Covariance<T>,
    slip_ratio: T,
    friction: T,
    measurement_variance: T,
) -> (State<T>, Covariance<T>) {
    let lean = lean(
        state,
        covariance,
        slip_ratio,
        friction,
        measurement_variance,
    );
    (lean.state, lean.covariance)
}

/// One update of any state and covariance, with what it did, for the study of the article and the tests: a
/// filter checks its start when it is built, this checks it at every call.
///
/// `measurement_variance` is (n σ)², > 0: inflation included, pseudonoise not.
///
/// # Errors
/// [`UpdateError`]; nothing is changed, as state and covariance are the caller's.
#[doc(hidden)]
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
