//! The recording that `muslip demo` works on, bundled with the command.
//!
//! Origin: `host-sim/demo/README.md`.

use muslip::law::Peak;

use crate::report::CurveLabel;
use crate::simulate::RigLaw;

/// The rig file.
pub const RIG: &[u8] = include_bytes!("../demo/rig.toml");
/// The recording.
pub const RECORDING: &[u8] = include_bytes!("../demo/run.csv");
/// The tyre law that is true in the recording, in the words of `muslip simulate --law`.
pub const LAW: &str = "magic-formula:8,1.95,0.92,0";

fn law() -> Option<RigLaw> {
    LAW.parse().ok()
}

/// The true curve, for pictures.
pub fn truth() -> CurveLabel {
    const STEPS: u32 = 200;
    let points = law().map_or_else(Vec::new, |law| {
        (0..=STEPS)
            .map(|step| f64::from(step) / f64::from(STEPS))
            .map(|slip| (slip, law.friction(slip)))
            .collect()
    });
    CurveLabel {
        name: "true curve".into(),
        points,
    }
}

/// The true peak.
pub fn true_peak() -> Peak<f64> {
    law().map_or(
        Peak {
            friction: f64::NAN,
            slip_ratio: f64::NAN,
            is_maximum: false,
        },
        |law| law.peak(),
    )
}
