//! The audit of the measuring chain: what the channels' own timing, noise and resolution are, found before any physics.
//!
//! | question | module |
//! | --- | --- |
//! | when each channel tells what happened | [`timing`]: [`vehicle`], [`wheel`], [`law`], all by [`squares`] |
//! | what rolling wheels tell of both speeds | [`mod@rolling`] |
//! | what is held, what moves in steps | [`hold`], [`steps`], [`simple`] |
//! | what was measured at other times than the recording's | [`resampled`] |
//! | narrow lines: hum, ripple | [`mod@hum`], [`mod@line`] |
//! | what filters a channel passes | [`filter`] |
//! | what is off at a standstill | [`still`] |
//! | noise with a memory | [`colour`], by [`structure`] |
//! | what both speeds have in common | [`common`] |
//! | what the drag leaves beside law and balance | [`tyre`] |
//! | columns made from the drag | [`leak`] |
//! | what it says | [`finding`] |
//! | by which figures it decides | [`constants`] |

pub mod colour;
pub mod common;
pub mod constants;
pub mod filter;
pub mod finding;
pub mod hold;
pub mod hum;
pub mod law;
pub mod leak;
pub mod line;
pub mod recording;
pub mod resampled;
pub mod ring;
pub mod rolling;
pub mod signal;
pub mod simple;
pub mod squares;
pub mod steps;
pub mod still;
pub mod structure;
pub mod timing;
#[cfg(test)]
mod toy;
pub mod tyre;
pub mod vehicle;
pub mod wheel;

pub use finding::{Finding, Timing, Word};
pub use ring::Ring;

use rayon::prelude::*;

use crate::campaign::{Rig, Run};
use colour::Colour;
use constants::HUM_BEYOND_NOISE;
use recording::{Recording, recording};
use timing::{Timings, timings};

/// What the audit found.
#[derive(Clone, Debug, Default)]
pub struct Audit {
    /// Delay of the wheel speed against the drag.
    pub wheel_late: Timing,
    /// Delay of the vehicle speed against the drag.
    pub vehicle_late: Timing,
    /// Delay of the brake column against the drag.
    pub brake_late: Timing,
    /// The delays in detail.
    pub timings: Timings,
    /// Slow noise of the vehicle speed.
    pub vehicle_colour: Option<Colour>,
    /// Whether the drag varies once a revolution as a ripple of the wheel speed would have it, and its reading less.
    pub ripple_unread: bool,
    /// A ring of the drag.
    pub ring: Option<Ring>,
    /// A hum of the drag that stands out of its noise.
    pub loud_hum: Option<hum::Hum>,
    /// What the channels themselves show.
    pub findings: Vec<Finding>,
    /// What the reading of the recordings says of them.
    pub resampled: Vec<Finding>,
}

impl Audit {
    /// Entries of `chain`: of a hold that is known from the reading only what that says.
    #[must_use]
    pub fn chain(&self) -> Vec<Finding> {
        let known = |found: &Finding| {
            let mut resampled = self.resampled.iter();
            found.finding == Word::Held && resampled.any(|one| one.channel == found.channel)
        };
        let seen = self.findings.iter().filter(|found| !known(found));
        self.resampled.iter().chain(seen).cloned().collect()
    }

    /// The run without the columns that reproduce the drag: what they tell of it they have from it.
    #[must_use]
    pub fn without_leaks(&self, mut run: Run) -> Run {
        let leaks = |column: &str| {
            let mut findings = self.findings.iter();
            findings.any(|found| found.finding == Word::Leaks && found.channel == column)
        };
        run.extra.retain(|(column, _)| !leaks(column));
        run
    }

    /// What shows that the channels come through a chain: what no effect that a simulation lacks makes of them. Slow noise of
    /// the drag may be the road's.
    #[must_use]
    pub fn shown(&self) -> Shown {
        let any = |by_colour: fn(&str) -> bool| {
            self.findings.iter().any(|found| match found.finding {
                Word::ColouredNoise => by_colour(&found.channel),
                Word::CommonNoise
                | Word::Quantised
                | Word::Held
                | Word::Hum
                | Word::Ripple
                | Word::Clock => true,
                _ => false,
            })
        };
        Shown {
            of_any: any(|channel| channel != "drag_force_n"),
            of_wheel: any(|channel| channel == "wheel_speed_rad_s"),
            of_timing: self.findings.iter().any(|found| {
                let late = found.finding == Word::Late && found.value > 0.0;
                late || found.finding == Word::Scale
            }),
        }
    }

    /// Whether the vehicle speed passes a filter slower than the other channels'.
    #[must_use]
    pub fn vehicle_filtered(&self) -> bool {
        let mut findings = self.findings.iter();
        findings.any(|f| f.finding == Word::LowPassed && f.channel == "vehicle_speed_m_s")
    }
}

/// Whether a chain shows that channels come through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shown {
    /// Any of them.
    pub of_any: bool,
    /// The wheel speed: slow noise of the vehicle's alone is that sensor's.
    pub of_wheel: bool,
    /// A channel that is late, against whichever other, or speeds of which one is scaled: no effect makes either.
    pub of_timing: bool,
}

/// What the speeds err by, together or the vehicle's alone, and that one's colour.
fn of_speeds(
    rig: &Rig,
    timings: &Timings,
    recordings: &[Recording],
) -> (Option<Finding>, Option<Colour>) {
    if let Some(finding) = common::common(rig, recordings) {
        return (Some(finding), None);
    }
    if recordings.iter().any(|run| run.speed.is_coarse()) {
        return (None, None);
    }
    match colour::of_speed(rig, recordings, timings) {
        Some((finding, colour)) => (finding, Some(colour)),
        None => (None, None),
    }
}

/// Step of the grid for the drag's slow noise, s.
const DRAG_STEP_S: f64 = 0.005;
/// Step of the grid for ripple, s: a few of it a tooth of a commutator.
const RIPPLE_STEP_S: f64 = 0.002;

/// What shows beside the tyre's law: ripple, zero, slow noise of the drag; and whether the wheel speed's reading has less of that
/// ripple.
fn of_tyre(
    rig: &Rig,
    timings: &Timings,
    recordings: &[Recording],
    found: &[Finding],
) -> (Vec<Finding>, bool) {
    let has = |word: Word| found.iter().any(|f| f.finding == word);
    let mut out = Vec::new();
    let step = timing::median_of(recordings, |run| run.step);
    let fitted = tyre::fitted(rig, recordings, timings);
    let of_law = fitted.as_ref().and_then(|fitted| {
        let step = step.max(RIPPLE_STEP_S);
        line::ripple_of_law(&fitted.left(recordings, step), step)
    });
    let unread = of_law.as_ref().is_some_and(|of_law| of_law.unread);
    let line = of_law.is_some();
    let ripple = match of_law {
        Some(of_law) => of_law.ripple,
        None => line::ripple(recordings),
    };
    let zero = still::zero(recordings);
    let Some(fitted) = fitted else {
        out.extend(ripple);
        out.extend(zero);
        return (out, unread);
    };
    let step = step.max(DRAG_STEP_S);
    let left = fitted.left(recordings, step);
    out.extend(zero.or_else(|| still::zero_of_law(&fitted, &left)));
    // A speed that errs, a filter, a line: the law shows them as the drag's. So does a channel with fewer readings than rows.
    let coarse = |run: &Recording| {
        [&run.wheel, &run.speed, &run.drag, &run.load]
            .iter()
            .any(|channel| channel.coarse)
    };
    let other = recordings.iter().any(coarse)
        || [
            Word::ColouredNoise,
            Word::Held,
            Word::Quantised,
            Word::LowPassed,
            Word::Hum,
        ]
        .into_iter()
        .any(has);
    if !other && !line && ripple.is_none() {
        out.extend(colour::of_drag(&left, step));
    }
    out.extend(ripple);
    (out, unread)
}

/// Audits the measuring chain of a campaign.
#[must_use]
pub fn audit(rig: &Rig, runs: &[Run]) -> Audit {
    let recordings: Vec<Recording> = runs.par_iter().map(|run| recording(rig, run)).collect();
    let timings = timings(rig, &recordings);
    let brake = recordings
        .iter()
        .find_map(|run| run.brake.as_ref())
        .map_or("", |(name, _)| name);
    let mut findings = timing::findings(&timings, brake);
    if let Some(rolling) = &timings.rolling {
        findings.extend(rolling::findings(rig, &recordings, rolling));
    }
    findings.extend(simple::simple(runs, &recordings));
    let hum = hum::hum(&recordings);
    findings.extend(hum.iter().map(|hum| hum.finding.clone()));
    findings.extend(leak::leaks(runs));
    findings.extend(filter::filters(&timings, &recordings));
    let (of_speeds, vehicle_colour) = of_speeds(rig, &timings, &recordings);
    findings.extend(of_speeds);
    let (more, ripple_unread) = of_tyre(rig, &timings, &recordings, &findings);
    findings.extend(more);
    Audit {
        wheel_late: timings.wheel,
        vehicle_late: timings.vehicle,
        brake_late: timings.brake,
        vehicle_colour,
        ripple_unread,
        ring: ring::ring(&recordings, hum.as_ref().map(|hum| hum.frequency_hz)),
        loud_hum: hum.filter(|hum| hum.share > HUM_BEYOND_NOISE),
        findings,
        resampled: resampled::findings(runs),
        timings,
    }
}

#[cfg(test)]
mod tests {
    use super::toy::white;
    use super::*;

    const MASS: f64 = 420.0;
    const RADIUS: f64 = 0.31;

    fn rig() -> Rig {
        Rig {
            radius_m: RADIUS,
            wheel_inertia_kg_m2: 1.2,
            mass_kg: MASS,
            coasting: true,
            peak_friction: 0.9,
            critical_slip: 0.12,
            ..Rig::default()
        }
    }

    #[test]
    fn slow_noise_of_the_drag_shows_no_chain_and_the_vehicle_s_none_of_the_wheel() {
        let of = |channel| Audit {
            findings: vec![Finding::of(channel, Word::ColouredNoise, (1.0, 0.1), "1")],
            ..Audit::default()
        };
        assert_eq!(of("drag_force_n").shown(), Shown::default());
        let of_vehicle = of("vehicle_speed_m_s").shown();
        assert!(of_vehicle.of_any && !of_vehicle.of_wheel);
        let of_wheel = of("wheel_speed_rad_s").shown();
        assert!(of_wheel.of_any && of_wheel.of_wheel);
        let late_by = |value: f64| Audit {
            findings: vec![Finding::of(
                "vehicle_speed_m_s",
                Word::Late,
                (value, 1e-3),
                "s",
            )],
            ..Audit::default()
        };
        let late = late_by(0.03).shown();
        assert!(late.of_timing && !late.of_any);
        // A drag that is late makes the others early.
        assert_eq!(late_by(-0.03).shown(), Shown::default());
    }

    /// A coasting vehicle whose slip swings, its speeds read late by so many s.
    fn run(phase: f64, wheel_late: f64, vehicle_late: f64) -> Run {
        let (dt, count) = (1e-3, 8000);
        let (mut v, mut white) = (30.0, white(3));
        let (mut speed, mut wheel, mut drag) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..count {
            let t = f64::from(k) * dt;
            let s = 0.08 * (1.0 - (2.3 * t + phase).cos()) * (0.7 + 0.3 * (5.1 * t).sin());
            let u = s / 0.12;
            let force = 3500.0 * 0.9 * 2.0 * u / (1.0 + u * u);
            speed.push(v);
            wheel.push(v * (1.0 - s) / RADIUS);
            drag.push(force);
            v -= dt * force / MASS * 0.3;
        }
        let mut noise = |size: f64| size * white.next().unwrap();
        let late =
            |x: &[f64], by: f64, k: i32| x[usize::try_from(k - (by / dt) as i32).unwrap_or(0)];
        let rows = || 0..count;
        Run {
            name: "run".to_owned(),
            time_s: rows().map(|k| f64::from(k) * dt).collect(),
            wheel_speed_rad_s: rows()
                .map(|k| late(&wheel, wheel_late, k) + noise(0.1))
                .collect(),
            vehicle_speed_m_s: rows()
                .map(|k| late(&speed, vehicle_late, k) + noise(0.02))
                .collect(),
            drag_force_n: rows()
                .map(|k| 0.3 * drag[k as usize] + noise(20.0))
                .collect(),
            normal_force_n: rows().map(|_| 0.3 * 3500.0).collect(),
            ..Run::default()
        }
    }

    #[test]
    fn known_delays_are_found() {
        let runs = [
            run(0.0, 0.02, 0.05),
            run(1.0, 0.02, 0.05),
            run(2.0, 0.02, 0.05),
        ];
        let found = audit(&rig(), &runs);
        assert!(
            (found.wheel_late.value - 0.02).abs() < 1e-3,
            "{:?}",
            found.wheel_late
        );
        assert!(
            (found.vehicle_late.value - 0.05).abs() < 2e-3,
            "{:?}",
            found.vehicle_late
        );
        let late = found
            .findings
            .iter()
            .filter(|f| f.finding == Word::Late)
            .count();
        assert_eq!(late, 2, "{:?}", found.findings);
    }

    #[test]
    fn a_filter_of_the_drag_is_told_from_its_delay() {
        let changed = |change: fn(&[f64]) -> Vec<f64>| {
            let runs = [0.0, 1.0, 2.0].map(|phase| {
                let run = run(phase, 0.0, 0.0);
                let drag_force_n = change(&run.drag_force_n);
                Run {
                    drag_force_n,
                    ..run
                }
            });
            let found = audit(&rig(), &runs).findings;
            let mut filters = found
                .into_iter()
                .filter(|f| f.finding == Word::LowPassed && f.channel == "drag_force_n");
            filters.next()
        };
        let filtered = changed(|drag| signal::low_pass(drag, 1e-3, 0.03)).unwrap();
        assert!((filtered.value - 0.03).abs() < 2e-3, "{filtered:?}");
        let delayed = changed(|drag| [&[drag[0]; 30], &drag[..drag.len() - 30]].concat());
        assert!(delayed.is_none(), "{delayed:?}");
    }

    #[test]
    fn a_radius_that_varies_is_told_from_a_rippling_encoder_by_what_the_wheel_speed_reads() {
        let ripple = 0.008;
        let turned = |of_radius: bool| {
            [0.0, 1.0, 2.0].map(|phase| {
                let mut run = run(phase, 0.0, 0.0);
                let mut angle = phase;
                for k in 0..run.time_s.len() {
                    let (omega, v) = (run.wheel_speed_rad_s[k], run.vehicle_speed_m_s[k]);
                    angle += 1e-3 * omega;
                    let change = ripple * angle.cos();
                    if of_radius {
                        // The wheel is held to its speed: the drag is that of the slip of a larger or smaller wheel.
                        let drag = |slip: f64| {
                            let u = slip / 0.12;
                            0.3 * 3500.0 * 0.9 * 2.0 * u / (1.0 + u * u)
                        };
                        let slip = 1.0 - RADIUS * omega / v;
                        run.drag_force_n[k] += drag(slip - change * (1.0 - slip)) - drag(slip);
                    } else {
                        run.wheel_speed_rad_s[k] *= 1.0 + change;
                    }
                }
                run
            })
        };
        let encoder = audit(&rig(), &turned(false));
        assert!(!encoder.ripple_unread);
        let mut ripples = encoder
            .findings
            .iter()
            .filter(|f| f.finding == Word::Ripple);
        let value = ripples.next().unwrap().value;
        assert!((value - ripple).abs() < 1e-3, "{value}");
        let radius = audit(&rig(), &turned(true));
        assert!(radius.ripple_unread, "{:?}", radius.findings);
        // Nor is what turns with the wheel slow noise of the drag.
        let told = |word| radius.findings.iter().any(|f| f.finding == word);
        let neither = !told(Word::Ripple) && !told(Word::ColouredNoise);
        assert!(neither, "{:?}", radius.findings);
    }

    #[test]
    fn in_step_and_white_says_nothing() {
        let runs = [run(0.0, 0.0, 0.0), run(1.0, 0.0, 0.0), run(2.0, 0.0, 0.0)];
        let found = audit(&rig(), &runs);
        assert!(found.findings.is_empty(), "{:?}", found.findings);
    }

    #[test]
    fn nothing_usable_is_no_reason_to_fail() {
        assert!(audit(&rig(), &[]).findings.is_empty());
        let of = |count: usize, value: f64| {
            let column = vec![value; count];
            Run {
                time_s: (0..count).map(|k| k as f64 * 0.01).collect(),
                wheel_speed_rad_s: column.clone(),
                vehicle_speed_m_s: column.clone(),
                drag_force_n: column.clone(),
                normal_force_n: column.clone(),
                brake_torque_nm: Some(column.clone()),
                extra: vec![("x".to_owned(), column)],
                ..Run::default()
            }
        };
        for count in [0, 1, 2, 30, 1000] {
            for value in [0.0, 1.0, 20.0, f64::NAN, 1e308, f64::INFINITY] {
                let found = audit(&rig(), &[of(count, value), of(count, value)]);
                assert!(
                    found.findings.is_empty(),
                    "{count} {value} {:?}",
                    found.findings
                );
            }
        }
        let mut short = run(0.0, 0.0, 0.0);
        short.drag_force_n.clear();
        assert!(!audit(&rig(), &[short]).vehicle_late.std.is_finite());
    }

    #[test]
    fn a_column_that_reproduces_the_drag_is_no_candidate_and_others_stay() {
        let found = Audit {
            findings: vec![
                Finding::of("frame_force_n", Word::Leaks, (1.0, 0.0), "1"),
                Finding::of("temperature_c", Word::Drifts, (0.1, 0.01), "degC/s"),
            ],
            ..Audit::default()
        };
        let column = |name: &str| (name.to_owned(), vec![0.0]);
        let run = Run {
            extra: vec![column("frame_force_n"), column("temperature_c")],
            ..Run::default()
        };
        assert_eq!(found.without_leaks(run).extra, [column("temperature_c")]);
    }
}
