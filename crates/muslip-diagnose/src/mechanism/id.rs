//! Names of the vocabulary.

use crate::balance::Balance;

macro_rules! ids {
    ($($variant:ident $word:literal $balance:ident $what:literal;)*) => {
        /// A mechanism of the vocabulary.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Id { $(#[doc = $what] $variant,)* }

        impl Id {
            /// Every mechanism, in the vocabulary's order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The contract's word.
            #[must_use]
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $word,)* }
            }

            /// The balance that it breaks.
            #[must_use]
            pub fn balance(self) -> Balance {
                match self { $(Self::$variant => Balance::$balance,)* }
            }

            /// What was left out, in words.
            #[must_use]
            pub fn what(self) -> &'static str {
                match self { $(Self::$variant => $what,)* }
            }

            /// The mechanism of this word.
            #[must_use]
            pub fn parse(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|id| id.as_str() == word)
            }
        }
    };
}

ids! {
    CurveShape "curve_shape" Tyre "the curve's shape beside its peak";
    LoadSensitivity "load_sensitivity" Tyre "peak friction that changes with normal force";
    SpeedSensitivity "speed_sensitivity" Tyre "friction that changes with sliding or vehicle speed";
    ThermalFade "thermal_fade" Tyre "friction that changes with tread temperature";
    RelaxationLength "relaxation_length" Tyre "force that builds up over a rolling distance";
    RollingResistance "rolling_resistance" Tyre "drag of the rolling, unbraked wheel";
    EffectiveRadius "effective_radius" Tyre "a rolling radius that is not the rig file's";
    SurfacePatch "surface_patch" Tyre "friction that differs over a stretch of the track";
    WearDrift "wear_drift" Tyre "friction that shifts with use and does not recover";
    SlipHysteresis "slip_hysteresis" Tyre "different curves for rising and falling slip";
    ForceDelay "force_delay" Tyre "a drag channel that reports late";
    ForceLag "force_lag" Tyre "a drag channel behind a low-pass filter";
    StructuralResonance "structural_resonance" Tyre "a load cell and mount that ring";
    InertialReaction "inertial_reaction" Tyre "a share of the wheel's acceleration in the drag reading";
    LoadCrosstalk "load_crosstalk" Tyre "a share of the normal force in the drag reading";
    ZeroDrift "zero_drift" Tyre "a drag channel whose zero moves";
    ForceGain "force_gain" Vehicle "a wrong scale of the drag channel";
    ForceSaturation "force_saturation" Tyre "a drag channel that clips";
    RunOut "run_out" Tyre "drag that varies with the wheel's angle";
    EncoderRipple "encoder_ripple" Tyre "a wheel speed reading that varies with the wheel's angle";
    VehicleSpeedDelay "vehicle_speed_delay" Tyre "a vehicle-speed channel that reports late";
    WheelSpeedDelay "wheel_speed_delay" Tyre "a wheel-speed channel that reports late";
    AeroDrag "aero_drag" Vehicle "a deceleration that grows with speed squared";
    GradeOrDrive "grade_or_drive" Vehicle "a constant force on the vehicle";
    VehicleInertia "vehicle_inertia" Vehicle "a translating mass that is not the rig file's";
    BearingDrag "bearing_drag" Wheel "a torque that opposes the wheel's rotation";
    BrakeFade "brake_fade" Wheel "torque per pressure that falls with brake temperature";
    BrakeLag "brake_lag" Wheel "brake torque that follows pressure with a lag";
    WheelInertia "wheel_inertia" Wheel "a wheel inertia that is not the rig file's";
}
