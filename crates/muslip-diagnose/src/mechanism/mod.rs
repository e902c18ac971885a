//! The vocabulary: what a simulation may have left out, one type per mechanism.
//!
//! A new mechanism is a new file here, a variant of [`Id`] and a line in [`catalogue`]. Each has its section of the
//! field guide ([`Guide`]: physics, look-alikes, the run that tells them apart), says where in the chain from speeds to
//! reading it acts and by what equation ([`Facts`]), what its parameters are and where a search for them starts, and how
//! it changes the [`State`] of one run. Some have several forms (a speed effect may follow the sliding or the vehicle
//! speed); each form is an entry of the catalogue.

mod aero_drag;
mod bearing_drag;
mod brake_fade;
mod brake_lag;
mod curve_shape;
mod describe;
mod effective_radius;
mod encoder_ripple;
mod filters;
mod force_delay;
mod force_gain;
mod force_lag;
mod force_saturation;
mod grade_or_drive;
mod guide;
mod id;
mod inertial_reaction;
mod late;
mod load_crosstalk;
mod load_sensitivity;
mod once_a_turn;
mod prelude;
mod relaxation_length;
mod rolling_resistance;
mod run_out;
mod slip_hysteresis;
mod speed_delay;
mod speed_sensitivity;
mod state;
mod structural_resonance;
mod surface_patch;
mod thermal_fade;
mod vehicle_inertia;
mod vehicle_speed_delay;
mod wear_drift;
mod wheel_inertia;
mod wheel_speed_delay;
mod zero_drift;

pub use describe::{
    Against, Audited, Describe, Facts, Fitted, Mechanism, Parameter, Reported, Residuals, Search,
    Speed, Stage,
};
pub use guide::{Alias, Compensation, Example, Guide, Kind, Memory, Sign};
pub use id::Id;
pub use once_a_turn::resolves_angle;
pub use state::{Law, State};

pub use crate::balance::Balance;
pub use crate::context::{Before, Context};
use crate::number::Number;

fn entry<T: Number>(mechanism: impl Mechanism<T> + 'static) -> Box<dyn Mechanism<T>> {
    Box::new(mechanism)
}

/// All mechanisms in all their forms. The order is part of no file format.
#[must_use]
pub fn catalogue<T: Number>() -> Vec<Box<dyn Mechanism<T>>> {
    let mut all: Vec<Box<dyn Mechanism<T>>> = vec![
        entry(load_crosstalk::LoadCrosstalk),
        entry(inertial_reaction::InertialReaction),
        entry(force_delay::ForceDelay),
        entry(force_lag::ForceLag),
        entry(load_sensitivity::LoadSensitivity {
            with_stiffness: false,
        }),
        entry(load_sensitivity::LoadSensitivity {
            with_stiffness: true,
        }),
        entry(rolling_resistance::RollingResistance { growing: false }),
        entry(rolling_resistance::RollingResistance { growing: true }),
        entry(surface_patch::SurfacePatch { patches: 1 }),
        entry(surface_patch::SurfacePatch { patches: 2 }),
        entry(aero_drag::AeroDrag),
        entry(grade_or_drive::GradeOrDrive),
        entry(vehicle_inertia::VehicleInertia),
        entry(brake_fade::BrakeFade),
        entry(brake_lag::BrakeLag),
        entry(wheel_inertia::WheelInertia),
    ];
    all.extend(force_gain::FORMS.map(|form| entry(force_gain::ForceGain { form })));
    all.extend(
        structural_resonance::FORMS
            .map(|form| entry(structural_resonance::StructuralResonance { form })),
    );
    all.extend(
        force_saturation::FORMS.map(|form| entry(force_saturation::ForceSaturation { form })),
    );
    all.extend(curve_shape::FORMS.map(|form| entry(curve_shape::CurveShape { form })));
    all.extend(
        speed_sensitivity::FORMS.map(|form| entry(speed_sensitivity::SpeedSensitivity { form })),
    );
    all.extend(thermal_fade::FORMS.map(|form| entry(thermal_fade::ThermalFade { form })));
    all.extend(
        relaxation_length::FORMS.map(|form| entry(relaxation_length::RelaxationLength { form })),
    );
    all.extend(slip_hysteresis::FORMS.map(|form| entry(slip_hysteresis::SlipHysteresis { form })));
    all.extend(
        effective_radius::FORMS.map(|form| entry(effective_radius::EffectiveRadius { form })),
    );
    all.extend(wear_drift::FORMS.map(|form| entry(wear_drift::WearDrift { form })));
    all.extend(zero_drift::FORMS.map(|form| entry(zero_drift::ZeroDrift { form })));
    all.extend(run_out::RunOut::all().map(entry));
    all.extend(once_a_turn::FORMS.map(|form| entry(encoder_ripple::EncoderRipple { form })));
    all.extend(bearing_drag::FORMS.map(|form| entry(bearing_drag::BearingDrag { form })));
    all.push(entry(vehicle_speed_delay::VehicleSpeedDelay));
    all.push(entry(wheel_speed_delay::WheelSpeedDelay));
    all
}
