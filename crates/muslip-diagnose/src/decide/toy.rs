//! Trials for tests.

use super::trial::{Claim, Trial};
use crate::data::Data;
use crate::innovations::hypothesis::Judged;
use crate::innovations::toy;
use crate::mechanism::Id;

/// A trial of a name that is clear: as many nats at both levels of the noise, unseen runs with this t.
pub fn of_name(data: &Data, base: &Judged, id: Id, nats: f64, t: f64) -> Trial {
    Trial {
        claim: Claim::Mechanism(id, toy::entry_of(data, id)),
        gain: nats,
        price: 0.0,
        unseen: (nats, t),
        runs: 6,
        share: 1.0,
        at_sensors: (nats, t),
        first: false,
        own: true,
        says_as_well: None,
        fed_by_chain: false,
        like_noise_of_load: false,
        of_tyre: false,
        remembers: false,
        rings: false,
        lasts: true,
        outlasts_chain: true,
        beside_chain: true,
        readings: 1,
        size: f64::INFINITY,
        predicts: 0.2,
        predicts_within: 0.2,
        unanimous: [false, false],
        without_best: [0.0, 0.0],
        judged: base.clone().without_columns(),
    }
}
