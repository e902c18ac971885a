//! The judge: one campaign's answer against its truth, then the figures of all with their confidence.
//!
//! | what | module |
//! | --- | --- |
//! | one answer | [`case`] |
//! | all answers | [`score`] |
//! | one figure | [`headline`] |
//! | figures and tables | [`tally`], [`bars`], [`cause`] |
//! | beside other methods | [`rivals`] |

pub mod bars;
pub mod case;
pub mod cause;
pub mod headline;
pub mod rivals;
pub mod score;
pub mod tally;
