//! One campaign: a rig, a plan, what is concealed, and everything that was recorded.

use anyhow::{Result, bail};
use serde::{Deserialize, Serialize};

use crate::generate::chain::{Chain, Readings};
use crate::draw::Draw;
use crate::generate::effect::{Effect, Scale};
use crate::generate::figures;
use crate::generate::form::{Form, Needs};
use crate::generate::measure::{
    BalanceSigma, Base, Interval, balance_sigma, base_error, intervals, refit, residual, rms,
};
use crate::generate::noise::{Errors, Written, write};
use crate::generate::oracle::Oracle;
use crate::generate::plan::{Plan, PlanKind, RunPlan};
use crate::generate::rig::{Actuation, BrakeColumn, NoiseKind, Rig};
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

/// One figure of an effect in the contract's definition.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Figure {
    pub name: String,
    pub unit: String,
    /// More than one where the contract leaves the choice of variable open.
    pub values: Vec<f64>,
}

/// A concealed effect as the truth file tells it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Concealed {
    pub effect: Effect,
    pub figures: Vec<Figure>,
    /// Names that count as right for this form.
    pub accept: Vec<String>,
    /// Names that may stand beside it without being wrong.
    pub tolerated: Vec<String>,
    /// For an effect outside the vocabulary: the variables that it may be said to depend on.
    pub variables: Vec<String>,
}

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
    /// Whether the gain on fresh runs means anything (an unknowable phase or wander makes it void).
    pub gain_scored: bool,
}

/// One recorded run.
pub struct Recorded {
    pub file: String,
    pub clean: Readings,
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
    let needs = order
        .forms
        .iter()
        .fold(Needs::default(), |needs, form| needs.and(form.needs()));
    let mut rig = Rig::draw(needs, &mut draw);
    let mut idle_column = draw.chance(0.2);
    shape_null(&mut rig, order.null, &mut idle_column, &mut draw);
    let plan = Plan::draw(
        needs,
        &rig,
        order.null == Some(NullKind::Repeats),
        &mut draw,
    );
    let mut plan = plan;
    if order.forms.iter().any(|form| {
        matches!(
            form,
            Form::BrakeLagOne | Form::BrakeLagTwo | Form::BrakeLagDead
        )
    }) {
        // Past the peak a late brake only locks the wheel.
        for run in plan.fit.iter_mut().chain(plan.fresh.iter_mut()) {
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
    let column = column_name(&order.forms, idle_column, &mut draw);
    let all_runs: Vec<&RunPlan> = plan.fit.iter().chain(plan.fresh.iter()).collect();
    let columns: Vec<ColumnSignal> = all_runs
        .iter()
        .map(|run| ColumnSignal::draw(run.duration_s, &mut draw))
        .collect();
    let errors: Vec<(Errors, Errors)> = all_runs
        .iter()
        .map(|run| {
            let samples = |seconds: f64| (seconds * rig.rate_hz) as usize + 2;
            (
                Errors::draw(&rig, samples(run.standstill_s), &mut draw),
                Errors::draw(&rig, samples(run.duration_s), &mut draw),
            )
        })
        .collect();
    let jitter_seed = draw.seed();
    let bench = Bench {
        rig: &rig,
        plan: &plan,
        scale,
        columns: &columns,
        errors: &errors,
        with_column: column.is_some(),
        jitter_seed,
    };

    for (effect, strength) in effects.iter_mut().zip(&order.strength) {
        calibrate(&bench, effect, *strength)?;
    }
    let (rides, _) = bench.ride(&effects, 0..all_runs.len())?;
    if rides.iter().any(|ride| ride.motion.locked) && rig.brake == BrakeColumn::Pressure {
        bail!("the wheel locked under a pressure brake");
    }
    let fit_count = plan.fit.len();
    if rides.iter().any(|ride| ride.clean.time.len() < 700) {
        bail!("a run stopped too early");
    }
    let clean_fit: Vec<Readings> = rides[..fit_count]
        .iter()
        .map(|ride| ride.clean.clone())
        .collect();
    let base_refitted = refit(&rig, &clean_fit);
    let sigma = balance_sigma(&rig, base_refitted, &clean_fit);

    let mut write_draw = Draw::new(seed, &[attempt, 77]);
    let mut fit = Vec::new();
    let mut fresh = Vec::new();
    for (index, ride) in rides.iter().enumerate() {
        let written = ride.write(&rig, &errors[index], &mut write_draw);
        let recorded = |file: String| Recorded {
            file,
            clean: ride.clean.clone(),
            written,
        };
        if index < fit_count {
            fit.push(recorded(format!("run{:02}.csv", index + 1)));
        } else {
            fresh.push(recorded(format!("fresh{:02}.csv", index - fit_count + 1)));
        }
    }
    let (found, coverage, size) = locate(&rig, base_refitted, &sigma, &fit);
    let fresh_truth = fresh
        .iter()
        .enumerate()
        .map(|(index, recorded)| {
            let ride = &rides[fit_count + index];
            let oracle = Oracle {
                rig: &rig,
                effects: &effects,
                scale,
                run: fit_count + index,
                clock: plan.fresh[index].clock_s,
                angle: plan.fresh[index].angle_rad,
                wear: ride.wear_before,
            };
            let floor = oracle.floor(&recorded.clean, &recorded.written);
            FreshTruth {
                file: recorded.file.clone(),
                floor: floor.raw,
                floor_best: floor.best,
                base: base_error(&rig, base_refitted, &recorded.clean, &recorded.written),
                drag_column: index % 2 == 1,
            }
        })
        .collect();
    let gain_scored = effects.iter().any(|effect| effect.balance == "tyre")
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
    let balances: Vec<String> = [
        ("tyre", true),
        ("wheel", rig.brake != BrakeColumn::None),
        ("vehicle", rig.coasting),
    ]
    .into_iter()
    .filter(|(_, there)| *there)
    .map(|(balance, _)| balance.to_owned())
    .collect();
    let column_header = column.clone();
    let concealed = effects
        .iter()
        .map(|effect| {
            figures::concealed(
                effect,
                &rig,
                &scale,
                &rides[..fit_count]
                    .iter()
                    .map(|ride| (&ride.motion, &ride.clean))
                    .collect::<Vec<_>>(),
                column_header.as_deref(),
            )
        })
        .collect();
    let truth_rig = rig.clone();
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
        gain_scored,
        column,
        rig: truth_rig,
    };
    let twin = if with_twin {
        let (rides, _) = bench.ride(&[], 0..all_runs.len())?;
        let mut draw = Draw::new(seed, &[attempt, 77]);
        rides
            .iter()
            .enumerate()
            .map(|(index, ride)| Recorded {
                file: format!("twin{:02}.csv", (index + 1).saturating_sub(fit_count)),
                clean: ride.clean.clone(),
                written: ride.write(&truth.rig, &errors[index], &mut draw),
            })
            .skip(fit_count)
            .collect()
    } else {
        Vec::new()
    };
    Ok((Campaign { truth, fit, fresh }, twin))
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
        _ => (31.0, 6.0),
    }
}

/// Everything but the effects, so that a campaign can be ridden again with other strengths.
struct Bench<'a> {
    rig: &'a Rig,
    plan: &'a Plan,
    scale: Scale,
    columns: &'a [ColumnSignal],
    errors: &'a [(Errors, Errors)],
    with_column: bool,
    jitter_seed: u64,
}

/// One run as it went and as it read.
struct Ride {
    motion: Motion,
    /// Readings of each stretch apart, for the recorder.
    parts: Vec<Readings>,
    clean: Readings,
    wear_before: Wear,
}

impl Bench<'_> {
    fn ride(&self, effects: &[Effect], which: std::ops::Range<usize>) -> Result<(Vec<Ride>, Wear)> {
        let mut wear = Wear::default();
        let mut rides = Vec::new();
        for index in which {
            let run_plan = self
                .plan
                .fit
                .get(index)
                .or_else(|| self.plan.fresh.get(index - self.plan.fit.len()));
            let Some(run_plan) = run_plan else {
                bail!("no such run")
            };
            let (_, main) = &self.errors[index];
            let seen: Vec<(f64, f64)> = main
                .wheel
                .iter()
                .copied()
                .zip(main.speed.iter().copied())
                .collect();
            let wear_before = wear;
            let setting = Setting {
                rig: self.rig,
                effects,
                scale: self.scale,
                run: index,
                wear,
                column: self.with_column.then_some(&self.columns[index]),
                seen_noise: &seen,
            };
            let motion = simulate(run_plan, &setting);
            wear = motion.wear;
            let chain = Chain {
                effects,
                scale: self.scale,
                run: index,
                clock: run_plan.clock_s,
            };
            let mut jitter = Draw::new(self.jitter_seed, &[index as u64]);
            let clock_offset = if effects.iter().any(|effect| effect.form == Form::DriftClock) {
                run_plan.clock_s
            } else {
                0.0
            };
            let mut parts = Vec::new();
            let mut clean = Readings::default();
            for stretch in &motion.stretches {
                let samples =
                    ((stretch.end() - stretch.start) * self.rig.rate_hz).floor() as usize + 1;
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
                clean.extend(readings.clone());
                parts.push(readings);
            }
            rides.push(Ride {
                motion,
                parts,
                clean,
                wear_before,
            });
        }
        Ok((rides, wear))
    }
}

impl Ride {
    fn write(&self, rig: &Rig, errors: &(Errors, Errors), draw: &mut Draw) -> Written {
        let mut written = Written::default();
        let last = self.parts.len() - 1;
        for (index, part) in self.parts.iter().enumerate() {
            written.extend(write(
                rig,
                part,
                if index == last { &errors.1 } else { &errors.0 },
                draw,
            ));
        }
        written
    }
}

/// Turns an effect's strength until it leaves the ordered size in its balance.
fn calibrate(bench: &Bench, effect: &mut Effect, wanted: f64) -> Result<()> {
    let runs = bench.plan.fit.len();
    let measured = |effect: &Effect| -> Result<f64> {
        let (rides, _) = bench.ride(std::slice::from_ref(effect), 0..runs)?;
        if rides.iter().any(|ride| ride.motion.locked)
            && bench.rig.brake == BrakeColumn::Pressure
            && bench.rig.actuation == Actuation::Brake
        {
            bail!("the wheel locked under a pressure brake");
        }
        let clean: Vec<Readings> = rides.into_iter().map(|ride| ride.clean).collect();
        let base = refit(bench.rig, &clean);
        let sigma = balance_sigma(bench.rig, base, &clean);
        let residuals: Vec<f64> = clean
            .iter()
            .flat_map(|run| residual(&effect.balance, bench.rig, base, run))
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
fn locate(rig: &Rig, base: Base, sigma: &BalanceSigma, runs: &[Recorded]) -> Located {
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
        for recorded in runs {
            let values = residual(balance, rig, base, &recorded.clean);
            let here = intervals(
                &recorded.file,
                balance,
                rig,
                &recorded.clean,
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
