//! A model judged with everything that it may claim: its parameters, the chain's nuisances and the noise are fitted
//! with it, so that two models are compared each at its own best.

mod columns;
mod judged;
mod place;
mod sizes;
mod unseen;

use place::Place;

pub use columns::table_grams;
pub use judged::Judged;
pub use sizes::{Effort, capped, noise_stride};
pub use unseen::Unseen;

use super::dependence::Dependence;
use super::noise::BalanceParts;
use crate::data::Data;
use crate::model::Model;

/// A first guess of the noise.
#[derive(Clone, Copy)]
pub struct Guess<'a> {
    /// As it was fitted to another model.
    pub parts: &'a [BalanceParts],
    /// Whether that model lacks the last term or dependence and nothing else: then the noise of a balance that this
    /// one does not touch stays what it is.
    pub added: bool,
}

impl<'a> Guess<'a> {
    /// That of a model that differs in more than its last term.
    #[must_use]
    pub fn of(parts: &'a [BalanceParts]) -> Self {
        Self {
            parts,
            added: false,
        }
    }

    /// That of a model to which something is added.
    #[must_use]
    pub fn beside(judged: &'a Judged) -> Self {
        Self {
            parts: &judged.parts,
            added: true,
        }
    }
}

/// Fits and judges a model from this start under a first guess of the noise.
#[must_use]
pub fn judge(
    data: &Data,
    start: &Model,
    extra: &[Dependence],
    guess: Option<Guess<'_>>,
    effort: Effort,
) -> Option<Judged> {
    let first = (guess.is_none()).then_some(effort);
    let added = guess.is_some_and(|g| g.added);
    Place::new(data, start.clone(), extra, guess.map(|g| g.parts), first)?
        .descended(data, extra, effort.steps)?
        .refitted(data, extra, effort, added)?
        .descended(data, extra, effort.steps.div_ceil(2))?
        .judged(data, extra)
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
        let mut base = judge(&data, &law, &[], None, effort).unwrap();
        for _ in 0..3 {
            let guess = Some(Guess::of(&base.parts));
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
            let Some(with) = judge(&data, &model, &[], Some(Guess::beside(&base)), effort) else {
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
