//! A model judged with everything that it may claim: its parameters, the chain's nuisances and the noise are fitted
//! with it, so that two models are compared each at its own best.

mod columns;
mod judged;
mod place;
mod sizes;
mod unseen;

use place::{Known, Place};

pub use columns::table_grams;
pub use judged::Judged;
pub use sizes::{Effort, capped, noise_stride};
pub use unseen::Unseen;

use super::dependence::Dependence;
use super::noise::BalanceParts;
use crate::data::Data;
use crate::model::Model;

/// What is known of a model's noise before it is judged.
#[derive(Clone, Copy)]
pub enum Guess<'a> {
    /// Nothing.
    None,
    /// Its sizes, as fitted to another model.
    Sizes(&'a [BalanceParts]),
    /// As fitted to another model, to be compared with this one: by what the noise enters is held, for likelihoods are
    /// of one noise or of none. A force that changes with the model would buy or sell readings by their noise.
    Under(&'a Judged),
    /// The same where that model lacks the last term or dependence and nothing else: then the noise of a balance that
    /// this one does not touch stays what it is.
    Beside(&'a Judged),
}

/// Fits and judges a model from this start under a first guess of the noise.
#[must_use]
pub fn judge(
    data: &Data,
    start: &Model,
    extra: &[Dependence],
    guess: Guess<'_>,
    effort: Effort,
) -> Option<Judged> {
    let known = match guess {
        Guess::None => Known::Nothing(effort),
        Guess::Sizes(parts) => Known::Sizes(parts),
        Guess::Under(other) | Guess::Beside(other) => Known::Noise(&other.parts),
    };
    let added = matches!(guess, Guess::Beside(_));
    Place::new(data, start.clone(), extra, known)?
        .descended(data, extra, effort.steps)?
        .refitted(data, extra, effort, added)?
        .descended(data, extra, effort.steps.div_ceil(2))?
        .judged(data, extra)
}

/// Judges a model to which something is added. Noise that was fitted without it may have swallowed it: its parameters are
/// first sought where the noise is no larger than the sensors make plausible. Where that leads nowhere, they are sought
/// from the start under the noise as it was fitted, which may leave them there: what is added is no worse than nothing.
#[must_use]
pub fn judge_added(
    data: &Data,
    start: &Model,
    extra: &[Dependence],
    so_far: &Judged,
    effort: Effort,
) -> Option<Judged> {
    let at_sensors = capped(&so_far.parts);
    let sought = Place::new(data, start.clone(), extra, Known::Noise(&at_sensors))
        .and_then(|place| place.descended(data, extra, effort.steps))
        .and_then(|place| {
            judge(
                data,
                &place.into_model(),
                extra,
                Guess::Beside(so_far),
                effort,
            )
        });
    if sought
        .as_ref()
        .is_some_and(|found| found.loss < so_far.loss)
    {
        return sought;
    }
    let plain = judge(data, start, extra, Guess::Beside(so_far), effort);
    match (sought, plain) {
        (Some(a), Some(b)) => Some(if a.loss < b.loss { a } else { b }),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, stop};
    use crate::mechanism::Id;
    use crate::model::Term;

    #[test]
    fn a_likelihood_never_falls_by_a_term_that_may_be_nothing() {
        let data = stop(Noise::TYPICAL, 4);
        let effort = Effort {
            steps: 8,
            noise_steps: 20,
            noise_stride: 1,
        };
        let law = Model::of_law(PEAK, CRITICAL);
        let mut base = judge(&data, &law, &[], Guess::None, effort).unwrap();
        for _ in 0..3 {
            let guess = Guess::Sizes(&base.parts);
            base = judge(&data, &base.model, &[], guess, effort).unwrap();
        }
        let mut tried = 0;
        for (entry, mechanism) in data.catalogue.entries().iter().enumerate() {
            let nothing = match mechanism.id() {
                Id::WearDrift if mechanism.form() == "energy" => vec![0.0],
                Id::RollingResistance if mechanism.form() == "constant" => vec![0.0],
                Id::InertialReaction | Id::WheelInertia => vec![0.0],
                _ => continue,
            };
            let mut model = base.model.clone();
            model.terms.push(Term {
                entry,
                parameters: nothing,
            });
            let Some(with) = judge_added(&data, &model, &[], &base, effort) else {
                continue;
            };
            tried += 1;
            assert!(
                with.loss < base.loss + 0.5,
                "{:?}: {} beside {}",
                mechanism.id(),
                with.loss,
                base.loss
            );
        }
        assert!(tried >= 3, "{tried}");
    }
}
