//! The judge: one campaign's answer against its truth, then the figures of all with their confidence.
//!
//! | what | module |
//! | --- | --- |
//! | one answer | [`case`] |
//! | its names, delays, findings and predictions | [`names`], [`timing`], [`findings`], [`gain`] |
//! | all answers | [`score`] |
//! | one figure | [`headline`] |
//! | figures and tables | [`tally`], [`bars`], [`cause`] |
//! | what it says of its own certainty | [`calibration`], [`coverage`], [`prediction`], [`uniform`] |
//! | what it finds at a fixed rate of false alarms | [`power`] |
//! | ideal sensors, real chains; drawing campaigns anew | [`family`] |
//! | beside other methods | [`rivals`] |

pub mod bars;
pub mod calibration;
pub mod case;
pub mod cause;
pub mod coverage;
pub mod family;
pub mod findings;
pub mod gain;
pub mod headline;
pub mod names;
pub mod power;
pub mod prediction;
pub mod rivals;
pub mod score;
pub mod tally;
pub mod timing;
pub mod uniform;

use case::Case;
use headline::Headline;

/// The figures of certainty and power, for the bars and the ratchet.
pub fn certainty(cases: &[Case]) -> Vec<Headline> {
    [
        calibration::headlines,
        coverage::headlines,
        prediction::headlines,
        uniform::headlines,
        power::headlines,
    ]
    .iter()
    .flat_map(|headlines| headlines(cases))
    .collect()
}
