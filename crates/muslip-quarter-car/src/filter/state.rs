use muslip::real::Real;

/// The state x = (ω, v, λ, μ, m).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State<T> {
    /// Wheel speed ω in rad/s.
    pub wheel_speed_rad_s: T,
    /// Vehicle speed v in m/s.
    pub vehicle_speed_m_s: T,
    /// Slip λ, dimensionless: the slip of one sample ago, as the model has it. For the slip of now see
    /// [`Filter::slip_ratio`](super::Filter::slip_ratio).
    pub slip_ratio: T,
    /// Friction μ, dimensionless.
    pub friction: T,
    /// Quarter mass m in kg.
    pub mass_kg: T,
}

/// Standard deviations of the five states, each in its state's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StateStd<T> {
    /// Of wheel speed, rad/s.
    pub wheel_speed_rad_s: T,
    /// Of vehicle speed, m/s.
    pub vehicle_speed_m_s: T,
    /// Of slip, dimensionless.
    pub slip_ratio: T,
    /// Of friction, dimensionless.
    pub friction: T,
    /// Of the mass, kg.
    pub mass_kg: T,
}

/// The covariance P of the state: the 15 numbers of its upper triangle, symmetric by construction.
///
/// `pij` is the covariance of states i and j in the order ω, v, λ, μ, m; its unit is the product of
/// theirs. It may be singular: the tutorial starts with zero.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(missing_docs, reason = "one rule names all fifteen")]
pub struct Covariance<T> {
    pub p00: T,
    pub p01: T,
    pub p02: T,
    pub p03: T,
    pub p04: T,
    pub p11: T,
    pub p12: T,
    pub p13: T,
    pub p14: T,
    pub p22: T,
    pub p23: T,
    pub p24: T,
    pub p33: T,
    pub p34: T,
    pub p44: T,
}

/// State and covariance together: all that the filter carries from one sample to the next but for the
/// last reading.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    /// The state.
    pub state: State<T>,
    /// Its covariance.
    pub covariance: Covariance<T>,
}

impl<T: Real> State<T> {
    /// The five numbers in the order ω, v, λ, μ, m.
    #[inline]
    pub fn to_array(self) -> [T; 5] {
        [
            self.wheel_speed_rad_s,
            self.vehicle_speed_m_s,
            self.slip_ratio,
            self.friction,
            self.mass_kg,
        ]
    }

    /// From the five numbers in the order ω, v, λ, μ, m.
    #[inline]
    pub fn from_array(array: [T; 5]) -> Self {
        let [
            wheel_speed_rad_s,
            vehicle_speed_m_s,
            slip_ratio,
            friction,
            mass_kg,
        ] = array;
        Self {
            wheel_speed_rad_s,
            vehicle_speed_m_s,
            slip_ratio,
            friction,
            mass_kg,
        }
    }

    /// True where all five are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.to_array().iter().all(|value| value.is_finite())
    }
}

impl<T: Real> StateStd<T> {
    /// All zero: the state is taken as known.
    pub const ZERO: Self = Self {
        wheel_speed_rad_s: T::ZERO,
        vehicle_speed_m_s: T::ZERO,
        slip_ratio: T::ZERO,
        friction: T::ZERO,
        mass_kg: T::ZERO,
    };

    /// The five numbers in the order ω, v, λ, μ, m.
    #[inline]
    pub fn to_array(self) -> [T; 5] {
        [
            self.wheel_speed_rad_s,
            self.vehicle_speed_m_s,
            self.slip_ratio,
            self.friction,
            self.mass_kg,
        ]
    }

    /// Their squares.
    #[inline]
    pub fn variances(self) -> [T; 5] {
        self.to_array().map(T::squared)
    }

    /// True where all five are finite and none is negative.
    pub fn is_valid(&self) -> bool {
        self.to_array()
            .iter()
            .all(|value| value.is_finite() && *value >= T::ZERO)
    }
}

impl<T: Real> Covariance<T> {
    /// All zero.
    pub const ZERO: Self = Self {
        p00: T::ZERO,
        p01: T::ZERO,
        p02: T::ZERO,
        p03: T::ZERO,
        p04: T::ZERO,
        p11: T::ZERO,
        p12: T::ZERO,
        p13: T::ZERO,
        p14: T::ZERO,
        p22: T::ZERO,
        p23: T::ZERO,
        p24: T::ZERO,
        p33: T::ZERO,
        p34: T::ZERO,
        p44: T::ZERO,
    };

    /// Uncorrelated, from standard deviations in the states' units.
    pub fn from_std(std: StateStd<T>) -> Self {
        let [p00, p11, p22, p33, p44] = std.variances();
        Self {
            p00,
            p11,
            p22,
            p33,
            p44,
            ..Self::ZERO
        }
    }

    /// The five variances in the order ω, v, λ, μ, m.
    #[inline]
    pub fn variances(&self) -> [T; 5] {
        [self.p00, self.p11, self.p22, self.p33, self.p44]
    }

    /// The five standard deviations; NaN where a variance is negative.
    pub fn std(&self) -> StateStd<T> {
        let [wheel, vehicle, slip, friction, mass] = self.variances().map(T::sqrt);
        StateStd {
            wheel_speed_rad_s: wheel,
            vehicle_speed_m_s: vehicle,
            slip_ratio: slip,
            friction,
            mass_kg: mass,
        }
    }

    /// The five rows, which are the columns as well.
    #[inline]
    pub fn rows(&self) -> [[T; 5]; 5] {
        [
            [self.p00, self.p01, self.p02, self.p03, self.p04],
            [self.p01, self.p11, self.p12, self.p13, self.p14],
            [self.p02, self.p12, self.p22, self.p23, self.p24],
            [self.p03, self.p13, self.p23, self.p33, self.p34],
            [self.p04, self.p14, self.p24, self.p34, self.p44],
        ]
    }

    /// From five rows, of which the upper triangle is read.
    #[inline]
    pub fn from_rows(rows: [[T; 5]; 5]) -> Self {
        let [
            [p00, p01, p02, p03, p04],
            [_, p11, p12, p13, p14],
            [_, _, p22, p23, p24],
            [_, _, _, p33, p34],
            [_, _, _, _, p44],
        ] = rows;
        Self {
            p00,
            p01,
            p02,
            p03,
            p04,
            p11,
            p12,
            p13,
            p14,
            p22,
            p23,
            p24,
            p33,
            p34,
            p44,
        }
    }

    /// True where all is finite and no variance is negative.
    pub fn is_valid(&self) -> bool {
        self.rows()
            .iter()
            .all(|row| row.iter().all(|value| value.is_finite()))
            && self.variances().iter().all(|value| *value >= T::ZERO)
    }

    /// `self` plus `share` times (`other` plus d dᵀ): one term of a mixture, d being the other's mean less
    /// the mixture's.
    pub(crate) fn plus_spread(&self, other: &Self, difference: [T; 5], share: T) -> Self {
        let mut rows = self.rows();
        for ((row, others), d_row) in rows.iter_mut().zip(other.rows()).zip(difference) {
            for ((value, theirs), d_column) in row.iter_mut().zip(others).zip(difference) {
                *value += share * (theirs + d_row * d_column);
            }
        }
        Self::from_rows(rows)
    }
}
