//! What was looked for: whether the recordings could have shown a mechanism, and the smallest that they would have
//! shown. A verdict of "consistent" is only as good as this list.

use crate::constants::PLAUSIBLE_SHARE;
use crate::data::Data;
use crate::innovations::candidates::Candidate;
use crate::innovations::screen::Score;
use crate::mechanism::Id;
use crate::number::finite_or_zero;
use crate::outcome::{LookedFor, MinimumDetectable};

/// A mechanism at one start: how large its effect is in the innovations, beside base and nuisances.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Which.
    pub id: Id,
    /// Smallest value of its size that would be seen; `None` where no parameter is its size.
    least: Option<MinimumDetectable>,
    /// Whether that is one that could be.
    identifiable: bool,
}

/// All candidates where nothing stands beside the base, for a threshold in standard deviations.
#[must_use]
pub fn seen(data: &Data, candidates: &[Candidate], scores: &[Score], threshold: f64) -> Vec<Seen> {
    scores
        .iter()
        .filter_map(|score| {
            let candidate = &candidates[score.candidate];
            let (id, entry) = (candidate.id?, candidate.entry?);
            let mechanism = data.catalogue.get(entry);
            // What excites a form of the fast force is mostly noise of the wheel's speed.
            if mechanism.facts().counter_form || mechanism.facts().of_fast_force {
                return None;
            }
            let Some(amplitude) = mechanism.facts().amplitude else {
                let size = score.sizes.iter().copied().fold(0.0, f64::max);
                return Some(Seen {
                    id,
                    least: None,
                    identifiable: size > threshold,
                });
            };
            let described = mechanism
                .parameters(&data.context)
                .into_iter()
                .nth(amplitude)?;
            let std = match candidate.free.iter().position(|p| *p == amplitude) {
                Some(at) => 1.0 / score.sizes[at],
                // The one column is the whole effect.
                None => candidate.start[amplitude].abs() / score.sizes[0],
            };
            let value = threshold * std;
            Some(Seen {
                id,
                identifiable: value < PLAUSIBLE_SHARE * (described.high - described.low),
                least: value.is_finite().then(|| MinimumDetectable {
                    name: described.name,
                    value: finite_or_zero(value),
                    unit: described.unit.to_owned(),
                }),
            })
        })
        .collect()
}

/// What the starts of one mechanism say: that of the middle one. One that no parameter is the size of says no smallest
/// size: it is heard only where all are like it.
#[must_use]
pub fn looked_for(id: Id, seen: &[Seen]) -> LookedFor {
    let mut own: Vec<&Seen> = seen.iter().filter(|s| s.id == id).collect();
    if own.iter().any(|s| s.least.is_some()) {
        own.retain(|s| s.least.is_some());
    }
    let size = |s: &&Seen| s.least.as_ref().map_or(f64::INFINITY, |l| l.value);
    own.sort_by(|a, b| size(a).total_cmp(&size(b)));
    let middle = own.get(own.len() / 2);
    LookedFor {
        id: id.as_str(),
        identifiable: middle.is_some_and(|s| s.identifiable),
        minimum_detectable: middle.and_then(|s| s.least.clone()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(value: Option<f64>) -> Seen {
        Seen {
            id: Id::SlipHysteresis,
            least: value.map(|value| MinimumDetectable {
                name: "loop_share".to_owned(),
                value,
                unit: "1".to_owned(),
            }),
            identifiable: value.is_some(),
        }
    }

    #[test]
    fn starts_without_a_size_do_not_hide_the_smallest_of_those_that_have_one() {
        let of = |all: &[Option<f64>]| {
            let all: Vec<Seen> = all.iter().copied().map(seen).collect();
            looked_for(Id::SlipHysteresis, &all)
        };
        let mixed = of(&[None, Some(0.04), None, Some(0.02), Some(0.03), None]);
        assert!(mixed.identifiable);
        assert_eq!(mixed.minimum_detectable.map(|m| m.value), Some(0.03));
        assert!(of(&[None, None]).minimum_detectable.is_none());
    }
}
