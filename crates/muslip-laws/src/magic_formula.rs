//! Pacejka's Magic Formula in its pure longitudinal form, without shifts.

use muslip::law::{LawError, Parameter, Peak, TyreLaw, validated};
use muslip::real::Real;

/// mu = D sin(C atan(B s - E (B s - atan(B s)))).
///
/// Source: H. B. Pacejka, "Tire and Vehicle Dynamics", 3rd ed. 2012, section 4.3. Slip here is the
/// braking slip (v - R ω)/v within 0..=1. Parameters, all dimensionless: B > 0, 0 < C <= 2 (so that the
/// sine's argument stays within ±π), D > 0, E <= 1 (so that the curve has one maximum).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        try_from = "Unchecked<T>",
        bound(deserialize = "T: Real + serde::Deserialize<'de>")
    )
)]
pub struct MagicFormula<T> {
    stiffness_factor: T,
    shape_factor: T,
    peak_factor: T,
    curvature_factor: T,
}

/// As read, before validation.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Unchecked<T> {
    stiffness_factor: T,
    shape_factor: T,
    peak_factor: T,
    curvature_factor: T,
}

#[cfg(feature = "serde")]
impl<T: Real> TryFrom<Unchecked<T>> for MagicFormula<T> {
    type Error = LawError;

    fn try_from(raw: Unchecked<T>) -> Result<Self, LawError> {
        Self::new(
            raw.stiffness_factor,
            raw.shape_factor,
            raw.peak_factor,
            raw.curvature_factor,
        )
    }
}

/// The inner angle θ = atan(y), y = u - E (u - atan u), u = B s, and what its derivatives need.
struct Angle<T> {
    /// B s
    u: T,
    /// atan(B s)
    atan_u: T,
    /// 1/(1 + u²)
    d_atan_u: T,
    /// dy/du
    y_u: T,
    /// y
    y: T,
    /// θ
    theta: T,
    /// dθ/dy
    theta_y: T,
}

impl<T: Real> MagicFormula<T> {
    /// The law with factors B, C, D, E, in the ranges that the type states.
    ///
    /// # Errors
    /// [`LawError::NonFinite`] or [`LawError::OutOfRange`], naming the parameter.
    pub fn new(
        stiffness_factor: T,
        shape_factor: T,
        peak_factor: T,
        curvature_factor: T,
    ) -> Result<Self, LawError> {
        Ok(Self {
            stiffness_factor: validated(
                stiffness_factor,
                Parameter::StiffnessFactor,
                stiffness_factor > T::ZERO,
            )?,
            shape_factor: validated(
                shape_factor,
                Parameter::ShapeFactor,
                shape_factor > T::ZERO && shape_factor <= T::TWO,
            )?,
            peak_factor: validated(peak_factor, Parameter::PeakFactor, peak_factor > T::ZERO)?,
            curvature_factor: validated(
                curvature_factor,
                Parameter::CurvatureFactor,
                curvature_factor <= T::ONE,
            )?,
        })
    }

    /// B, dimensionless.
    pub fn stiffness_factor(&self) -> T {
        self.stiffness_factor
    }

    /// C, dimensionless.
    pub fn shape_factor(&self) -> T {
        self.shape_factor
    }

    /// D, dimensionless.
    pub fn peak_factor(&self) -> T {
        self.peak_factor
    }

    /// E, dimensionless.
    pub fn curvature_factor(&self) -> T {
        self.curvature_factor
    }

    fn angle(&self, slip_ratio: T) -> Angle<T> {
        let e = self.curvature_factor;
        let u = self.stiffness_factor * slip_ratio;
        let atan_u = u.atan();
        let d_atan_u = T::ONE / (T::ONE + u * u);
        let y = u - e * (u - atan_u);
        Angle {
            u,
            atan_u,
            d_atan_u,
            y_u: T::ONE - e + e * d_atan_u,
            y,
            theta: y.atan(),
            theta_y: T::ONE / (T::ONE + y * y),
        }
    }

    /// C θ - π/2: negative before the peak, positive after it, rising with slip.
    fn past_the_peak(&self, slip_ratio: T) -> T {
        let quarter_turn = T::from_f64(core::f64::consts::FRAC_PI_2);
        self.shape_factor * self.angle(slip_ratio).theta - quarter_turn
    }
}

impl<T: Real> TyreLaw<T, 4> for MagicFormula<T> {
    const PARAMETER_NAMES: [&'static str; 4] = [
        "stiffness_factor",
        "shape_factor",
        "peak_factor",
        "curvature_factor",
    ];

    fn parameters(&self) -> [T; 4] {
        [
            self.stiffness_factor,
            self.shape_factor,
            self.peak_factor,
            self.curvature_factor,
        ]
    }

    fn from_parameters(parameters: &[T; 4]) -> Result<Self, LawError> {
        let [b, c, d, e] = *parameters;
        Self::new(b, c, d, e)
    }

    fn friction(&self, slip_ratio: T) -> T {
        let angle = self.angle(slip_ratio);
        self.peak_factor * (self.shape_factor * angle.theta).sin()
    }

    fn slip_derivative(&self, slip_ratio: T) -> T {
        let a = self.angle(slip_ratio);
        let c = self.shape_factor;
        let outer = self.peak_factor * c * (c * a.theta).cos();
        outer * a.theta_y * a.y_u * self.stiffness_factor
    }

    fn gradient(&self, slip_ratio: T) -> [T; 4] {
        let a = self.angle(slip_ratio);
        let (c, d) = (self.shape_factor, self.peak_factor);
        let (sin, cos) = ((c * a.theta).sin(), (c * a.theta).cos());
        let by_theta = d * c * cos;
        [
            by_theta * a.theta_y * a.y_u * slip_ratio,
            d * cos * a.theta,
            sin,
            -(by_theta * a.theta_y * (a.u - a.atan_u)),
        ]
    }

    fn hessian(&self, slip_ratio: T) -> [[T; 4]; 4] {
        let a = self.angle(slip_ratio);
        let (c, d, e, s) = (
            self.shape_factor,
            self.peak_factor,
            self.curvature_factor,
            slip_ratio,
        );
        let (sin, cos) = ((c * a.theta).sin(), (c * a.theta).cos());

        // y by B and E, then θ by chain rule; θ'' = -2 y θ'².
        let y_b = a.y_u * s;
        let y_e = -(a.u - a.atan_u);
        let y_bb = -(T::TWO * e * a.u * a.d_atan_u * a.d_atan_u) * s * s;
        let y_be = -(a.u * a.u * a.d_atan_u) * s;
        let theta_yy = -(T::TWO * a.y * a.theta_y * a.theta_y);
        let theta_b = a.theta_y * y_b;
        let theta_e = a.theta_y * y_e;
        let theta_bb = theta_yy * y_b * y_b + a.theta_y * y_bb;
        let theta_be = theta_yy * y_b * y_e + a.theta_y * y_be;
        let theta_ee = theta_yy * y_e * y_e;

        // mu = D sin(C θ)
        let first = d * c * cos;
        let second = -(d * c * c * sin);
        let mixed_c = d * (cos - c * a.theta * sin);
        let bb = second * theta_b * theta_b + first * theta_bb;
        let be = second * theta_b * theta_e + first * theta_be;
        let ee = second * theta_e * theta_e + first * theta_ee;
        let bc = mixed_c * theta_b;
        let ce = mixed_c * theta_e;
        let cc = -(d * a.theta * a.theta * sin);
        let bd = c * cos * theta_b;
        let cd = cos * a.theta;
        let de = c * cos * theta_e;
        [
            [bb, bc, bd, be],
            [bc, cc, cd, ce],
            [bd, cd, T::ZERO, de],
            [be, ce, de, ee],
        ]
    }

    /// Where C θ = π/2, if that is before lock; by bisection and one Newton step, so not for the loop
    /// of a controller.
    fn peak(&self) -> Peak<T> {
        if self.past_the_peak(T::ONE) <= T::ZERO {
            return Peak {
                friction: self.friction(T::ONE),
                slip_ratio: T::ONE,
                is_maximum: false,
            };
        }
        let (mut low, mut high) = (T::ZERO, T::ONE);
        // 60 halvings exhaust f64; f32 stops by itself.
        for _ in 0..60 {
            let middle = T::HALF * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.past_the_peak(middle) < T::ZERO {
                low = middle;
            } else {
                high = middle;
            }
        }
        // The step carries derivatives, which bisection loses, into a scalar that has them.
        let a = self.angle(high);
        let slope = self.shape_factor * a.theta_y * a.y_u * self.stiffness_factor;
        let slip_ratio = high - self.past_the_peak(high) / slope;
        Peak {
            friction: self.friction(slip_ratio),
            slip_ratio,
            is_maximum: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{LawError, MagicFormula, Parameter, TyreLaw};

    #[test]
    fn the_peak_is_the_peak_factor_where_the_slope_vanishes() {
        for (b, c, d, e) in [
            (10.0_f64, 1.9, 1.0_f64, 0.97_f64),
            (12.0, 2.0, 0.82, -0.5),
            (4.0, 1.65, 1.1, -10.0),
        ] {
            let law = MagicFormula::new(b, c, d, e).unwrap();
            let peak = law.peak();
            assert!(peak.is_maximum);
            assert!((peak.friction - d).abs() < 1e-14);
            assert!(law.slip_derivative(peak.slip_ratio).abs() < 1e-12);

            let single = MagicFormula::new(b as f32, c as f32, d as f32, e as f32).unwrap();
            assert!((single.peak().slip_ratio - peak.slip_ratio as f32).abs() < 1e-5);
        }
    }

    #[test]
    fn a_curve_that_rises_until_lock_has_its_peak_there() {
        let peak = MagicFormula::new(5.0, 0.9, 1.0_f64, 0.0).unwrap().peak();
        assert_eq!((peak.slip_ratio, peak.is_maximum), (1.0, false));
    }

    #[test]
    fn the_law_is_odd_in_slip() {
        let law = MagicFormula::new(10.0_f32, 1.9, 1.0, 0.97).unwrap();
        for s in [0.01, 0.12, 0.5, 1.0] {
            assert_eq!(law.friction(-s), -law.friction(s));
            assert_eq!(law.slip_derivative(-s), law.slip_derivative(s));
        }
    }

    #[test]
    fn bad_parameters_are_named() {
        let refused = |b, c, d, e| MagicFormula::new(b, c, d, e).unwrap_err();
        assert_eq!(
            refused(0.0, 1.9, 1.0, 0.9),
            LawError::OutOfRange(Parameter::StiffnessFactor)
        );
        assert_eq!(
            refused(10.0, 2.1, 1.0, 0.9),
            LawError::OutOfRange(Parameter::ShapeFactor)
        );
        assert_eq!(
            refused(10.0, 1.9, -1.0, 0.9),
            LawError::OutOfRange(Parameter::PeakFactor)
        );
        assert_eq!(
            refused(10.0, 1.9, 1.0, f64::NAN),
            LawError::NonFinite(Parameter::CurvatureFactor)
        );
    }
}
