//! What can be concealed: every mechanism in several truth forms, and effects outside the vocabulary.
//!
//! A form is the physics used to make the recordings. None of them needs to be what a diagnosis
//! would write down; each belongs to one mechanism of the contract, or to none.

use serde::{Deserialize, Serialize};

/// One truth form. The comment behind a form says what its strength `a` multiplies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    CurveMagic,
    CurveBurckhardt,
    CurveBrush,
    CurveBroad,
    LoadPower,
    LoadLinear,
    LoadPowerStiff,
    SpeedSlideExponential,
    SpeedVehicleLinear,
    SpeedStribeck,
    SpeedSlideRational,
    ThermalOneNode,
    ThermalTwoNode,
    ThermalAirCooled,
    RelaxSlip,
    RelaxForce,
    RelaxBrush,
    RelaxLoadSlip,
    RollConstant,
    RollSpeed,
    RadiusConstant,
    RadiusLoad,
    RadiusSpeed,
    PatchHard,
    PatchSmooth,
    PatchSeveral,
    WearEnergy,
    WearRun,
    WearDistance,
    HysteresisDahl,
    HysteresisSign,
    HysteresisPlay,
    DelayPure,
    DelayHold,
    VehicleLate,
    VehicleLateHeld,
    WheelLate,
    WheelLateWindow,
    LagOnePole,
    LagTwoPoles,
    LagMovingAverage,
    ResonanceMode,
    ResonanceShare,
    InertialDirect,
    InertialSoft,
    CrosstalkConstant,
    CrosstalkBent,
    DriftLinear,
    DriftWarmUp,
    DriftClock,
    DriftSlow,
    GainConstant,
    GainBent,
    SaturationHard,
    SaturationSoft,
    RunOutLoad,
    RunOutRadius,
    RunOutAdditive,
    RippleSine,
    RippleTiming,
    AeroStill,
    AeroHeadwind,
    GradeConstant,
    GradeDrive,
    MassConstant,
    MassFuel,
    BearingConstant,
    BearingSpeed,
    BearingLoad,
    FadeTemperature,
    FadeEnergy,
    BrakeLagOne,
    BrakeLagTwo,
    BrakeLagDead,
    InertiaConstant,
    InertiaGrowth,
    // outside the vocabulary
    OutColumnFriction,
    OutColumnSlip,
    OutColumnSteer,
    OutColumnZero,
    OutColumnWind,
    OutColumnOil,
    OutBrakeTime,
    OutHum,
    OutSlipBand,
    OutLoadLag,
    OutSlipRate,
    OutTrackWave,
    OutCellBacklash,
    OutSpeedBand,
    OutLoadRate,
    OutTimeStep,
    OutDiscWave,
}

use Form as F;

/// The vocabulary of the contract, each with its balance and its truth forms.
#[rustfmt::skip] // a row each
pub const VOCABULARY: [(&str, &str, &[Form]); 29] = [
    ("curve_shape", "tyre", &[F::CurveMagic, F::CurveBurckhardt, F::CurveBrush, F::CurveBroad]),
    ("load_sensitivity", "tyre", &[F::LoadPower, F::LoadLinear, F::LoadPowerStiff]),
    ("speed_sensitivity", "tyre", &[F::SpeedSlideExponential, F::SpeedVehicleLinear, F::SpeedStribeck, F::SpeedSlideRational]),
    ("thermal_fade", "tyre", &[F::ThermalOneNode, F::ThermalTwoNode, F::ThermalAirCooled]),
    ("relaxation_length", "tyre", &[F::RelaxSlip, F::RelaxForce, F::RelaxBrush, F::RelaxLoadSlip]),
    ("rolling_resistance", "tyre", &[F::RollConstant, F::RollSpeed]),
    ("effective_radius", "tyre", &[F::RadiusConstant, F::RadiusLoad, F::RadiusSpeed]),
    ("surface_patch", "tyre", &[F::PatchHard, F::PatchSmooth, F::PatchSeveral]),
    ("wear_drift", "tyre", &[F::WearEnergy, F::WearRun, F::WearDistance]),
    ("slip_hysteresis", "tyre", &[F::HysteresisDahl, F::HysteresisSign, F::HysteresisPlay]),
    ("force_delay", "tyre", &[F::DelayPure, F::DelayHold]),
    ("force_lag", "tyre", &[F::LagOnePole, F::LagTwoPoles, F::LagMovingAverage]),
    ("structural_resonance", "tyre", &[F::ResonanceMode, F::ResonanceShare]),
    ("inertial_reaction", "tyre", &[F::InertialDirect, F::InertialSoft]),
    ("load_crosstalk", "tyre", &[F::CrosstalkConstant, F::CrosstalkBent]),
    ("zero_drift", "tyre", &[F::DriftLinear, F::DriftWarmUp, F::DriftClock, F::DriftSlow]),
    ("force_gain", "vehicle", &[F::GainConstant, F::GainBent]),
    ("force_saturation", "tyre", &[F::SaturationHard, F::SaturationSoft]),
    ("run_out", "tyre", &[F::RunOutLoad, F::RunOutRadius, F::RunOutAdditive]),
    ("encoder_ripple", "tyre", &[F::RippleSine, F::RippleTiming]),
    ("vehicle_speed_delay", "tyre", &[F::VehicleLate, F::VehicleLateHeld]),
    ("wheel_speed_delay", "tyre", &[F::WheelLate, F::WheelLateWindow]),
    ("aero_drag", "vehicle", &[F::AeroStill, F::AeroHeadwind]),
    ("grade_or_drive", "vehicle", &[F::GradeConstant, F::GradeDrive]),
    ("vehicle_inertia", "vehicle", &[F::MassConstant, F::MassFuel]),
    ("bearing_drag", "wheel", &[F::BearingConstant, F::BearingSpeed, F::BearingLoad]),
    ("brake_fade", "wheel", &[F::FadeTemperature, F::FadeEnergy]),
    ("brake_lag", "wheel", &[F::BrakeLagOne, F::BrakeLagTwo, F::BrakeLagDead]),
    ("wheel_inertia", "wheel", &[F::InertiaConstant, F::InertiaGrowth]),
];

/// Effects that no mechanism of the vocabulary accounts for: the form, its balance, and the words
/// that a diagnosis may use for the variable that it depends on (a leading `@` stands for the
/// header of the recorded column).
pub const OUTSIDE: [(Form, &str, &[&str]); 17] = [
    (F::OutColumnFriction, "tyre", &["@"]),
    (F::OutColumnSlip, "tyre", &["@"]),
    (F::OutColumnSteer, "tyre", &["@"]),
    (F::OutColumnZero, "tyre", &["@"]),
    (F::OutColumnWind, "vehicle", &["@"]),
    (F::OutColumnOil, "wheel", &["@"]),
    (F::OutBrakeTime, "tyre", &["time_s"]),
    (F::OutHum, "tyre", &["time_s"]),
    (F::OutSlipBand, "tyre", &["slip"]),
    (F::OutLoadLag, "tyre", &["normal_force_n"]),
    (F::OutSlipRate, "tyre", &["slip_rate"]),
    (F::OutTrackWave, "tyre", &["distance_m"]),
    (F::OutCellBacklash, "tyre", &[]),
    (F::OutSpeedBand, "tyre", &["vehicle_speed_m_s"]),
    (F::OutLoadRate, "tyre", &["normal_force_n"]),
    (F::OutTimeStep, "tyre", &["time_s"]),
    (F::OutDiscWave, "wheel", &["wheel_angle_rad"]),
];

/// Mechanisms that recordings of an ordinary plan can hardly tell apart; pairs are never drawn
/// from within one group.
const LOOKALIKES: [&[&str]; 6] = [
    &[
        "vehicle_speed_delay",
        "wheel_speed_delay",
        "force_delay",
        "force_lag",
        "relaxation_length",
        "structural_resonance",
        "slip_hysteresis",
    ],
    &[
        "thermal_fade",
        "speed_sensitivity",
        "wear_drift",
        "surface_patch",
        "curve_shape",
    ],
    &[
        "rolling_resistance",
        "load_crosstalk",
        "effective_radius",
        "zero_drift",
    ],
    &["run_out", "encoder_ripple"],
    &[
        "aero_drag",
        "grade_or_drive",
        "vehicle_inertia",
        "force_gain",
    ],
    &[
        "brake_fade",
        "brake_lag",
        "wheel_inertia",
        "bearing_drag",
        "force_gain",
    ],
];

/// Whether two mechanisms make a sensible pair.
pub fn may_pair(one: &str, other: &str) -> bool {
    one != other
        && !LOOKALIKES
            .iter()
            .any(|group| group.contains(&one) && group.contains(&other))
}

/// The vocabulary entry of a mechanism.
pub fn mechanism(id: &str) -> Option<&'static (&'static str, &'static str, &'static [Form])> {
    VOCABULARY.iter().find(|entry| entry.0 == id)
}

impl Form {
    /// What the recordings must offer for this form to be concealed in them at all.
    pub fn needs(self) -> Needs {
        let mut needs = Needs::default();
        match self {
            F::LoadPower
            | F::LoadLinear
            | F::LoadPowerStiff
            | F::RadiusLoad
            | F::OutLoadLag
            | F::OutLoadRate => needs.load_plan = true,
            F::SpeedSlideExponential
            | F::SpeedVehicleLinear
            | F::SpeedStribeck
            | F::SpeedSlideRational
            | F::RadiusSpeed
            | F::OutSpeedBand => {
                needs.speed_plan = true;
            }
            F::AeroStill | F::AeroHeadwind => {
                needs.coasting = true;
                needs.speed_plan = true;
            }
            F::GradeConstant
            | F::GradeDrive
            | F::MassConstant
            | F::MassFuel
            | F::GainConstant
            | F::GainBent
            | F::VehicleLate
            | F::VehicleLateHeld
            | F::OutColumnWind => {
                needs.coasting = true;
            }
            F::BearingConstant
            | F::BearingSpeed
            | F::BearingLoad
            | F::InertiaConstant
            | F::InertiaGrowth
            | F::OutColumnOil => {
                needs.brake = true;
            }
            F::FadeTemperature
            | F::FadeEnergy
            | F::BrakeLagOne
            | F::BrakeLagTwo
            | F::BrakeLagDead => needs.pressure = true,
            F::OutDiscWave => needs.pressure = true,
            F::CurveMagic | F::CurveBurckhardt | F::CurveBrush | F::CurveBroad | F::OutSlipBand => {
                needs.deep_slip = true
            }
            F::RollConstant
            | F::RollSpeed
            | F::CrosstalkConstant
            | F::CrosstalkBent
            | F::RadiusConstant => needs.free_rolling = true,
            F::WearEnergy | F::WearRun | F::WearDistance => needs.many_runs = true,
            F::RelaxSlip
            | F::RelaxForce
            | F::RelaxBrush
            | F::RelaxLoadSlip
            | F::DelayPure
            | F::DelayHold
            | F::LagOnePole
            | F::LagTwoPoles => {
                needs.speed_plan = true;
            }
            _ => {}
        }
        needs.lively = matches!(
            self,
            F::RelaxSlip
                | F::RelaxForce
                | F::RelaxBrush
                | F::RelaxLoadSlip
                | F::DelayPure
                | F::DelayHold
                | F::VehicleLate
                | F::VehicleLateHeld
                | F::WheelLate
                | F::WheelLateWindow
                | F::LagOnePole
                | F::LagTwoPoles
                | F::LagMovingAverage
                | F::ResonanceMode
                | F::ResonanceShare
                | F::InertialDirect
                | F::InertialSoft
                | F::HysteresisDahl
                | F::HysteresisSign
                | F::HysteresisPlay
                | F::OutSlipRate
                | F::InertiaConstant
                | F::InertiaGrowth
                | F::BrakeLagOne
                | F::BrakeLagTwo
                | F::BrakeLagDead
        );
        // Without a brake column a wrong scale and a wrong mass are one and the same; half the forms
        // leave it at that.
        needs.brake |= matches!(self, F::GainConstant | F::MassConstant);
        needs.column = matches!(
            self,
            F::OutColumnFriction
                | F::OutColumnSlip
                | F::OutColumnSteer
                | F::OutColumnZero
                | F::OutColumnWind
                | F::OutColumnOil
        );
        needs
    }

    /// Whether the strength may have either sign.
    pub fn either_sign(self) -> bool {
        matches!(
            self,
            F::RadiusConstant
                | F::RadiusLoad
                | F::RadiusSpeed
                | F::LoadLinear
                | F::SpeedVehicleLinear
                | F::GradeConstant
                | F::MassConstant
                | F::MassFuel
                | F::GainConstant
                | F::GainBent
                | F::InertialDirect
                | F::InertialSoft
                | F::CrosstalkConstant
                | F::CrosstalkBent
                | F::DriftLinear
                | F::DriftWarmUp
                | F::DriftClock
                | F::DriftSlow
                | F::InertiaConstant
                | F::PatchSmooth
                | F::WearRun
                | F::HysteresisDahl
                | F::HysteresisSign
                | F::OutColumnFriction
                | F::OutColumnSlip
                | F::OutColumnZero
                | F::OutSlipBand
                | F::OutSpeedBand
                | F::OutLoadRate
                | F::OutTimeStep
                | F::OutSlipRate
                | F::OutColumnWind
                | F::OutColumnOil
        )
    }

    /// Whether the effect holds values, so that what it does is no smooth function of its strength.
    pub fn holds(self) -> bool {
        matches!(self, F::DelayHold | F::VehicleLateHeld)
    }

    /// Whether the effect depends on how many runs were driven before.
    pub fn of_the_order(self) -> bool {
        matches!(
            self,
            F::WearEnergy | F::WearRun | F::WearDistance | F::MassFuel | F::DriftClock
        )
    }

    /// Whether a rider who has the fitting runs could predict the effect in a fresh run.
    pub fn predictable(self) -> bool {
        !matches!(self, F::DriftSlow | F::OutHum | F::OutCellBacklash)
    }
}

/// What a plan or a rig must offer for a form.
#[derive(Clone, Copy, Debug, Default)]
pub struct Needs {
    pub load_plan: bool,
    pub speed_plan: bool,
    pub coasting: bool,
    pub brake: bool,
    pub pressure: bool,
    pub deep_slip: bool,
    pub free_rolling: bool,
    pub many_runs: bool,
    pub lively: bool,
    pub column: bool,
}

impl Needs {
    /// What either of two effects needs.
    pub fn and(self, other: Needs) -> Needs {
        Needs {
            load_plan: self.load_plan | other.load_plan,
            speed_plan: self.speed_plan | other.speed_plan,
            coasting: self.coasting | other.coasting,
            brake: self.brake | other.brake,
            pressure: self.pressure | other.pressure,
            deep_slip: self.deep_slip | other.deep_slip,
            free_rolling: self.free_rolling | other.free_rolling,
            many_runs: self.many_runs | other.many_runs,
            lively: self.lively | other.lively,
            column: self.column | other.column,
        }
    }
}
