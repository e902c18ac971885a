//! The motion of the quarter car over one sample, its Jacobian, and the covariance that it leaves.

use muslip::law::TyreLaw;
use muslip::real::Real;
use muslip_laws::Burckhardt;

use super::state::{Covariance, State};

/// What does not change of wheel and vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Vehicle<T> {
    /// Free-rolling radius R of the wheel in m, > 0.
    pub radius_m: T,
    /// Inertia J of the wheel in kg m², > 0.
    pub inertia_kg_m2: T,
    /// Gravity g in m/s², > 0.
    pub gravity_m_s2: T,
}

/// What is known of the road.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Road<T> {
    /// Friction follows this law of slip.
    Known(Burckhardt<T>),
    /// Friction walks at random: it is where it was, give or take the process noise.
    Unknown,
}

/// How wheel and vehicle move; what slip means depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Motion {
    /// Vehicle and wheel move; slip is defined.
    Rolling,
    /// The vehicle moves, the wheel stands: the brake's torque exceeds the tyre's. Slip is 1.
    Locked,
    /// The vehicle is slower than the minimum speed: slip has no meaning.
    Standstill,
}

/// The six entries of F beside its unit and zero entries, and which of its rows apply.
///
/// ```text
///         ω   v   λ   μ   m
/// ω   [   1   .   .   a   b ]     a = Ts R g m/J,   b = Ts R g μ/J     (row all zero where locked)
/// v   [   .   1   .  -c   . ]     c = Ts g
/// λ   [   d   e   .   .   . ]     d = -R/v,         e = R ω/v²         (identity at standstill)
/// μ   [   .   .   f   .   . ]     f = dμ/dλ                            (identity on an unknown road)
/// m   [   .   .   .   .   1 ]
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Jacobian<T> {
    wheel: T,
    a: T,
    b: T,
    c: T,
    slip: SlipRow<T>,
    friction: FrictionRow<T>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum SlipRow<T> {
    OfSpeeds { d: T, e: T },
    Held,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum FrictionRow<T> {
    OfSlip(T),
    Held,
}

/// Where a prediction leads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Predicted<T> {
    pub(super) state: State<T>,
    pub(super) jacobian: Jacobian<T>,
    pub(super) motion: Motion,
}

/// The model: everything that the motion over a sample depends on but state and torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Model<T> {
    pub(super) vehicle: Vehicle<T>,
    pub(super) road: Road<T>,
    pub(super) sample_time_s: T,
    pub(super) minimum_vehicle_speed_m_s: T,
}

impl<T: Real> Model<T> {
    /// How a state moves.
    ///
    /// The brake opposes rotation and cannot turn the wheel backwards: a step that would carry the wheel
    /// through zero ends at zero, locked, and it stays there until the tyre's torque exceeds the brake's.
    #[inline]
    fn motion(&self, state: &State<T>, wheel_after: T) -> Motion {
        if state.vehicle_speed_m_s < self.minimum_vehicle_speed_m_s {
            Motion::Standstill
        } else if wheel_after <= T::ZERO {
            Motion::Locked
        } else {
            Motion::Rolling
        }
    }

    /// State, Jacobian and motion one sample on, under a brake torque in N m.
    #[inline]
    pub(super) fn predicted(&self, state: &State<T>, brake_torque_nm: T) -> Predicted<T> {
        let Vehicle {
            radius_m: r,
            inertia_kg_m2: j,
            gravity_m_s2: g,
        } = self.vehicle;
        let ts = self.sample_time_s;
        let State {
            wheel_speed_rad_s: omega,
            vehicle_speed_m_s: v,
            slip_ratio: lambda,
            friction: mu,
            mass_kg: m,
        } = *state;
        let (friction, friction_row) = match self.road {
            Road::Known(law) => (
                law.friction(lambda),
                FrictionRow::OfSlip(law.slip_derivative(lambda)),
            ),
            Road::Unknown => (mu, FrictionRow::Held),
        };
        // Noise may leave the estimate of a standing wheel below zero; the wheel is not.
        let rolling = omega.max(T::ZERO);
        let wheel_after = rolling + ts / j * (r * g * mu * m - brake_torque_nm);
        let vehicle_after = v - ts * g * mu;
        let c = ts * g;
        let motion = self.motion(state, wheel_after);
        if motion == Motion::Standstill {
            return Predicted {
                state: State {
                    vehicle_speed_m_s: vehicle_after.min(v).max(T::ZERO),
                    ..*state
                },
                jacobian: Jacobian {
                    wheel: T::ONE,
                    a: T::ZERO,
                    b: T::ZERO,
                    c: T::ZERO,
                    slip: SlipRow::Held,
                    friction: FrictionRow::Held,
                },
                motion,
            };
        }
        let (wheel_after, wheel, a, b) = match motion {
            Motion::Rolling => {
                let torque_gain = ts * r * g / j;
                (wheel_after, T::ONE, torque_gain * m, torque_gain * mu)
            }
            _ => (T::ZERO, T::ZERO, T::ZERO, T::ZERO),
        };
        Predicted {
            state: State {
                wheel_speed_rad_s: wheel_after,
                vehicle_speed_m_s: vehicle_after,
                slip_ratio: (v - r * omega) / v,
                friction,
                mass_kg: m,
            },
            jacobian: Jacobian {
                wheel,
                a,
                b,
                c,
                slip: SlipRow::OfSpeeds {
                    d: -(r / v),
                    e: r * omega / (v * v),
                },
                friction: friction_row,
            },
            motion,
        }
    }
}

impl<T: Real> Jacobian<T> {
    /// F P Fᵀ + diag(q) with the structure written out: the upper triangle alone, and no product with an
    /// entry that is 0 or 1 by structure but for ω's own.
    #[inline]
    pub(super) fn propagated(&self, covariance: &Covariance<T>, process: [T; 5]) -> Covariance<T> {
        let Self { wheel, a, b, c, .. } = *self;
        let [row0, row1, row2, row3, row4] = covariance.rows();
        let [q0, q1, q2, q3, q4] = process;
        // A = F P, row by row.
        let a0 = sum(sum(row0, wheel, row3, a), T::ONE, row4, b);
        let a1 = sum(row1, T::ONE, row3, -c);
        let a2 = match self.slip {
            SlipRow::OfSpeeds { d, e } => sum(row0, d, row1, e),
            SlipRow::Held => row2,
        };
        let a3 = match self.friction {
            FrictionRow::OfSlip(f) => row2.map(|value| f * value),
            FrictionRow::Held => row3,
        };
        // P = A Fᵀ: column j of it is row j of F applied along A's rows.
        let onto_vehicle = |row: [T; 5]| row[1] - c * row[3];
        let onto_slip = |row: [T; 5]| match self.slip {
            SlipRow::OfSpeeds { d, e } => d * row[0] + e * row[1],
            SlipRow::Held => row[2],
        };
        let onto_friction = |row: [T; 5]| match self.friction {
            FrictionRow::OfSlip(f) => f * row[2],
            FrictionRow::Held => row[3],
        };
        Covariance {
            p00: wheel * a0[0] + a * a0[3] + b * a0[4] + q0,
            p01: onto_vehicle(a0),
            p02: onto_slip(a0),
            p03: onto_friction(a0),
            p04: a0[4],
            p11: onto_vehicle(a1) + q1,
            p12: onto_slip(a1),
            p13: onto_friction(a1),
            p14: a1[4],
            p22: onto_slip(a2) + q2,
            p23: onto_friction(a2),
            p24: a2[4],
            p33: onto_friction(a3) + q3,
            p34: a3[4],
            p44: row4[4] + q4,
        }
    }

    /// The five rows of F, for analysis.
    pub(super) fn rows(&self) -> [[T; 5]; 5] {
        let (o, i) = (T::ZERO, T::ONE);
        let slip = match self.slip {
            SlipRow::OfSpeeds { d, e } => [d, e, o, o, o],
            SlipRow::Held => [o, o, i, o, o],
        };
        let friction = match self.friction {
            FrictionRow::OfSlip(f) => [o, o, f, o, o],
            FrictionRow::Held => [o, o, o, i, o],
        };
        [
            [self.wheel, o, o, self.a, self.b],
            [o, i, o, -self.c, o],
            slip,
            friction,
            [o, o, o, o, i],
        ]
    }
}

/// x times one row plus y times another.
#[inline]
fn sum<T: Real>(first: [T; 5], x: T, second: [T; 5], y: T) -> [T; 5] {
    let ([a0, a1, a2, a3, a4], [b0, b1, b2, b3, b4]) = (first, second);
    [
        x * a0 + y * b0,
        x * a1 + y * b1,
        x * a2 + y * b2,
        x * a3 + y * b3,
        x * a4 + y * b4,
    ]
}
