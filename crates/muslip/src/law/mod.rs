//! Tyre laws: friction as a function of slip.
//!
//! [`TyreLaw`] is what every law offers, [`Rudd`] the filter's own; Burckhardt's and the Magic Formula are
//! in the crate `muslip-laws`.
//!
//! Every law is odd in slip: for negative slip (a driven wheel, or noise around free rolling) friction
//! is minus that of the mirrored slip. Constructors validate; a law that exists is a usable one.

mod error;
mod rudd;

pub use error::{LawError, Parameter, validated};
pub(crate) use rudd::expand;
pub use rudd::{Expansion, Rudd};

use crate::real::Real;

/// The largest friction that a law reaches while braking, slip 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Peak<T> {
    /// Friction at the peak, dimensionless.
    pub friction: T,
    /// Slip at the peak, dimensionless, within 0..=1.
    pub slip_ratio: T,
    /// True where the curve has its maximum there; false where it still rises at the locked wheel and
    /// the peak is merely the end of the range.
    pub is_maximum: bool,
}

/// A tyre law with `N` parameters.
///
/// | item | symbol | shape | unit |
/// |---|---|---|---|
/// | [`friction`](TyreLaw::friction) | mu(s; θ) | scalar | - |
/// | [`slip_derivative`](TyreLaw::slip_derivative) | ∂mu/∂s | scalar | - |
/// | [`gradient`](TyreLaw::gradient) | ∂mu/∂θ | N | 1/unit of θ |
/// | [`hessian`](TyreLaw::hessian) | ∂²mu/∂θ∂θ | N×N, symmetric | 1/unit of θ squared |
///
/// Slip is dimensionless and positive when braking. A slip that is not finite gives a result that is
/// not finite; nothing panics.
pub trait TyreLaw<T: Real, const N: usize>: Copy {
    /// Names of the parameters in the order of [`TyreLaw::parameters`].
    const PARAMETER_NAMES: [&'static str; N];

    /// The parameters θ.
    fn parameters(&self) -> [T; N];

    /// The law with these parameters.
    ///
    /// # Errors
    /// [`LawError`] naming the first parameter that is not finite or outside its range.
    fn from_parameters(parameters: &[T; N]) -> Result<Self, LawError>;

    /// Friction at a slip.
    fn friction(&self, slip_ratio: T) -> T;

    /// Derivative of friction with respect to slip.
    fn slip_derivative(&self, slip_ratio: T) -> T;

    /// First derivatives of friction with respect to the parameters.
    fn gradient(&self, slip_ratio: T) -> [T; N];

    /// Second derivatives of friction with respect to the parameters, row by row.
    fn hessian(&self, slip_ratio: T) -> [[T; N]; N];

    /// The largest friction over slip 0..=1 and where it lies.
    fn peak(&self) -> Peak<T>;
}
