//! The true quarter car: the simulator's plant on patches of road, behind an actuator with limits.

use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;

use host_sim::{Contact, Plant, PlantEffect, PlantParameters, PlantState};

use super::scenario::{Actuator, GRAVITY_M_S2, Road, SAMPLE_TIME_S, STEPS_A_SAMPLE, Scenario};

/// The road's friction over that of its first patch, which is the plant's own law.
struct Patches(Road);

impl PlantEffect for Patches {
    fn friction_factor(&self, contact: &Contact) -> f64 {
        if self.0.patches.len() < 2 {
            return 1.0;
        }
        let (first, here) = (self.0.truth_at(0.0), self.0.truth_at(contact.distance_m));
        if first == here {
            return 1.0;
        }
        // Both are zero at zero slip; their slopes there are the limit of the quotient.
        if contact.slip_ratio.abs() < 1e-9 {
            here.slip_derivative(0.0) / first.slip_derivative(0.0)
        } else {
            here.friction(contact.slip_ratio) / first.friction(contact.slip_ratio)
        }
    }
}

/// A tyre whose force is that of a slip which follows the true one over a distance, with ds'/dt = v (s − s')/length.
/// The plant's own law is taken off again, so that what is left of it is what its scheme is implicit in.
#[derive(Clone)]
struct Relaxation {
    road: Road,
    length_m: f64,
    radius_m: f64,
    slip: Rc<Cell<f64>>,
}

impl Relaxation {
    /// Force in N beside that of the plant's own law.
    fn beside_n(&self, contact: &Contact) -> f64 {
        let first = self.road.truth_at(0.0);
        let here = self.road.truth_at(contact.distance_m);
        contact.normal_force_n
            * (here.friction(self.slip.get()) - first.friction(contact.slip_ratio))
    }
}

impl PlantEffect for Relaxation {
    fn vehicle_force_n(&self, contact: &Contact) -> f64 {
        self.beside_n(contact)
    }

    fn wheel_torque_nm(&self, contact: &Contact) -> f64 {
        -self.radius_m * self.beside_n(contact)
    }

    fn advance(&mut self, contact: &Contact, _drag_n: f64, dt_s: f64) {
        // Exact for a slip held over the step.
        let stays = (-contact.vehicle_speed_m_s * dt_s / self.length_m).exp();
        let slip = contact.slip_ratio + stays * (self.slip.get() - contact.slip_ratio);
        self.slip.set(slip);
    }
}

/// What is true at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Time in s.
    pub time_s: f64,
    /// Distance in m.
    pub distance_m: f64,
    /// Wheel speed in rad/s.
    pub wheel_speed_rad_s: f64,
    /// Vehicle speed in m/s.
    pub vehicle_speed_m_s: f64,
    /// Slip; 0 at standstill.
    pub slip_ratio: f64,
    /// Friction; 0 at standstill.
    pub friction: f64,
    /// Brake torque in N m.
    pub brake_torque_nm: f64,
}

/// The quarter car in motion.
pub struct Car {
    plant: Plant,
    relaxation: Option<Relaxation>,
    actuator: Actuator,
    normal_force_n: f64,
    brake_torque_nm: f64,
    waiting: VecDeque<f64>,
}

impl Car {
    /// Rolling freely, the brake open.
    pub fn new(scenario: &Scenario) -> Self {
        let parameters = PlantParameters {
            radius_m: scenario.radius_m,
            inertia_kg_m2: scenario.inertia_kg_m2,
            mass_kg: scenario.mass_kg,
            coasting: true,
            law: scenario.road.truth_at(0.0),
        };
        let mut plant = Plant::rolling(parameters, scenario.from_m_s);
        let relaxation = (scenario.relaxation_length_m > 0.0).then(|| Relaxation {
            road: scenario.road.clone(),
            length_m: scenario.relaxation_length_m,
            radius_m: scenario.radius_m,
            slip: Rc::default(),
        });
        match &relaxation {
            Some(relaxation) => plant.add_effect(Box::new(relaxation.clone())),
            None => plant.add_effect(Box::new(Patches(scenario.road.clone()))),
        }
        Self {
            plant,
            relaxation,
            actuator: scenario.actuator,
            normal_force_n: scenario.mass_kg * GRAVITY_M_S2,
            brake_torque_nm: 0.0,
            waiting: std::iter::repeat_n(0.0, scenario.actuator.dead_samples).collect(),
        }
    }

    /// What is true now.
    pub fn truth(&self) -> Truth {
        let PlantState {
            time_s,
            wheel_speed_rad_s,
            vehicle_speed_m_s,
            distance_m,
            ..
        } = self.plant.state();
        let contact = self.plant.contact(self.normal_force_n);
        let mut drag_n = self.plant.drag_n(&contact);
        if let Some(relaxation) = &self.relaxation
            && !self.plant.stands()
        {
            drag_n += relaxation.beside_n(&contact);
        }
        Truth {
            time_s,
            distance_m,
            wheel_speed_rad_s,
            vehicle_speed_m_s,
            slip_ratio: contact.slip_ratio,
            friction: drag_n / self.normal_force_n,
            brake_torque_nm: self.brake_torque_nm,
        }
    }

    /// One step of the integration, the torque on its way to a demand in N m.
    pub fn step(&mut self, demand_nm: f64) {
        let dt = SAMPLE_TIME_S / f64::from(STEPS_A_SAMPLE);
        let reach = self.actuator.maximum_rate_nm_s * dt;
        let before = self.brake_torque_nm;
        let demand = demand_nm.clamp(0.0, self.actuator.maximum_torque_nm);
        self.brake_torque_nm = demand.clamp(before - reach, before + reach);
        self.plant.step(
            dt,
            0.5 * (before + self.brake_torque_nm),
            self.normal_force_n,
        );
    }

    /// One sample under a demand in N m, which acts after the dead time; `watch` sees every step's end.
    pub fn sample(&mut self, demand_nm: f64, mut watch: impl FnMut(&Truth)) {
        self.waiting.push_back(demand_nm);
        let acting = self.waiting.pop_front().unwrap_or(demand_nm);
        for _ in 0..STEPS_A_SAMPLE {
            self.step(acting);
            watch(&self.truth());
        }
    }
}
