//! The rig itself: a braked wheel on a vehicle, and the scheme that moves them on.
//!
//! ```text
//! J dω/dt = R drag - brake torque - further torques
//! m dv/dt = -drag - further forces            (only where the vehicle coasts)
//! drag    = normal force · friction(slip) · effects,     slip = (v - R ω)/v
//! ```
//!
//! Scheme: the two-stage Rosenbrock method ROS2 (J. G. Verwer et al., SIAM J. Sci. Comput. 20 (1999)
//! 1456-1480) with fixed step h and γ = 1 - 1/√2,
//!
//! ```text
//! (I - γ h A) k1 = f(y)
//! (I - γ h A) k2 = f(y + h k1) - 2 k1
//! y(t + h)       = y + 3/2 h k1 + 1/2 h k2
//! ```
//!
//! It is of second order whatever the matrix A, and L-stable where A is the Jacobian. The wheel's rate
//! is R² N mu'(slip)/(J v), which has no bound as v goes to zero: an explicit scheme rings there with
//! any fixed step, this one does not. Past the peak mu' is negative and the motion is truly unstable;
//! there A takes mu' = 0, which keeps the order and never makes the matrix singular. The brake torque is
//! held over a step at its value in the middle.
//!
//! A friction brake opposes rotation and cannot turn the wheel backwards: a step that ends below zero
//! ends at exactly zero, and a locked wheel stays at exactly zero until the tyre's torque exceeds the
//! brake's. Below [`STANDSTILL_M_S`] the vehicle stands.

use super::law::RigLaw;
use muslip::sample::slip_ratio;

/// Below this speed in m/s the vehicle stands still and no tyre force is left.
pub const STANDSTILL_M_S: f64 = 0.05;

/// γ = 1 - 1/√2, the smaller of the two values for which ROS2 is L-stable.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// What does not change during a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantParameters {
    /// Free-rolling radius R in m.
    pub radius_m: f64,
    /// Wheel inertia J in kg m2.
    pub inertia_kg_m2: f64,
    /// Translating mass m in kg.
    pub mass_kg: f64,
    /// True where only the modelled forces slow the vehicle, false where its speed is held.
    pub coasting: bool,
    /// The tyre law.
    pub law: RigLaw,
}

/// Where the rig is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantState {
    /// Time in s.
    pub time_s: f64,
    /// Wheel speed ω in rad/s, never negative.
    pub wheel_speed_rad_s: f64,
    /// Vehicle speed v in m/s, never negative.
    pub vehicle_speed_m_s: f64,
    /// Distance run in m.
    pub distance_m: f64,
    /// Angle turned by the wheel in rad.
    pub wheel_angle_rad: f64,
}

/// What the tyre meets at an instant; what an effect may depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Slip, 0 rolling freely, 1 locked.
    pub slip_ratio: f64,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: f64,
    /// Wheel speed in rad/s.
    pub wheel_speed_rad_s: f64,
    /// Normal force in N.
    pub normal_force_n: f64,
    /// Time in s.
    pub time_s: f64,
    /// Distance run in m.
    pub distance_m: f64,
}

/// Something beyond the three balances: how it acts, and how its own state moves on.
///
/// All methods have a default that does nothing, so that an effect states only what it does. Forces are
/// evaluated several times a step and must depend on the arguments and the effect's state alone;
/// [`PlantEffect::advance`] is called once, after the step.
pub trait PlantEffect {
    /// Factor on the tyre's friction.
    fn friction_factor(&self, _contact: &Contact) -> f64 {
        1.0
    }
    /// Force in N that slows the vehicle beside the tyre.
    fn vehicle_force_n(&self, _contact: &Contact) -> f64 {
        0.0
    }
    /// Torque in N m that slows the wheel beside the brake.
    fn wheel_torque_nm(&self, _contact: &Contact) -> f64 {
        0.0
    }
    /// Moves the effect's own state on by a step of `dt_s` seconds.
    fn advance(&mut self, _contact: &Contact, _drag_n: f64, _dt_s: f64) {}
}

/// The rig in motion.
pub struct Plant {
    parameters: PlantParameters,
    state: PlantState,
    effects: Vec<Box<dyn PlantEffect>>,
}

impl Plant {
    /// A wheel rolling freely at a vehicle speed in m/s.
    pub fn rolling(parameters: PlantParameters, vehicle_speed_m_s: f64) -> Self {
        Self {
            state: PlantState {
                time_s: 0.0,
                wheel_speed_rad_s: vehicle_speed_m_s / parameters.radius_m,
                vehicle_speed_m_s,
                distance_m: 0.0,
                wheel_angle_rad: 0.0,
            },
            parameters,
            effects: Vec::new(),
        }
    }

    /// Adds an effect beyond the three balances.
    pub fn add_effect(&mut self, effect: Box<dyn PlantEffect>) {
        self.effects.push(effect);
    }

    /// Where the rig is now.
    pub fn state(&self) -> PlantState {
        self.state
    }

    /// True once the vehicle has come to rest.
    pub fn stands(&self) -> bool {
        self.state.vehicle_speed_m_s < STANDSTILL_M_S
    }

    /// What the tyre meets now, under a normal force in N.
    pub fn contact(&self, normal_force_n: f64) -> Contact {
        self.contact_at(
            [self.state.wheel_speed_rad_s, self.state.vehicle_speed_m_s],
            normal_force_n,
        )
    }

    fn contact_at(&self, [omega, v]: [f64; 2], normal_force_n: f64) -> Contact {
        let rolling = slip_ratio(omega, v, self.parameters.radius_m);
        let slip_ratio = rolling.filter(|_| v >= STANDSTILL_M_S).unwrap_or(0.0);
        Contact {
            slip_ratio,
            vehicle_speed_m_s: v,
            wheel_speed_rad_s: omega,
            normal_force_n,
            time_s: self.state.time_s,
            distance_m: self.state.distance_m,
        }
    }

    /// Drag of the tyre in N.
    pub fn drag_n(&self, contact: &Contact) -> f64 {
        if contact.vehicle_speed_m_s < STANDSTILL_M_S {
            return 0.0;
        }
        contact.normal_force_n
            * self.parameters.law.friction(contact.slip_ratio)
            * self.friction_factor(contact)
    }

    fn friction_factor(&self, contact: &Contact) -> f64 {
        self.effects
            .iter()
            .map(|effect| effect.friction_factor(contact))
            .product()
    }

    fn vehicle_force_n(&self, contact: &Contact) -> f64 {
        self.effects
            .iter()
            .map(|effect| effect.vehicle_force_n(contact))
            .sum()
    }

    fn wheel_torque_nm(&self, contact: &Contact) -> f64 {
        self.effects
            .iter()
            .map(|effect| effect.wheel_torque_nm(contact))
            .sum()
    }

    /// Moves on by `dt_s` seconds under a brake torque in N m and a normal force in N, both taken as
    /// constant over the step.
    pub fn step(&mut self, dt_s: f64, brake_torque_nm: f64, normal_force_n: f64) {
        let before = self.state;
        let contact = self.contact(normal_force_n);
        let drag = self.drag_n(&contact);
        let [omega, v] = if self.stands() {
            [0.0, before.vehicle_speed_m_s]
        } else if self.stays_locked(&contact, drag, brake_torque_nm) {
            [0.0, self.locked_step(dt_s, &contact, drag)]
        } else {
            self.rosenbrock_step(dt_s, brake_torque_nm, normal_force_n)
        };
        let v = if v < STANDSTILL_M_S { 0.0 } else { v };
        let omega = if v == 0.0 { 0.0 } else { omega.max(0.0) };
        self.state = PlantState {
            time_s: before.time_s + dt_s,
            wheel_speed_rad_s: omega,
            vehicle_speed_m_s: v,
            distance_m: before.distance_m + 0.5 * dt_s * (before.vehicle_speed_m_s + v),
            wheel_angle_rad: before.wheel_angle_rad
                + 0.5 * dt_s * (before.wheel_speed_rad_s + omega),
        };
        for effect in &mut self.effects {
            effect.advance(&contact, drag, dt_s);
        }
    }

    fn stays_locked(&self, contact: &Contact, drag_n: f64, brake_torque_nm: f64) -> bool {
        contact.wheel_speed_rad_s == 0.0
            && self.parameters.radius_m * drag_n <= brake_torque_nm + self.wheel_torque_nm(contact)
    }

    /// The vehicle alone, by the explicit midpoint rule: nothing is stiff while the wheel is locked.
    fn locked_step(&self, dt_s: f64, contact: &Contact, drag_n: f64) -> f64 {
        let PlantParameters {
            mass_kg, coasting, ..
        } = self.parameters;
        let v = contact.vehicle_speed_m_s;
        if !coasting {
            return v;
        }
        let halfway = v - 0.5 * dt_s * (drag_n + self.vehicle_force_n(contact)) / mass_kg;
        let contact = self.contact_at([0.0, halfway], contact.normal_force_n);
        v - dt_s * (self.drag_n(&contact) + self.vehicle_force_n(&contact)) / mass_kg
    }

    /// Right-hand sides (dω/dt, dv/dt).
    fn rates(&self, y: [f64; 2], brake_torque_nm: f64, normal_force_n: f64) -> [f64; 2] {
        let PlantParameters {
            radius_m,
            inertia_kg_m2,
            mass_kg,
            coasting,
            ..
        } = self.parameters;
        let contact = self.contact_at(y, normal_force_n);
        let drag = self.drag_n(&contact);
        let torque = radius_m * drag - brake_torque_nm - self.wheel_torque_nm(&contact);
        let deceleration = if coasting {
            (drag + self.vehicle_force_n(&contact)) / mass_kg
        } else {
            0.0
        };
        [torque / inertia_kg_m2, -deceleration]
    }

    fn rosenbrock_step(&self, h: f64, brake_torque_nm: f64, normal_force_n: f64) -> [f64; 2] {
        let y = [self.state.wheel_speed_rad_s, self.state.vehicle_speed_m_s];
        let contact = self.contact_at(y, normal_force_n);
        let PlantParameters {
            radius_m,
            inertia_kg_m2,
            mass_kg,
            coasting,
            law,
        } = self.parameters;
        // d drag / d(ω, v), with the unstable branch left to the explicit part.
        let stiffness = normal_force_n
            * law.slip_derivative(contact.slip_ratio).max(0.0)
            * self.friction_factor(&contact);
        let [omega, v] = y;
        let drag_by = [
            -stiffness * radius_m / v,
            stiffness * radius_m * omega / (v * v),
        ];
        let by_wheel = radius_m / inertia_kg_m2;
        let by_vehicle = if coasting { -1.0 / mass_kg } else { 0.0 };
        // I - γ h A, A = (R/J, -1/m) ⊗ drag_by: rank one, so the inverse is Sherman and Morrison's.
        let scale = 1.0 - GAMMA * h * (by_wheel * drag_by[0] + by_vehicle * drag_by[1]);
        let solve = |r: [f64; 2]| {
            let along = GAMMA * h * (drag_by[0] * r[0] + drag_by[1] * r[1]) / scale;
            [r[0] + by_wheel * along, r[1] + by_vehicle * along]
        };
        let k1 = solve(self.rates(y, brake_torque_nm, normal_force_n));
        let ahead = [omega + h * k1[0], v + h * k1[1]];
        let f2 = self.rates(ahead, brake_torque_nm, normal_force_n);
        let k2 = solve([f2[0] - 2.0 * k1[0], f2[1] - 2.0 * k1[1]]);
        [
            omega + h * (1.5 * k1[0] + 0.5 * k2[0]),
            v + h * (1.5 * k1[1] + 0.5 * k2[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NORMAL_FORCE_N: f64 = 4120.0;

    fn parameters(law: &str) -> PlantParameters {
        PlantParameters {
            radius_m: 0.31,
            inertia_kg_m2: 1.25,
            mass_kg: 420.0,
            coasting: true,
            law: law.parse().unwrap(),
        }
    }

    /// A smooth torque that stays short of the peak.
    fn gentle_torque(time_s: f64) -> f64 {
        400.0 * (1.0 - (-time_s / 0.1).exp()) + 150.0 * (9.0 * time_s).sin()
    }

    fn run_gently(dt_s: f64) -> PlantState {
        let mut plant = Plant::rolling(parameters("magic-formula:12,1.65,0.9,0.3"), 20.0);
        for _ in 0..(1.0 / dt_s).round() as usize {
            let middle = plant.state().time_s + 0.5 * dt_s;
            plant.step(dt_s, gentle_torque(middle), NORMAL_FORCE_N);
        }
        plant.state()
    }

    #[test]
    fn halving_the_step_quarters_the_error() {
        let reference = run_gently(1.0 / 65536.0);
        let errors: Vec<f64> = [512.0, 1024.0, 2048.0, 4096.0]
            .iter()
            .map(|steps| {
                let state = run_gently(1.0 / steps);
                (state.wheel_speed_rad_s - reference.wheel_speed_rad_s).abs()
                    + (state.vehicle_speed_m_s - reference.vehicle_speed_m_s).abs()
            })
            .collect();
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((1.8..2.3).contains(&order), "{order} from {errors:?}");
        }
    }

    #[test]
    fn energy_lost_is_what_brake_and_tyre_took() {
        let p = parameters("burckhardt:dry-asphalt");
        let mut plant = Plant::rolling(p, 25.0);
        let energy = |s: PlantState| {
            0.5 * p.inertia_kg_m2 * s.wheel_speed_rad_s.powi(2)
                + 0.5 * p.mass_kg * s.vehicle_speed_m_s.powi(2)
        };
        let start = energy(plant.state());
        let dt_s = 2e-5;
        let mut taken = 0.0;
        let power = |plant: &Plant, torque: f64| {
            let contact = plant.contact(NORMAL_FORCE_N);
            let sliding = contact.vehicle_speed_m_s - p.radius_m * contact.wheel_speed_rad_s;
            torque * contact.wheel_speed_rad_s + plant.drag_n(&contact) * sliding
        };
        // Ramp through the peak into a locked wheel, hold, release, roll on.
        for step in 0..60_000 {
            let time = (f64::from(step) + 0.5) * dt_s;
            let torque = if time < 0.9 { 2600.0 * time } else { 0.0 };
            let before = power(&plant, torque);
            plant.step(dt_s, torque, NORMAL_FORCE_N);
            taken += 0.5 * dt_s * (before + power(&plant, torque));
        }
        assert!(plant.state().vehicle_speed_m_s > 5.0);
        let error = (start - energy(plant.state()) - taken) / start;
        assert!(error.abs() < 2e-5, "{error}");
    }

    #[test]
    fn a_locked_wheel_stays_at_exactly_zero_and_spins_up_when_released() {
        let mut plant = Plant::rolling(parameters("rudd:0.85,0.14"), 20.0);
        let mut locked_steps = 0;
        for _ in 0..5_000 {
            plant.step(1e-4, 2500.0, NORMAL_FORCE_N);
            if plant.state().wheel_speed_rad_s == 0.0 {
                locked_steps += 1;
            } else {
                assert_eq!(locked_steps, 0, "a locked wheel moved");
            }
        }
        assert!(locked_steps > 3_000);
        for _ in 0..5_000 {
            plant.step(1e-4, 0.0, NORMAL_FORCE_N);
        }
        assert!(plant.contact(NORMAL_FORCE_N).slip_ratio.abs() < 1e-3);
    }

    #[test]
    fn nothing_rings_down_to_standstill_with_a_coarse_step() {
        // At 1 m/s the free wheel's rate is 4e4/s here: an explicit scheme would need steps of 25 us.
        let mut plant = Plant::rolling(parameters("burckhardt:ice"), 3.0);
        let mut last_slip = 0.0;
        while !plant.stands() && plant.state().time_s < 120.0 {
            plant.step(1e-3, 10.0, NORMAL_FORCE_N);
            if plant.stands() {
                break;
            }
            let slip = plant.contact(NORMAL_FORCE_N).slip_ratio;
            assert!(slip > -1e-9, "slip {slip} at {:?}", plant.state());
            assert!((slip - last_slip).abs() < 2e-3, "slip jumped to {slip}");
            last_slip = slip;
        }
        assert!(plant.stands());
        assert_eq!(plant.state().wheel_speed_rad_s, 0.0);
        assert_eq!(plant.drag_n(&plant.contact(NORMAL_FORCE_N)), 0.0);
    }

    #[test]
    fn a_held_speed_is_held() {
        let held = PlantParameters {
            coasting: false,
            ..parameters("rudd:0.85,0.14")
        };
        let mut plant = Plant::rolling(held, 20.0);
        for _ in 0..10_000 {
            plant.step(1e-4, 600.0, NORMAL_FORCE_N);
        }
        assert_eq!(plant.state().vehicle_speed_m_s, 20.0);
        assert!((plant.state().distance_m - 20.0).abs() < 1e-9);
        // In equilibrium the tyre's torque is the brake's.
        let drag = plant.drag_n(&plant.contact(NORMAL_FORCE_N));
        assert!((0.31 * drag - 600.0).abs() < 1e-6);
    }

    #[test]
    fn an_added_effect_acts_on_the_vehicle() {
        struct Grade;
        impl PlantEffect for Grade {
            fn vehicle_force_n(&self, _: &Contact) -> f64 {
                420.0
            }
        }
        let mut plant = Plant::rolling(parameters("rudd:0.85,0.14"), 20.0);
        plant.add_effect(Box::new(Grade));
        for _ in 0..10_000 {
            plant.step(1e-4, 0.0, NORMAL_FORCE_N);
        }
        // 1 m/s2 on 420 kg, of which the wheel's inertia takes its share: J/R2 = 13 kg.
        let expected = 20.0 - 420.0 / (420.0 + 1.25 / 0.31_f64.powi(2));
        let speed = plant.state().vehicle_speed_m_s;
        assert!((speed - expected).abs() < 2e-4, "{speed} {expected}");
    }
}
