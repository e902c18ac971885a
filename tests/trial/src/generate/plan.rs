//! Test plans: what the test engineer ordered each run to do.

use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::form::Needs;
use crate::generate::rig::{Actuation, BrakeColumn, Rig, RigKind};

/// The style of a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanKind {
    /// The same ramps again and again, one speed, one load.
    Repeats,
    /// A plan over speed and load, every run of one manner.
    Grid,
    /// A plan over speed and load, with manners mixed between runs.
    Mixed,
}

/// What a slip programme looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Manner {
    Ramps,
    Cycling,
    Holds,
}

/// Orders for one run.
#[derive(Clone, Debug)]
pub struct RunPlan {
    pub duration_s: f64,
    /// Held or initial speed, m/s, at knots of time.
    pub speed: Vec<(f64, f64)>,
    pub load_n: f64,
    /// Relative load at knots of time.
    pub load_steps: Vec<(f64, f64)>,
    /// Bounce: relative amplitude, frequency in Hz, phase.
    pub bounce: [(f64, f64, f64); 2],
    /// Share of the drag that comes on the wheel as load.
    pub weight_transfer: f64,
    /// Ordered slip at knots of time.
    pub slip: Vec<(f64, f64)>,
    /// First-order smoothing of the ordered slip, in s.
    pub slip_smoothing_s: f64,
    /// Seconds recorded at standstill before a gap in time and the run proper.
    pub standstill_s: f64,
    /// Wheel angle at the start, rad.
    pub angle_rad: f64,
    /// Where on the track the run starts, m from its usual start.
    pub clock_s: f64,
}

/// A whole campaign's orders.
#[derive(Clone, Debug)]
pub struct Plan {
    pub kind: PlanKind,
    /// All runs in the order in which they are driven.
    pub runs: Vec<RunPlan>,
    /// Which of them are kept for predictions: the last two, the first and the last, or the first and one between.
    pub fresh: [usize; 2],
    /// Whether the wheel's angle at the start differs from run to run.
    pub angle_unknown: bool,
}

impl Plan {
    /// Orders that give the concealed effects something to show in.
    pub fn draw(needs: Needs, rig: &Rig, force_repeats: bool, draw: &mut Draw) -> Plan {
        let needs_grid = needs.load_plan || needs.speed_plan;
        let kind = if force_repeats || (!needs_grid && draw.chance(0.2)) {
            PlanKind::Repeats
        } else if draw.chance(0.4) {
            PlanKind::Grid
        } else {
            PlanKind::Mixed
        };
        let runs = draw.whole(if needs.many_runs || needs_grid { 5 } else { 4 }, 8);
        let fresh_runs = 2;
        let angle_unknown = draw.chance(0.3);
        let style = Style::draw(needs, rig, kind, draw);
        let mut clock = 0.0;
        let mut all = Vec::new();
        for index in 0..runs + fresh_runs {
            let mut run = style.run(index, rig, draw);
            run.angle_rad = if angle_unknown {
                draw.between(0.0, std::f64::consts::TAU)
            } else {
                0.0
            };
            run.clock_s = clock;
            clock += run.duration_s + run.standstill_s + draw.between(20.0, 90.0);
            all.push(run);
        }
        let last = runs + fresh_runs - 1;
        let fresh = match draw.whole(0, 2) {
            0 => [last - 1, last],
            1 => [0, last],
            _ => [0, draw.whole(2, last - 1)],
        };
        Plan {
            kind,
            runs: all,
            fresh,
            angle_unknown,
        }
    }

    /// Runs that are fitted, with their place in the order.
    pub fn fitted(&self) -> impl Iterator<Item = (usize, &RunPlan)> {
        self.runs
            .iter()
            .enumerate()
            .filter(|(index, _)| !self.fresh.contains(index))
    }

    /// Where a run stands in the order.
    pub fn place(&self, index: usize) -> &'static str {
        if index == 0 {
            "first"
        } else if index + 1 == self.runs.len() {
            "last"
        } else {
            "middle"
        }
    }
}

/// What all runs of a campaign have in common.
struct Style {
    kind: PlanKind,
    manner: Manner,
    lively: bool,
    duration_s: f64,
    deepest: f64,
    floor_slip: f64,
    bounce: f64,
    weight_transfer: f64,
    speeds: Vec<f64>,
    loads: Vec<f64>,
    load_steps: bool,
    speed_sweeps: bool,
    standstill: bool,
    smoothing_s: f64,
}

impl Style {
    fn draw(needs: Needs, rig: &Rig, kind: PlanKind, draw: &mut Draw) -> Style {
        let samples = (rig.rate_hz * draw.between(6.0, 14.0)).clamp(1000.0, 5000.0);
        let mut deepest = if needs.deep_slip {
            draw.between(0.45, 0.85)
        } else {
            draw.between(2.0, 4.5) * rig.critical_slip
        };
        if rig.actuation == Actuation::Brake {
            // Under a brake a wheel near lock is a coin toss; the recorded pressure would say nothing.
            deepest = deepest.min(if rig.brake == BrakeColumn::Pressure {
                0.6
            } else {
                0.7
            });
        }
        let spread = kind != PlanKind::Repeats;
        let speeds = if spread {
            let low = draw.between(0.4, 0.6);
            let high = draw.between(1.05, 1.3);
            let middle = 0.5 * (low + high);
            vec![low, middle, high]
        } else {
            vec![draw.between(0.8, 1.1)]
        };
        let loads = if spread && (needs.load_plan || draw.chance(0.75)) {
            vec![draw.between(0.55, 0.75), 1.0, draw.between(1.2, 1.45)]
        } else {
            vec![1.0]
        };
        Style {
            kind,
            manner: if needs.lively {
                draw.one_of(&[Manner::Ramps, Manner::Cycling, Manner::Cycling])
            } else {
                draw.one_of(&[Manner::Ramps, Manner::Ramps, Manner::Cycling, Manner::Holds])
            },
            lively: needs.lively,
            duration_s: samples / rig.rate_hz,
            deepest,
            floor_slip: if needs.free_rolling || draw.chance(0.7) {
                0.0
            } else {
                draw.between(0.005, 0.02)
            },
            bounce: if draw.chance(0.7) {
                draw.between(0.005, 0.05)
            } else {
                0.0
            },
            weight_transfer: if draw.chance(0.5) {
                draw.between(0.03, 0.18)
            } else {
                0.0
            },
            speeds,
            loads,
            load_steps: spread && draw.chance(if needs.load_plan { 0.6 } else { 0.3 }),
            speed_sweeps: !rig.coasting && spread && draw.chance(0.5),
            standstill: draw.chance(if needs.free_rolling { 0.7 } else { 0.25 }),
            smoothing_s: (2.0 / rig.rate_hz).max(draw.between(0.008, 0.03)),
        }
    }

    fn run(&self, index: usize, rig: &Rig, draw: &mut Draw) -> RunPlan {
        let duration = self.duration_s * draw.between(0.85, 1.0);
        let level = |levels: &[f64], step: usize| levels[(index / step) % levels.len()];
        let speed = rig.mean_speed_m_s * level(&self.speeds, 1) * draw.between(0.97, 1.03);
        let load_n = rig.mean_load_n
            * level(&self.loads, if self.speeds.len() > 1 { 2 } else { 1 })
            * draw.between(0.97, 1.03);
        let speed_knots = if rig.coasting || !self.speed_sweeps || draw.chance(0.4) {
            vec![(0.0, speed)]
        } else if draw.chance(0.5) {
            let other = speed * draw.between(0.6, 1.4);
            let (a, b) = (
                draw.between(0.3, 0.45) * duration,
                draw.between(0.55, 0.7) * duration,
            );
            vec![(a, speed), (b, other)]
        } else {
            vec![(0.0, speed), (duration, speed * draw.between(0.6, 1.5))]
        };
        let mut load_steps = vec![(0.0, 1.0)];
        if self.load_steps {
            let mut time = draw.between(0.1, 0.3) * duration;
            let mut value = 1.0;
            while time < duration {
                load_steps.push((time, value));
                value = draw.between(0.7, 1.3);
                time += draw.between(0.05, 0.1) * duration;
                load_steps.push((time, value));
                time += draw.between(0.15, 0.35) * duration;
            }
        }
        let body_hz = if rig.kind == RigKind::ScaleCar {
            draw.between(3.0, 7.0)
        } else {
            draw.between(0.8, 3.0)
        };
        let manner = match self.kind {
            PlanKind::Mixed if self.lively => draw.one_of(&[Manner::Ramps, Manner::Cycling]),
            PlanKind::Mixed => draw.one_of(&[Manner::Ramps, Manner::Cycling, Manner::Holds]),
            _ => self.manner,
        };
        RunPlan {
            duration_s: duration,
            speed: speed_knots,
            load_n,
            load_steps,
            bounce: [
                (
                    self.bounce * draw.between(0.5, 1.2),
                    body_hz,
                    draw.between(0.0, std::f64::consts::TAU),
                ),
                (
                    self.bounce * draw.between(0.0, 0.5),
                    body_hz * draw.between(2.5, 5.0),
                    draw.between(0.0, std::f64::consts::TAU),
                ),
            ],
            weight_transfer: self.weight_transfer,
            slip: self.programme(manner, duration, rig, draw),
            slip_smoothing_s: self.smoothing_s,
            standstill_s: if self.standstill {
                draw.between(0.5, 1.2).min(0.12 * duration + 0.2)
            } else {
                0.0
            },
            angle_rad: 0.0,
            clock_s: 0.0,
        }
    }

    /// The ordered slip as knots over time.
    fn programme(
        &self,
        manner: Manner,
        duration: f64,
        rig: &Rig,
        draw: &mut Draw,
    ) -> Vec<(f64, f64)> {
        let pace = (duration / 8.0).clamp(0.3, 1.5) * if self.lively { 0.6 } else { 1.0 };
        let low = self.floor_slip;
        let critical = rig.critical_slip;
        let mut knots = vec![(0.0, low)];
        let mut time = draw.between(0.15, 0.5) * pace;
        let mut go = |time: &mut f64, span: f64, slip: f64| {
            *time += span;
            knots.push((*time, slip));
        };
        go(&mut time, 0.0, low);
        while time < duration {
            match manner {
                Manner::Ramps => {
                    let top = self.deepest
                        * if draw.chance(0.3) {
                            draw.between(0.35, 0.8)
                        } else {
                            draw.between(0.85, 1.0)
                        };
                    let rise = draw.between(0.5, 1.5) * pace;
                    let fall = draw.between(0.3, 1.2) * pace;
                    go(&mut time, rise, top);
                    if draw.chance(0.4) {
                        go(&mut time, draw.between(0.05, 0.2) * pace, top);
                    }
                    go(&mut time, fall, low);
                    go(&mut time, draw.between(0.1, 0.7) * pace, low);
                }
                Manner::Cycling => {
                    let centre = critical * draw.between(0.8, 1.4);
                    let swing = critical * draw.between(0.3, 0.75);
                    let period = (draw.between(0.12, 0.6) * pace.max(0.4)).max(24.0 / rig.rate_hz);
                    go(&mut time, draw.between(0.15, 0.4) * pace, centre);
                    for _ in 0..draw.whole(3, 8) {
                        let up = draw.between(0.3, 0.7);
                        let high = (centre + swing * draw.between(0.7, 1.3))
                            .min(self.deepest.max(1.5 * critical));
                        go(&mut time, period * up, high);
                        go(
                            &mut time,
                            period * (1.0 - up),
                            (centre - swing * draw.between(0.7, 1.1)).max(low),
                        );
                    }
                    if draw.chance(0.35) {
                        let top = self.deepest * draw.between(0.7, 1.0);
                        go(&mut time, draw.between(0.4, 1.0) * pace, top);
                    }
                    go(&mut time, draw.between(0.1, 0.4) * pace, low);
                    go(&mut time, draw.between(0.2, 0.9) * pace, low);
                }
                Manner::Holds => {
                    let levels = [0.25, 0.5, 0.8, 1.0, 1.3, 1.8, 2.5, 3.5];
                    for _ in 0..draw.whole(2, 5) {
                        let slip = (critical * draw.one_of(&levels) * draw.between(0.85, 1.15))
                            .min(self.deepest.max(critical));
                        go(&mut time, draw.between(0.04, 0.12) * pace, slip);
                        go(&mut time, draw.between(0.25, 0.8) * pace, slip);
                    }
                    go(&mut time, draw.between(0.05, 0.2) * pace, low);
                    go(&mut time, draw.between(0.2, 0.8) * pace, low);
                }
            }
        }
        knots
    }
}

/// Linear interpolation through knots of rising time, held beyond both ends.
pub fn through(knots: &[(f64, f64)], time: f64) -> f64 {
    let after = knots.partition_point(|knot| knot.0 <= time);
    match (
        after.checked_sub(1).and_then(|i| knots.get(i)),
        knots.get(after),
    ) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (time - a.0) / (b.0 - a.0).max(1e-12),
        (Some(a), None) => a.1,
        (None, Some(b)) => b.1,
        (None, None) => 0.0,
    }
}
