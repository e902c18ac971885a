//! The three balances of one run as rows, nothing differentiated: the tyre's as a force, the wheel's and the
//! vehicle's in level (integrated) form.
//!
//! tyre e = reading − model of the reading, in N; wheel z = J ω − ∫(R F − T − opposing) dt, in N m s; vehicle
//! z = m v + ∫(F + opposing) dt, in N s; F is the reading less what the model says that the load cell adds to the
//! force in the contact. A constant of z means nothing: the whitening takes each stretch's level as unknown.

use core::iter::zip;

use crate::data::{Catalogue, Data, Listed};
use crate::mechanism::{Balance, Context, Stage, State};
use crate::model::{FAST_S, Model, Term, acting, added_to_fast, filtered, tyre};
use crate::number::Number;
use crate::prepare::mean_twice_about;
use crate::series::{Channel, Series};

/// Rows of one run by balance, in the order tyre, wheel, vehicle.
pub type Triple = [Vec<f64>; 3];

/// Residuals of the three balances on one run, one value a sample; empty where the balance cannot be formed.
pub struct Rows<T> {
    /// In N.
    pub tyre: Vec<T>,
    /// In N m s.
    pub wheel: Vec<T>,
    /// In N s.
    pub vehicle: Vec<T>,
}

impl<T: Number> Rows<T> {
    /// That of the tyre alone, by the force that its model reads.
    fn of_tyre(series: &Series, force: Vec<T>) -> Self {
        Self {
            tyre: tyre_row(series, force),
            wheel: Vec::new(),
            vehicle: Vec::new(),
        }
    }
}

impl<T> Rows<T> {
    /// Those of one balance.
    #[must_use]
    pub fn of(&self, balance: Balance) -> &[T] {
        match balance {
            Balance::Tyre => &self.tyre,
            Balance::Wheel => &self.wheel,
            Balance::Vehicle => &self.vehicle,
        }
    }
}

/// Rows of a model at its own parameters on one run of a campaign.
#[must_use]
pub fn rows_of(data: &Data, model: &Model, run: usize) -> Rows<f64> {
    let p = model.vector();
    rows(&data.catalogue, model, &p, &data.series[run], &data.context)
}

/// The tyre's row alone, which needs neither wheel nor vehicle.
#[must_use]
pub fn tyre_row_of(data: &Data, model: &Model, run: usize) -> Vec<f64> {
    let p = model.vector();
    tyre_rows(&data.catalogue, model, &p, &data.series[run], &data.context)
}

/// The same in any numbers.
pub fn tyre_rows<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
) -> Vec<T> {
    tyre_row(series, tyre(catalogue, model, p, series, context).force)
}

/// The reading less the model of it; nothing where the balance is not formed.
fn tyre_row<T: Number>(series: &Series, mut force: Vec<T>) -> Vec<T> {
    if series.tyre.is_empty() {
        return Vec::new();
    }
    for (f, y) in force.iter_mut().zip(&series.drag) {
        *f = -*f + *y;
    }
    force
}

/// The force by a law where there is one, else the reading less its noise, in N.
#[must_use]
pub fn quiet_force(series: &Series, law: &[f64]) -> Vec<f64> {
    (0..series.len())
        .map(|k| match law.get(k) {
            Some(f) if series.rolling[k] && f.is_finite() && !series.tyre.is_empty() => *f,
            _ => series.drag_smooth[k],
        })
        .collect()
}

/// What of what a model leaves of the reading, in N, the law is off by, the reading's own noise apart: what it was last where
/// the tyre's balance is not formed, nothing where no error of the law is told from noise yet.
fn law_is_off_by<T: Number>(series: &Series, left: &[T]) -> Option<Vec<T>> {
    let law_error = series.law_error.as_ref()?;
    let mut off = law_error.at_samples(&series.time, left);
    let mut formed = series.tyre.iter().flat_map(Clone::clone).peekable();
    let mut last = T::constant(0.0);
    for (k, off) in off.iter_mut().enumerate() {
        if formed.next_if_eq(&k).is_some() {
            last = *off;
        }
        *off = last;
    }
    Some(off)
}

/// The force by a model of the reading in N, with what the reading says that it is off by: a few percent, which integrated
/// are more than the speeds' noise. The reading's own noise must not be in it, or what scales the force buys it: a mass
/// came out as three times itself. Where the tyre's balance is not formed it is as [`quiet_force`] has it.
fn calibrated_force(series: &Series, by_model: &[f64]) -> Vec<f64> {
    let mut force = quiet_force(series, by_model);
    let Some(off) = law_is_off_by(series, &tyre_row(series, by_model.to_vec())) else {
        return force;
    };
    for k in series.tyre.iter().flat_map(Clone::clone) {
        force[k] = by_model[k] + off[k];
    }
    force
}

/// What the reading says beyond that in N, its own noise, of what a model leaves of it: nothing where the tyre's balance is
/// not formed, or no error of the law is told from noise yet.
#[must_use]
pub fn noise_of_drag(series: &Series, left: &[f64]) -> Vec<f64> {
    let off = (!left.is_empty()).then(|| law_is_off_by(series, left));
    let Some(off) = off.flatten() else {
        return Vec::new();
    };
    let mut noise = vec![0.0; series.len()];
    for k in series.tyre.iter().flat_map(Clone::clone) {
        noise[k] = left[k] - off[k];
    }
    noise
}

/// Rows of a model. Terms act on every balance that they touch.
pub fn rows<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
) -> Rows<T> {
    let state = tyre(catalogue, model, p, series, context);
    rows_beside(catalogue, model, p, series, context, state)
}

/// The same but for the rows of wheel and vehicle where no term of the model moves them: these are empty, for no
/// parameter changes them.
pub fn moved_rows<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
) -> Rows<T> {
    let state = tyre(catalogue, model, p, series, context);
    if moves_speeds(catalogue, model, &state) {
        return rows_beside(catalogue, model, p, series, context, state);
    }
    Rows::of_tyre(series, state.force)
}

/// Whether a mechanism acts on wheel or vehicle.
fn acts_on_speeds(catalogue: &Catalogue, entry: usize) -> bool {
    let mechanism = catalogue.get(entry);
    mechanism.acts_at(Stage::Vehicle) || mechanism.acts_at(Stage::Wheel)
}

/// Whether any term changes the rows of wheel or vehicle: what it adds to the reading, what the speeds are read off by,
/// what acts on wheel or vehicle.
fn moves_speeds<T: Listed>(catalogue: &Catalogue, model: &Model, tyre: &State<T>) -> bool {
    let moves = |entry: usize| {
        catalogue.get(entry).stage() == Stage::Kinematics || acts_on_speeds(catalogue, entry)
    };
    tyre.contact.is_some()
        || tyre.rolling_moment.is_some()
        || tyre.read_off.is_some()
        || model.terms.iter().any(|term| moves(term.entry))
}

/// Rows beside the tyre's state.
fn rows_beside<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    state: State<T>,
) -> Rows<T> {
    if series.wheel_balance.is_empty() && series.vehicle_balance.is_empty() {
        return Rows::of_tyre(series, state.force);
    }
    let acting = |stage: Stage| acting(catalogue, model, p, series, context, stage);
    let mut terms = model.terms.iter();
    let scaled = terms.any(|term| acts_on_speeds(catalogue, term.entry));
    let added = added_by_load_cell(catalogue, model, p, series, context, &state);
    let force = Force::new(series, &state, added, scaled);
    let wheel = match (&series.torque, series.wheel_balance.is_empty()) {
        (Some(torque), false) => {
            let acting = acting(Stage::Wheel);
            wheel(series, torque, context, &force, &state, &acting)
        }
        _ => Vec::new(),
    };
    let vehicle = if series.vehicle_balance.is_empty() {
        Vec::new()
    } else {
        vehicle(series, context, &force, &acting(Stage::Vehicle))
    };
    Rows {
        tyre: tyre_row(series, state.force),
        wheel,
        vehicle,
    }
}

/// The force in the contact by the reading: less what the model says that the load cell adds.
struct Force<'a, T> {
    series: &'a Series,
    added: Option<Vec<T>>,
    /// The reading without its own noise, where something may scale it.
    quiet: Option<Vec<f64>>,
}

/// What a model says that the load cell adds to the force in the contact, in N. What its filters take is made of the force
/// without what is fast in it: integrated, the slip's noise stays in every level, times their delay, and none but the
/// shortest delays paid for that. What lags or is late takes of the law's error, too, as the reading says it.
fn added_by_load_cell<T: Listed>(
    catalogue: &Catalogue,
    model: &Model,
    p: &[T],
    series: &Series,
    context: &Context,
    tyre: &State<T>,
) -> Option<Vec<T>> {
    let both = zip(&tyre.force, tyre.contact.as_ref()?);
    let mut added: Vec<T> = both.map(|(force, contact)| *force - *contact).collect();
    for (added, fast) in added.iter_mut().zip(&tyre.read_of_fast) {
        *added = *added - *fast;
    }
    if let Some(entered) = &tyre.entered {
        let fast = added_to_fast(catalogue, model, p, series, context, entered);
        for (added, fast) in added.iter_mut().zip(fast) {
            *added = *added - fast;
        }
        let memory_s = remembered_s(catalogue, model, context);
        let off =
            (memory_s > 0.0).then(|| law_is_off_by(series, &tyre_row(series, tyre.force.clone())));
        if let Some(off) = off.flatten() {
            let reach = f64::max(FAST_S, MEMORIES * memory_s);
            let slow = mean_twice_about(&series.time, &off, &series.tyre, reach);
            add_to_what_is_off(slow, &mut added, |x| {
                filtered(catalogue, model, p, ERROR_ENTERS, series, context, x)
            });
        }
    }
    Some(added)
}

/// The stage at which the law's error enters the filters: what makes a structure ring is not told from its ringing.
const ERROR_ENTERS: Stage = Stage::Filter;

/// Over so many memories of the filters, either way, means twice over are taken of what the law is off by: what goes faster
/// is what another filter would have made of the law's own force.
const MEMORIES: f64 = 2.0;

/// How long in s a model's filters of the law's error remember, one after the other.
fn remembered_s(catalogue: &Catalogue, model: &Model, context: &Context) -> f64 {
    let own_s = |term: &Term| {
        let mechanism = catalogue.get(term.entry);
        let facts = mechanism.facts();
        let filters = facts.filters && facts.stage >= ERROR_ENTERS;
        filters.then(|| mechanism.memory_s(&term.parameters, context))?
    };
    model.terms.iter().filter_map(own_s).sum()
}

/// Adds what filters add to what the law is off by, as it is read: it has been through them like all of the force. What it
/// was before them is, but for the second order, what is read and what they take of that.
fn add_to_what_is_off<T: Number>(
    read: Vec<T>,
    added: &mut [T],
    filtered: impl Fn(Vec<T>) -> Vec<T>,
) {
    let again = filtered(read.clone());
    let before: Vec<T> = zip(&read, again).map(|(x, y)| *x + (*x - y)).collect();
    let after = filtered(before.clone());
    for ((added, after), before) in added.iter_mut().zip(after).zip(before) {
        *added += after - before;
    }
}

impl<'a, T: Number> Force<'a, T> {
    fn new(series: &'a Series, tyre: &State<T>, added: Option<Vec<T>>, scaled: bool) -> Self {
        let quiet = || {
            let by_model: Vec<f64> = tyre.force.iter().map(|f| f.value()).collect();
            calibrated_force(series, &by_model)
        };
        Self {
            series,
            added,
            quiet: scaled.then(quiet),
        }
    }

    fn added(&self, k: usize) -> T {
        self.added.as_ref().map_or(T::constant(0.0), |c| c[k])
    }

    /// Without the reading's own noise; nothing where nothing scales it.
    fn quiet(&self, k: usize) -> T {
        let quiet = self.quiet.as_ref();
        quiet.map_or(T::constant(0.0), |quiet| -self.added(k) + quiet[k])
    }

    /// What of the reading is the drag, where its scale is wrong.
    fn true_share(&self, acting: &State<T>, k: usize) -> T {
        acting.true_share(self.quiet(k).value())
    }

    /// The drag, where the reading's scale is wrong. Deviations from the base are made of what does not hold the
    /// residual's own noise, or a parameter could buy noise by scaling it: the drag's by the model's reading, the
    /// speeds' by their slow part.
    fn drag(&self, acting: &State<T>, k: usize) -> T {
        (self.true_share(acting, k) - 1.0) * self.quiet(k) + (-self.added(k) + self.series.drag[k])
    }
}

fn wheel<T: Number>(
    series: &Series,
    torque: &Channel,
    context: &Context,
    force: &Force<'_, T>,
    tyre: &State<T>,
    acting: &State<T>,
) -> Vec<T> {
    let zero = T::constant(0.0);
    let slowing = |k: usize| {
        let brake = acting.brake[k] + (torque.raw[k] - torque.smooth[k]);
        let rolling = tyre.rolling_moment.as_ref().map_or(zero, |r| r[k]);
        brake + acting.opposing[k] + rolling - force.drag(acting, k) * context.radius
    };
    let whole = 1.0 + series.slow_wheel_lacks;
    let level = |k: usize| {
        // What the reading is off by, an encoder's ripple, is off in the level as well.
        let beyond = tyre.read_off.as_ref().map_or(zero, |off| off[k]);
        let off = tyre.omega[k] - series.wheel.smooth[k] + beyond;
        let off = if off.value().is_finite() { off } else { zero };
        acting.inertia_change * (context.inertia * (whole * series.wheel.slow[k]))
            + (off + series.wheel.raw[k]) * context.inertia
    };
    integrated(series, slowing, level)
}

fn vehicle<T: Number>(
    series: &Series,
    context: &Context,
    force: &Force<'_, T>,
    acting: &State<T>,
) -> Vec<T> {
    // A mass in error scales what slows it: by the model's force, for the speed's own errors are in the level.
    let lighter = T::constant(1.0) / (acting.inertia_change + 1.0) - 1.0;
    let slowing = |k: usize| {
        let own = force.true_share(acting, k) * force.quiet(k) + acting.opposing[k];
        force.drag(acting, k) + acting.opposing[k] + lighter * own
    };
    let level = |k: usize| T::constant(context.mass * series.speed.raw[k]);
    integrated(series, slowing, level)
}

/// A level, and the integral of a rate on top of it.
pub fn integrated<T: Number>(
    series: &Series,
    rate: impl Fn(usize) -> T,
    level: impl Fn(usize) -> T,
) -> Vec<T> {
    let mut sum = T::constant(0.0);
    let mut before = sum;
    (0..series.len())
        .map(|k| {
            let now = rate(k);
            let now = if now.value().is_finite() { now } else { before };
            if k > 0 {
                sum += (now + before) * (0.5 * series.dt[k].min(10.0 * series.typical_dt));
            }
            before = now;
            level(k) + sum
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::hypothesis::{Guess, judge};
    use crate::innovations::noise::{BalanceParts, Slopes, parts};
    use crate::innovations::toy::{
        CRITICAL, EFFORT, Noise, PEAK, entry_of, entry_of_form, settled, stop, with_term,
    };
    use crate::mechanism::Id;
    use crate::number::mean_and_std;

    /// Root mean square over the stretches of the wheel's balance.
    fn rms(series: &Series, x: impl Fn(usize) -> f64) -> f64 {
        let samples = series.wheel_balance.iter().flat_map(Clone::clone);
        let squares: Vec<f64> = samples.map(|k| x(k).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    /// Friction that comes and goes by this much, as one that is fitted to a law that is off.
    fn let_fast_friction_be(parts: &mut [BalanceParts], std: f64) {
        let mut sources = parts.iter_mut().flat_map(|own| &mut own.sources);
        let fast = sources.find(|own| own.name == "friction, fast");
        fast.unwrap().log_std = std.ln();
    }

    #[test]
    fn what_the_reading_says_of_the_law_mends_the_law_and_brings_little_noise() {
        let mut data = stop(Noise::TYPICAL, 4);
        let exact = stop(Noise::NONE, 4);
        let mut parts = settled(&data).parts;
        let_fast_friction_be(&mut parts, 0.07);
        data.tell_law_error(&parts);
        let (series, truth) = (&data.series[0], &exact.series[0].drag);
        // The law is exact: what is brought in is the reading's noise.
        let exact = calibrated_force(series, truth);
        let noise = rms(series, |k| exact[k] - truth[k]);
        assert!(noise < 0.5 * series.drag_sigma, "{noise}");
        // It is off by a tenth, this way and that four times a second.
        let off = |k: usize| 0.1 * truth[k] * (25.0 * series.time[k]).sin();
        let law: Vec<f64> = (0..series.len()).map(|k| truth[k] + off(k)).collect();
        let mended = calibrated_force(series, &law);
        let left = rms(series, |k| mended[k] - truth[k]);
        assert!(
            left < 0.15 * rms(series, off),
            "{left} {}",
            rms(series, off)
        );
    }

    #[test]
    fn what_the_law_is_off_by_comes_as_late_as_the_force() {
        let noise = Noise {
            drag: 3.0,
            torque: 1.0,
            ..Noise::FINE_WHEEL
        };
        let mut data = stop(noise, 4);
        let delay_s = 0.02;
        let series = &mut data.series[0];
        // A drag that is late, and friction that comes and goes, which no law knows of: in the wheel's balance what the drag
        // is off by now is what friction was off by then.
        let late = (delay_s / series.typical_dt).round() as usize;
        let off = |time: f64| 0.15 * (25.0 * time).sin();
        for k in (late..series.len()).rev() {
            series.drag[k] = series.drag[k - late] * (1.0 + off(series.time[k - late]));
        }
        let acted: Vec<f64> = series.drag[late..].to_vec();
        let torque = series.torque.as_mut().unwrap();
        let radius = data.context.radius;
        for (k, drag) in acted.into_iter().enumerate() {
            let more = radius * drag * off(series.time[k]) / (1.0 + off(series.time[k]));
            torque.raw[k] += more;
            torque.smooth[k] += more;
        }
        let law = Model::of_law(PEAK, CRITICAL);
        let mut parts = parts(&data, &Slopes::new(&data, &law));
        let_fast_friction_be(&mut parts, 0.1);
        let mut delayed = law;
        delayed.terms.push(Term {
            entry: entry_of(&data, Id::ForceDelay),
            parameters: vec![delay_s],
        });
        // What moves within a second: a level means nothing.
        let moves = |data: &Data| {
            let series = &data.series[0];
            let level = rows_of(data, &delayed, 0).wheel;
            let slow = mean_twice_about(&series.time, &level, &series.wheel_balance, 0.2);
            rms(series, |k| level[k] - slow[k])
        };
        let by_law_alone = moves(&data);
        data.tell_law_error(&parts);
        let with_its_error = moves(&data);
        assert!(
            with_its_error < 0.5 * by_law_alone,
            "{with_its_error} {by_law_alone}"
        );
    }

    #[test]
    fn a_scale_of_the_drag_in_error_is_right_beside_a_law_that_is_off() {
        let mut data = stop(Noise::FINE_WHEEL, 4);
        // What the law's slip is made of is off by turns, by up to a fifth of the slip at the peak.
        let series = &mut data.series[0];
        for (omega, time) in series.wheel.smooth.iter_mut().zip(&series.time) {
            *omega *= 1.0 + 0.024 * (25.0 * time).sin();
        }
        for reading in [&mut series.drag, &mut series.drag_smooth] {
            for force in reading {
                *force *= 1.2;
            }
        }
        let law = settled(&data);
        data.tell_law_error(&law.parts);
        let model = with_term(&data, &law, Id::ForceGain, 0.0);
        let judged = judge(&data, &model, &[], Guess::None, EFFORT).unwrap();
        let gain = 1.0 + judged.model.terms[0].parameters[0];
        assert!((gain - 1.2).abs() < 0.02, "{gain}");
    }

    #[test]
    fn a_scale_that_bends_is_told_and_one_that_does_not_is_straight() {
        let bend_found = |bend: f64, seed: u64| {
            let mut data = stop(Noise::TYPICAL, seed);
            let largest = data.context.max_drag;
            for series in &mut data.series {
                for reading in [&mut series.drag, &mut series.drag_smooth] {
                    for force in reading {
                        *force *= (1.2 - 0.5 * bend) / (1.0 - bend * force.abs() / largest);
                    }
                }
            }
            let law = settled(&data);
            let mut model = with_term(&data, &law, Id::ForceGain, 0.0);
            model.terms[0].entry = entry_of_form(&data, Id::ForceGain, "bent");
            model.terms[0].parameters = vec![0.0; 2];
            let judged = judge(&data, &model, &[], Guess::None, EFFORT).unwrap();
            judged.model.terms[0].parameters[1]
        };
        for bend in [0.0, 0.1] {
            let off = |seed: u64| bend_found(bend, seed) - bend;
            let (mean, std) = mean_and_std(&(4..10).map(off).collect::<Vec<_>>());
            assert!(mean.abs() < 0.012 && std < 0.008, "{bend}: {mean} {std}");
        }
    }

    #[test]
    fn what_filters_add_holds_little_of_the_slip_s_noise() {
        let (data, exact) = (stop(Noise::TYPICAL, 4), stop(Noise::NONE, 4));
        let model = with_term(&data, &settled(&data), Id::ForceDelay, 0.012);
        let added = |data: &Data, quiet: bool| {
            let (p, series) = (model.vector(), &data.series[0]);
            let mut state = tyre::<f64>(&data.catalogue, &model, &p, series, &data.context);
            if !quiet {
                state.entered = None;
            }
            let Data {
                catalogue, context, ..
            } = data;
            added_by_load_cell(catalogue, &model, &p, series, context, &state).unwrap()
        };
        let truth = added(&exact, false);
        let off = |own: &[f64]| rms(&data.series[0], |k| own[k] - truth[k]);
        let (quiet, loud) = (off(&added(&data, true)), off(&added(&data, false)));
        assert!(quiet < 0.85 * loud, "{quiet} {loud}");
        let blurred = added(&exact, true);
        let (blurred, all) = (off(&blurred), rms(&exact.series[0], |k| truth[k]));
        assert!(blurred < 0.1 * all, "{blurred} {all}");
    }
}
