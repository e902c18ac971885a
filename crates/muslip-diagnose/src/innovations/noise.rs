//! The noise of the three balances: which parts there are, by what they enter, and how large they start.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::blocks::Blocks;
use super::rows::quiet_force;
use super::whiten::{Course, DIFFUSE, Kind, MOST, Part, Sizes};
use crate::audit::colour::Colour;
use crate::data::Data;
use crate::law_error::{self, LawError};
use crate::mechanism::{Balance, Stage};
use crate::model::{Model, filtered, friction_about, is_filtered};
use crate::number::finite_or_zero;
use crate::series::Series;
use crate::slip;

/// Memory in s of the wheel speed's noise in the slip: so many of the smoother's windows, within bounds.
const WINDOWS: f64 = 1.5;
const SHORTEST_MEMORY_S: f64 = 0.015;
const LONGEST_MEMORY_S: f64 = 0.1;

/// Memory in s of the vehicle speed's slow noise where the audit knows none.
const VEHICLE_MEMORY_S: f64 = 0.2;

/// Gains by run and block.
type Gains = Vec<Vec<f64>>;

/// One part of a balance's noise over the campaign.
#[derive(Clone, Debug)]
pub struct Source {
    /// What it is, for a reader.
    pub name: &'static str,
    /// How it goes in time; `None` is the readings' own white noise.
    pub kind: Option<Kind>,
    /// Gain by run and block; an empty run where by one. Sizes are tried by the hundred: all share it.
    pub gain: Arc<Gains>,
    /// Natural logarithm of its standard deviation.
    pub log_std: f64,
    /// The same as it starts, from the sensors' own noise.
    pub log_start: f64,
    /// The largest that the sensors alone make plausible, on the same scale.
    pub log_cap: f64,
    /// The largest that it may be fitted to, on the same scale.
    pub log_most: f64,
    /// Whether it is an error of the slip, which enters by the law's slope.
    pub of_slip: bool,
    /// Whether it is an error of the law, of its slip or its friction, rather than of the reading.
    pub of_law: bool,
}

/// Noise of one balance.
#[derive(Clone, Debug)]
pub struct BalanceParts {
    /// Which.
    pub balance: Balance,
    /// Its parts; a walk first where the balance is integrated.
    pub sources: Vec<Source>,
}

/// How the force on the model's curve changes with what is measured, by run and sample: without what remembers and
/// what the reading adds, but for what is `read`.
pub struct Slopes {
    /// N per rad/s of the wheel speed.
    pub wheel: Vec<Vec<f64>>,
    /// N per m/s of the vehicle speed.
    pub speed: Vec<Vec<f64>>,
    /// Force in N.
    pub force: Vec<Vec<f64>>,
    /// N per 1 of slip.
    pub slip: Vec<Vec<f64>>,
    /// Second derivative, in N per 1 of slip squared.
    pub curvature: Vec<Vec<f64>>,
    /// `force` and `slip` as they are read, where the model's force passes filters.
    read: Option<[Vec<Vec<f64>>; 2]>,
}

impl Slopes {
    /// On the curve of a model, its law with all that its terms make of it.
    #[must_use]
    pub fn new(data: &Data, model: &Model) -> Self {
        let p = model.vector();
        let of_run = |s: &Series| Self::of_run(data, model, &p, s);
        let by_run: Vec<[Vec<f64>; 5]> = data.series.par_iter().map(of_run).collect();
        let mut out = Self {
            wheel: Vec::new(),
            speed: Vec::new(),
            force: Vec::new(),
            slip: Vec::new(),
            curvature: Vec::new(),
            read: None,
        };
        for [wheel, speed, force, slip, curvature] in by_run {
            out.wheel.push(wheel);
            out.speed.push(speed);
            out.force.push(force);
            out.slip.push(slip);
            out.curvature.push(curvature);
        }
        if is_filtered(&data.catalogue, model) {
            // A slip that is off by a constant is so behind a filter of the slip, too: the slope is that beyond it.
            let Data {
                catalogue, context, ..
            } = data;
            let of_run = |(s, change): (&Series, &Vec<f64>)| {
                filtered(
                    catalogue,
                    model,
                    &p,
                    Stage::Contact,
                    s,
                    context,
                    change.clone(),
                )
            };
            let read = |all: &[Vec<f64>]| data.series.par_iter().zip(all).map(of_run).collect();
            out.read = Some([read(&out.force), read(&out.slip)]);
        }
        out
    }

    /// How the reading changes with the friction, as a share of it, where that is off for long: in N.
    fn force_read(&self) -> &[Vec<f64>] {
        self.read.as_ref().map_or(&self.force, |read| &read[0])
    }

    /// How the reading changes with a slip that is off over a run: in N per 1 of slip.
    fn slip_read(&self) -> &[Vec<f64>] {
        self.read.as_ref().map_or(&self.slip, |read| &read[1])
    }

    /// On one run, in the order of the fields.
    fn of_run(data: &Data, model: &Model, p: &[f64], s: &Series) -> [Vec<f64>; 5] {
        let ([before, here, after], step) =
            friction_about(&data.catalogue, model, p, s, &data.context);
        let mut all = [(); 5].map(|()| Vec::with_capacity(s.len()));
        for k in 0..s.len() {
            let (v, omega, load) = (s.speed.smooth[k], s.wheel.smooth[k], s.load.smooth[k]);
            let [mut force, mut slope, mut bend] = [0.0; 3];
            if s.rolling[k] {
                force = load * here[k];
                slope = load * (after[k] - before[k]) / (2.0 * step);
                bend = load * (after[k] - 2.0 * here[k] + before[k]) / (step * step);
            }
            let [by_wheel, by_speed] = slip::slopes(data.context.radius, omega, v);
            let own = [slope * by_wheel, slope * by_speed, force, slope, bend];
            for (into, own) in all.iter_mut().zip(own) {
                into.push(finite_or_zero(own));
            }
        }
        all
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.filter(|v| *v > 0.0).collect();
    if all.is_empty() {
        0.0
    } else {
        crate::smooth::median_in_place(&mut all)
    }
}

/// Integral of a column over a run, and time since its start.
fn integral(dt: &[f64], x: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    x.iter()
        .zip(dt)
        .enumerate()
        .map(|(k, (x, dt))| {
            if k > 0 && x.is_finite() {
                sum += x * dt.min(0.1);
            }
            sum
        })
        .collect()
}

/// The parts of every balance that can be formed, at their starting sizes.
#[must_use]
pub fn parts(data: &Data, slopes: &Slopes) -> Vec<BalanceParts> {
    let sensors = Sensors::new(data, slopes);
    [Balance::Tyre, Balance::Wheel, Balance::Vehicle]
        .into_iter()
        .filter(|balance| data.forms(*balance))
        .map(|balance| {
            let sources = match balance {
                Balance::Tyre => sensors.tyre(),
                Balance::Wheel => sensors.wheel(),
                Balance::Vehicle => sensors.vehicle(),
            };
            by_blocks(data, balance, sources)
        })
        .collect()
}

/// Parts as they enter means over blocks.
fn by_blocks(data: &Data, balance: Balance, mut sources: Vec<Source>) -> BalanceParts {
    // A mean of so many readings holds so much less of their own noise.
    let blocks = data.blocks.iter().map(|b| &b[balance as usize].samples);
    let (count, samples) = blocks
        .flatten()
        .fold((0.0, 0.0), |(count, samples), block| {
            (count + 1.0, samples + block.len() as f64)
        });
    let less = 0.5 * f64::ln(f64::max(samples, 1.0) / f64::max(count, 1.0));
    for source in sources.iter_mut().filter(|s| s.kind.is_none()) {
        source.log_std -= less;
        source.log_start -= less;
    }
    BalanceParts { balance, sources }
}

impl Source {
    /// A part that starts at this standard deviation and may become as large as the data say.
    fn new(name: &'static str, kind: Option<Kind>, gain: &Arc<Gains>, std: f64) -> Self {
        Self {
            name,
            kind,
            gain: Arc::clone(gain),
            log_std: std.max(1e-12).ln(),
            log_start: std.max(1e-12).ln(),
            log_cap: f64::INFINITY,
            log_most: f64::INFINITY,
            of_slip: false,
            of_law: false,
        }
    }

    /// The same, of which the sensors make no more than this plausible.
    fn at_most(self, std: f64) -> Self {
        Self {
            log_cap: std.max(1e-12).ln(),
            ..self
        }
    }

    /// By what it enters a block of one run.
    fn gain_in(&self, run: usize, block: usize) -> f64 {
        self.gain[run].get(block).copied().unwrap_or(1.0)
    }

    /// Variance of a block of one run as fitted.
    fn variance(&self, run: usize, block: usize) -> f64 {
        let gain = self.gain_in(run, block);
        (2.0 * self.log_std).exp() * gain * gain
    }

    /// The same as an error of the slip.
    fn of_slip(self) -> Self {
        Self {
            of_slip: true,
            ..self.of_law()
        }
    }

    /// The same as an error of the law.
    fn of_law(self) -> Self {
        Self {
            of_law: true,
            ..self
        }
    }

    /// The same as it enters these blocks of a run, where it has a state that is forgotten or stays.
    fn state(&self, run: usize, blocks: &Blocks) -> Option<law_error::State> {
        let memory_s = match self.kind? {
            Kind::Forgetting(time_s) => time_s,
            Kind::Constant => f64::INFINITY,
            _ => return None,
        };
        let std = self.log_std.exp();
        let gain = (0..blocks.time.len()).map(|block| std * self.gain_in(run, block));
        Some(law_error::State {
            memory_s,
            gain: gain.collect(),
            is_force: self.of_law,
        })
    }
}

/// What stays what it is over a run.
const OF_A_RUN: Option<Kind> = Some(Kind::Constant);

fn forgetting(time_s: f64) -> Option<Kind> {
    Some(Kind::Forgetting(time_s))
}

fn integrated(time_s: f64) -> Option<Kind> {
    Some(Kind::Integrated(time_s))
}

/// What the sensors' noise is like, and by what it enters.
struct Sensors<'a> {
    data: &'a Data,
    slopes: &'a Slopes,
    /// Standard deviations of the readings' own noise.
    drag: f64,
    wheel: f64,
    speed: f64,
    torque: f64,
    /// Memory in s of white noise that the smoother has passed: about as long as its window.
    smoothed: f64,
    /// Slow noise of the vehicle speed: its standard deviation, its memory in s.
    coloured: f64,
    colour_time: f64,
    /// Gains of what enters as it is.
    none: Arc<Gains>,
    /// Time since the start of each run.
    time: Vec<Vec<f64>>,
    /// The law's force, for the reading's own noise, integrated, is the walk: scaling it would buy the walk away.
    impulse: Vec<Vec<f64>>,
}

impl<'a> Sensors<'a> {
    fn new(data: &'a Data, slopes: &'a Slopes) -> Self {
        let s = &data.series;
        let sigma = |f: &dyn Fn(&Series) -> f64| median(s.iter().map(f));
        let speed = sigma(&|s| s.speed.sigma).max(1e-6 * data.context.mean_speed);
        let colour = data.vehicle_colour.unwrap_or(Colour {
            std: 0.0,
            time: VEHICLE_MEMORY_S,
        });
        let share = sigma(&|s| median(s.wheel.variance_share.iter().copied())).max(1e-3);
        Self {
            data,
            slopes,
            drag: sigma(&|s| s.drag_sigma).max(1e-6 * data.context.max_drag),
            wheel: sigma(&|s| s.wheel.sigma).max(1e-6 * data.context.mean_wheel_speed),
            speed,
            torque: sigma(&|s| s.torque.as_ref().map_or(0.0, |t| t.sigma)),
            smoothed: (WINDOWS * data.context.dt / share)
                .clamp(SHORTEST_MEMORY_S, LONGEST_MEMORY_S),
            coloured: colour.std.max(0.3 * speed),
            colour_time: colour.time,
            none: Arc::new(vec![Vec::new(); s.len()]),
            time: s
                .iter()
                .map(|s| s.time.iter().map(|t| t - s.time[0]).collect())
                .collect(),
            impulse: s
                .iter()
                .zip(&slopes.force)
                .map(|(s, law)| integral(&s.dt, &quiet_force(s, law)))
                .collect(),
        }
    }

    /// Gains of what enters by these columns, as means over a balance's blocks.
    fn by_blocks(&self, balance: Balance, columns: &[Vec<f64>]) -> Arc<Gains> {
        let runs = columns.iter().zip(&self.data.blocks);
        Arc::new(
            runs.map(|(gain, blocks)| blocks[balance as usize].mean(gain))
                .collect(),
        )
    }

    fn tyre(&self) -> Vec<Source> {
        let gain = |columns: &[Vec<f64>]| self.by_blocks(Balance::Tyre, columns);
        let (none, force) = (&self.none, &gain(&self.slopes.force));
        // What stays is read behind the model's filters, as the force is; what is as fast as they are has its own memory.
        let read = &gain(self.slopes.force_read());
        vec![
            Source::new("white", None, none, self.drag),
            Source::new(
                "wheel speed",
                forgetting(self.smoothed),
                &gain(&self.slopes.wheel),
                0.5 * self.wheel,
            )
            .of_slip(),
            Source::new(
                "vehicle speed",
                forgetting(self.colour_time),
                &gain(&self.slopes.speed),
                self.coloured,
            )
            .of_slip(),
            Source::new("drag, coloured", forgetting(0.07), none, 0.1 * self.drag),
            Source::new("friction, fast", forgetting(0.03), force, 0.003).of_law(),
            Source::new("friction, slow", forgetting(0.6), read, 0.001)
                .at_most(0.003)
                .of_law(),
            Source::new("friction of a run", OF_A_RUN, read, 0.002)
                .at_most(0.005)
                .of_law(),
            Source::new("zero of a run", OF_A_RUN, none, 0.1 * self.drag)
                .at_most(0.002 * self.data.context.max_drag),
            Source::new(
                "slip of a run",
                OF_A_RUN,
                &gain(self.slopes.slip_read()),
                1e-4,
            )
            .at_most(5e-4)
            .of_slip(),
        ]
    }

    fn wheel(&self) -> Vec<Source> {
        let gain = |columns: &[Vec<f64>]| self.by_blocks(Balance::Wheel, columns);
        let (none, context) = (&self.none, &self.data.context);
        let (radius, inertia) = (context.radius, context.inertia);
        let turned: Vec<Vec<f64>> = self
            .data
            .series
            .iter()
            .zip(&self.impulse)
            .map(|(s, impulse)| {
                let slowed = s.wheel.slow.iter().zip(impulse);
                slowed
                    .map(|(omega, p)| finite_or_zero(radius * p - inertia * omega))
                    .collect()
            })
            .collect();
        let root = context.dt.sqrt();
        let walk = (radius * self.drag).hypot(self.torque) * root;
        let level = inertia * self.wheel;
        vec![
            Source::new("walk", Some(Kind::Walk), none, walk),
            Source::new("white", None, none, level),
            Source::new("wheel speed, coloured", forgetting(0.02), none, 0.3 * level),
            Source::new("torque, fast", integrated(0.03), none, 0.2 * walk / root),
            Source::new("torque, slow", integrated(0.3), none, 0.03 * walk / root)
                .at_most(0.1 * walk / root),
            Source::new(
                "torque, drifting",
                integrated(3.0),
                none,
                0.01 * walk / root,
            )
            .at_most(0.03 * walk / root),
            Source::new("torque's scale of a run", OF_A_RUN, &gain(&turned), 0.002).at_most(0.005),
            Source::new(
                "torque's zero of a run",
                OF_A_RUN,
                &gain(&self.time),
                0.001 * context.max_drag * radius,
            )
            .at_most(0.002 * context.max_drag * radius),
        ]
    }

    fn vehicle(&self) -> Vec<Source> {
        let gain = |columns: &[Vec<f64>]| self.by_blocks(Balance::Vehicle, columns);
        let (none, context) = (&self.none, &self.data.context);
        let (mass, force) = (context.mass, context.max_drag);
        let root = context.dt.sqrt();
        let walk = self.drag * root;
        let level = mass * self.speed;
        // What a filter has passed goes smoothly, which no noise that forgets does: a force would have to.
        let slow = if self.data.vehicle_filtered && self.data.vehicle_colour.is_some() {
            Kind::Filtered(self.colour_time)
        } else {
            Kind::Forgetting(self.colour_time)
        };
        vec![
            Source::new("walk", Some(Kind::Walk), none, walk),
            Source::new("white", None, none, level),
            Source::new(
                "vehicle speed, coloured",
                Some(slow),
                none,
                mass * self.coloured,
            ),
            Source::new(
                "vehicle speed, windowed",
                forgetting(0.02),
                none,
                0.3 * level,
            ),
            Source::new("force, slow", integrated(0.3), none, 0.03 * walk / root)
                .at_most(0.2 * walk / root),
            Source::new("force, drifting", integrated(3.0), none, 0.01 * walk / root)
                .at_most(0.03 * walk / root),
            Source::new(
                "drag's scale of a run",
                OF_A_RUN,
                &gain(&self.impulse),
                0.002,
            )
            .at_most(0.005),
            Source::new("force of a run", OF_A_RUN, &gain(&self.time), 0.001 * force)
                .at_most(0.002 * force),
        ]
    }
}

impl Data {
    /// Lets an error of the law be told from the drag's own noise, by the noise of the balances as fitted.
    pub fn tell_law_error(&mut self, parts: &[BalanceParts]) {
        let Some(tyre) = parts.iter().find(|p| p.balance == Balance::Tyre) else {
            return;
        };
        let of_run = |run: usize| {
            let blocks = &self.blocks[run][Balance::Tyre as usize];
            let states = tyre.sources.iter().filter_map(|s| s.state(run, blocks));
            LawError::new(
                &blocks.time,
                &blocks.samples,
                tyre.white(),
                states.collect(),
            )
        };
        let runs = 0..self.series.len();
        let by_run: Vec<LawError> = runs.into_par_iter().map(of_run).collect();
        for (series, own) in self.series.iter_mut().zip(by_run) {
            series.law_error = Some(Arc::new(own));
        }
    }
}

impl BalanceParts {
    /// Standard deviation of the readings' own noise.
    #[must_use]
    pub fn white(&self) -> f64 {
        let white = self.sources.iter().find(|s| s.kind.is_none());
        white.map_or(0.0, |s| s.log_std.exp())
    }

    /// Variances of a block of one run as fitted: of what is in error of the slip, times the law's slope, and of all
    /// else.
    #[must_use]
    pub fn variances(&self, run: usize, block: usize) -> [f64; 2] {
        let mut all = [0.0; 2];
        for source in self.varying() {
            all[usize::from(!source.of_slip)] += source.variance(run, block);
        }
        all
    }

    /// All but what belongs to a run, which is no noise that a model could follow.
    fn varying(&self) -> impl Iterator<Item = &Source> {
        self.sources.iter().filter(|s| s.kind != OF_A_RUN)
    }

    /// What a run's own friction and zero come to in each of its blocks, fitted to what is left there beside its own slip
    /// under the sizes as fitted. Blocks are so many s apart: under noise with a memory they tell no more of a constant than
    /// one block in twice that memory.
    #[must_use]
    pub fn of_run(&self, run: usize, apart_s: f64, left: &[f64]) -> Vec<f64> {
        let constants: Vec<&Source> = self.sources.iter().filter(|s| s.kind == OF_A_RUN).collect();
        let gains = |block: usize| {
            let all = constants.iter().map(|s| s.gain_in(run, block));
            DVector::from_iterator(constants.len(), all)
        };
        let precision = constants.iter().map(|s| (-2.0 * s.log_std).exp());
        let precision = DVector::from_iterator(constants.len(), precision);
        let mut products = DMatrix::from_diagonal(&precision);
        let mut right = DVector::zeros(constants.len());
        for (block, left) in left.iter().enumerate() {
            let told = |source: &Source| {
                let memory_s = match source.kind {
                    Some(Kind::Forgetting(time_s)) => time_s,
                    _ => 0.0,
                };
                source.variance(run, block) * f64::max(1.0, 2.0 * memory_s / apart_s)
            };
            let weight = 1.0 / self.varying().map(told).sum::<f64>();
            if weight.is_finite() && left.is_finite() {
                let own = gains(block);
                right.axpy(weight * left, &own, 1.0);
                products.ger(weight, &own, &own, 1.0);
            }
        }
        let made = products.cholesky().map(|products| products.solve(&right));
        let mut made = made.unwrap_or_else(|| DVector::zeros(constants.len()));
        for (made, source) in made.iter_mut().zip(&constants) {
            if source.of_slip {
                *made = 0.0;
            }
        }
        (0..left.len())
            .map(|block| gains(block).dot(&made))
            .collect()
    }

    /// Parts with a memory on one run, in the order of the sources.
    #[must_use]
    pub fn parts(&self, run: usize) -> Vec<Part<'_>> {
        self.sources
            .iter()
            .filter_map(|s| {
                Some(Part {
                    kind: s.kind?,
                    std: s.log_std.exp(),
                    gain: &s.gain[run],
                })
            })
            .collect()
    }

    /// Every `stride`-th reading of every run as the filter meets it; nothing of a run that does not form the balance.
    #[must_use]
    pub fn courses(&self, data: &Data, stride: usize) -> Vec<Option<Arc<Course>>> {
        (0..data.series.len())
            .into_par_iter()
            .map(|run| {
                let formed = !data.series[run].segments(self.balance).is_empty();
                let blocks = &data.blocks[run][self.balance as usize];
                formed.then(|| {
                    let parts = self.parts(run);
                    Arc::new(Course::new(&blocks.time, &blocks.segments, stride, &parts))
                })
            })
            .collect()
    }

    /// Sizes of all parts.
    #[must_use]
    pub fn sizes(&self) -> Sizes {
        // Of a level nothing is known, whatever the noise is taken to be: else the likelihood would count it.
        let start: f64 = self.sources.iter().map(|s| (2.0 * s.log_start).exp()).sum();
        let mut parts = [0.0; MOST];
        let remembered = self.sources.iter().filter(|s| s.kind.is_some());
        for (into, source) in parts.iter_mut().zip(remembered) {
            *into = source.log_std.exp();
        }
        Sizes {
            white: self.white(),
            diffuse: DIFFUSE * start,
            parts,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::rows::tyre_row_of;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, entry_of, entry_of_form, stop};
    use crate::mechanism::Id;
    use crate::model::Term;

    /// By what a part of the tyre's balance enters the blocks of the first run.
    fn gain_in_tyre(data: &Data, slopes: &Slopes, name: &str) -> Vec<f64> {
        let tyre = &parts(data, slopes)[0];
        let part = tyre.sources.iter().find(|s| s.name == name);
        part.unwrap().gain[0].clone()
    }

    #[test]
    fn what_is_off_over_a_run_is_read_behind_the_model_s_filters() {
        let data = stop(Noise::TYPICAL, 5);
        let mut lagged = Model::of_law(PEAK, CRITICAL);
        lagged.terms.push(Term {
            entry: entry_of(&data, Id::ForceLag),
            parameters: vec![0.05],
        });
        let slopes = Slopes::new(&data, &lagged);
        let column = gain_in_tyre(&data, &slopes, "friction of a run");
        // A percent more friction, as the model itself has it read: the law's first parameter is its logarithm.
        let blocks = &data.blocks[0][Balance::Tyre as usize];
        let read = |model: &Model| blocks.mean(&tyre_row_of(&data, model, 0));
        let mut more = lagged.clone();
        more.base[0] += 0.01_f64.ln_1p();
        let (before, after) = (read(&lagged), read(&more));
        let mut largest = 0.0_f64;
        for (block, gain) in column.iter().enumerate() {
            let change = (before[block] - after[block]) / 0.01;
            assert!((gain - change).abs() < 2.0, "{block}: {gain} {change}");
            largest = largest.max(change);
        }
        assert!(largest > 1000.0, "{largest}");
    }

    #[test]
    fn a_slip_that_is_off_over_a_run_is_so_behind_a_filter_of_the_slip() {
        let data = stop(Noise::TYPICAL, 5);
        let mut relaxed = Model::of_law(PEAK, CRITICAL);
        relaxed.terms.push(Term {
            entry: entry_of_form(&data, Id::RelaxationLength, "slip"),
            parameters: vec![2.0],
        });
        let slopes = Slopes::new(&data, &relaxed);
        let gain = gain_in_tyre(&data, &slopes, "slip of a run");
        // The slope is that of the curve at the slip that the filter has passed: it passes none again.
        let blocks = &data.blocks[0][Balance::Tyre as usize];
        let slope = blocks.mean(&slopes.slip[0]);
        assert!(core::iter::zip(&gain, &slope).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn the_slope_is_that_of_the_law_and_of_all_that_terms_make_of_it() {
        let data = stop(Noise::TYPICAL, 5);
        let law = Model::of_law(PEAK, CRITICAL);
        let plain = Slopes::new(&data, &law);
        let s = &data.series[0];
        for k in (0..s.len()).step_by(97).filter(|k| s.rolling[*k]) {
            let x = s.slip(k, data.context.radius) / CRITICAL;
            let expected =
                s.load.smooth[k] * 2.0 * PEAK / CRITICAL * (1.0 - x * x) / (1.0 + x * x).powi(2);
            let scale = s.load.smooth[k] * PEAK / CRITICAL;
            assert!((plain.slip[0][k] - expected).abs() < 1e-5 * scale, "{k}");
        }
        let mut worn = law;
        worn.terms.push(Term {
            entry: entry_of_form(&data, Id::WearDrift, "energy"),
            parameters: vec![0.7],
        });
        let worn = Slopes::new(&data, &worn);
        // A wear is a factor on friction: on its slope as well, down to exp(-0.7) at the end.
        let mut least = f64::INFINITY;
        for k in (0..s.len()).filter(|k| plain.force[0][*k].abs() > 300.0) {
            let factor = worn.force[0][k] / plain.force[0][k];
            let difference = worn.slip[0][k] - factor * plain.slip[0][k];
            let scale = s.load.smooth[k] * PEAK / CRITICAL;
            assert!(difference.abs() < 1e-5 * scale, "{k}: {difference}");
            least = least.min(factor);
        }
        assert!((least - f64::exp(-0.7)).abs() < 0.02, "{least}");
    }
}
