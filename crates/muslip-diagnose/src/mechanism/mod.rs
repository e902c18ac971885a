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
    Against, Describe, Facts, Fitted, Mechanism, Parameter, Reported, Residuals, Search, Speed,
    Stage,
};
pub use guide::{Alias, Compensation, Example, Guide, Kind, Memory, Sign};
pub use id::Id;
pub use state::{Law, State};

pub use crate::balance::Balance;
pub use crate::context::{Before, Context};
use crate::number::Number;

/// All mechanisms in all their forms. The order is part of no file format.
#[must_use]
pub fn catalogue<T: Number>() -> Vec<Box<dyn Mechanism<T>>> {
    let mut all: Vec<Box<dyn Mechanism<T>>> = vec![
        Box::new(load_crosstalk::LoadCrosstalk),
        Box::new(inertial_reaction::InertialReaction),
        Box::new(force_delay::ForceDelay),
        Box::new(force_lag::ForceLag),
        Box::new(load_sensitivity::LoadSensitivity {
            with_stiffness: false,
        }),
        Box::new(load_sensitivity::LoadSensitivity {
            with_stiffness: true,
        }),
        Box::new(slip_hysteresis::SlipHysteresis),
        Box::new(rolling_resistance::RollingResistance { growing: false }),
        Box::new(rolling_resistance::RollingResistance { growing: true }),
        Box::new(surface_patch::SurfacePatch { patches: 1 }),
        Box::new(surface_patch::SurfacePatch { patches: 2 }),
        Box::new(force_gain::ForceGain),
        Box::new(aero_drag::AeroDrag),
        Box::new(grade_or_drive::GradeOrDrive),
        Box::new(vehicle_inertia::VehicleInertia),
        Box::new(brake_fade::BrakeFade),
        Box::new(brake_lag::BrakeLag),
        Box::new(wheel_inertia::WheelInertia),
    ];
    for form in structural_resonance::FORMS {
        all.push(Box::new(structural_resonance::StructuralResonance { form }));
    }
    for form in force_saturation::FORMS {
        all.push(Box::new(force_saturation::ForceSaturation { form }));
    }
    for form in curve_shape::FORMS {
        all.push(Box::new(curve_shape::CurveShape { form }));
    }
    for form in speed_sensitivity::FORMS {
        all.push(Box::new(speed_sensitivity::SpeedSensitivity { form }));
    }
    for form in thermal_fade::FORMS {
        all.push(Box::new(thermal_fade::ThermalFade { form }));
    }
    for form in relaxation_length::FORMS {
        all.push(Box::new(relaxation_length::RelaxationLength { form }));
    }
    for form in effective_radius::FORMS {
        all.push(Box::new(effective_radius::EffectiveRadius { form }));
    }
    for form in wear_drift::FORMS {
        all.push(Box::new(wear_drift::WearDrift { form }));
    }
    for form in zero_drift::FORMS {
        all.push(Box::new(zero_drift::ZeroDrift { form }));
    }
    for form in once_a_turn::FORMS {
        let of = run_out::Of::Drag;
        all.push(Box::new(run_out::RunOut { form, of }));
        if form.orders == 1 {
            let of = run_out::Of::Radius;
            all.push(Box::new(run_out::RunOut { form, of }));
        }
    }
    for form in once_a_turn::FORMS {
        all.push(Box::new(encoder_ripple::EncoderRipple { form }));
    }
    for form in bearing_drag::FORMS {
        all.push(Box::new(bearing_drag::BearingDrag { form }));
    }
    all.push(Box::new(vehicle_speed_delay::VehicleSpeedDelay));
    all.push(Box::new(wheel_speed_delay::WheelSpeedDelay));
    all
}
