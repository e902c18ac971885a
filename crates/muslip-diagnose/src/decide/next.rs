//! Which trial of a round is taken up.

use super::rank::{much_more, softness};
use super::stands::{could_stand, stands};
use super::trial::Trial;
use crate::constants::{FORM_LEFT, STILL_SPEAKS};
use crate::data::Data;
use crate::mechanism::{Balance, Id};

/// What was taken up in the rounds before.
#[derive(Default)]
pub struct TakenUp {
    /// Names, and how much spoke for each.
    names: Vec<(Id, f64)>,
    /// What all of it gained at the sensors' noise, in nats.
    pub at_sensors: f64,
    /// Names that stood beside what was taken up before, and how much spoke for each.
    pub stood: Vec<(Id, f64)>,
    /// Names that counter-forms refuted: beside what was taken up in their place they are what its form leaves.
    pub refuted: Vec<Id>,
}

impl TakenUp {
    /// Takes it up.
    pub fn add(&mut self, trial: &Trial) {
        self.at_sensors += trial.at_sensors.0.max(0.0);
        let name = trial.mechanism().map(|(id, _)| (id, trial.weight()));
        self.names.extend(name);
    }

    /// Whether a name stood before, and what was taken up since has taken little of what speaks for it: of two effects the
    /// order in which they are found is an accident.
    fn still_stands(&self, trial: &Trial) -> bool {
        let Some((id, _)) = trial.mechanism() else {
            return false;
        };
        let as_much =
            |&(other, weight): &(Id, f64)| other == id && trial.weight() > STILL_SPEAKS * weight;
        could_stand(trial) && self.stood.iter().any(as_much)
    }
}

/// Whether a trial is of an alias of what was named, and so small beside it that it is what that name's form leaves.
fn left_by_form(trial: &Trial, before: &TakenUp) -> bool {
    let Some((id, _)) = trial.mechanism() else {
        return false;
    };
    before.names.iter().any(|&(other, weight)| {
        let small = trial.weight() < FORM_LEFT * weight;
        small && is_alias(id, other)
    })
}

/// The trial that is taken up: a mechanism, unless a free dependence accounts for much more in a balance that it touches.
/// One in another balance is no other account of it, and has its turn later.
pub fn next<'a>(data: &Data, trials: &'a [Trial], before: &TakenUp) -> Option<&'a Trial> {
    let own = |t: &&Trial| (stands(t) || before.still_stands(t)) && !left_by_form(t, before);
    let standing = || trials.iter().filter(own);
    let Some(named) = standing().find(|t| t.mechanism().is_some()) else {
        return standing().next();
    };
    // That something is there is shown by what stands; what it is, by what all recordings together say.
    let likelier = |t: &&Trial| {
        let of_same = t.claim.balance(data) == named.claim.balance(data);
        t.mechanism().is_some() && of_same && could_stand(t) && !left_by_form(t, before)
    };
    let named = trials.iter().find(likelier).map_or(named, |likeliest| {
        let apart = likeliest.weight() - named.weight() > softness(likeliest.weight());
        if apart { likeliest } else { named }
    });
    let named = standing()
        .find(|t| in_more_balances(data, t, named))
        .unwrap_or(named);
    // Much more at the sensors' noise, too: what the runs' own differences hide of a name says nothing against it.
    let of_named = touches(data, named);
    let instead = |t: &&Trial| {
        of_named.contains(&t.claim.balance(data))
            && much_more(t.weight(), named.weight())
            && much_more(t.at_sensors.0, named.at_sensors.0)
    };
    let mut free = standing().filter(|t| t.mechanism().is_none());
    Some(free.find(instead).unwrap_or(named))
}

/// Balances that a name touches, of those that the recordings form.
pub fn touches(data: &Data, trial: &Trial) -> Vec<Balance> {
    let entry = trial.mechanism().map(|(_, entry)| entry);
    let all = entry.map_or(&[][..], |entry| data.catalogue.get(entry).guide().touches);
    let formed = all.iter().copied().filter(|balance| data.forms(*balance));
    formed.collect()
}

/// Whether a trial is of an alias of a name that accounts for what more balances show, and for much more: one number fits
/// all of them.
fn in_more_balances(data: &Data, trial: &Trial, named: &Trial) -> bool {
    let (Some((id, _)), Some((of, _))) = (trial.mechanism(), named.mechanism()) else {
        return false;
    };
    let wider = || wider(&touches(data, trial), &touches(data, named));
    is_alias(id, of) && much_more(trial.at_sensors.0, named.at_sensors.0) && wider()
}

/// Whether a name is an alias of another.
fn is_alias(id: Id, of: Id) -> bool {
    of.aliases().iter().any(|alias| alias.with == id)
}

/// Whether these balances are all of those, and more.
fn wider(these: &[Balance], those: &[Balance]) -> bool {
    these.len() > those.len() && those.iter().all(|balance| these.contains(balance))
}

/// Whether a trial is one that [`next`] may take.
pub fn could_be_taken(trial: &Trial) -> bool {
    stands(trial) || could_stand(trial)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decide::rank::rank;
    use crate::decide::toy::of_name;
    use crate::innovations::toy::{self, Noise, stop};

    #[test]
    fn one_parameter_that_two_balances_bear_out_comes_before_one_that_one_of_them_does() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let first = |gain_at_sensors: f64, mass_at_sensors: f64| {
            let at = |id, nats, at_sensors| Trial {
                at_sensors: (at_sensors, 14.0),
                ..of_name(&data, &base, id, nats, 3.0)
            };
            let mut trials = [
                at(Id::VehicleInertia, 20.0, mass_at_sensors),
                at(Id::ForceGain, 8.0, gain_at_sensors),
            ];
            rank(&data, &mut trials);
            let taken = next(&data, &trials, &TakenUp::default()).unwrap();
            taken.mechanism().unwrap().0
        };
        assert_eq!(first(1500.0, 900.0), Id::ForceGain);
        // The wheel balance says nothing for it.
        assert_eq!(first(900.0, 900.0), Id::VehicleInertia);
        assert_eq!(first(900.0, 2500.0), Id::VehicleInertia);
    }

    #[test]
    fn a_name_that_stood_before_another_was_taken_up_stands_while_as_much_speaks_for_it() {
        let data = stop(Noise::TYPICAL, 4);
        let base = toy::settled(&data);
        let load = |nats, t| of_name(&data, &base, Id::LoadSensitivity, nats, t);
        let stood = load(100.0, 3.0);
        let mut before = TakenUp::default();
        before.add(&of_name(&data, &base, Id::EncoderRipple, 600.0, 3.0));
        before.stood = vec![(Id::LoadSensitivity, stood.weight())];
        let is_taken = |trial: Trial, before: &TakenUp| next(&data, &[trial], before).is_some();
        // Less even than before it would not stand by itself.
        assert!(is_taken(load(100.0, 3.0), &TakenUp::default()));
        assert!(!is_taken(load(90.0, 1.3), &TakenUp::default()));
        assert!(is_taken(load(90.0, 1.3), &before));
        // Nor where what was taken up says most of it, or where it is not even likely.
        assert!(!is_taken(load(40.0, 1.3), &before));
        assert!(!is_taken(load(90.0, 0.5), &before));
        // Nothing is said of other names.
        let other = of_name(&data, &base, Id::WearDrift, 90.0, 1.3);
        assert!(!is_taken(other, &before));
    }
}
