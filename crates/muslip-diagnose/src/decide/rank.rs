//! The order of a round's trials.

use super::stands::stands;
use super::trial::{Claim, Trial};
use crate::constants::{
    ALIKE_NATS, ALIKE_SHARE, DEPENDENCE_NATS, DEPENDENCE_SHARE, PREDICTED_APART, SOFT_SHARE,
    SOFTNESS,
};
use crate::data::Data;

/// Best first; of those that gain alike, the one first that claims the least.
pub fn rank(data: &Data, trials: &mut [Trial]) {
    let order = |a: &Trial, b: &Trial| b.weight().total_cmp(&a.weight());
    trials.sort_by(|a, b| order(a, b).then(b.gain.total_cmp(&a.gain)));
    least_claims_first(trials, Trial::weight, |t| balances(data, t));
    better_predicted_first(trials, Trial::weight, |t| t.remembers.then_some(t.predicts));
    likelier_first(trials, Trial::weight, |t| t.predicts);
    said_as_well_first(trials, Trial::weight, |own, other| {
        let own = own.mechanism().filter(|_| stands(own));
        own.is_some_and(|(id, _)| other.says_as_well == Some(id))
    });
    commoner_first(trials, Trial::weight, |t| {
        let mechanism = t.mechanism();
        mechanism.is_some_and(|(_, entry)| data.catalogue.get(entry).is_rare(&data.context))
    });
}

/// What another's parameters say as well comes before that, where it gains much the same.
fn said_as_well_first<T>(
    best_first: &mut [T],
    gain: impl Fn(&T) -> f64,
    said: impl Fn(&T, &T) -> bool,
) {
    sort_neighbours(best_first, |own, other| {
        gain(own) > ALIKE_SHARE * gain(other) && said(own, other)
    });
}

/// Of neighbours that the recordings hardly tell apart, what is common first.
fn commoner_first<T>(best_first: &mut [T], gain: impl Fn(&T) -> f64, rare: impl Fn(&T) -> bool) {
    sort_neighbours(best_first, |own, other| {
        !rare(own) && rare(other) && gain(other) - gain(own) < softness(gain(other))
    });
}

/// Nats by which two names may differ and be hardly told apart: no model of this kind is exactly true.
pub fn softness(gain: f64) -> f64 {
    SOFTNESS + SOFT_SHARE * gain
}

/// Whether one gain is so much more than another that the other's form does not make up for it.
pub fn much_more(own: f64, than: f64) -> bool {
    own > DEPENDENCE_SHARE * than + DEPENDENCE_NATS
}

/// Of those that gain much the same and remember, the one first that predicts the drag clearly better: the chain's own
/// kernels stand in for much of what a memory gains, but predict nothing. `predicts` is nothing for all others.
fn better_predicted_first<T>(
    best_first: &mut [T],
    gain: impl Fn(&T) -> f64,
    predicts: impl Fn(&T) -> Option<f64>,
) {
    sort_neighbours(best_first, |own, other| {
        let (Some(of_own), Some(of_other)) = (predicts(own), predicts(other)) else {
            return false;
        };
        let alike = gain(own) > ALIKE_SHARE * gain(other);
        alike && of_own.is_finite() && of_own > of_other + PREDICTED_APART
    });
}

/// Of neighbours that work through the force, the likelier one first: what it gains less by, in softnesses, is made up for by
/// what it predicts the drag better by.
fn likelier_first<T>(best_first: &mut [T], gain: impl Fn(&T) -> f64, predicts: impl Fn(&T) -> f64) {
    sort_neighbours(best_first, |own, other| {
        let less = (gain(other) - gain(own)) / softness(gain(other));
        let better = (predicts(own) - predicts(other)) / PREDICTED_APART;
        better.is_finite() && better > less.max(1.0)
    });
}

/// Balances that a trial's claim is about.
fn balances(data: &Data, trial: &Trial) -> usize {
    match trial.claim {
        Claim::Mechanism(_, entry) => data.catalogue.get(entry).guide().touches.len(),
        Claim::Dependence(_) => 1,
    }
}

/// Of neighbours that gain alike, the one first that claims the least: a mass in error says less than a drag
/// channel's scale in error, which all balances would show if they could.
fn least_claims_first<T>(
    best_first: &mut [T],
    gain: impl Fn(&T) -> f64,
    claims: impl Fn(&T) -> usize,
) {
    sort_neighbours(best_first, |own, other| {
        gain(other) - gain(own) < ALIKE_NATS && claims(own) < claims(other)
    });
}

/// Lets each go before the one next to it, again and again, as long as it `precedes` that: for orders that hold
/// between neighbours only.
fn sort_neighbours<T>(all: &mut [T], precedes: impl Fn(&T, &T) -> bool) {
    for from in 1..all.len() {
        let mut at = from;
        while at > 0 && precedes(&all[at], &all[at - 1]) {
            all.swap(at - 1, at);
            at -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_predicts_better_by_more_than_it_gains_less_comes_first() {
        // Softness of 1,700 nats is 55: 25 nats less are half a softness, a prediction better by 0.57 is six.
        let first = |mut all: Vec<(f64, f64)>| {
            likelier_first(&mut all, |t| t.0, |t| t.1);
            all[0].0
        };
        assert_eq!(first(vec![(1700.0, 0.87), (1675.0, 1.44)]) as u32, 1675);
        assert_eq!(first(vec![(1700.0, 0.87), (1675.0, 0.95)]) as u32, 1700);
        assert_eq!(first(vec![(1700.0, 0.87), (1000.0, 1.44)]) as u32, 1700);
        // What does not work through the force predicts nothing of it, either way.
        assert_eq!(
            first(vec![(1700.0, 0.87), (1675.0, f64::INFINITY)]) as u32,
            1700
        );
        assert_eq!(
            first(vec![(1700.0, f64::INFINITY), (1675.0, 1.44)]) as u32,
            1700
        );
    }

    #[test]
    fn of_memories_that_gain_much_the_same_the_one_that_predicts_clearly_better_comes_first() {
        // Gain and prediction: what gains less than 0.7 of another, predicts but little better, or does not remember
        // stays behind it.
        let mut all = [
            (400.0, Some(1.0)),
            (330.0, Some(1.4)),
            (310.0, Some(1.45)),
            (100.0, Some(9.0)),
            (90.0, Some(f64::INFINITY)),
            (80.0, None),
        ];
        better_predicted_first(&mut all, |t| t.0, |t| t.1);
        let gains = all.map(|t| t.0);
        assert_eq!(gains, [330.0, 310.0, 400.0, 100.0, 90.0, 80.0]);
    }

    #[test]
    fn what_another_says_as_well_comes_before_it_where_it_gains_much_the_same() {
        // Gain, name, and what the parameters say as well.
        let mut all = [(100.0, 'z', 'c'), (80.0, 'c', '-'), (60.0, 'y', 'c')];
        said_as_well_first(&mut all, |t| t.0, |own, other| other.2 == own.1);
        assert_eq!(all.map(|t| t.1), ['c', 'z', 'y']);
        let mut all = [(100.0, 'z', 'c'), (60.0, 'c', '-')];
        said_as_well_first(&mut all, |t| t.0, |own, other| other.2 == own.1);
        assert_eq!(all.map(|t| t.1), ['z', 'c']);
    }

    #[test]
    fn of_two_that_are_hardly_told_apart_the_common_one_comes_first() {
        // Gain and whether it is rare: within 4 nats and 3 % of the better one.
        let mut all = [(402.0, true), (396.0, false), (384.0, true), (300.0, false)];
        commoner_first(&mut all, |t| t.0, |t| t.1);
        let gains = all.map(|t| t.0);
        assert_eq!(gains, [396.0, 402.0, 384.0, 300.0]);
    }

    #[test]
    fn of_two_that_gain_alike_the_one_that_claims_less_comes_first() {
        // Gain and claims: only neighbours within half a nat change places.
        let mut all = [(40.0, 1), (35.2, 3), (35.0, 1), (34.9, 2), (12.0, 1)];
        least_claims_first(&mut all, |t| t.0, |t| t.1);
        assert_eq!(all, [(40.0, 1), (35.0, 1), (34.9, 2), (35.2, 3), (12.0, 1)]);
    }
}
