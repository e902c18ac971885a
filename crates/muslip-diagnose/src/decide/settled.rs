//! A model under the noise that is its own.

use super::finalists::effort;
use super::trial::Trial;
use crate::constants::ALIKE_NATS;
use crate::data::Data;
use crate::innovations::dependence::Dependence;
use crate::innovations::hypothesis::{Guess, Judged, judge};
use crate::model::Model;

/// How often the noise of a model is fitted anew before others are tried beside it.
const MOST_SETTLING: usize = 5;

/// A model whose noise is fitted until it stays: what it is short of its best would count for what is tried beside it.
pub fn settled(data: &Data, mut judged: Judged) -> Judged {
    for _ in 0..MOST_SETTLING {
        let guess = Guess::Sizes(&judged.parts);
        let Some(next) = judge(data, &judged.model, &judged.extra, guess, effort(data)) else {
            break;
        };
        let gained = judged.loss - next.loss;
        if gained > 0.0 {
            judged = next;
        }
        if gained < ALIKE_NATS {
            break;
        }
    }
    judged
}

/// The model so far under noise like a trial's, where that is better: sizes of the noise that only the trial came
/// upon are no gain of its.
pub fn at_noise_of(data: &Data, so_far: &Judged, trial: &Trial) -> Option<Judged> {
    let guess = Guess::Sizes(&trial.judged.parts);
    let again = judge(data, &so_far.model, &so_far.extra, guess, effort(data))?;
    (again.loss < so_far.loss - ALIKE_NATS).then_some(again)
}

/// A model that was judged under another's noise, judged anew under what its own force makes of it.
pub fn under_own_noise(data: &Data, judged: Judged) -> Judged {
    again(data, &judged.model, &judged.extra, &judged).unwrap_or(judged)
}

/// Judges a model anew from the noise of one that is like it.
pub fn again(data: &Data, model: &Model, extra: &[Dependence], like: &Judged) -> Option<Judged> {
    judge(data, model, extra, Guess::Sizes(&like.parts), effort(data))
}
