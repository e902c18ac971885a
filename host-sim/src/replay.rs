//! A recording's inputs under a repaired model: speeds, load and all other columns as recorded, the drag as the
//! model has it.

use muslip::sample::slip_ratio;
use muslip_diagnose::campaign::Run;
use muslip_diagnose::repaired::{Repaired, RepairedError, Which};
use muslip_recordings::load::Loaded;
use muslip_recordings::model_file::ModelFile;
use muslip_recordings::recording::Channel;

use super::model_noise::DragNoise;
use super::repaired::{domain, within};

/// A replayed recording.
#[derive(Debug, Clone)]
pub struct Replay {
    /// Headers of the columns.
    pub names: Vec<String>,
    /// The columns.
    pub columns: Vec<Vec<f64>>,
    /// Rows at speed that lie outside the model's domain.
    pub outside: usize,
}

/// A recording that cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The model cannot be run.
    #[error(transparent)]
    Model(#[from] RepairedError),
    /// Nothing of the recording lies where the model was fitted.
    #[error("no row lies in the model's domain ({0})")]
    Outside(String),
}

/// Below this speed in m/s slip has no meaning.
const SLOWEST_M_S: f64 = 0.5;

/// Replays a recording; with a seed its drag has the model's noise.
///
/// # Errors
/// [`ReplayError`].
pub fn replay(
    model: &ModelFile,
    loaded: &Loaded,
    seed: Option<u64>,
) -> Result<Replay, ReplayError> {
    let repaired = &model.repaired;
    let run = &loaded.run;
    let outside = rows_outside(repaired, run)?;
    let mut drag = repaired.predict(run, Which::Repaired)?.drag_force_n;
    if let Some(seed) = seed {
        let mut noise = DragNoise::new(&repaired.noise, seed);
        let sigma = repaired.reading_sigma(run, &drag);
        for (force, sigma) in drag.iter_mut().zip(sigma) {
            *force += noise.next(noise.of_size(sigma));
        }
    }
    let mut names = Vec::new();
    let mut columns = Vec::new();
    let mut put = |name: &str, column: Vec<f64>| {
        names.push(name.to_owned());
        columns.push(column);
    };
    put(Channel::Time.name(), loaded.recorded_time_s());
    put(Channel::WheelSpeed.name(), run.wheel_speed_rad_s.clone());
    put(Channel::VehicleSpeed.name(), run.vehicle_speed_m_s.clone());
    put(Channel::DragForce.name(), drag);
    put(Channel::NormalForce.name(), run.normal_force_n.clone());
    for (channel, column) in [
        (Channel::BrakeTorque, &run.brake_torque_nm),
        (Channel::BrakePressure, &run.brake_pressure_pa),
    ] {
        if let Some(column) = column {
            put(channel.name(), column.clone());
        }
    }
    for (name, column) in &run.extra {
        put(name, column.clone());
    }
    Ok(Replay {
        names,
        columns,
        outside,
    })
}

/// Rows at speed of which slip, speed or load lies outside the model's domain.
fn rows_outside(model: &Repaired, run: &Run) -> Result<usize, ReplayError> {
    let ranges: Vec<(&str, [f64; 2])> = ["slip", "vehicle_speed_m_s", "normal_force_n"]
        .into_iter()
        .filter_map(|key| Some((key, domain(model, key)?)))
        .collect();
    let (mut rolling, mut outside) = (0, 0);
    let rows = run
        .wheel_speed_rad_s
        .iter()
        .zip(&run.vehicle_speed_m_s)
        .zip(&run.normal_force_n);
    for ((omega, v), load) in rows {
        let Some(slip) = slip_ratio(*omega, *v, model.rig.radius_m) else {
            continue;
        };
        if *v < SLOWEST_M_S || !load.is_finite() {
            continue;
        }
        rolling += 1;
        let inside = ranges.iter().all(|(key, range)| {
            within(
                *range,
                match *key {
                    "slip" => slip,
                    "normal_force_n" => *load,
                    _ => *v,
                },
            )
        });
        outside += usize::from(!inside);
    }
    if rolling > 0 && outside == rolling {
        let ranges: Vec<String> = ranges
            .iter()
            .map(|(key, [low, high])| format!("{key} {low:.4} to {high:.4}"))
            .collect();
        return Err(ReplayError::Outside(ranges.join(", ")));
    }
    Ok(outside)
}
