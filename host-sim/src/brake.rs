//! The brake programme: a hydraulic ramp to skid and release, several times a run.

/// How the brake is worked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrakeProgramme {
    /// Applications a run.
    pub applications: u32,
    /// Time from one application to the next in s.
    pub period_s: f64,
    /// How fast the demanded torque rises in N m/s.
    pub ramp_nm_s: f64,
    /// Torque beyond which the demand does not rise, in N m.
    pub largest_torque_nm: f64,
    /// Slip from which the wheel counts as skidding.
    pub skid_slip_ratio: f64,
    /// How long the skid is held before the release, in s.
    pub skid_hold_s: f64,
    /// Time constant of the hydraulics in s: torque follows demand through a first-order lag.
    pub hydraulic_lag_s: f64,
}

/// Share of a period that passes before its ramp begins, rolling freely.
const ROLLING_SHARE: f64 = 0.1;
/// Share of a period after which the brake is released whatever the slip.
const RELEASE_SHARE: f64 = 0.85;

/// A programme being run.
#[derive(Debug, Clone)]
pub struct Brake {
    programme: BrakeProgramme,
    torque_nm: f64,
    application: u32,
    skid_since_s: Option<f64>,
    released: bool,
}

impl Brake {
    /// A released brake, at the start of its programme.
    pub fn new(programme: BrakeProgramme) -> Self {
        Self {
            programme,
            torque_nm: 0.0,
            application: 0,
            skid_since_s: None,
            released: false,
        }
    }

    /// Torque on the wheel now, in N m.
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm
    }

    /// Moves on by `dt_s` seconds and returns the torque in the middle of that step, in N m.
    pub fn step(&mut self, time_s: f64, dt_s: f64, slip_ratio: f64) -> f64 {
        let demand = self.demand_nm(time_s, slip_ratio);
        let lag = self.programme.hydraulic_lag_s;
        // Exact for a demand held over the step.
        let towards = |torque: f64, dt: f64| demand + (torque - demand) * (-dt / lag).exp();
        let middle = towards(self.torque_nm, 0.5 * dt_s);
        self.torque_nm = towards(self.torque_nm, dt_s);
        // The tail of an exponential is no torque that a brake has.
        if demand == 0.0 && self.torque_nm < 1e-6 * self.programme.largest_torque_nm {
            self.torque_nm = 0.0;
        }
        middle
    }

    fn demand_nm(&mut self, time_s: f64, slip_ratio: f64) -> f64 {
        let p = self.programme;
        let application = (time_s / p.period_s) as u32;
        if application != self.application {
            self.application = application;
            self.skid_since_s = None;
            self.released = false;
        }
        let into_period_s = time_s - f64::from(application) * p.period_s;
        let ramp_start_s = ROLLING_SHARE * p.period_s;
        if application >= p.applications || self.released || into_period_s < ramp_start_s {
            return 0.0;
        }
        if slip_ratio >= p.skid_slip_ratio && self.skid_since_s.is_none() {
            self.skid_since_s = Some(time_s);
        }
        let held = self
            .skid_since_s
            .is_some_and(|since| time_s - since >= p.skid_hold_s);
        if held || into_period_s > RELEASE_SHARE * p.period_s {
            self.released = true;
            return 0.0;
        }
        (p.ramp_nm_s * (into_period_s - ramp_start_s)).min(p.largest_torque_nm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROGRAMME: BrakeProgramme = BrakeProgramme {
        applications: 2,
        period_s: 1.0,
        ramp_nm_s: 2000.0,
        largest_torque_nm: 1200.0,
        skid_slip_ratio: 0.98,
        skid_hold_s: 0.1,
        hydraulic_lag_s: 0.01,
    };

    fn torque_at(times: &[f64], slip_at: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut brake = Brake::new(PROGRAMME);
        let mut found = Vec::new();
        let mut time = 0.0;
        for &until in times {
            while time < until {
                brake.step(time, 1e-3, slip_at(time));
                time += 1e-3;
            }
            found.push(brake.torque_nm());
        }
        found
    }

    #[test]
    fn demand_ramps_lags_saturates_and_is_released_in_every_period() {
        let torque = torque_at(&[0.09, 0.4, 0.8, 0.99, 1.05, 1.4, 2.5], |_| 0.1);
        assert_eq!(torque[0], 0.0);
        // 2000 N m/s for 0.3 s, less the lag of 10 ms.
        assert!((torque[1] - 580.0).abs() < 3.0, "{torque:?}");
        assert!((torque[2] - 1200.0).abs() < 1.0, "{torque:?}");
        assert_eq!(torque[3], 0.0);
        assert_eq!(torque[4], 0.0);
        assert!((torque[5] - torque[1]).abs() < 3.0, "{torque:?}");
        assert_eq!(torque[6], 0.0, "no third application");
    }

    #[test]
    fn a_skid_is_held_and_then_released() {
        let skid_from = |time: f64| if time > 0.5 { 1.0 } else { 0.1 };
        let torque = torque_at(&[0.58, 0.72], skid_from);
        assert!(torque[0] > 700.0, "{torque:?}");
        assert!(torque[1] < 1.0, "{torque:?}");
    }
}
