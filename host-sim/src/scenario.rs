//! One run of the rig: what it is made from, and its rows.

use std::io;

use muslip::law::{LawError, Rudd};
use muslip_recordings::recording::Channel;
use muslip_recordings::rig_file::RigFile;

use super::brake::{Brake, BrakeProgramme};
use super::law::RigLaw;
use super::plant::{Plant, PlantParameters};
use super::sensors::Sensors;

/// Standard gravity in m/s2 (3rd General Conference on Weights and Measures, 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;

/// Longest step of the integration in s.
pub(super) const LONGEST_STEP_S: f64 = 1e-4;

/// One run of the rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The rig.
    pub rig: RigFile,
    /// The tyre law that is true in this run.
    pub law: RigLaw,
    /// Seed of all noise.
    pub seed: u64,
    /// Vehicle speed at the start in m/s.
    pub speed_m_s: f64,
    /// Normal force in N, constant.
    pub normal_force_n: f64,
    /// Brake applications in the run.
    pub applications: u32,
    /// Length of the run in s.
    pub duration_s: f64,
    /// Rows a second.
    pub rate_hz: f64,
}

/// A scenario that cannot be run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScenarioError {
    /// A value that must be finite and positive is not.
    #[error("{name} = {value}: must be finite and positive")]
    NotPositive {
        /// The value's name.
        name: &'static str,
        /// The value.
        value: f64,
    },
    /// The rig file's tyre parameters make no law.
    #[error("tyre of the rig file: {0}")]
    Tyre(#[from] LawError),
}

impl Scenario {
    /// The usual run of a rig: its own tyre law (or another one), three applications in four seconds at
    /// 500 Hz, the weight of its mass as normal force, and a speed that lasts for the run.
    ///
    /// # Errors
    /// [`ScenarioError::Tyre`] if the rig file's tyre parameters make no law.
    pub fn usual(rig: RigFile, law: Option<RigLaw>) -> Result<Self, ScenarioError> {
        let law = match law {
            Some(law) => law,
            None => RigLaw::Rudd(Rudd::new(rig.tyre.peak_friction, rig.tyre.critical_slip)?),
        };
        let normal_force_n = rig.vehicle.mass_kg * STANDARD_GRAVITY_M_S2;
        let mut scenario = Self {
            rig,
            law,
            seed: 1,
            speed_m_s: 0.0,
            normal_force_n,
            applications: 3,
            duration_s: 4.0,
            rate_hz: 500.0,
        };
        scenario.speed_m_s = scenario.lasting_speed_m_s();
        Ok(scenario)
    }

    /// A starting speed in m/s at which the wheel turns at 65 rad/s, or more where braking would
    /// otherwise stop the vehicle before the run is over.
    pub fn lasting_speed_m_s(&self) -> f64 {
        let rolling = 65.0 * self.rig.wheel.radius_m;
        if !self.rig.vehicle.coasting {
            return rolling;
        }
        // Over a run the mean drag is about a third of the peak's.
        let deceleration =
            self.law.peak().friction * self.normal_force_n / self.rig.vehicle.mass_kg;
        rolling.max(0.6 * deceleration * self.duration_s)
    }

    /// Columns of the recording that this run writes.
    pub fn channels(&self) -> &'static [Channel] {
        if self.rig.brake.is_some() {
            &Channel::ALL
        } else {
            &Channel::ALL[..5]
        }
    }

    /// Number of rows of the recording.
    pub fn rows(&self) -> u64 {
        ((self.duration_s * self.rate_hz).round() as u64).max(1)
    }

    /// Lines that say where the recording is from and how to make it again.
    pub fn origin(&self) -> Vec<String> {
        vec![format!(
            "simulated: muslip simulate --law {} --seed {} --speed {} --normal-force {} --applications {} --duration {} --rate-hz {}",
            self.law,
            self.seed,
            self.speed_m_s,
            self.normal_force_n,
            self.applications,
            self.duration_s,
            self.rate_hz
        )]
    }

    /// Whether the run can be made.
    ///
    /// # Errors
    /// [`ScenarioError::NotPositive`] naming the value.
    pub fn check(&self) -> Result<(), ScenarioError> {
        for (name, value) in [
            ("speed", self.speed_m_s),
            ("normal force", self.normal_force_n),
            ("duration", self.duration_s),
            ("rate", self.rate_hz),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(ScenarioError::NotPositive { name, value });
            }
        }
        Ok(())
    }

    pub(super) fn programme(&self) -> BrakeProgramme {
        let period_s = self.duration_s / f64::from(self.applications.max(1));
        // The torque that balances the tyre at its peak is reached after 60 % of a period.
        let peak_torque_nm =
            self.law.peak().friction * self.normal_force_n * self.rig.wheel.radius_m;
        BrakeProgramme {
            applications: self.applications,
            period_s,
            ramp_nm_s: peak_torque_nm / (0.5 * period_s),
            largest_torque_nm: 1.5 * peak_torque_nm,
            skid_slip_ratio: 0.98,
            skid_hold_s: 0.02 * period_s,
            hydraulic_lag_s: 0.01,
        }
    }

    /// Runs the rig and hands every row, in the order of [`Scenario::channels`], to `write`.
    ///
    /// # Errors
    /// [`RunError::Scenario`] before the first row, [`RunError::Write`] with what `write` answers.
    pub fn run(&self, mut write: impl FnMut(&[f64]) -> io::Result<()>) -> Result<(), RunError> {
        self.check()?;
        let channels = self.channels();
        let mut sensors = Sensors::new(channels, &self.rig.noise, self.seed);
        let mut brake = Brake::new(self.programme());
        let mut plant = Plant::rolling(
            PlantParameters {
                radius_m: self.rig.wheel.radius_m,
                inertia_kg_m2: self.rig.wheel.inertia_kg_m2,
                mass_kg: self.rig.vehicle.mass_kg,
                coasting: self.rig.vehicle.coasting,
                law: self.law,
            },
            self.speed_m_s,
        );
        let steps = (1.0 / (self.rate_hz * LONGEST_STEP_S)).ceil().max(1.0);
        let dt_s = 1.0 / (self.rate_hz * steps);
        let mut row = vec![0.0; channels.len()];
        for index in 0..self.rows() {
            for (value, &channel) in row.iter_mut().zip(channels) {
                *value = match channel {
                    Channel::Time => index as f64 / self.rate_hz,
                    _ => self.truth(channel, &plant, &brake),
                };
            }
            sensors.read(&mut row);
            write(&row)?;
            for _ in 0..steps as u64 {
                let slip_ratio = plant.contact(self.normal_force_n).slip_ratio;
                let torque_nm = brake.step(plant.state().time_s, dt_s, slip_ratio);
                plant.step(dt_s, torque_nm, self.normal_force_n);
            }
        }
        Ok(())
    }

    pub(super) fn truth(&self, channel: Channel, plant: &Plant, brake: &Brake) -> f64 {
        let state = plant.state();
        match channel {
            Channel::Time => state.time_s,
            Channel::WheelSpeed => state.wheel_speed_rad_s,
            Channel::VehicleSpeed => state.vehicle_speed_m_s,
            Channel::DragForce => plant.drag_n(&plant.contact(self.normal_force_n)),
            Channel::NormalForce => self.normal_force_n,
            Channel::BrakeTorque => brake.torque_nm(),
            Channel::BrakePressure => self.rig.brake.map_or(f64::NAN, |hydraulics| {
                brake.torque_nm() / hydraulics.torque_per_pressure_nm_pa
            }),
        }
    }
}

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scenario cannot be run.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A row could not be written.
    #[error(transparent)]
    Write(#[from] io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn rig(extra: &str) -> RigFile {
        let text = format!(
            "[wheel]\nradius_m = 0.31\ninertia_kg_m2 = 1.25\n[vehicle]\nmass_kg = 420.0\ncoasting = true\n\
             [tyre]\nlaw = \"rudd\"\npeak_friction = 0.85\ncritical_slip = 0.14\n{extra}"
        );
        RigFile::parse(Path::new("rig.toml"), text.as_bytes()).unwrap()
    }

    fn rows(scenario: &Scenario) -> Vec<Vec<f64>> {
        let mut rows = Vec::new();
        scenario
            .run(|row| {
                rows.push(row.to_vec());
                Ok(())
            })
            .unwrap();
        rows
    }

    #[test]
    fn every_application_goes_through_the_peak_to_a_locked_wheel_and_back() {
        let scenario = Scenario::usual(rig(""), None).unwrap();
        let rows = rows(&scenario);
        assert_eq!(rows.len(), 2000);
        assert_eq!(rows[0].len(), 5);
        let slip = |row: &Vec<f64>| (row[2] - 0.31 * row[1]) / row[2];
        let locks = rows
            .windows(2)
            .filter(|w| w[0][1] > 0.0 && w[1][1] == 0.0)
            .count();
        assert_eq!(locks, 3);
        assert!(
            rows.iter().all(|row| row[2] > 1.0),
            "the vehicle must not stop"
        );
        assert!(slip(&rows[1999]).abs() < 1e-3);
        let near_peak = rows
            .iter()
            .filter(|row| (0.05..0.3).contains(&slip(row)))
            .count();
        assert!(near_peak > 100, "{near_peak}");
    }

    #[test]
    fn a_brake_in_the_rig_file_adds_its_two_columns() {
        let scenario =
            Scenario::usual(rig("[brake]\ntorque_per_pressure_nm_pa = 3.2e-4\n"), None).unwrap();
        for row in rows(&scenario) {
            assert_eq!(row.len(), 7);
            assert!((row[5] - 3.2e-4 * row[6]).abs() <= 1e-12 * row[5].abs());
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_rows() {
        let mut scenario = Scenario::usual(
            rig("[noise]\ndrag_force_n = 90.0\n"),
            Some("burckhardt:snow".parse().unwrap()),
        )
        .unwrap();
        let first = rows(&scenario);
        assert_eq!(first, rows(&scenario));
        scenario.seed = 2;
        assert_ne!(first, rows(&scenario));
    }

    #[test]
    fn a_scenario_without_sense_is_refused() {
        let mut scenario = Scenario::usual(rig(""), None).unwrap();
        scenario.rate_hz = 0.0;
        let refused = scenario.run(|_| Ok(()));
        assert!(matches!(refused, Err(RunError::Scenario(_))));
    }
}
