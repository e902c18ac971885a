//! Burckhardt's law and its published coefficient sets.

use muslip::law::{LawError, Parameter, Peak, TyreLaw, validated};
use muslip::real::Real;

/// mu = c1 (1 - exp(-c2 s)) - c3 s for s >= 0, extended as an odd function.
///
/// Source: M. Burckhardt, "Fahrwerktechnik: Radschlupf-Regelsysteme", Vogel 1993. Parameters, all
/// dimensionless: c1 > 0, c2 > 0, c3 >= 0 and c1 c2 > c3 (friction rises from free rolling).
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
pub struct Burckhardt<T> {
    c1: T,
    c2: T,
    c3: T,
}

/// As read, before validation.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Unchecked<T> {
    c1: T,
    c2: T,
    c3: T,
}

#[cfg(feature = "serde")]
impl<T: Real> TryFrom<Unchecked<T>> for Burckhardt<T> {
    type Error = LawError;

    fn try_from(raw: Unchecked<T>) -> Result<Self, LawError> {
        Self::new(raw.c1, raw.c2, raw.c3)
    }
}

/// A published coefficient set of Burckhardt's law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedSet {
    name: &'static str,
    c1: f64,
    c2: f64,
    c3: f64,
}

/// Dry asphalt; peak friction 1.17 at slip 0.17.
pub const DRY_ASPHALT: PublishedSet = PublishedSet::of("dry_asphalt", 1.2801, 23.99, 0.52);
/// Wet asphalt; peak friction 0.80 at slip 0.13.
pub const WET_ASPHALT: PublishedSet = PublishedSet::of("wet_asphalt", 0.857, 33.822, 0.347);
/// Dry concrete; peak friction 1.09 at slip 0.16.
pub const DRY_CONCRETE: PublishedSet = PublishedSet::of("dry_concrete", 1.1973, 25.168, 0.5373);
/// Dry cobblestone; peak friction 1.00 at slip 0.40.
pub const DRY_COBBLESTONE: PublishedSet =
    PublishedSet::of("dry_cobblestone", 1.3713, 6.4565, 0.6691);
/// Wet cobblestone; peak friction 0.38 at slip 0.14.
pub const WET_COBBLESTONE: PublishedSet =
    PublishedSet::of("wet_cobblestone", 0.4004, 33.7080, 0.1204);
/// Snow; peak friction 0.19 at slip 0.06.
pub const SNOW: PublishedSet = PublishedSet::of("snow", 0.1946, 94.129, 0.0646);
/// Ice; rises to 0.05 and has no maximum.
pub const ICE: PublishedSet = PublishedSet::of("ice", 0.05, 306.39, 0.0);

/// All published sets.
pub const PUBLISHED_SETS: [PublishedSet; 7] = [
    DRY_ASPHALT,
    WET_ASPHALT,
    DRY_CONCRETE,
    DRY_COBBLESTONE,
    WET_COBBLESTONE,
    SNOW,
    ICE,
];

/// The published set of that name (for instance `"dry_asphalt"`), if there is one.
pub fn published_set(name: &str) -> Option<PublishedSet> {
    PUBLISHED_SETS.into_iter().find(|set| set.name == name)
}

impl PublishedSet {
    const fn of(name: &'static str, c1: f64, c2: f64, c3: f64) -> Self {
        Self { name, c1, c2, c3 }
    }

    /// The surface in lower case with underscores.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Coefficients (c1, c2, c3), dimensionless.
    pub const fn coefficients(&self) -> (f64, f64, f64) {
        (self.c1, self.c2, self.c3)
    }

    /// The law with these coefficients.
    pub fn law<T: Real>(&self) -> Burckhardt<T> {
        Burckhardt {
            c1: T::from_f64(self.c1),
            c2: T::from_f64(self.c2),
            c3: T::from_f64(self.c3),
        }
    }
}

impl<T: Real> Burckhardt<T> {
    /// The law with these coefficients, in the ranges that the type states.
    ///
    /// # Errors
    /// [`LawError::NonFinite`] or [`LawError::OutOfRange`], naming the parameter;
    /// [`LawError::NeverRises`] unless c1 c2 > c3.
    pub fn new(c1: T, c2: T, c3: T) -> Result<Self, LawError> {
        let law = Self {
            c1: validated(c1, Parameter::C1, c1 > T::ZERO)?,
            c2: validated(c2, Parameter::C2, c2 > T::ZERO)?,
            c3: validated(c3, Parameter::C3, c3 >= T::ZERO)?,
        };
        if c1 * c2 > c3 {
            Ok(law)
        } else {
            Err(LawError::NeverRises)
        }
    }

    /// Coefficients (c1, c2, c3), dimensionless.
    pub fn coefficients(&self) -> (T, T, T) {
        (self.c1, self.c2, self.c3)
    }
}

/// Magnitude of slip and the sign of an odd function there.
fn mirrored<T: Real>(slip_ratio: T) -> (T, T) {
    if slip_ratio < T::ZERO {
        (-slip_ratio, -T::ONE)
    } else {
        (slip_ratio, T::ONE)
    }
}

impl<T: Real> TyreLaw<T, 3> for Burckhardt<T> {
    const PARAMETER_NAMES: [&'static str; 3] = ["c1", "c2", "c3"];

    fn parameters(&self) -> [T; 3] {
        [self.c1, self.c2, self.c3]
    }

    fn from_parameters(parameters: &[T; 3]) -> Result<Self, LawError> {
        let [c1, c2, c3] = *parameters;
        Self::new(c1, c2, c3)
    }

    fn friction(&self, slip_ratio: T) -> T {
        let (s, sign) = mirrored(slip_ratio);
        let decay = (-(self.c2 * s)).exp();
        sign * (self.c1 * (T::ONE - decay) - self.c3 * s)
    }

    fn slip_derivative(&self, slip_ratio: T) -> T {
        let (s, _) = mirrored(slip_ratio);
        self.c1 * self.c2 * (-(self.c2 * s)).exp() - self.c3
    }

    fn gradient(&self, slip_ratio: T) -> [T; 3] {
        let (s, sign) = mirrored(slip_ratio);
        let decay = (-(self.c2 * s)).exp();
        [
            sign * (T::ONE - decay),
            sign * (self.c1 * s * decay),
            -slip_ratio,
        ]
    }

    fn hessian(&self, slip_ratio: T) -> [[T; 3]; 3] {
        let (s, sign) = mirrored(slip_ratio);
        let decay = (-(self.c2 * s)).exp();
        let c1_c2 = sign * (s * decay);
        let c2_c2 = -sign * (self.c1 * s * s * decay);
        let o = T::ZERO;
        [[o, c1_c2, o], [c1_c2, c2_c2, o], [o, o, o]]
    }

    /// Where c1 c2 exp(-c2 s) = c3, at s = ln(c1 c2/c3)/c2, if that is before lock.
    fn peak(&self) -> Peak<T> {
        if self.c3 > T::ZERO {
            let slip_ratio = (self.c1 * self.c2 / self.c3).ln() / self.c2;
            if slip_ratio <= T::ONE {
                return Peak {
                    friction: self.friction(slip_ratio),
                    slip_ratio,
                    is_maximum: true,
                };
            }
        }
        Peak {
            friction: self.friction(T::ONE),
            slip_ratio: T::ONE,
            is_maximum: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        Burckhardt, DRY_ASPHALT, ICE, LawError, PUBLISHED_SETS, Parameter, TyreLaw, published_set,
    };

    #[test]
    fn every_published_set_is_a_valid_law_and_found_by_its_name() {
        for set in PUBLISHED_SETS {
            let (c1, c2, c3) = set.coefficients();
            assert_eq!(Burckhardt::new(c1, c2, c3), Ok(set.law::<f64>()));
            assert_eq!(published_set(set.name()), Some(set));
        }
        assert_eq!(published_set("lava"), None);
    }

    #[test]
    fn no_slip_has_more_friction_than_the_peak() {
        for set in PUBLISHED_SETS {
            let law = set.law::<f64>();
            let peak = law.peak();
            let highest = (0..=10_000)
                .map(|i| law.friction(f64::from(i) * 1e-4))
                .fold(f64::MIN, f64::max);
            assert!(highest <= peak.friction + 1e-15, "{}", set.name());
            assert!(peak.friction - highest < 1e-4, "{}", set.name());
            assert!(!peak.is_maximum || law.slip_derivative(peak.slip_ratio).abs() < 1e-12);
        }
        assert!(!ICE.law::<f64>().peak().is_maximum);
        assert!((DRY_ASPHALT.law::<f64>().peak().friction - 1.17).abs() < 5e-3);
    }

    #[test]
    fn negative_slip_mirrors_the_curve() {
        let law = DRY_ASPHALT.law::<f64>();
        for s in [0.01, 0.2, 0.9] {
            assert_eq!(law.friction(-s), -law.friction(s));
            assert_eq!(law.slip_derivative(-s), law.slip_derivative(s));
            assert_eq!(law.gradient(-s), law.gradient(s).map(|by| -by));
            let mirrored = law.hessian(s).map(|row| row.map(|by| -by));
            assert_eq!(law.hessian(-s), mirrored);
        }
    }

    #[test]
    fn bad_parameters_are_named() {
        assert_eq!(
            Burckhardt::new(1.0, f64::INFINITY, 0.1),
            Err(LawError::NonFinite(Parameter::C2))
        );
        assert_eq!(
            Burckhardt::new(1.0, 20.0, -0.1),
            Err(LawError::OutOfRange(Parameter::C3))
        );
        assert_eq!(Burckhardt::new(0.1, 2.0, 0.5), Err(LawError::NeverRises));
    }
}
