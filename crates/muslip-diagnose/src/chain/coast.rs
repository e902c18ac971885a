//! The speed of a coasting vehicle where its late channel has not told it yet, or not any more.

use super::correct::{Lateness, longest_step, straight_on};
use super::held::last_reading;
use crate::campaign::Run;
use crate::cleaning::clean;
use crate::mechanism::Law;
use crate::slip;

/// What slows a coasting vehicle: the tyre alone.
#[derive(Clone, Copy, Debug)]
pub struct Coasting {
    /// Mass in kg.
    pub mass_kg: f64,
    /// Rolling radius in m.
    pub radius_m: f64,
    /// The law of its tyre.
    pub law: Law<f64>,
}

impl Coasting {
    /// Draws the vehicle's speed of a run that is `corrected` for how `late` its channels are on from its last reading in the run as
    /// recorded: m dv/dt = -load mu(slip), with the wheel's speed and the load as they are. Along a straight line a speed
    /// that came down to the wheel's has no slip any more, or one against the brake, and the friction of neither. Behind a gap in
    /// time the straight line stands.
    pub fn draw_on(self, recorded: &Run, late: &Lateness, corrected: &mut Run) {
        if late.vehicle <= 0.0 {
            return;
        }
        let time = &recorded.time_s;
        let Some(last) = last_reading(time, &recorded.vehicle_speed_m_s) else {
            return;
        };
        let told = time.partition_point(|t| t + late.vehicle <= last);
        if told == 0 || told == time.len() {
            return;
        }
        let cleaned =
            |column: &str, x: &[f64]| clean(&recorded.name, column, time, x, &mut Vec::new()).0;
        let wheel = cleaned("wheel_speed_rad_s", &corrected.wheel_speed_rad_s);
        let load = cleaned("normal_force_n", &corrected.normal_force_n);
        let speed = &mut corrected.vehicle_speed_m_s;
        let at_last = straight_on(&time[..told], &speed[..told], time[told - 1]);
        let mut before = at_last.unwrap_or(speed[told - 1]);
        let longest = longest_step(time);
        for k in told..time.len() {
            let step = time[k] - time[k - 1];
            let after = self.after(step, before, wheel[k - 1], load[k - 1]);
            if step <= longest && after.is_finite() {
                speed[k] = after;
            }
            before = speed[k];
        }
    }

    fn friction(&self, slip: f64) -> f64 {
        self.law.friction(slip / self.law.critical)
    }

    /// Speed in m/s after a step in s from this speed, at this wheel speed in rad/s and load in N: one step of Rosenbrock's method, for
    /// near rest the slip, and friction with it, changes as fast as one likes. What comes to rest does not turn round.
    fn after(self, step: f64, speed: f64, wheel_speed: f64, load: f64) -> f64 {
        if speed <= 0.0 {
            return speed;
        }
        let force =
            |speed: f64| load * self.friction(slip::slip(self.radius_m, wheel_speed, speed));
        let change = 1e-3 * speed;
        let slope = (force(speed + change) - force(speed - change)) / (2.0 * change);
        let stiff = 1.0 + step * slope.max(0.0) / self.mass_kg;
        let after = speed - step * force(speed) / self.mass_kg / stiff;
        if after < 0.0 { 0.0 } else { after }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRAVITY: f64 = 9.81;
    const COASTING: Coasting = Coasting {
        mass_kg: 400.0,
        radius_m: 0.3,
        law: Law {
            peak: 0.9,
            critical: 0.12,
            rise: None,
            fall: None,
        },
    };
    const STEP: f64 = 0.002;
    const LATE: f64 = 0.1;

    /// A run of so many samples at this wheel speed, whose vehicle's speed is read late.
    fn run(samples: usize, vehicle: impl Fn(f64) -> f64, wheel: impl Fn(f64) -> f64) -> Run {
        let time_s: Vec<f64> = (0..samples).map(|k| STEP * k as f64).collect();
        Run {
            vehicle_speed_m_s: time_s.iter().map(|t| vehicle(t - LATE)).collect(),
            wheel_speed_rad_s: time_s.iter().map(|t| wheel(*t)).collect(),
            normal_force_n: vec![COASTING.mass_kg * GRAVITY; samples],
            time_s,
            ..Run::default()
        }
    }

    fn drawn_on(run: &Run) -> Vec<f64> {
        let late = Lateness {
            vehicle: LATE,
            ..Lateness::default()
        };
        let mut corrected = late.corrected(run);
        COASTING.draw_on(run, &late, &mut corrected);
        corrected.vehicle_speed_m_s
    }

    /// Deceleration in m/s² by the friction at a slip of one.
    fn by_locked_wheel() -> f64 {
        let x = 1.0 / COASTING.law.critical;
        GRAVITY * 2.0 * COASTING.law.peak * x / (1.0 + x * x)
    }

    #[test]
    fn a_locked_wheel_slows_it_by_its_friction_until_it_rests() {
        let slows = by_locked_wheel();
        let speed = |t: f64| (0.15 + slows * (1.0 - t)).max(0.0);
        let drawn = drawn_on(&run(501, speed, |_| 0.0));
        for (k, v) in drawn.iter().enumerate() {
            assert!((v - speed(STEP * k as f64)).abs() < 1e-3, "{k}: {v}");
        }
        // It comes to rest, and nothing moves it again.
        let speed = |t: f64| (slows * (0.95 - t)).max(0.0);
        let stopped = drawn_on(&run(501, speed, |_| 0.0));
        assert_eq!(stopped[490..], [0.0; 11]);
    }

    #[test]
    fn a_wheel_that_rolls_again_leaves_it_its_speed() {
        // The brake is let go 0.1 s before the end, which the reading does not show any more.
        let speed = |t: f64| 20.0 - 6.0 * t.min(0.9);
        let let_go = run(501, speed, |t| if t < 0.9 { 40.0 } else { speed(t) / 0.3 });
        let drawn = drawn_on(&let_go);
        assert!((drawn[500] - speed(1.0)).abs() < 0.05, "{}", drawn[500]);
        // Nor does a load that is missing stop it.
        let mut missing = let_go;
        missing.normal_force_n[470] = f64::NAN;
        assert!((drawn_on(&missing)[500] - drawn[500]).abs() < 0.01);
    }

    #[test]
    fn behind_a_gap_in_time_the_straight_line_stands() {
        let mut paused = run(501, |t| 20.0 - 6.0 * t, |_| 0.0);
        for t in &mut paused.time_s[475..] {
            *t += 2.0;
        }
        let late = Lateness {
            vehicle: LATE,
            ..Lateness::default()
        };
        let straight = late.corrected(&paused).vehicle_speed_m_s[475];
        let drawn = drawn_on(&paused);
        assert_eq!(drawn[475], straight);
        // From there on it slows again.
        let fell = (drawn[475] - drawn[500]) / (25.0 * STEP);
        assert!((fell - by_locked_wheel()).abs() < 1e-3, "{fell}");
    }

    #[test]
    fn what_is_not_late_stays_as_it_is() {
        let own = run(100, |_| 10.0, |_| 0.0);
        let mut same = own.clone();
        COASTING.draw_on(&own, &Lateness::default(), &mut same);
        assert_eq!(same.vehicle_speed_m_s, own.vehicle_speed_m_s);
    }
}
