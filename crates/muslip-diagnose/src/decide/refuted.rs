//! Names that a counter-form, which no mechanism of theirs takes, says better.

use super::rank::softness;
use super::trial::Trial;
use crate::data::Data;
use crate::mechanism::Id;

/// Names that a counter-form clearly outweighs: what there is of them is something else.
pub fn refuted(data: &Data, trials: &[Trial]) -> Vec<Id> {
    let weights = |counter: bool| {
        trials.iter().filter_map(move |t| {
            let (id, entry) = t.mechanism()?;
            let own = data.catalogue.get(entry).facts().counter_form == counter;
            own.then(|| (id, t.weight()))
        })
    };
    let most = |id: Id| {
        let own = weights(false).filter(|own| own.0 == id);
        own.map(|own| own.1).fold(f64::NEG_INFINITY, f64::max)
    };
    weights(true)
        .filter(|&(id, weight)| weight - most(id) > softness(weight))
        .map(|own| own.0)
        .collect()
}

/// Takes names from trials that these refute, or that were refuted before.
pub fn refute(data: &Data, trials: &mut [Trial], before: &[Id]) {
    let now = refuted(data, trials);
    for trial in trials {
        let lost = |id: Id| now.contains(&id) || before.contains(&id);
        trial.own &= !trial.mechanism().is_some_and(|(id, _)| lost(id));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decide::toy::of_name;
    use crate::decide::trial::Claim;
    use crate::innovations::toy::{self, Noise, stop};

    #[test]
    fn a_name_is_refuted_by_its_counter_form_where_that_says_clearly_more() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let entries = data.catalogue.entries();
        let counter = entries.iter().position(|m| m.facts().counter_form).unwrap();
        let stays_beside = |before: &[Id], of_counter: f64, named: Id| {
            let mut trials = [
                of_name(&data, &base, named, 100.0, 3.0),
                Trial {
                    claim: Claim::Mechanism(entries[counter].id(), counter),
                    ..of_name(&data, &base, Id::SlipHysteresis, of_counter, 3.0)
                },
            ];
            refute(&data, &mut trials, before);
            trials[0].own
        };
        let stays = |of_counter: f64, named: Id| stays_beside(&[], of_counter, named);
        // Softness of 110 nats is 7.3.
        assert!(!stays(110.0, Id::SlipHysteresis));
        assert!(stays(106.0, Id::SlipHysteresis));
        assert!(stays(900.0, Id::LoadSensitivity));
        // Once refuted it stays so beside what was taken up in its place.
        assert!(!stays_beside(
            &[Id::SlipHysteresis],
            10.0,
            Id::SlipHysteresis
        ));
    }
}
