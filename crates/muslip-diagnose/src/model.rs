//! The simulation: the base law with any set of mechanisms, run on one recording.

use core::iter::zip;

use crate::data::{Catalogue, Listed};
use crate::mechanism::{Context, Law, Stage, State};
use crate::number::Number;
use crate::prepare::mean_twice_about;
use crate::series::{Channel, Series};
use crate::slip::slip;

/// Parameters that every tyre model has: logarithms of peak friction and slip at the peak, and three
/// shares that say how the inputs are to be read between raw and smoothed (no physics: see `prepare`).
pub const TYRE_BASE: usize = 5;

/// One mechanism in a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Entry of the catalogue.
    pub entry: usize,
    /// Its parameters.
    pub parameters: Vec<f64>,
}

/// A model of one balance (or of wheel and vehicle together): base parameters, then the terms'.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Base parameters (none for wheel and vehicle).
    pub base: Vec<f64>,
    /// Mechanisms.
    pub terms: Vec<Term>,
}

impl Model {
    /// The base law alone with this peak friction and critical slip, inputs as smoothed.
    #[must_use]
    pub fn of_law(peak: f64, critical: f64) -> Self {
        let mut base = vec![0.0; TYRE_BASE];
        base[0] = peak.ln();
        base[1] = critical.ln();
        Self {
            base,
            terms: Vec::new(),
        }
    }

    /// All parameters in one vector.
    #[must_use]
    pub fn vector(&self) -> Vec<f64> {
        let mut p = self.base.clone();
        for term in &self.terms {
            p.extend_from_slice(&term.parameters);
        }
        p
    }

    /// Places in that vector of what is fitted: the base law's two parameters and all of the terms.
    #[must_use]
    pub fn free_places(&self) -> Vec<usize> {
        let of_terms = self.base.len()..self.vector().len();
        [0, 1].into_iter().chain(of_terms).collect()
    }

    /// Places in that vector of one term's parameters.
    #[must_use]
    pub fn places_of(&self, term: usize) -> core::ops::Range<usize> {
        let before = self.terms[..term].iter().map(|own| own.parameters.len());
        let first = self.base.len() + before.sum::<usize>();
        first..first + self.terms[term].parameters.len()
    }

    /// The same model with other parameters.
    #[must_use]
    pub fn with(&self, p: &[f64]) -> Self {
        let mut model = self.clone();
        let (base, mut rest) = p.split_at(self.base.len());
        model.base = base.to_vec();
        for term in &mut model.terms {
            let (own, others) = rest.split_at(term.parameters.len());
            term.parameters = own.to_vec();
            rest = others;
        }
        model
    }

    /// The same model without what goes by the order of the runs.
    #[must_use]
    pub fn without_order(&self, catalogue: &Catalogue, context: &Context) -> Self {
        let mut model = self.clone();
        model
            .terms
            .retain(|term| !catalogue.get(term.entry).by_order(context));
        model
    }
}

/// Slices of the parameter vector that belong to the terms.
fn split<'a, T>(model: &'a Model, p: &'a [T]) -> impl Iterator<Item = (usize, &'a [T])> {
    let mut at = model.base.len();
    model.terms.iter().map(move |term| {
        let from = at;
        at += term.parameters.len();
        (term.entry, &p[from..at])
    })
}

/// Applies the terms of one stage, each with its own parameters.
fn apply_stage<T: Listed>(
    catalogue: &Catalogue,
    terms: &[(usize, &[T])],
    stage: Stage,
    series: &Series,
    context: &Context,
    state: &mut State<T>,
) {
    for (entry, own) in terms {
        let mechanism = T::entry(catalogue, *entry);
        if mechanism.stage() == stage {
            mechanism.apply(own, series, context, state);
        }
    }
}

/// A channel smoothed a share less, and a share more.
fn blended<T: Number>(channel: &Channel, raw_share: T, smoother_share: T) -> Vec<T> {
    let Channel {
        raw,
        smooth,
        smoother,
        ..
    } = channel;
    let zero = T::constant(0.0);
    // Shares that are exactly zero cost nothing to leave out.
    if raw_share == zero && smoother_share == zero {
        return smooth.iter().map(|x| T::constant(*x)).collect();
    }
    (0..smooth.len())
        .map(|k| {
            raw_share * (raw[k] - smooth[k])
                + smoother_share * (smoother[k] - smooth[k])
                + smooth[k]
        })
        .collect()
}

/// Runs the tyre model on one recording up to the friction, at the slip and so much beyond it.
pub fn friction<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    beyond: f64,
) -> State<T> {
    let n = series.len();
    let [
        log_peak,
        log_critical,
        raw_share,
        smoother_share,
        load_share,
    ] = core::array::from_fn(|i| p[i]);
    let mut state = State::empty();
    let zero = T::constant(0.0);
    state.omega = blended(&series.wheel, raw_share, smoother_share);
    state.speed = blended(&series.speed, raw_share, smoother_share);
    state.load = (0..n)
        .map(|k| load_share * (series.load.raw[k] - series.load.smooth[k]) + series.load.smooth[k])
        .collect();
    state.law = Law::rudd(log_peak.exp(), log_critical.exp());
    let terms: Vec<(usize, &[T])> = split(model, p).collect();
    let run = |stage: Stage, state: &mut State<T>| {
        apply_stage(catalogue, &terms, stage, series, context, state);
    };
    run(Stage::Kinematics, &mut state);
    let nominal_radius = T::constant(context.radius);
    state.slip = (0..n)
        .map(|k| {
            if series.rolling[k] {
                let radius = state.radius.as_ref().map_or(nominal_radius, |r| r[k]);
                slip(radius, state.omega[k], state.speed[k]) + beyond
            } else {
                zero
            }
        })
        .collect();
    run(Stage::Slip, &mut state);
    run(Stage::Law, &mut state);
    let inverse_critical = T::constant(1.0) / state.law.critical;
    state.friction = (0..n)
        .map(|k| {
            let mut x = state.slip[k] * inverse_critical;
            if let Some(factor) = &state.critical_factor {
                x = x / factor[k];
            }
            let mu = state.law.friction(x);
            match &state.peak_factor {
                Some(factor) => mu * factor[k],
                None => mu,
            }
        })
        .collect();
    run(Stage::Friction, &mut state);
    state
}

/// Step of a curve's derivatives, in critical slips.
const CURVE_STEP: f64 = 1e-3;

/// Friction a step below the slip, at it and a step beyond it, by sample, with all that the terms make of the law; and that
/// step.
pub fn friction_about(
    catalogue: &Catalogue,
    model: &Model,
    p: &[f64],
    series: &Series,
    context: &Context,
) -> ([Vec<f64>; 3], f64) {
    let step = CURVE_STEP * model.base[1].exp();
    let at = |beyond: f64| friction::<f64>(catalogue, model, p, series, context, beyond).friction;
    ([-step, 0.0, step].map(at), step)
}

/// Runs the tyre model on one recording up to the reading; `state.contact` is the force in the contact.
pub fn tyre<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
) -> State<T> {
    let n = series.len();
    let mut state = friction(catalogue, model, p, series, context, 0.0);
    let terms: Vec<(usize, &[T])> = split(model, p).collect();
    let run = |stage: Stage, state: &mut State<T>| {
        apply_stage(catalogue, &terms, stage, series, context, state);
    };
    state.force = (0..n).map(|k| state.friction[k] * state.load[k]).collect();
    // What remembers acts on what the readings say, not on what the drag, noise and all, says of them.
    for (force, beside) in state.force.iter_mut().zip(&series.beside_law) {
        *force = *force - *beside;
    }
    run(Stage::Contact, &mut state);
    if terms
        .iter()
        .any(|(e, _)| T::entry(catalogue, *e).stage() > Stage::Contact)
    {
        state.contact = Some(state.force.clone());
        run(Stage::Reading, &mut state);
        let filters = |(entry, _): &(usize, &[T])| {
            let facts = catalogue.get(*entry).facts();
            facts.filters && facts.stage > Stage::Contact
        };
        if terms.iter().any(filters) {
            state.entered = Some(state.force.clone());
        }
        if terms.iter().any(|(e, _)| catalogue.is_of_fast_force(*e)) {
            state.fast_force.clone_from(&series.fast_force);
        }
        for stage in [Stage::Structure, Stage::Filter, Stage::Line, Stage::Input] {
            run(stage, &mut state);
        }
    }
    state
}

/// Reach in s of the means twice over that leave out of the force what is fast in it: mostly the slip's noise.
pub const FAST_S: f64 = 0.005;

/// What a model's filters between contact and reading add to what is fast in the force that enters them, in N.
pub fn added_to_fast<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    entered: &[T],
) -> Vec<T> {
    // As many samples as lie within the reach, to the nearest.
    let reach = FAST_S + 0.5 * series.typical_dt;
    let slow = mean_twice_about(&series.time, entered, &series.tyre, reach);
    let fast: Vec<T> = zip(entered, &slow)
        .map(|(all, slow)| *all - *slow)
        .collect();
    let read = filtered(
        catalogue,
        model,
        p,
        Stage::Structure,
        series,
        context,
        fast.clone(),
    );
    zip(read, fast).map(|(read, fast)| read - fast).collect()
}

/// Stages between the slip and the reading at which filters stand, in their order.
const FILTERED_AT: [Stage; 5] = [
    Stage::Slip,
    Stage::Contact,
    Stage::Structure,
    Stage::Filter,
    Stage::Line,
];

/// Whether a model's force passes a filter on its way to the reading.
pub fn is_filtered(catalogue: &Catalogue, model: &Model) -> bool {
    let mut terms = model.terms.iter();
    terms.any(|term| catalogue.get(term.entry).facts().filters)
}

/// What a model's filters leave of a change of the force in N, as long as the series, where the reading is taken: those
/// from a stage on. A change of the slip passes them, from its own stage on, as the change of the force that it makes.
pub fn filtered<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    from: Stage,
    series: &Series,
    context: &Context,
    mut change: Vec<T>,
) -> Vec<T> {
    let terms: Vec<(usize, &[T])> = split(model, p).collect();
    let mut state = State::empty();
    for stage in FILTERED_AT.into_iter().skip_while(|stage| *stage != from) {
        for (entry, own) in &terms {
            let facts = catalogue.get(*entry).facts();
            if !facts.filters || facts.stage != stage {
                continue;
            }
            *passing(&mut state, stage) = change;
            T::entry(catalogue, *entry).apply(own, series, context, &mut state);
            change = core::mem::take(passing(&mut state, stage));
        }
    }
    change
}

/// What passes a filter that stands at a stage.
fn passing<T>(state: &mut State<T>, stage: Stage) -> &mut Vec<T> {
    if stage == Stage::Slip {
        &mut state.slip
    } else {
        &mut state.force
    }
}

/// What the terms make of a wheel or a vehicle on which nothing acts but the brake torque as smoothed.
pub fn acting<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    stage: Stage,
) -> State<T> {
    let mut state = State::empty();
    state.opposing = vec![T::constant(0.0); series.len()];
    if let Some(torque) = &series.torque {
        state.brake = torque.smooth.iter().map(|t| T::constant(*t)).collect();
    }
    for (entry, own) in split(model, p) {
        let mechanism = T::entry(catalogue, entry);
        if mechanism.acts_at(stage) {
            mechanism.apply(own, series, context, &mut state);
        }
    }
    state
}

/// Imbalance of what has this inertia and speed: inertia Δspeed/Δt + the mean over the step of what opposes it.
fn imbalance<T: Number>(
    inertia: f64,
    speed: &[f64],
    dt: &[f64],
    opposing: impl Fn(usize) -> T,
) -> Vec<T> {
    let mut before = T::constant(0.0);
    (0..speed.len())
        .map(|k| {
            let now = opposing(k);
            let mean = (now + before) * 0.5;
            before = now;
            if k == 0 {
                return T::constant(0.0);
            }
            mean + inertia * ((speed[k] - speed[k - 1]) / dt[k])
        })
        .collect()
}

/// The drag by its reading, with `chain` taken off, where the reading's scale is wrong. Deviations from the base model act on smoothed
/// columns, so that a parameter cannot buy anything by scaling noise.
fn drag<T: Listed>(state: &State<T>, series: &Series, chain: Option<&[f64]>, k: usize) -> T {
    let chain = chain.map_or(0.0, |c| c[k]);
    let smooth = series.drag_smooth[k] - chain;
    (state.true_share(smooth) - 1.0) * smooth + (series.drag[k] - chain)
}

/// Imbalance of the wheel, one value a step ending at each sample:
/// J Δω/Δt − R drag + brake torque + what the terms add, in N m, with `chain` (reading minus contact
/// force, from the tyre model) taken off the drag reading.
pub fn wheel<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    chain: Option<&[f64]>,
) -> Vec<T> {
    let n = series.len();
    let (Some(torque), false) = (&series.torque, series.drag.is_empty()) else {
        return vec![T::constant(0.0); n];
    };
    let state = acting(catalogue, model, p, series, context, Stage::Wheel);
    let opposing = |k: usize| {
        let drag = drag(&state, series, chain, k);
        let brake = state.brake[k] + (torque.raw[k] - torque.smooth[k]);
        state.inertia_change * (context.inertia * series.wheel.rate[k]) - drag * context.radius
            + brake
            + state.opposing[k]
    };
    imbalance(context.inertia, &series.wheel.raw, &series.dt, opposing)
}

/// Imbalance of the vehicle, one value a step: m Δv/Δt + drag + what the terms add, in N.
pub fn vehicle<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    chain: Option<&[f64]>,
) -> Vec<T> {
    let n = series.len();
    if series.drag.is_empty() {
        return vec![T::constant(0.0); n];
    }
    let state = acting(catalogue, model, p, series, context, Stage::Vehicle);
    let force = |k: usize| {
        state.inertia_change * (context.mass * series.speed.rate[k])
            + drag(&state, series, chain, k)
            + state.opposing[k]
    };
    imbalance(context.mass, &series.speed.raw, &series.dt, force)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Data;
    use crate::innovations::toy::{Noise, stop};

    #[test]
    fn a_term_s_parameters_stand_at_its_places_in_the_vector() {
        let mut model = Model::of_law(0.9, 0.12);
        for parameters in [vec![1.0, 2.0], vec![], vec![3.0]] {
            let entry = model.terms.len();
            model.terms.push(Term { entry, parameters });
        }
        let all = model.vector();
        for (place, term) in model.terms.iter().enumerate() {
            assert_eq!(all[model.places_of(place)], term.parameters);
        }
    }

    #[test]
    fn what_is_called_a_filter_is_linear_and_adds_nothing_of_its_own() {
        let data = stop(Noise::NONE, 1);
        let series = &data.series[0];
        let wave = |hz: f64| -> Vec<f64> {
            let phase = |t: &f64| core::f64::consts::TAU * hz * t;
            series.time.iter().map(|t| phase(t).sin()).collect()
        };
        let (slow, fast) = (wave(0.7), wave(6.0));
        let mut filters = 0;
        for (entry, mechanism) in data.catalogue.entries().iter().enumerate() {
            if !mechanism.facts().filters {
                continue;
            }
            filters += 1;
            let id = mechanism.id();
            let mut model = Model::of_law(0.8, 0.12);
            let parameters = mechanism.parameters(&data.context);
            model.terms.push(Term {
                entry,
                parameters: parameters.iter().map(|p| f64::max(p.low, 0.02)).collect(),
            });
            let passed = |x: Vec<f64>| {
                let Data {
                    catalogue, context, ..
                } = &data;
                filtered(
                    catalogue,
                    &model,
                    &model.vector(),
                    Stage::Slip,
                    series,
                    context,
                    x,
                )
            };
            let both = core::iter::zip(&slow, &fast).map(|(s, f)| 3.0 * s - 2.0 * f);
            let both = passed(both.collect());
            let alone = [&slow, &fast].map(|wave| passed(wave.clone()));
            assert!(alone[1] != fast, "{id:?} does nothing");
            let [slow, fast] = alone;
            for k in 0..both.len() {
                let sum = 3.0 * slow[k] - 2.0 * fast[k];
                assert!(
                    (both[k] - sum).abs() < 1e-9,
                    "{id:?} {k}: {} {sum}",
                    both[k]
                );
            }
            let nothing = passed(vec![0.0; series.len()]);
            assert!(nothing.iter().all(|x| *x == 0.0), "{id:?}");
            assert!(is_filtered(&data.catalogue, &model));
        }
        assert!(filters >= 6, "{filters}");
    }
}
