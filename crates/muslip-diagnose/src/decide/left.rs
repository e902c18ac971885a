//! What is left open beside a model.

use super::stands::left_open;
use super::trial::{Claim, Trial};
use crate::constants::FORM_LEFT;
use crate::innovations::dependence::Dependence;

/// What is left beside a model: the free dependence that gains most where the noise is no larger than the sensors make
/// plausible.
pub struct Left {
    /// It.
    pub dependence: Dependence,
    /// Its gain there in nats.
    pub gain: f64,
    /// That as a share of what was taken up and it gain together.
    pub share: f64,
}

impl Left {
    /// Of a round's trials; nothing where it is so small beside what was taken up that it is what that one's form leaves.
    pub fn of(trials: &[Trial], taken_up: f64) -> Option<Self> {
        let open = trials.iter().filter(|t| left_open(t));
        let most = open.max_by(|a, b| a.at_sensors.0.total_cmp(&b.at_sensors.0))?;
        let Claim::Dependence(dependence) = &most.claim else {
            return None;
        };
        let gain = most.at_sensors.0;
        (gain > FORM_LEFT * taken_up).then(|| Self {
            dependence: dependence.clone(),
            gain,
            share: gain / (gain + taken_up),
        })
    }
}
