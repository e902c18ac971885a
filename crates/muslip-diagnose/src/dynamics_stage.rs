//! The wheel and vehicle balances, diagnosed together: a wrong drag scale breaks both.

use crate::choose::{Limits, Search, candidate, refine, required, search};
use crate::data::Data;
use crate::dynamics_remainder::{DynamicRemainder, candidates};
use crate::fit::{BalanceNoise, Fitted, Joint, Problem};
use crate::mechanism::{Balance, Id};
use crate::model::Model;
use crate::saturated::{self, Slow};
use crate::split::Split;
use crate::validation::validated;

/// What wheel and vehicle say.
pub struct DynamicsStage {
    /// Noise of each balance under the final model.
    pub noise: Vec<(Balance, BalanceNoise)>,
    /// All sets tried and the one chosen.
    pub search: Search,
    /// Dependences that no mechanism explains.
    pub unexplained: Vec<DynamicRemainder>,
}

/// Shortest balance that is looked at, in innovations.
const LEAST: usize = 60;

fn part<'a>(
    data: &'a Data,
    split: &'a Split,
    balance: Balance,
    noise: &'a BalanceNoise,
    chain: Option<&'a [Vec<f64>]>,
) -> Problem<'a> {
    Problem {
        data,
        balance,
        noise,
        runs: &split.fit_runs,
        segments: split.fit.of(balance),
        chain,
    }
}

fn joint_under<'a>(
    data: &'a Data,
    split: &'a Split,
    noise: &'a [(Balance, BalanceNoise)],
    chain: Option<&'a [Vec<f64>]>,
) -> Joint<'a> {
    Joint {
        parts: noise
            .iter()
            .map(|(balance, noise)| part(data, split, *balance, noise, chain))
            .collect(),
    }
}

/// Balances that the recordings allow.
fn available(data: &Data, split: &Split) -> Vec<Balance> {
    [Balance::Wheel, Balance::Vehicle]
        .into_iter()
        .filter(|b| {
            let count: usize = split
                .fit_runs
                .iter()
                .flat_map(|r| &split.fit.of(*b)[*r])
                .map(|s| s.len())
                .sum();
            count >= LEAST && (*b != Balance::Vehicle || data.rig.coasting)
        })
        .collect()
}

fn noises(
    data: &Data,
    split: &Split,
    model: &Model,
    chain: Option<&[Vec<f64>]>,
    slow: Slow,
) -> Vec<(Balance, BalanceNoise)> {
    available(data, split)
        .into_iter()
        .map(|balance| {
            let guess = saturated::first_guess(data, balance);
            let problem = part(data, split, balance, &guess, chain);
            let fitted = Fitted {
                model: model.clone(),
                loss: 0.0,
                information: nalgebra::DMatrix::zeros(0, 0),
            };
            (balance, saturated::estimate(&problem, &fitted, slow))
        })
        .collect()
}

/// Analyses wheel and vehicle; `None` where neither can be formed.
#[must_use]
pub fn analyse(
    data: &Data,
    split: &Split,
    limits: &Limits,
    chain: Option<&[Vec<f64>]>,
) -> Option<DynamicsStage> {
    let model = Model::default();
    let noise = noises(data, split, &model, chain, Slow::Ignored);
    if noise.is_empty() {
        return None;
    }
    let joint = joint_under(data, split, &noise, chain);
    let base = joint.fit(&model, 1);
    let mut found = search(&joint, base, limits);
    let sharper_noise = noises(
        data,
        split,
        &found.chosen.fitted.model,
        chain,
        Slow::Counted,
    );
    let sharper = joint_under(data, split, &sharper_noise, chain);
    if found.chosen.ids.is_empty() {
        found = under(&sharper, found);
    } else {
        found = validated(&sharper, refine(&sharper, &found, limits), limits);
    }
    let unexplained = left_over(&sharper, &mut found, limits);
    Some(DynamicsStage {
        noise: sharper_noise,
        search: found,
        unexplained,
    })
}

/// The search's base judged under other noise.
fn under(joint: &Joint<'_>, mut found: Search) -> Search {
    found.base = candidate(joint, joint.fit(&found.base.fitted.model, 1));
    found.chosen = found.base.clone();
    found.tried.clear();
    found
}

/// Share of a recorded column's worth that mechanisms must reach to be preferred to it.
const MECHANISM_SHARE: f64 = 0.85;

/// What the chosen mechanisms leave over; they give way to one recorded column that says more than all of them.
fn left_over(joint: &Joint<'_>, found: &mut Search, limits: &Limits) -> Vec<DynamicRemainder> {
    if limits.ablation.remainder {
        return Vec::new();
    }
    let explained = found.base.criterion - found.chosen.criterion;
    if !found.chosen.ids.is_empty() {
        let free = candidates(joint, &found.base.fitted.model, limits);
        if let Some(rival) = free.into_iter().find(|r| r.recorded)
            && rival.worth * MECHANISM_SHARE > explained
        {
            found.chosen = found.base.clone();
            return vec![rival];
        }
    }
    if let Some(without) = viscous_instead(joint, found) {
        found.chosen = candidate(joint, without);
        found.forget(Id::AeroDrag);
    }
    let explained = found.base.criterion - found.chosen.criterion;
    candidates(joint, &found.chosen.fitted.model, limits)
        .into_iter()
        .find(|r| r.worth >= required(limits, found.count, 2.0 * explained))
        .into_iter()
        .collect()
}

/// Nats by which a drag that grows with the speed itself must fit better than one that grows with its square.
const VISCOUS_MARGIN: f64 = 3.0;

/// The chosen model without its aero drag where a drag in proportion to the speed fits better: bearings and tyres drag
/// with the speed, too, but not as air does.
fn viscous_instead(joint: &Joint<'_>, found: &Search) -> Option<Fitted> {
    let data = joint.data();
    let chosen = &found.chosen.fitted;
    let place = chosen
        .model
        .terms
        .iter()
        .position(|term| data.catalogue.get(term.entry).id() == Id::AeroDrag)?;
    let mut viscous = data.clone();
    for series in &mut viscous.series {
        for v in &mut series.speed.smooth {
            *v = (v.abs() * data.context.mean_speed).sqrt();
        }
    }
    let other = Joint {
        parts: joint
            .parts
            .iter()
            .map(|part| Problem {
                data: if part.balance == Balance::Vehicle {
                    &viscous
                } else {
                    part.data
                },
                ..*part
            })
            .collect(),
    };
    let in_proportion = other.fit(&chosen.model, 12).loss;
    (in_proportion + VISCOUS_MARGIN < chosen.loss).then(|| joint.without(found, place))
}

/// What wheel and vehicle say of a fault in the drag channel: a force that the cell reports late breaks
/// them too, a force that the tyre builds up late does not.
pub struct CrossEvidence<'a> {
    data: &'a Data,
    split: &'a Split,
    limits: Limits,
    noise: Vec<(Balance, BalanceNoise)>,
}

/// Weight of the cross evidence: these balances have noise models of their own to be wrong.
const CROSS_WEIGHT: f64 = 0.5;
/// Price in nats of each further mechanism that a set of tyre mechanisms calls for in wheel and vehicle: one fault in the
/// channel is likelier than two or three elsewhere that happen to look like it.
const EXTRA_MECHANISM: f64 = 40.0;
/// Sets of tyre mechanisms that are compared by it.
const COMPARED: usize = 4;

impl<'a> CrossEvidence<'a> {
    /// Prepares the balances; `None` where there are none. `chain` is the best guess so far.
    #[must_use]
    pub fn new(
        data: &'a Data,
        split: &'a Split,
        limits: &Limits,
        chain: Option<&[Vec<f64>]>,
    ) -> Option<Self> {
        let noise = noises(data, split, &Model::default(), chain, Slow::Counted);
        (!noise.is_empty()).then(|| Self {
            data,
            split,
            limits: limits.for_dynamics(),
            noise,
        })
    }

    /// Least loss and price of both balances with this chain taken off the drag, whatever mechanisms of their
    /// own they then need.
    fn criterion(&self, chain: Option<&[Vec<f64>]>) -> f64 {
        let joint = joint_under(self.data, self.split, &self.noise, chain);
        let base = joint.fit(&Model::default(), 1);
        let chosen = search(&joint, base, &self.limits).chosen;
        CROSS_WEIGHT * chosen.criterion + EXTRA_MECHANISM * chosen.ids.len() as f64
    }

    /// Adds what the other balances say to the best sets of the chosen size, and chooses again.
    #[must_use]
    pub fn rerank(&self, mut found: Search) -> Search {
        let size = found.chosen.ids.len();
        let reach = 60.0 + 0.5 * (found.base.criterion - found.chosen.criterion);
        let best = found.chosen.criterion;
        let compared: Vec<usize> = (0..found.tried.len())
            .filter(|i| {
                found.tried[*i].ids.len() == size && found.tried[*i].criterion - best <= reach
            })
            .take(COMPARED)
            .collect();
        let chains: Vec<Option<Vec<Vec<f64>>>> = compared
            .iter()
            .map(|i| crate::tyre_stage::chain(self.data, &found.tried[*i].fitted.model))
            .collect();
        if size == 0 || compared.len() < 2 || chains.iter().all(Option::is_none) {
            return found;
        }
        let without = self.criterion(None);
        let mut worst = f64::NEG_INFINITY;
        for (i, chain) in compared.iter().zip(&chains) {
            let change = match chain {
                Some(chain) => self.criterion(Some(chain)) - without,
                None => 0.0,
            };
            if change.is_finite() {
                found.tried[*i].criterion += change;
                worst = worst.max(change);
            }
        }
        // Sets that were not compared must not win by having been spared.
        for (i, candidate) in found.tried.iter_mut().enumerate() {
            if candidate.ids.len() == size && !compared.contains(&i) {
                candidate.criterion += worst.max(0.0);
            }
        }
        found
            .tried
            .sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
        if let Some(top) = found.tried.iter().find(|c| c.ids.len() == size) {
            found.chosen = top.clone();
        }
        found
    }
}
