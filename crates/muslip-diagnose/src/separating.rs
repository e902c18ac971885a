//! The run that would tell two mechanisms apart.

use crate::mechanism::Id;

/// What a test plan varies when it is asked for.
const RUNS: [(&[Id], &[Id], &str); 14] = {
    use Id::{
        AeroDrag, BearingDrag, BrakeFade, BrakeLag, CurveShape, EffectiveRadius, EncoderRipple,
        ForceDelay, ForceGain, ForceLag, ForceSaturation, GradeOrDrive, InertialReaction,
        LoadCrosstalk, LoadSensitivity, RelaxationLength, RollingResistance, RunOut,
        SlipHysteresis, SpeedSensitivity, StructuralResonance, SurfacePatch, ThermalFade,
        VehicleInertia, WearDrift, WheelInertia, ZeroDrift,
    };
    [
        (
            &[LoadCrosstalk],
            &[RollingResistance, ZeroDrift, LoadSensitivity],
            "Load the standing wheel in steps, brake released: crosstalk moves the reading with the load, nothing else does.",
        ),
        (
            &[RollingResistance],
            &[EffectiveRadius, ZeroDrift],
            "Roll unbraked and then drive the wheel slightly: rolling resistance stays, a wrong radius changes its sign with slip.",
        ),
        (
            &[ForceDelay, ForceLag],
            &[RelaxationLength, SlipHysteresis],
            "Repeat the same brake ramp at a third and at three times the speed: a lag of the channel keeps its time, a relaxation length keeps its distance.",
        ),
        (
            &[ForceDelay],
            &[ForceLag, StructuralResonance],
            "Tap the load cell (an impulse, wheel standing): a delay keeps the pulse's shape, a filter widens it, a resonance rings.",
        ),
        (
            &[StructuralResonance],
            &[ForceLag, RunOut, InertialReaction],
            "Tap the load cell with the wheel standing, then repeat the ramp at another speed: a resonance keeps its frequency.",
        ),
        (
            &[InertialReaction],
            &[ForceLag, ForceDelay, SlipHysteresis, RelaxationLength],
            "Spin the lifted wheel up and stop it with the brake: a reaction shows without any tyre force.",
        ),
        (
            &[ThermalFade],
            &[
                SpeedSensitivity,
                WearDrift,
                CurveShape,
                ZeroDrift,
                SlipHysteresis,
            ],
            "Repeat the same ramp after rests of 0, 30 and 120 s: heat recovers, wear does not, speed and shape do not care.",
        ),
        (
            &[SpeedSensitivity],
            &[CurveShape, LoadSensitivity, WearDrift],
            "Repeat the ramp at two speeds a factor of three apart, at one load: shape follows slip, speed sensitivity follows sliding speed.",
        ),
        (
            &[WearDrift],
            &[ZeroDrift, SurfacePatch, LoadSensitivity],
            "Repeat the first run at the end, and read the zero with the wheel lifted before and after.",
        ),
        (
            &[SurfacePatch],
            &[ThermalFade, ZeroDrift, SpeedSensitivity],
            "Run the same track again, entering it ten metres later: a patch stays where it is on the track.",
        ),
        (
            &[RunOut],
            &[EncoderRipple],
            "Turn the encoder's ring on the hub by a quarter and repeat: a ripple of the encoder moves with it, a run-out of the tyre does not.",
        ),
        (
            &[ForceGain],
            &[VehicleInertia, WheelInertia, BearingDrag, GradeOrDrive],
            "Hang a known weight on the load cell; or ballast the vehicle by a known mass and repeat the stop.",
        ),
        (
            &[AeroDrag],
            &[GradeOrDrive, VehicleInertia, ForceGain],
            "Coast down unbraked from the highest speed, in both directions of the track.",
        ),
        (
            &[BrakeFade, BrakeLag],
            &[
                WheelInertia,
                BearingDrag,
                ForceGain,
                ForceSaturation,
                CurveShape,
            ],
            "Spin the lifted wheel up and apply the brake in steps, cold and hot: inertia and bearing show in the coast-down, lag and fade in the stops.",
        ),
    ]
};

/// The run that tells these two apart, in one sentence.
#[must_use]
pub fn separating_test(a: Id, b: Id) -> &'static str {
    RUNS.iter()
        .find(|(one, others, _)| (one.contains(&a) && others.contains(&b)) || (one.contains(&b) && others.contains(&a)))
        .or_else(|| RUNS.iter().find(|(one, others, _)| (one.contains(&a) && one.contains(&b)) || (others.contains(&a) && others.contains(&b))))
        .or_else(|| RUNS.iter().find(|(one, _, _)| one.contains(&a) || one.contains(&b)))
        .map_or(
            "Repeat the ramp at two speeds and two loads, with a free-rolling stretch and a standstill before and after.",
            |(_, _, text)| text,
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_has_a_run_that_would_tell_it_apart() {
        for &a in Id::ALL {
            for &b in Id::ALL {
                assert!(separating_test(a, b).len() > 40);
            }
        }
        assert!(separating_test(Id::LoadCrosstalk, Id::RollingResistance).contains("standing"));
        assert!(separating_test(Id::RelaxationLength, Id::ForceLag).contains("speed"));
    }
}
