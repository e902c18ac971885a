//! A run of the rig in which a repaired model is true: base law, mechanisms and remainder make the force in the
//! contact, and what was found on wheel and vehicle acts on them.
//!
//! Mechanisms have hidden states and look back along the run, so the engine's own model is asked, at every
//! coupling step, for the force at the end of the run so far. The plant has the base law inside its steps, which
//! keeps them stable however stiff the tyre is, and the difference to the engine's force is held over a coupling
//! step. What is recorded as drag is what `muslip predict` says of the finished run, so that a prediction of a
//! recording without noise gives its drag back.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use muslip::law::Rudd;
use muslip_diagnose::campaign::Run;
use muslip_diagnose::correction::{Action, Levers};
use muslip_diagnose::data::{Catalogue, Data};
use muslip_diagnose::mechanism::{Mechanism, Stage, State};
use muslip_diagnose::model::{Model, tyre};
use muslip_diagnose::repaired::{Repaired, RepairedError, Which};
use muslip_diagnose::series::{Channel as Prepared, Series};
use muslip_recordings::recording::Channel;

use super::brake::Brake;
use super::law::RigLaw;
use super::model_noise::DragNoise;
use super::plant::{Contact, Plant, PlantEffect, PlantParameters};
use super::scenario::{LONGEST_STEP_S, Scenario, ScenarioError};
use super::sensors::Sensors;

/// Longest coupling step in s where the run is short, and where it is long: the whole run so far is looked at in
/// every step.
const COUPLING_STEP_S: [f64; 2] = [1e-3, 4e-3];
/// Coupling steps of a run above which they become longer.
const COUPLING_STEPS: f64 = 8000.0;
/// Below this speed in m/s the engine knows no slip, and the base law alone brings the vehicle to rest.
const SLOWEST_M_S: f64 = 0.5;

/// A run that the model cannot make.
#[derive(Debug, thiserror::Error)]
pub enum ModelRunError {
    /// The scenario has no sense.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The model cannot be run.
    #[error(transparent)]
    Model(#[from] RepairedError),
    /// The run starts where the model was never fitted.
    #[error("{name} = {value} {unit} is outside the model's domain, {low} to {high} {unit}")]
    Outside {
        /// What lies outside.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Lower end of the domain.
        low: f64,
        /// Upper end of the domain.
        high: f64,
    },
}

impl Scenario {
    /// The usual run under a repaired model: its base law, the mean normal force and the largest speed of the
    /// recordings that it was made from, their sampling rate.
    ///
    /// # Errors
    /// [`ScenarioError::Tyre`] if the base law of the model is none.
    pub fn of_model(
        rig: muslip_recordings::rig_file::RigFile,
        model: &Repaired,
    ) -> Result<Self, ScenarioError> {
        let [log_peak, log_critical] = [0, 1].map(|i| model.base.get(i).copied().unwrap_or(0.0));
        let law = RigLaw::Rudd(Rudd::new(log_peak.exp(), log_critical.exp())?);
        let mut scenario = Self::usual(rig, Some(law))?;
        scenario.normal_force_n = model.context.mean_load;
        scenario.rate_hz = (1.0 / model.context.dt * 1e6).round() / 1e6;
        scenario.speed_m_s =
            domain(model, "vehicle_speed_m_s").map_or(model.context.max_speed, |[_, high]| high);
        Ok(scenario)
    }

    /// Whether the run starts where the model was fitted.
    ///
    /// # Errors
    /// [`ModelRunError::Outside`].
    pub fn check_domain(&self, model: &Repaired) -> Result<(), ModelRunError> {
        for (name, key, value, unit) in [
            ("speed", "vehicle_speed_m_s", self.speed_m_s, "m/s"),
            ("normal force", "normal_force_n", self.normal_force_n, "N"),
        ] {
            if let Some([low, high]) = domain(model, key)
                && !within([low, high], value)
            {
                return Err(ModelRunError::Outside {
                    name,
                    value,
                    unit,
                    low,
                    high,
                });
            }
        }
        Ok(())
    }

    /// Runs the rig under a repaired model and returns the rows, in the order of [`Scenario::channels`]. The noise
    /// is the model's. `progress` receives the rows done.
    ///
    /// # Errors
    /// [`ModelRunError`].
    pub fn run_model(
        &self,
        model: &Repaired,
        noisy: bool,
        mut progress: impl FnMut(u64),
    ) -> Result<Vec<Vec<f64>>, ModelRunError> {
        self.check()?;
        self.check_domain(model)?;
        let mut rows = self.undisturbed(model, &mut progress)?;
        let channels = self.channels();
        let run = as_run(&rows, channels);
        let reading = model.predict(&run, Which::Repaired)?.drag_force_n;
        let place = |wanted| channels.iter().position(|channel| *channel == wanted);
        let Some(drag) = place(Channel::DragForce) else {
            return Ok(rows);
        };
        let mut sigma = if noisy {
            model.noise.channels.clone()
        } else {
            Default::default()
        };
        sigma.remove(Channel::DragForce.name());
        let mut sensors = Sensors::new(channels, &sigma, self.seed);
        let mut noise = DragNoise::new(&model.noise, self.seed);
        for (row, force) in rows.iter_mut().zip(reading) {
            sensors.read(row);
            if let Some(cell) = row.get_mut(drag) {
                // Noise of the slip is in the speeds already.
                *cell = force
                    + if noisy {
                        noise.next(noise.sigma(force))
                    } else {
                        0.0
                    };
            }
        }
        Ok(rows)
    }

    /// The truth, row by row; the drag column holds the force in the contact.
    fn undisturbed(
        &self,
        model: &Repaired,
        progress: &mut impl FnMut(u64),
    ) -> Result<Vec<Vec<f64>>, ModelRunError> {
        let channels = self.channels();
        let mut coupling = Coupling::new(model)?;
        let (vehicle_share, wheel_share) = coupling.inertia_shares();
        let held = Rc::new(Cell::new(Held::default()));
        let mut brake = Brake::new(self.programme());
        let mut plant = Plant::rolling(
            PlantParameters {
                radius_m: self.rig.wheel.radius_m,
                inertia_kg_m2: self.rig.wheel.inertia_kg_m2 * wheel_share,
                mass_kg: self.rig.vehicle.mass_kg * vehicle_share,
                coasting: self.rig.vehicle.coasting,
                law: self.law,
            },
            self.speed_m_s,
        );
        plant.add_effect(Box::new(HeldForces(Rc::clone(&held))));
        let steps = (1.0 / (self.rate_hz * LONGEST_STEP_S)).ceil().max(1.0);
        let dt_s = 1.0 / (self.rate_hz * steps);
        let [least, most] = COUPLING_STEP_S;
        let coupling_s = (self.duration_s / COUPLING_STEPS).clamp(least, most);
        let every = (coupling_s / dt_s).round().max(1.0) as u64;
        let mut step = 0;
        let mut rows = Vec::new();
        for index in 0..self.rows() {
            rows.push(
                channels
                    .iter()
                    .map(|&channel| match channel {
                        Channel::Time => index as f64 / self.rate_hz,
                        _ => self.truth(channel, &plant, &brake),
                    })
                    .collect(),
            );
            for _ in 0..steps as u64 {
                if step % every == 0 {
                    held.set(coupling.forces(&plant, &brake, self));
                }
                step += 1;
                let slip_ratio = plant.contact(self.normal_force_n).slip_ratio;
                let torque_nm = brake.step(plant.state().time_s, dt_s, slip_ratio);
                plant.step(dt_s, torque_nm, self.normal_force_n);
            }
            progress(index + 1);
        }
        Ok(rows)
    }
}

/// Range of a variable that a model was fitted on.
pub(super) fn domain(model: &Repaired, key: &str) -> Option<[f64; 2]> {
    model
        .domain
        .ranges
        .get(key)
        .copied()
        .filter(|[low, high]| low < high)
}

/// Whether a value lies in a range, or beside it by no more than a reading's noise may put it.
pub(super) fn within([low, high]: [f64; 2], value: f64) -> bool {
    let margin = 0.05 * (high - low);
    (low - margin..=high + margin).contains(&value)
}

fn as_run(rows: &[Vec<f64>], channels: &[Channel]) -> Run {
    let column = |wanted| {
        let place = channels.iter().position(|channel| *channel == wanted)?;
        Some(rows.iter().map(|row| row[place]).collect::<Vec<f64>>())
    };
    let needed = |wanted| column(wanted).unwrap_or_default();
    Run {
        time_s: needed(Channel::Time),
        wheel_speed_rad_s: needed(Channel::WheelSpeed),
        vehicle_speed_m_s: needed(Channel::VehicleSpeed),
        normal_force_n: needed(Channel::NormalForce),
        brake_torque_nm: column(Channel::BrakeTorque),
        brake_pressure_pa: column(Channel::BrakePressure),
        ..Run::default()
    }
}

/// What is held over a coupling step: force on the vehicle in N, torque on the wheel in N m, both slowing.
#[derive(Debug, Clone, Copy, Default)]
struct Held {
    vehicle_n: f64,
    wheel_nm: f64,
}

struct HeldForces(Rc<Cell<Held>>);

impl PlantEffect for HeldForces {
    fn vehicle_force_n(&self, _: &Contact) -> f64 {
        self.0.get().vehicle_n
    }

    fn wheel_torque_nm(&self, _: &Contact) -> f64 {
        self.0.get().wheel_nm
    }
}

/// The engine's models on the run so far.
struct Coupling<'a> {
    repaired: &'a Repaired,
    tyre: Model,
    dynamics: Model,
    data: Data,
}

impl<'a> Coupling<'a> {
    fn new(repaired: &'a Repaired) -> Result<Self, RepairedError> {
        let catalogue = Catalogue::default();
        let tyre = repaired.tyre_model(&catalogue, Which::Repaired)?;
        let dynamics = repaired.dynamics_model(&catalogue)?;
        let series = Series {
            typical_dt: repaired.context.dt,
            torque: Some(Prepared::default()),
            index: repaired.recordings.len(),
            ..Series::default()
        };
        Ok(Self {
            tyre,
            dynamics,
            data: Data {
                catalogue: Arc::new(catalogue),
                ..Data::of(&repaired.rig, vec![series], repaired.context.clone())
            },
            repaired,
        })
    }

    /// True over declared inertia of vehicle and wheel.
    fn inertia_shares(&self) -> (f64, f64) {
        let share = |stage| 1.0 + self.applied(stage).inertia_change;
        (share(Stage::Vehicle), share(Stage::Wheel))
    }

    /// State of wheel or vehicle after the mechanisms of that stage, and of the drag channel's scale.
    fn applied(&self, stage: Stage) -> State<f64> {
        let series = &self.data.series[0];
        let mut state = State::empty();
        state.opposing = vec![0.0; series.len()];
        state.brake = series
            .torque
            .as_ref()
            .map(|torque| torque.smooth.clone())
            .unwrap_or_default();
        for term in &self.dynamics.terms {
            let mechanism: &dyn Mechanism<f64> = self.data.catalogue.get(term.entry);
            if mechanism.acts_at(stage) {
                mechanism.apply(&term.parameters, series, &self.data.context, &mut state);
            }
        }
        state
    }

    /// What the plant has to be given beside its base law from now on.
    fn forces(&mut self, plant: &Plant, brake: &Brake, scenario: &Scenario) -> Held {
        let contact = plant.contact(scenario.normal_force_n);
        let base = plant.drag_n(&contact);
        self.push(&contact, brake.torque_nm());
        let (wheel, vehicle) = (self.applied(Stage::Wheel), self.applied(Stage::Vehicle));
        let last = |values: &[f64]| values.last().copied().unwrap_or(0.0);
        let beside = if contact.vehicle_speed_m_s < SLOWEST_M_S {
            0.0
        } else {
            let read = self.contact_force();
            read * wheel.true_share(read) - base
        };
        let beside = if beside.is_finite() { beside } else { 0.0 };
        Held {
            vehicle_n: beside + last(&vehicle.opposing),
            wheel_nm: -scenario.rig.wheel.radius_m * beside
                + last(&wheel.opposing)
                + (last(&wheel.brake) - brake.torque_nm()),
        }
    }

    /// Force in the contact now, as the load cell's scale has it.
    fn contact_force(&self) -> f64 {
        let data = &self.data;
        let state = tyre(
            &data.catalogue,
            &self.tyre,
            &self.tyre.vector(),
            &data.series[0],
            &data.context,
        );
        let mut force = state.contact.unwrap_or(state.force);
        let acting: Vec<_> = self
            .repaired
            .corrections
            .iter()
            // A force that is added may be the load cell's, and a slip that is read wrongly is no slip; the rest is the
            // contact's.
            .filter(|c| match Action::parse(&c.acts_on) {
                Some(Action::Friction | Action::CriticalSlip) => true,
                Some(Action::Force | Action::Slip) | None => false,
            })
            .collect();
        if !acting.is_empty() {
            let levers = Levers::new(data, &self.tyre);
            for correction in acting {
                let added = correction.apply(data, &levers, 0).unwrap_or_default();
                for (force, added) in force.iter_mut().zip(added) {
                    *force += added;
                }
            }
        }
        if !self.repaired.corrections.is_empty() {
            let left = self.repaired.leave_to_base(data, &self.tyre, &mut force);
            // The base law was checked with the model.
            left.unwrap_or_default();
        }
        force.last().copied().unwrap_or(0.0)
    }

    /// Puts an instant at the end of the run so far.
    fn push(&mut self, contact: &Contact, torque_nm: f64) {
        let series = &mut self.data.series[0];
        let step = series
            .time
            .last()
            .map_or(series.typical_dt, |last| contact.time_s - last);
        let (omega, v) = (contact.wheel_speed_rad_s, contact.vehicle_speed_m_s);
        let along = |so_far: &[f64], channel: &Prepared, now: f64| {
            let before = channel.raw.last().copied().unwrap_or(now);
            so_far
                .last()
                .map_or(0.0, |sum| sum + 0.5 * step * (before + now))
        };
        let distance = along(&series.distance, &series.speed, v);
        let angle = along(&series.angle, &series.wheel, omega);
        series.distance.push(distance);
        series.angle.push(angle);
        series.time.push(contact.time_s);
        series.dt.push(step);
        push_exactly(&mut series.wheel, omega, step);
        push_exactly(&mut series.speed, v, step);
        push_exactly(&mut series.load, contact.normal_force_n, step);
        if let Some(torque) = &mut series.torque {
            push_exactly(torque, torque_nm, step);
        }
        series.still.push(v == 0.0 && omega == 0.0);
        series.rolling.push(v >= SLOWEST_M_S);
    }
}

/// A value that is known exactly: smoothing has nothing to do.
fn push_exactly(channel: &mut Prepared, value: f64, step: f64) {
    let before = channel.raw.last().copied().unwrap_or(value);
    channel.rate.push((value - before) / step);
    channel.raw.push(value);
    channel.smooth.push(value);
    channel.smoother.push(value);
    channel.variance_share.push(0.0);
}
