//! One campaign: a rig, a plan, what is concealed, and everything that was recorded.

use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::attainable::{Shown, attainable_std};
use crate::generate::chain::{Chain, Readings};
use crate::generate::effect::{Effect, Scale};
use crate::generate::figures::{self, Concealed, Ridden};
use crate::generate::form::{Form, Needs};
use crate::generate::instrument::finding::Finding;
use crate::generate::instrument::{ChainKind, Channels, Instruments, RunSpread};
use crate::generate::measure::{
    BalanceSigma, Base, Interval, balance_sigma, base_error, intervals, refit, residual, rms,
    usable,
};
use crate::generate::noise::{Errors, Written, drop_cells, write};
use crate::generate::oracle::Oracle;
use crate::generate::plan::{Plan, PlanKind};
use crate::generate::rig::{Actuation, BrakeColumn, NoiseKind, Rig, Sigmas};
use crate::generate::sim::{ColumnSignal, Motion, Setting, run as simulate};
use crate::generate::tyre::Wear;

/// What a campaign is to conceal.
#[derive(Clone, Debug)]
pub struct Order {
    pub stratum: String,
    pub forms: Vec<Form>,
    /// Ordered size of each effect, in sigma after the base was refitted.
    pub strength: Vec<f64>,
    pub null: Option<NullKind>,
    /// What the recordings come through.
    pub chain: ChainKind,
}

/// The sorts of null campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NullKind {
    White,
    Coloured,
    HeavyTailed,
    Rough,
    Feedback,
    ExtraColumn,
    NoisySlip,
    Repeats,
    RealChain,
}

/// All sorts of null campaign.
pub const NULL_KINDS: [NullKind; 8] = [
    NullKind::White,
    NullKind::Coloured,
    NullKind::HeavyTailed,
    NullKind::Rough,
    NullKind::Feedback,
    NullKind::ExtraColumn,
    NullKind::NoisySlip,
    NullKind::Repeats,
];

/// What awaits a prediction of one fresh run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FreshTruth {
    pub file: String,
    /// Oracle driven with the written inputs, and with these inputs smoothed as suits it best.
    pub floor: f64,
    pub floor_best: f64,
    /// Base refitted without noise, driven with the written inputs.
    pub base: f64,
    pub drag_column: bool,
    /// Where the run stands in the campaign's order: `first`, `middle` or `last`.
    pub place: String,
    /// Whether the gain on this run means anything: no model can know the wear before a first run that it never saw.
    pub gain_scored: bool,
}

/// The sealed truth of one campaign.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Truth {
    pub campaign: String,
    pub seed: u64,
    pub stratum: String,
    pub null: Option<NullKind>,
    pub plan: PlanKind,
    pub rig: Rig,
    pub column: Option<String>,
    pub base: Base,
    pub base_refitted: Base,
    pub sigma: BalanceSigma,
    pub concealed: Vec<Concealed>,
    /// Balances that the recordings can speak of.
    pub balances: Vec<String>,
    #[serde(rename = "where")]
    pub intervals: Vec<Interval>,
    /// Share of the usable time in which a balance is off by more than one sigma.
    pub coverage: Vec<(String, f64)>,
    /// Size of what the effects leave in each balance, in sigma.
    pub size: Vec<(String, f64)>,
    pub fresh: Vec<FreshTruth>,
    /// What the recordings came through, how each run differed, what `chain` is to say of it, and which names it makes
    /// true.
    pub instruments: Instruments,
    pub spread: Vec<RunSpread>,
    /// Any one of them will do.
    pub findings: Vec<Finding>,
    pub tolerated: Vec<String>,
}

/// One recorded run.
pub struct Recorded {
    pub file: String,
    /// Readings of ideal instruments.
    pub clean: Readings,
    /// What the load cell's channel would read without its random errors.
    pub reading: Vec<f64>,
    pub written: Written,
}

/// A campaign before it is filed.
pub struct Campaign {
    pub truth: Truth,
    pub fit: Vec<Recorded>,
    pub fresh: Vec<Recorded>,
}

/// Names of extra columns that have nothing to do with the matter, and of those that have.
const IDLE_COLUMNS: [&str; 5] = [
    "ambient_temperature_c",
    "track_temperature_c",
    "humidity_percent",
    "cabin_pressure_hpa",
    "battery_voltage_v",
];

/// Makes a campaign to order; draws rig and plan afresh until the order can be met.
pub fn make(name: &str, seed: u64, order: &Order) -> Result<Campaign> {
    attempts(seed, order, |attempt| {
        attempt_once(name, seed, attempt, order, false).map(|(campaign, _)| campaign)
    })
}

/// As [`make`], with the fresh runs recorded once more on a rig without the effects: the same programme,
/// the same noise.
pub fn make_with_twin(name: &str, seed: u64, order: &Order) -> Result<(Campaign, Vec<Recorded>)> {
    attempts(seed, order, |attempt| {
        attempt_once(name, seed, attempt, order, true)
    })
}

fn attempts<T>(seed: u64, order: &Order, once: impl Fn(u64) -> Result<T>) -> Result<T> {
    let mut why = String::from("no attempt");
    for attempt in 0..80 {
        match once(attempt) {
            Ok(made) => return Ok(made),
            Err(error) => why = format!("{error}"),
        }
    }
    bail!(
        "no rig and plan can conceal {:?} at {:?} (seed {seed}): {why}",
        order.forms,
        order.strength
    )
}

fn attempt_once(
    name: &str,
    seed: u64,
    attempt: u64,
    order: &Order,
    with_twin: bool,
) -> Result<(Campaign, Vec<Recorded>)> {
    let mut draw = Draw::new(seed, &[attempt]);
    let mut needs = order
        .forms
        .iter()
        .fold(Needs::default(), |needs, form| needs.and(form.needs()));
    if let ChainKind::Only(kind) = order.chain {
        needs.coasting |= kind.needs_coasting();
        needs.lively = true;
    }
    let mut rig = Rig::draw(needs, &mut draw);
    let mut idle_column = draw.chance(0.2);
    shape_null(&mut rig, order.null, &mut idle_column, &mut draw);
    let mut plan = Plan::draw(
        needs,
        &rig,
        order.null == Some(NullKind::Repeats),
        &mut draw,
    );
    if order.forms.iter().any(|form| {
        matches!(
            form,
            Form::BrakeLagOne | Form::BrakeLagTwo | Form::BrakeLagDead
        )
    }) {
        // Past the peak a late brake only locks the wheel.
        for run in &mut plan.runs {
            for knot in &mut run.slip {
                knot.1 = knot.1.min(0.8 * rig.critical_slip);
            }
        }
    }
    let scale = Scale::of(&rig, &plan);
    let mut effects: Vec<Effect> = order
        .forms
        .iter()
        .map(|form| Effect::draw(*form, &rig, &plan, &mut draw))
        .collect();
    let instruments =
        Instruments::draw(order.chain, &rig, &mut Draw::new(seed, &[attempt, 0xc4a1]));
    let column = if instruments.leak {
        Some(LEAKING_COLUMN.to_owned())
    } else {
        column_name(&order.forms, idle_column, &mut draw)
    };
    let columns: Vec<ColumnSignal> = plan
        .runs
        .iter()
        .map(|run| ColumnSignal::draw(run.duration_s, &mut draw))
        .collect();
    let errors: Vec<(Errors, Errors)> = plan
        .runs
        .iter()
        .map(|run| {
            let samples = |seconds: f64| (seconds * rig.rate_hz) as usize + 2;
            (
                Errors::draw(&rig, samples(run.standstill_s), &mut draw),
                Errors::draw(&rig, samples(run.duration_s), &mut draw),
            )
        })
        .collect();
    let spread: Vec<RunSpread> = (0..plan.runs.len())
        .map(|index| {
            let mut draw = Draw::new(seed, &[attempt, 0x59, index as u64]);
            instruments.spread.draw(&mut draw)
        })
        .collect();
    let seed_of_errors = draw.seed();
    let bench = |rig: &'_ Rig| -> Bench<'_> {
        Bench {
            rig: rig.clone(),
            plan: &plan,
            scale,
            columns: &columns,
            errors: &errors,
            with_column: column.is_some() && !instruments.leak,
            seed: seed_of_errors,
            instruments: &instruments,
            spread: &spread,
        }
    };
    if order.chain == ChainKind::Real {
        // What this chain's channels err by at random is their noise: sizes of effects count in it.
        rig.sigmas = bench(&rig).random_errors()?;
    }
    let bench = bench(&rig);
    for (effect, strength) in effects.iter_mut().zip(&order.strength) {
        calibrate(&bench, effect, *strength)?;
    }
    let all: Vec<usize> = (0..plan.runs.len()).collect();
    let rides = bench.ride(&effects, &all, Manner::Recorded)?;
    if rides.iter().any(|ride| ride.motion.locked) && rig.brake == BrakeColumn::Pressure {
        bail!("the wheel locked under a pressure brake");
    }
    if rides.iter().any(|ride| ride.clean.time.len() < 700) {
        bail!("a run stopped too early");
    }
    // What effects leave is measured on runs that do not differ otherwise.
    let clean_fit: Vec<Readings> = if instruments.acts() {
        bench.alike(&effects)?
    } else {
        plan.fitted()
            .map(|(index, _)| rides[index].clean.clone())
            .collect()
    };
    let base_refitted = refit(&rig, &clean_fit);
    let sigma = balance_sigma(&rig, base_refitted, &clean_fit);

    let mut fit = Vec::new();
    let mut fresh = Vec::new();
    let mut write_draw = Draw::new(seed, &[attempt, 77]);
    for (index, ride) in rides.iter().enumerate() {
        let (written, reading) = bench.written(index, ride, &mut write_draw);
        let kept = plan.fresh.contains(&index);
        let list = if kept { &mut fresh } else { &mut fit };
        list.push(Recorded {
            file: format!("{}{:02}.csv", if kept { "fresh" } else { "run" }, list.len() + 1),
            clean: ride.clean.clone(),
            reading,
            written,
        });
    }
    let (found, coverage, size) = locate(
        &rig,
        base_refitted,
        &sigma,
        &fit.iter()
            .map(|run| run.file.as_str())
            .zip(&clean_fit)
            .collect::<Vec<_>>(),
    );
    let gain_known = effects.iter().any(|effect| effect.balance == "tyre")
        && effects.iter().all(|effect| {
            effect.form.predictable()
                && !(plan.angle_unknown
                    && matches!(
                        effect.form,
                        Form::RunOutLoad
                            | Form::RunOutRadius
                            | Form::RunOutAdditive
                            | Form::RippleSine
                            | Form::RippleTiming
                    ))
        });
    let order_matters = effects.iter().any(|effect| effect.form.of_the_order());
    let fresh_truth = plan
        .fresh
        .iter()
        .zip(&fresh)
        .enumerate()
        .map(|(number, (index, recorded))| {
            let run = &plan.runs[*index];
            let oracle = Oracle {
                rig: &rig,
                effects: &effects,
                scale,
                run: *index,
                clock: run.clock_s,
                angle: run.angle_rad,
                wear: rides[*index].wear_before,
                instruments: &instruments,
            };
            let floor = oracle.floor(&recorded.clean, &recorded.reading, &recorded.written);
            FreshTruth {
                file: recorded.file.clone(),
                floor: floor.raw,
                floor_best: floor.best,
                base: base_error(
                    &rig,
                    base_refitted,
                    &recorded.clean,
                    &recorded.reading,
                    &recorded.written,
                ),
                drag_column: number % 2 == 1,
                place: plan.place(*index).to_owned(),
                gain_scored: gain_known && !(order_matters && *index + 2 < plan.runs.len()),
            }
        })
        .collect();
    let balances: Vec<String> = [
        ("tyre", true),
        ("wheel", rig.brake != BrakeColumn::None),
        ("vehicle", rig.coasting),
    ]
    .into_iter()
    .filter(|(_, there)| *there)
    .map(|(balance, _)| balance.to_owned())
    .collect();
    let ridden: Vec<Ridden<'_>> = plan
        .fitted()
        .map(|(index, _)| Ridden {
            motion: &rides[index].motion,
            index,
            wear_before: rides[index].wear_before,
        })
        .collect();
    let erring: Vec<Readings> = clean_fit
        .iter()
        .zip(bench.fitted())
        .zip(&fit)
        .map(|((plain, index), recorded)| {
            erring(&rig, plain, (&rides[index], spread[index]), &recorded.written)
        })
        .collect();
    let mut concealed = Vec::new();
    for (place, effect) in effects.iter().enumerate() {
        let mut told = figures::concealed(effect, &rig, &scale, &ridden, column.as_deref());
        // A little more of this effect, all else as it is: what one sample then shows is what a fit could use.
        let mut more = effects.clone();
        more[place].a *= 1.0 + NUDGE;
        let nudged = bench.alike(&more)?;
        let shown: Vec<Shown<'_>> = clean_fit
            .iter()
            .zip(&nudged)
            .zip(&erring)
            .map(|((plain, nudged), erring)| Shown {
                plain,
                nudged,
                erring,
            })
            .collect();
        let correlated = order.chain == ChainKind::Real;
        let std = attainable_std(&effect.balance, &rig, base_refitted, &shown, correlated)
            * (NUDGE * effect.a).abs();
        let with_more = figures::figures(&more[place], &rig, &scale, &ridden);
        for (figure, more) in told.figures.iter_mut().zip(with_more) {
            let slope = figure.values.first().zip(more.values.first()).map_or(
                0.0,
                |(before, after)| (after - before) / (NUDGE * effect.a),
            );
            // A nudge moves a hold's steps through the run: the difference is no derivative.
            figure.attainable_std = (slope != 0.0 && std.is_finite() && !effect.form.holds())
                .then(|| slope.abs() * std);
        }
        concealed.push(told);
    }
    let leak = column
        .as_deref()
        .filter(|_| instruments.leak)
        .map(|header| (header, correlation(&fit)));
    let (findings, tolerated) = match order.chain {
        ChainKind::Ideal => (Vec::new(), Vec::new()),
        ChainKind::Real => (Vec::new(), instruments.tolerated(&rig)),
        ChainKind::Only(kind) => (
            kind.truth(&instruments, mean_speeds(&rig, &clean_fit), leak),
            kind.tolerated().iter().map(|id| (*id).to_owned()).collect(),
        ),
    };
    let truth = Truth {
        campaign: name.to_owned(),
        seed,
        stratum: order.stratum.clone(),
        null: order.null,
        plan: plan.kind,
        base: Base {
            peak_friction: rig.peak_friction,
            critical_slip: rig.critical_slip,
        },
        base_refitted,
        sigma,
        concealed,
        balances,
        intervals: found,
        coverage,
        size,
        fresh: fresh_truth,
        column: column.clone(),
        rig: rig.clone(),
        instruments: instruments.clone(),
        spread: spread.clone(),
        findings,
        tolerated,
    };
    let twin = if with_twin {
        let rides = bench.ride(&[], &all, Manner::Recorded)?;
        let mut draw = Draw::new(seed, &[attempt, 77]);
        let mut twin = Vec::new();
        for (index, ride) in rides.iter().enumerate() {
            let (written, reading) = bench.written(index, ride, &mut draw);
            if plan.fresh.contains(&index) {
                twin.push(Recorded {
                    file: format!("twin{:02}.csv", twin.len() + 1),
                    clean: ride.clean.clone(),
                    reading,
                    written,
                });
            }
        }
        twin
    } else {
        Vec::new()
    };
    Ok((Campaign { truth, fit, fresh }, twin))
}

/// The relative change of a strength by which a parameter's attainable accuracy is found.
const NUDGE: f64 = 0.03;

/// Header of a column that copies the drag.
const LEAKING_COLUMN: &str = "frame_force_n";

/// Ideal readings with the random errors of a run's channels (what was written less what the chain does to any signal),
/// and with what the run differs by.
fn erring(
    rig: &Rig,
    plain: &Readings,
    (ride, spread): (&Ride, RunSpread),
    written: &Written,
) -> Readings {
    let add = |plain: &[f64], written: &[f64], expected: &[f64]| -> Vec<f64> {
        plain
            .iter()
            .zip(written.iter().zip(expected))
            .map(|(plain, (written, expected))| {
                let error = written - expected;
                plain + if error.is_finite() { error } else { 0.0 }
            })
            .collect()
    };
    let expected = ride.channels.as_ref().map(|channels| &channels.0);
    let in_torque = match rig.brake {
        BrakeColumn::Pressure => rig.torque_per_pressure,
        _ => 1.0,
    };
    let brake: Vec<f64> = written.brake.iter().map(|value| value * in_torque).collect();
    let torque = match rig.brake {
        BrakeColumn::Pressure => &ride.clean.command,
        _ => &ride.clean.torque,
    };
    let with = |plain: &[f64], written: &[f64], ideal: &[f64], read: fn(&Channels) -> &Vec<f64>| {
        add(plain, written, expected.map_or(ideal, |channels| read(channels)))
    };
    let clean = &ride.clean;
    Readings {
        // A coasting run may end a few samples earlier or later where runs differ.
        time: plain
            .time
            .iter()
            .take(written.time.len())
            .copied()
            .collect(),
        wheel: with(&plain.wheel, &written.wheel, &clean.wheel, |c| &c.wheel),
        speed: with(&plain.speed, &written.speed, &clean.speed, |c| &c.speed),
        drag: with(&plain.drag, &written.drag, &clean.drag, |c| &c.drag)
            .iter()
            .zip(&plain.drag)
            .map(|(reading, drag)| {
                reading + drag * (spread.gain + spread.friction) + spread.zero_n
            })
            .collect(),
        load: with(&plain.load, &written.load, &clean.load, |c| &c.load),
        torque: with(&plain.torque, &brake, torque, |c| &c.brake),
        command: with(&plain.command, &brake, torque, |c| &c.brake),
        ..Readings::default()
    }
}

/// Mean wheel and vehicle speed over usable samples.
fn mean_speeds(rig: &Rig, runs: &[Readings]) -> (f64, f64) {
    let (mut wheel, mut speed, mut count) = (0.0, 0.0, 1e-300);
    for run in runs {
        for index in (0..run.time.len()).filter(|&index| usable(rig, run, index)) {
            wheel += run.wheel[index];
            speed += run.speed[index];
            count += 1.0;
        }
    }
    (wheel / count, speed / count)
}

/// Correlation of a leaking column with the drag, as recorded.
fn correlation(runs: &[Recorded]) -> f64 {
    let pairs: Vec<(f64, f64)> = runs
        .iter()
        .flat_map(|run| run.written.drag.iter().copied().zip(run.written.column.iter().copied()))
        .filter(|(drag, column)| drag.is_finite() && column.is_finite())
        .collect();
    let n = pairs.len().max(1) as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| pairs.iter().map(pick).sum::<f64>() / n;
    let (a, b) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        pairs.iter().map(|(x, y)| f(x - a, y - b)).sum()
    };
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

/// Gives a null campaign the character that its kind asks for.
fn shape_null(rig: &mut Rig, null: Option<NullKind>, idle_column: &mut bool, draw: &mut Draw) {
    let Some(kind) = null else { return };
    rig.feedback = kind == NullKind::Feedback || (rig.feedback && kind == NullKind::Rough);
    *idle_column = kind == NullKind::ExtraColumn;
    rig.noise = match kind {
        NullKind::Coloured => draw.one_of(&[NoiseKind::Coloured, NoiseKind::Arma]),
        NullKind::HeavyTailed => draw.one_of(&[NoiseKind::HeavyTailed, NoiseKind::Outliers]),
        NullKind::Rough => draw.one_of(&[
            NoiseKind::Heteroscedastic,
            NoiseKind::Quantised,
            NoiseKind::MissingCells,
        ]),
        NullKind::Repeats => draw.one_of(&[NoiseKind::White, NoiseKind::Coloured]),
        // Their noise is the chain's own; a recorder drops cells behind any.
        NullKind::RealChain if draw.chance(0.1) => NoiseKind::MissingCells,
        _ => NoiseKind::White,
    };
    if kind == NullKind::NoisySlip {
        rig.scale_slip_noise(draw.between(2.5, 4.0));
    }
}

fn column_name(forms: &[Form], idle: bool, draw: &mut Draw) -> Option<String> {
    let names: &[&str] = match forms.iter().find(|form| form.needs().column) {
        Some(Form::OutColumnFriction) => {
            &["humidity_percent", "track_temperature_c", "water_depth_mm"]
        }
        Some(Form::OutColumnSlip) => &["tyre_pressure_pa", "carcass_temperature_c"],
        Some(Form::OutColumnSteer) => &["steering_angle_deg", "toe_angle_deg"],
        Some(Form::OutColumnZero) => &["amplifier_temperature_c", "frame_temperature_c"],
        Some(Form::OutColumnWind) => &["wind_speed_m_s", "tow_cable_tension"],
        Some(Form::OutColumnOil) => &["gearbox_oil_temperature_c", "hub_temperature_c"],
        _ if idle => &IDLE_COLUMNS,
        _ => return None,
    };
    Some(draw.one_of(names).to_owned())
}

/// How a column scaled to order one is written: centre and span.
pub fn column_scale(name: &str) -> (f64, f64) {
    match name {
        n if n.ends_with("_pa") => (2.2e5, 2.5e4),
        n if n.ends_with("_hpa") => (1008.0, 6.0),
        n if n.ends_with("_percent") => (55.0, 15.0),
        n if n.ends_with("_deg") => (0.0, 2.5),
        n if n.ends_with("_mm") => (1.2, 0.4),
        n if n.ends_with("_v") => (12.4, 0.3),
        n if n.ends_with("_m_s") => (0.0, 3.0),
        n if n.ends_with("tension") => (0.0, 50.0),
        n if n.ends_with("force_n") => (0.0, 900.0),
        _ => (31.0, 6.0),
    }
}

/// Everything but the effects, so that a campaign can be ridden again with other strengths.
struct Bench<'a> {
    rig: Rig,
    plan: &'a Plan,
    scale: Scale,
    columns: &'a [ColumnSignal],
    errors: &'a [(Errors, Errors)],
    with_column: bool,
    seed: u64,
    instruments: &'a Instruments,
    spread: &'a [RunSpread],
}

/// How runs are ridden.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Manner {
    /// None differs from the others but by its plan; ideal readings only.
    Alike,
    /// As they were recorded: each run with its own differences, through the instruments.
    Recorded,
}

/// One run as it went and as it read.
struct Ride {
    motion: Motion,
    /// Readings of each stretch apart, for the recorder.
    parts: Vec<Readings>,
    clean: Readings,
    /// What the instruments made of it, without and with random errors.
    channels: Option<(Channels, Channels)>,
    wear_before: Wear,
}

impl Bench<'_> {
    fn fitted(&self) -> Vec<usize> {
        self.plan.fitted().map(|(index, _)| index).collect()
    }

    /// Rides the runs that are fitted, all alike; where the order matters, those between them as well.
    fn ride_fitted(&self, effects: &[Effect]) -> Result<Vec<Ride>> {
        let fitted = self.fitted();
        if !effects.iter().any(|effect| effect.form.of_the_order()) {
            return self.ride(effects, &fitted, Manner::Alike);
        }
        let all: Vec<usize> = (0..self.plan.runs.len()).collect();
        let rides = self.ride(effects, &all, Manner::Alike)?;
        Ok(rides
            .into_iter()
            .enumerate()
            .filter(|(index, _)| fitted.contains(index))
            .map(|(_, ride)| ride)
            .collect())
    }

    /// Ideal readings of the runs that are fitted, all alike.
    fn alike(&self, effects: &[Effect]) -> Result<Vec<Readings>> {
        let rides = self.ride_fitted(effects)?;
        Ok(rides.into_iter().map(|ride| ride.clean).collect())
    }

    /// Rides the given runs in order; wear goes on from one to the next.
    fn ride(&self, effects: &[Effect], which: &[usize], manner: Manner) -> Result<Vec<Ride>> {
        let mut wear = Wear::default();
        let mut rides = Vec::new();
        for &index in which {
            let run_plan = &self.plan.runs[index];
            let (_, main) = &self.errors[index];
            let seen_noise: Vec<(f64, f64)> = main
                .wheel
                .iter()
                .copied()
                .zip(main.speed.iter().copied())
                .collect();
            let wear_before = wear;
            let spread = match manner {
                Manner::Alike => RunSpread::default(),
                Manner::Recorded => self.spread[index],
            };
            let setting = Setting {
                rig: &self.rig,
                effects,
                scale: self.scale,
                run: index,
                wear,
                column: self.with_column.then_some(&self.columns[index]),
                seen_noise: &seen_noise,
                friction: spread.friction,
            };
            let motion = simulate(run_plan, &setting);
            wear = motion.wear;
            let chain = Chain {
                effects,
                scale: self.scale,
                run: index,
                clock: run_plan.clock_s,
            };
            let mut jitter = Draw::new(self.seed, &[index as u64]);
            let clock_offset = if effects.iter().any(|effect| effect.form == Form::DriftClock) {
                run_plan.clock_s
            } else {
                0.0
            };
            let mut parts = Vec::new();
            let mut clean = Readings::default();
            let mut channels = (manner == Manner::Recorded && self.instruments.acts())
                .then(|| (Channels::default(), Channels::default()));
            for (number, stretch) in motion.stretches.iter().enumerate() {
                let recorded_s = stretch.end() - stretch.start - self.instruments.ahead_s();
                let samples = (recorded_s * self.rig.rate_hz).floor().max(0.0) as usize + 1;
                let times: Vec<f64> = (0..samples)
                    .map(|k| {
                        let shift = if self.rig.jitter && k > 0 && k + 1 < samples {
                            jitter.between(-0.1, 0.1)
                        } else {
                            0.0
                        };
                        stretch.start + (k as f64 + shift) / self.rig.rate_hz
                    })
                    .collect();
                let mut readings = chain.read(stretch, &times);
                for time in &mut readings.time {
                    *time += clock_offset;
                }
                if readings
                    .drag
                    .iter()
                    .chain(&readings.wheel)
                    .any(|value| !value.is_finite())
                {
                    bail!("the motion ran away");
                }
                if let Some((without, with)) = &mut channels {
                    let seen = chain.seen(stretch, self.rig.brake == BrakeColumn::Pressure);
                    let mut draw =
                        Draw::new(self.seed, &[index as u64, 0x3e, number as u64]);
                    without.extend(self.instruments.read(&seen, &times, spread, None));
                    with.extend(self.instruments.read(&seen, &times, spread, Some(&mut draw)));
                }
                clean.extend(readings.clone());
                parts.push(readings);
            }
            rides.push(Ride {
                motion,
                parts,
                clean,
                channels,
                wear_before,
            });
        }
        Ok(rides)
    }

    /// What the recorder writes of a run, and what the load cell would have read without random errors.
    fn written(&self, index: usize, ride: &Ride, draw: &mut Draw) -> (Written, Vec<f64>) {
        let (rig, errors) = (&self.rig, &self.errors[index]);
        let Some((without, with)) = &ride.channels else {
            let mut written = Written::default();
            let last = ride.parts.len() - 1;
            for (number, part) in ride.parts.iter().enumerate() {
                let errors = if number == last { &errors.1 } else { &errors.0 };
                written.extend(write(rig, part, errors, draw));
            }
            return (written, ride.clean.drag.clone());
        };
        let in_column = match rig.brake {
            BrakeColumn::Pressure => rig.torque_per_pressure,
            _ => 1.0,
        };
        let mut written = Written {
            time: ride.clean.time.clone(),
            wheel: with.wheel.clone(),
            speed: with.speed.clone(),
            drag: with.drag.clone(),
            load: with.load.clone(),
            brake: with.brake.iter().map(|torque| torque / in_column).collect(),
            column: if self.instruments.leak {
                // Another cell in the same frame, of order one as all columns here.
                with.drag
                    .iter()
                    .map(|drag| drag / rig.peak_drag_n() + 0.01 * draw.normal())
                    .collect()
            } else {
                ride.clean
                    .column
                    .iter()
                    .map(|value| value + 0.01 * draw.normal())
                    .collect()
            },
        };
        drop_cells(rig, &mut written, draw);
        (written, without.drag.clone())
    }

    /// Standard deviations of the channels' random errors on the fitted runs, nothing concealed.
    fn random_errors(&self) -> Result<Sigmas> {
        let rides = self.ride(&[], &self.fitted(), Manner::Recorded)?;
        let spread = |pick: &dyn Fn(&Channels) -> &Vec<f64>| -> f64 {
            let errors: Vec<f64> = rides
                .iter()
                .filter_map(|ride| ride.channels.as_ref().map(|channels| (ride, channels)))
                .flat_map(|(ride, (without, with))| {
                    pick(with)
                        .iter()
                        .zip(pick(without))
                        .enumerate()
                        .filter(|(index, _)| usable(&self.rig, &ride.clean, *index))
                        .map(|(_, (a, b))| a - b)
                        .collect::<Vec<_>>()
                })
                .collect();
            rms(errors.iter())
        };
        let found = Sigmas {
            drag_force_n: spread(&|c| &c.drag),
            normal_force_n: spread(&|c| &c.load),
            wheel_speed_rad_s: spread(&|c| &c.wheel),
            vehicle_speed_m_s: spread(&|c| &c.speed),
            brake_torque_nm: spread(&|c| &c.brake),
        };
        if [
            found.drag_force_n,
            found.wheel_speed_rad_s,
            found.vehicle_speed_m_s,
        ]
        .iter()
        .any(|sigma| !(sigma.is_finite() && *sigma > 0.0))
        {
            bail!("a channel without random errors");
        }
        Ok(found)
    }
}

/// Turns an effect's strength until it leaves the ordered size in its balance.
fn calibrate(bench: &Bench, effect: &mut Effect, wanted: f64) -> Result<()> {
    let measured = |effect: &Effect| -> Result<f64> {
        let rides = bench.ride_fitted(std::slice::from_ref(effect))?;
        if rides.iter().any(|ride| ride.motion.locked)
            && bench.rig.brake == BrakeColumn::Pressure
            && bench.rig.actuation == Actuation::Brake
        {
            bail!("the wheel locked under a pressure brake");
        }
        let clean: Vec<Readings> = rides.into_iter().map(|ride| ride.clean).collect();
        let base = refit(&bench.rig, &clean);
        let sigma = balance_sigma(&bench.rig, base, &clean);
        let residuals: Vec<f64> = clean
            .iter()
            .flat_map(|run| residual(&effect.balance, &bench.rig, base, run))
            .collect();
        Ok(rms(residuals.iter())
            / match effect.balance.as_str() {
                "wheel" => sigma.wheel,
                "vehicle" => sigma.vehicle,
                _ => sigma.tyre,
            })
    };
    let (low, high) = (
        effect.a_range.0.abs().min(effect.a_range.1.abs()),
        effect.a_range.0.abs().max(effect.a_range.1.abs()),
    );
    let sign = if effect.a < 0.0 { -1.0 } else { 1.0 };
    let mut exponent: f64 = if matches!(effect.form, Form::ResonanceMode | Form::ResonanceShare) {
        2.0
    } else {
        1.0
    };
    let mut last: Option<(f64, f64)> = None;
    let mut at_bound = 0;
    for _ in 0..12 {
        let size = measured(effect)?;
        if (size / wanted - 1.0).abs() < 0.04 {
            effect.strength_sigma = size;
            return Ok(());
        }
        let now = effect.a.abs();
        if let Some((before, before_size)) = last
            && (now / before).ln().abs() > 1e-3
            && size > 0.0
            && before_size > 0.0
        {
            exponent = ((size / before_size).ln() / (now / before).ln()).clamp(0.25, 4.0);
        }
        last = Some((now, size));
        let step = if size > 1e-9 {
            (wanted / size).powf(1.0 / exponent).clamp(0.1, 8.0)
        } else {
            4.0
        };
        let next = (now * step).clamp(low.max(1e-9), high);
        if (next - high).abs() < 1e-12 || next <= low {
            at_bound += 1;
            if at_bound > 2 {
                bail!("strength out of reach: {size:.2} of {wanted:.2} sigma");
            }
        }
        effect.a = sign * next;
    }
    bail!("strength does not settle")
}

type Located = (Vec<Interval>, Vec<(String, f64)>, Vec<(String, f64)>);

/// Where each balance is off, how much of the time, and by how much.
fn locate(rig: &Rig, base: Base, sigma: &BalanceSigma, runs: &[(&str, &Readings)]) -> Located {
    let mut found = Vec::new();
    let mut coverage = Vec::new();
    let mut size = Vec::new();
    for (balance, sigma) in [
        ("tyre", sigma.tyre),
        ("wheel", sigma.wheel),
        ("vehicle", sigma.vehicle),
    ] {
        let mut all = Vec::new();
        let mut total = 0.0;
        let mut covered = 0.0;
        for (file, clean) in runs {
            let values = residual(balance, rig, base, clean);
            let here = intervals(
                file,
                balance,
                rig,
                clean,
                &values,
                sigma,
            );
            total += values.iter().filter(|value| value.is_finite()).count() as f64 / rig.rate_hz;
            covered += here
                .iter()
                .map(|interval| interval.end_s - interval.start_s)
                .sum::<f64>();
            found.extend(here);
            all.extend(values);
        }
        if total > 0.0 {
            coverage.push((balance.to_owned(), (covered / total).min(1.0)));
            size.push((balance.to_owned(), rms(all.iter()) / sigma));
        }
    }
    (found, coverage, size)
}
