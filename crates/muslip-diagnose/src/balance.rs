//! The balances of the base simulation.

/// A balance of the base simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Balance {
    /// drag = normal · mu(slip)
    Tyre,
    /// J dω/dt = R·drag − brake torque
    Wheel,
    /// m dv/dt = −drag
    Vehicle,
}

impl Balance {
    /// Channel of a recording that shows what is missing in it.
    #[must_use]
    pub fn channel(self) -> &'static str {
        match self {
            Self::Tyre => "drag_force_n",
            Self::Wheel => "wheel_speed_rad_s",
            Self::Vehicle => "vehicle_speed_m_s",
        }
    }
    /// The contract's word.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Tyre => "tyre",
            Self::Wheel => "wheel",
            Self::Vehicle => "vehicle",
        }
    }
}
