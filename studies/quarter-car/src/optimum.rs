//! (e): the shortest stop that the actuator allows to one who knows everything beforehand.
//!
//! Torque enters the motion through its rate, which is bounded, so the shortest stop is made of pieces at
//! the full rate and pieces on the singular arc, where friction is at its peak (Pontryagin's principle).
//! The pieces: rise at the full rate, fall at the full rate until the peak slip is met, hold it; before an
//! edge of the road start towards the torque of the next patch. When each begins is searched for.

use super::car::{Car, Truth};
use super::scenario::{GRAVITY_M_S2, SAMPLE_TIME_S, STEPS_A_SAMPLE, Scenario};
use super::search::compass_search;

/// Time constant in s with which the hold removes an error of slip: two steps of the plant.
const HOLD_S: f64 = 2.0 * SAMPLE_TIME_S / STEPS_A_SAMPLE as f64;

/// How long the search simulates before it trusts the peak to be held, in s.
const TRANSIENT_S: f64 = 0.4;

/// The stop that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// Its distance in m.
    pub distance_m: f64,
    /// When the torque ceases to rise, in s.
    pub rises_until_s: f64,
    /// For how long it then falls, in s.
    pub falls_for_s: f64,
    /// Distances in m before each edge at which the torque starts towards the next patch's.
    pub leads_m: Vec<f64>,
}

/// What a stop is made of.
#[derive(Debug, Clone, PartialEq)]
struct Plan {
    rises_until_s: f64,
    falls_for_s: f64,
    leads_m: Vec<f64>,
    /// Slip to hold as a multiple of the peak's.
    slip_factor: f64,
}

impl Plan {
    fn demand(&self, scenario: &Scenario, truth: &Truth) -> f64 {
        let t = truth.time_s;
        if t < self.rises_until_s {
            return f64::MAX;
        }
        if t < self.rises_until_s + self.falls_for_s {
            return 0.0;
        }
        // The patch that the torque is meant for: the next one from its lead on.
        let edges = scenario.road.patches.iter().skip(1);
        let ahead = edges
            .zip(&self.leads_m)
            .filter(|((edge, _), lead)| truth.distance_m >= edge - **lead)
            .map(|((edge, _), _)| *edge)
            .fold(0.0, f64::max)
            .max(truth.distance_m);
        let law = scenario.road.truth_at(ahead);
        let slip = self.slip_factor * law.peak().slip_ratio;
        let (r, j) = (scenario.radius_m, scenario.inertia_kg_m2);
        let peak = law.friction(slip);
        let keeps = j * (1.0 - slip) * GRAVITY_M_S2 * peak / r;
        let leading = ahead > truth.distance_m;
        let (friction, correction) = if leading {
            (peak, 0.0)
        } else {
            (
                truth.friction,
                j * truth.vehicle_speed_m_s / r * (slip - truth.slip_ratio) / HOLD_S,
            )
        };
        r * scenario.mass_kg * GRAVITY_M_S2 * friction + keeps + correction
    }

    /// Distance in m of the whole stop.
    fn distance(&self, scenario: &Scenario) -> f64 {
        let mut car = Car::new(scenario);
        let mut before = car.truth();
        let to = scenario.to_m_s;
        while before.time_s < 60.0 {
            car.step(self.demand(scenario, &before));
            let now = car.truth();
            if now.vehicle_speed_m_s <= to {
                let share = (before.vehicle_speed_m_s - to)
                    / (before.vehicle_speed_m_s - now.vehicle_speed_m_s);
                return before.distance_m + share * (now.distance_m - before.distance_m);
            }
            before = now;
        }
        f64::INFINITY
    }

    /// The same, the peak taken as held once the transient is over: for one surface alone.
    fn distance_from_transient(&self, scenario: &Scenario) -> f64 {
        let mut car = Car::new(scenario);
        let mut truth = car.truth();
        while truth.time_s < TRANSIENT_S {
            car.step(self.demand(scenario, &truth));
            truth = car.truth();
        }
        let law = scenario.road.truth_at(0.0);
        let friction = law.friction(self.slip_factor * law.peak().slip_ratio);
        let (v, to) = (truth.vehicle_speed_m_s, scenario.to_m_s);
        truth.distance_m + (v * v - to * to) / (2.0 * GRAVITY_M_S2 * friction)
    }
}

/// Searches for the best stop.
pub fn optimum(scenario: &Scenario) -> Optimum {
    let edges = scenario.road.patches.len() - 1;
    // Where the torque of the peak is reached, and a little beyond.
    let (friction, _) = scenario.road.peak_at(0.0);
    let peak_torque = scenario.radius_m * scenario.mass_kg * GRAVITY_M_S2 * friction;
    let rise = 1.15 * peak_torque / scenario.actuator.maximum_rate_nm_s;
    let rising = |x: &[f64], leads_m: Vec<f64>| Plan {
        rises_until_s: x.first().copied().unwrap_or(0.0).max(0.0),
        falls_for_s: x.get(1).copied().unwrap_or(0.0).max(0.0),
        leads_m,
        slip_factor: 1.0,
    };
    let held = vec![0.0; edges];
    // The rise is over long before the first edge: its times can be searched for alone, over the transient.
    let (rise, _) = compass_search(
        |x| rising(x, held.clone()).distance_from_transient(scenario),
        vec![rise, 0.1 * rise],
        vec![0.1 * rise; 2],
        6,
    );
    let leads = if edges == 0 {
        Vec::new()
    } else {
        let leads = |x: &[f64]| x.iter().map(|lead| lead.max(0.0)).collect();
        let (best, _) = compass_search(
            |x| rising(&rise, leads(x)).distance(scenario),
            vec![0.3; edges],
            vec![0.1; edges],
            2,
        );
        leads(&best)
    };
    let plan = rising(&rise, leads);
    Optimum {
        distance_m: plan.distance(scenario),
        rises_until_s: plan.rises_until_s,
        falls_for_s: plan.falls_for_s,
        leads_m: plan.leads_m,
    }
}

/// The best constant slip, held by the same hand from the first step on: (slip as a multiple of the
/// peak's, distance in m).
pub fn best_constant_slip(scenario: &Scenario) -> (f64, f64) {
    let distance = |factor: f64| {
        Plan {
            rises_until_s: 0.0,
            falls_for_s: 0.0,
            leads_m: vec![0.0; scenario.road.patches.len() - 1],
            slip_factor: factor,
        }
        .distance(scenario)
    };
    (0..=16)
        .map(|step| 0.6 + 0.05 * f64::from(step))
        .map(|factor| (factor, distance(factor)))
        .fold((f64::NAN, f64::INFINITY), |best, this| {
            if this.1 < best.1 { this } else { best }
        })
}

/// Distance in m that no torque history of the actuator can undercut.
///
/// On the road friction is at most that of the peak, so v loses at most g μp a second. And while the torque rises from
/// zero at its rate r, momentum bounds it too: J dω/dt = R F − T, F = −m dv/dt and R ω ≤ v (with T ≥ 0 slip starts at
/// zero and cannot become negative) give (m + J/R²) (v0 − v(t)) ≤ ∫T/R ≤ r t²/(2 R). Both together: with
/// A = r/(R (m + J/R²)), v0 − v(t) ≤ A t²/2 until t = g μp/A, and grows by g μp a second from then on. The speed at any
/// place is then at least that of this course, on the patches that follow as well. A tyre with a relaxation length may
/// push its wheel beyond rolling, so there the momentum is not used.
pub fn bound(scenario: &Scenario) -> f64 {
    let (v0, to) = (scenario.from_m_s, scenario.to_m_s);
    let radius = scenario.radius_m;
    let moving = scenario.mass_kg + scenario.inertia_kg_m2 / (radius * radius);
    let jerk = scenario.actuator.maximum_rate_nm_s / (radius * moving);
    let (friction, _) = scenario.road.peak_at(0.0);
    let most = GRAVITY_M_S2 * friction;
    let rise = most / jerk;
    let (v, x) = (
        v0 - 0.5 * jerk * rise * rise,
        v0 * rise - jerk * rise.powi(3) / 6.0,
    );
    let edge = scenario.road.patches.get(1).map_or(f64::INFINITY, |p| p.0);
    if scenario.relaxation_length_m > 0.0 || v <= to || x >= edge {
        return coast(scenario, v0, 0.0);
    }
    coast(scenario, v, x)
}

/// Distance in m of a stop with peak friction from a speed in m/s at a place in m on.
fn coast(scenario: &Scenario, from_m_s: f64, at_m: f64) -> f64 {
    let mut v2 = from_m_s.powi(2);
    let to2 = scenario.to_m_s.powi(2);
    let patches = &scenario.road.patches;
    for (index, (from, _)) in patches.iter().enumerate() {
        let from = from.max(at_m);
        let until = patches.get(index + 1).map_or(f64::INFINITY, |next| next.0);
        let (friction, _) = scenario.road.peak_at(from);
        let twice = 2.0 * GRAVITY_M_S2 * friction;
        let needed = (v2 - to2) / twice;
        if needed <= until - from {
            return from + needed;
        }
        v2 -= twice * (until - from);
    }
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Road;

    #[test]
    fn the_optimum_lies_between_the_bound_and_the_best_constant_slip() {
        for road in [Road::dry(), Road::wet()] {
            let mut scenario = Scenario::usual(road, 1);
            scenario.from_m_s = 15.0;
            let best = optimum(&scenario).distance_m;
            let (_, constant) = best_constant_slip(&scenario);
            assert!(
                bound(&scenario) < best && best <= constant,
                "{best} {constant}"
            );
        }
    }

    #[test]
    fn the_bound_over_patches_is_that_of_their_frictions() {
        let mut scenario = Scenario::usual(Road::dry(), 1);
        let (friction, _) = scenario.road.peak_at(0.0);
        let one = (900.0 - 1.0) / (2.0 * GRAVITY_M_S2 * friction);
        assert!((coast(&scenario, 30.0, 0.0) - one).abs() < 1e-9);
        scenario.road = Road::step();
        let patched = coast(&scenario, 30.0, 0.0);
        assert!(patched > one);
        let (dry, _) = Road::dry().peak_at(0.0);
        let (wet, _) = Road::wet().peak_at(0.0);
        let rest =
            (900.0 - 1.0 - 2.0 * GRAVITY_M_S2 * 15.0 * (dry + wet)) / (2.0 * GRAVITY_M_S2 * dry);
        assert!((patched - (30.0 + rest)).abs() < 1e-9);
    }

    #[test]
    fn the_actuator_s_bound_is_that_of_integrating_its_course() {
        let scenario = Scenario::usual(Road::wet(), 1);
        let moving = 450.0 + 1.0 / 0.09;
        let jerk = 20_000.0 / (0.30 * moving);
        let most = GRAVITY_M_S2 * scenario.road.peak_at(0.0).0;
        let (mut v, mut x, mut t, dt) = (30.0_f64, 0.0, 0.0_f64, 1e-6);
        while v > 1.0 {
            let now = v - dt * (jerk * t).min(most);
            x += 0.5 * dt * (v + now);
            (v, t) = (now, t + dt);
        }
        assert!((bound(&scenario) - x).abs() < 1e-3, "{x}");
        assert!(bound(&scenario) > coast(&scenario, 30.0, 0.0) + 0.5);
    }

    #[test]
    fn the_best_stop_comes_within_one_percent_of_what_no_torque_can_undercut() {
        for road in [Road::dry(), Road::wet(), Road::snow()] {
            let scenario = Scenario::usual(road, 1);
            let ratio = optimum(&scenario).distance_m / bound(&scenario);
            assert!((1.0..1.01).contains(&ratio), "{ratio}");
        }
    }
}
