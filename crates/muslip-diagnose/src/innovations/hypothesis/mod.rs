//! A model judged with everything that it may claim: its parameters, the chain's nuisances and the noise are fitted
//! with it, so that two models are compared each at its own best.

mod columns;
mod filtered;
mod judged;
mod level;
mod place;
mod sizes;
mod unseen;

use place::{Known, Place};

pub use columns::table_grams;
pub use filtered::Noise;
pub use judged::Judged;
pub use level::whole_over_slow;
pub use sizes::{Effort, noise_stride};
use sizes::{capped, no_less_plausible};
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
}

/// A model that others are judged beside: they have one term or dependence more, and are held under its noise.
pub struct Beside {
    /// Its loss in nats.
    pub loss: f64,
    /// Its noise as fitted, in which nothing may become less plausible.
    pub fitted: Noise,
    /// The same no larger than the sensors make plausible.
    pub at_sensors: Noise,
}

impl Beside {
    /// Of a judged model.
    #[must_use]
    pub fn new(data: &Data, judged: &Judged) -> Self {
        let fitted = Noise::new(data, no_less_plausible(&judged.parts));
        let fitted = fitted.held_to(data, &judged.model);
        Self {
            loss: judged.loss,
            at_sensors: fitted.of_parts(data, capped(&judged.parts)),
            fitted,
        }
    }
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
    let held;
    let known = match guess {
        Guess::None => Known::Nothing(effort),
        Guess::Sizes(parts) => Known::Sizes(parts),
        Guess::Under(other) => {
            held = Noise::new(data, other.parts.clone()).held_to(data, &other.model);
            Known::Noise(&held)
        }
    };
    Place::new(data, start.clone(), extra, known)?
        .descended(data, extra, effort.steps)?
        .at_its_best(data, extra, effort, false)
}

/// Judges a model to which something is added. Noise that was fitted without it may have swallowed it: its parameters are
/// first sought where the noise is no larger than the sensors make plausible, and the noise is fitted to them there. Where that
/// leads nowhere, they are sought from the start under the noise as it was fitted, which may leave them there: what is added
/// is no worse than nothing.
#[must_use]
pub fn judge_added(
    data: &Data,
    start: &Model,
    extra: &[Dependence],
    beside: &Beside,
    effort: Effort,
) -> Option<Judged> {
    let sought_under = |noise| {
        Place::new(data, start.clone(), extra, Known::Noise(noise))?.descended(
            data,
            extra,
            effort.steps,
        )
    };
    let judged = |place: Place| place.at_its_best(data, extra, effort, true);
    let sought = sought_under(&beside.at_sensors)
        .and_then(|place| place.under(data, &beside.fitted))
        .and_then(judged);
    if sought
        .as_ref()
        .is_some_and(|found| found.loss < beside.loss)
    {
        return sought;
    }
    let plain = sought_under(&beside.fitted).and_then(judged);
    match (sought, plain) {
        (Some(a), Some(b)) => Some(if a.loss < b.loss { a } else { b }),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{EFFORT, Noise, settled, stop, with_term};
    use crate::mechanism::Id;
    use crate::model::Term;

    #[test]
    fn a_likelihood_never_falls_by_a_term_that_may_be_nothing() {
        let data = stop(Noise::TYPICAL, 4);
        let base = settled(&data);
        let beside = Beside::new(&data, &base);
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
            // Sizes of the noise that are the best of one block in five are not those of all.
            for noise_stride in [1, 5] {
                let effort = Effort {
                    noise_stride,
                    ..EFFORT
                };
                let Some(with) = judge_added(&data, &model, &[], &beside, effort) else {
                    continue;
                };
                tried += 1;
                // They are the best of the restricted likelihood, in which a free column counts, not of the loss.
                assert!(
                    with.loss < base.loss + 1.0,
                    "{:?}: {} beside {}",
                    mechanism.id(),
                    with.loss,
                    base.loss
                );
            }
        }
        assert!(tried >= 6, "{tried}");
    }

    #[test]
    fn an_inertia_s_error_is_right_by_all_of_the_level() {
        // The wheel's is a fifth more than the rig file's.
        let mut data = stop(Noise::FINE_WHEEL, 4);
        data.context.inertia = 1.0;
        let judged = |data: &Data| {
            let model = with_term(data, &settled(data), Id::WheelInertia, 0.1);
            judge(data, &model, &[], Guess::None, EFFORT).unwrap()
        };
        let slow = judged(&data);
        let by = whole_over_slow(&data, &slow);
        assert!(by > 1.0 && by < 1.1, "{by}");
        data.scale_slow_wheel(by);
        let error = judged(&data).model.terms[0].parameters[0];
        assert!((error - 0.2).abs() < 0.02, "{error} {by}");
        // Where the level lacks a half, its coefficient is twice as large.
        data.scale_slow_wheel(0.5);
        let twice = judged(&data).model.terms[0].parameters[0];
        let slow = slow.model.terms[0].parameters[0];
        assert!((twice / slow - 2.0).abs() < 0.05, "{twice} {slow}");
    }
}
