//! The recording that `muslip demo` works on, bundled with the command.
//!
//! Origin: `crates/muslip-cli/demo/README.md`.

use host_sim::RigLaw;
use muslip::law::Peak;
use muslip_report::CurveLabel;

/// The rig file.
pub const RIG: &[u8] = include_bytes!("../demo/rig.toml");
/// The recording.
pub const RECORDING: &[u8] = include_bytes!("../demo/run.csv");
/// The tyre law that is true in the recording, in the words of `muslip simulate --law`.
pub const LAW: &str = "rudd:0.92,0.13";

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

/// The rig file of the campaign with a concealed effect.
pub const CONCEALED_RIG: &[u8] = include_bytes!("../demo/concealed/rig.toml");
/// Names and contents of its recordings.
pub const CONCEALED_RUNS: [(&str, &[u8]); 4] = [
    ("run1.csv", include_bytes!("../demo/concealed/run1.csv")),
    ("run2.csv", include_bytes!("../demo/concealed/run2.csv")),
    ("run3.csv", include_bytes!("../demo/concealed/run3.csv")),
    ("run4.csv", include_bytes!("../demo/concealed/run4.csv")),
];
/// The mechanism that was concealed in them, in the vocabulary's word.
pub const CONCEALED: &str = "force_delay";
/// How late the drag channel truly reports in them, in seconds.
pub const CONCEALED_DELAY_S: f64 = 0.012_622_8;
