//! From a rig file and recordings to what the engine takes.

use std::path::Path;

use muslip_diagnose::campaign;

use crate::input_error::InputError;
use crate::recording::{Channel, Required, Run};
use crate::rig_file::RigFile;

/// The rig as the engine takes it.
#[must_use]
pub fn rig(file: &RigFile) -> campaign::Rig {
    campaign::Rig {
        radius_m: file.wheel.radius_m,
        wheel_inertia_kg_m2: file.wheel.inertia_kg_m2,
        mass_kg: file.vehicle.mass_kg,
        coasting: file.vehicle.coasting,
        torque_per_pressure_nm_pa: file.brake.map(|b| b.torque_per_pressure_nm_pa),
        peak_friction: file.tyre.peak_friction,
        critical_slip: file.tyre.critical_slip,
        law_fixed: file.tyre.fixed,
        declared_noise: file.noise.clone(),
    }
}

/// A whole recording as the engine takes it.
///
/// # Errors
/// [`InputError`] as for [`Run::read`].
pub fn run(path: &Path, required: Required) -> Result<campaign::Run, InputError> {
    let recording = Run::read(path, required)?;
    let column = |channel| recording.channel(channel).map(<[f64]>::to_vec);
    let or_missing = |channel| column(channel).unwrap_or_else(|| vec![f64::NAN; recording.rows()]);
    Ok(campaign::Run {
        name: path.display().to_string(),
        time_s: or_missing(Channel::Time),
        wheel_speed_rad_s: or_missing(Channel::WheelSpeed),
        vehicle_speed_m_s: or_missing(Channel::VehicleSpeed),
        drag_force_n: column(Channel::DragForce).unwrap_or_default(),
        normal_force_n: or_missing(Channel::NormalForce),
        brake_torque_nm: column(Channel::BrakeTorque),
        brake_pressure_pa: column(Channel::BrakePressure),
        extra: recording
            .extra()
            .map(|(name, values)| (name.to_owned(), values.to_vec()))
            .collect(),
    })
}
