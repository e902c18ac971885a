//! How accurately an effect's strength can be known from a campaign's runs: the standard deviation of least squares
//! that knows the effect's form, under the errors that these recordings have.
//!
//! The tyre balance is fitted sample by sample, peak friction and critical slip unknown as well. The wheel and vehicle
//! balances are fitted in integrated form, which keeps the slow information that a difference quotient throws away:
//!
//! ```text
//! m (v - v0) + ∫ drag dt = effect,   J (ω - ω0) - ∫ (R drag - torque) dt = effect
//! ```
//!
//! a level with errors on a random walk, whose innovations a scalar Kalman filter gives. With the effect's innovations
//! u, those of the errors e and their variance S, the estimate is off by Σ u e/S over Σ u²/S; the variance of the sum is that of its
//! parts over blocks, so that coloured errors count as what they are (a sandwich).

use crate::generate::chain::Readings;
use crate::generate::measure::{Base, base_drag, usable};
use crate::generate::rig::{BrakeColumn, Rig};

/// Length of a block, s, where errors are white or nearly so; a whole run where they are not.
const BLOCK_S: f64 = 0.5;

/// One run: as ideal instruments read it, with the effect a step stronger, and with the channels' random errors.
pub struct Shown<'a> {
    pub plain: &'a Readings,
    pub nudged: &'a Readings,
    pub erring: &'a Readings,
}

/// Sums over blocks of the score Σ u e/S, and the information Σ u²/S.
struct Sums {
    information: f64,
    variance: f64,
    block: f64,
    until: f64,
    block_s: f64,
}

impl Sums {
    fn add(&mut self, time: f64, effect: f64, error: f64, variance: f64) {
        if time > self.until {
            self.close();
            self.until = time + self.block_s;
        }
        self.information += effect * effect / variance;
        self.block += effect * error / variance;
    }

    fn close(&mut self) {
        self.variance += self.block * self.block;
        self.block = 0.0;
        self.until = f64::NEG_INFINITY;
    }
}

/// Standard deviation of the strength in units of the step between the plain and the nudged runs; not a number where
/// the runs do not show it. Where errors are `correlated` over longer than a block, or runs differ, a run is a block.
pub fn attainable_std(
    balance: &str,
    rig: &Rig,
    base: Base,
    runs: &[Shown<'_>],
    correlated: bool,
) -> f64 {
    let mut sums = Sums {
        information: 0.0,
        variance: 0.0,
        block: 0.0,
        until: f64::NEG_INFINITY,
        block_s: if correlated { f64::INFINITY } else { BLOCK_S },
    };
    if balance == "tyre" {
        tyre(rig, base, runs, &mut sums);
    } else {
        for run in runs {
            integrated(balance, rig, run, &mut sums);
            sums.close();
        }
    }
    sums.close();
    if sums.information > 0.0 {
        sums.variance.sqrt() / sums.information
    } else {
        f64::NAN
    }
}

/// Samples at which a run can tell of the tyre in all three readings.
fn usable_samples<'a>(rig: &'a Rig, run: &'a Shown<'_>) -> impl Iterator<Item = usize> + 'a {
    let count = run
        .plain
        .time
        .len()
        .min(run.nudged.time.len())
        .min(run.erring.time.len());
    (0..count).filter(|&index| usable(rig, run.plain, index) && usable(rig, run.nudged, index))
}

/// The change in the residual that no change of the law's two parameters gives, against the residual's errors.
fn tyre(rig: &Rig, base: Base, runs: &[Shown<'_>], sums: &mut Sums) {
    let stiffer = Base {
        critical_slip: 1.001 * base.critical_slip,
        ..base
    };
    let residual = |readings: &Readings, index: usize| {
        readings.drag[index] - base_drag(rig, base, readings, index)
    };
    let columns = |run: &Shown<'_>, index: usize| {
        let drag = base_drag(rig, base, run.plain, index);
        (
            residual(run.nudged, index) - residual(run.plain, index),
            drag / base.peak_friction,
            base_drag(rig, stiffer, run.plain, index) - drag,
        )
    };
    let (mut up, mut uq) = (0.0, 0.0);
    let (mut pp, mut pq, mut qq) = (1e-300, 0.0, 1e-300);
    for run in runs {
        for index in usable_samples(rig, run) {
            let (u, p, q) = columns(run, index);
            up += u * p;
            uq += u * q;
            pp += p * p;
            pq += p * q;
            qq += q * q;
        }
    }
    let determinant = pp * qq - pq * pq;
    let (a, b) = if determinant > 1e-12 * pp * qq {
        (
            (up * qq - uq * pq) / determinant,
            (uq * pp - up * pq) / determinant,
        )
    } else {
        (up / pp, 0.0)
    };
    for run in runs {
        for index in usable_samples(rig, run) {
            let (u, p, q) = columns(run, index);
            let error = residual(run.erring, index) - residual(run.plain, index);
            sums.add(run.plain.time[index], u - a * p - b * q, error, 1.0);
        }
        sums.close();
    }
}

/// Innovations of one run's integrated balance.
fn integrated(balance: &str, rig: &Rig, run: &Shown<'_>, sums: &mut Sums) {
    let s = &rig.sigmas;
    let wheel = balance == "wheel";
    if wheel && rig.brake == BrakeColumn::None {
        return;
    }
    let torque = |readings: &Readings, index: usize| match rig.brake {
        BrakeColumn::Pressure => readings.command[index],
        _ => readings.torque[index],
    };
    // Momentum of the balance, and the force or torque that changes it.
    let momentum = |readings: &Readings, index: usize| {
        if wheel {
            rig.inertia_kg_m2 * readings.wheel[index]
        } else {
            rig.mass_kg * readings.speed[index]
        }
    };
    let flow = |readings: &Readings, index: usize| {
        if wheel {
            torque(readings, index) - rig.radius_m * readings.drag[index]
        } else {
            readings.drag[index]
        }
    };
    let (level_sigma, flow_sigma) = if wheel {
        (
            rig.inertia_kg_m2 * s.wheel_speed_rad_s,
            (rig.radius_m * s.drag_force_n).hypot(s.brake_torque_nm),
        )
    } else {
        (rig.mass_kg * s.vehicle_speed_m_s, s.drag_force_n)
    };
    // Integrals of effect and of errors; levels of both and their common variance, none until a stretch's first sample.
    let mut sum = (0.0, 0.0);
    let mut state: Option<(f64, f64, f64)> = None;
    let mut before: Option<usize> = None;
    for index in usable_samples(rig, run) {
        let difference = |of: &dyn Fn(&Readings, usize) -> f64, index: usize| {
            let plain = of(run.plain, index);
            (
                of(run.nudged, index) - plain,
                of(run.erring, index) - plain,
            )
        };
        let dt = before.map_or(f64::INFINITY, |before| {
            run.plain.time[index] - run.plain.time[before]
        });
        if dt > 4.0 / rig.rate_hz {
            state = None;
        } else if let Some(before) = before {
            let (a, b) = (difference(&flow, before), difference(&flow, index));
            sum.0 += 0.5 * (a.0 + b.0) * dt;
            sum.1 += 0.5 * (a.1 + b.1) * dt;
        }
        before = Some(index);
        let now = difference(&momentum, index);
        let (effect, error) = (now.0 + sum.0, now.1 + sum.1);
        state = Some(match state {
            None => (effect, error, level_sigma.powi(2)),
            Some((effect_level, error_level, variance)) => {
                let predicted = variance + (flow_sigma * dt).powi(2);
                let total = predicted + level_sigma.powi(2);
                let (u, e) = (effect - effect_level, error - error_level);
                sums.add(run.plain.time[index], u, e, total);
                let gain = predicted / total;
                (
                    effect_level + gain * u,
                    error_level + gain * e,
                    (1.0 - gain) * predicted,
                )
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;
    use crate::generate::form::Needs;

    /// A vehicle that a constant force slows, seen at 100 Hz for ten seconds.
    fn coasting(rig: &Rig, force: f64, error: impl Fn() -> f64) -> Readings {
        let count = 1000;
        let time: Vec<f64> = (0..count).map(|k| 0.01 * f64::from(k)).collect();
        let speed = |t: f64| 20.0 - force / rig.mass_kg * t;
        Readings {
            wheel: time.iter().map(|t| speed(*t) / rig.radius_m).collect(),
            speed: time.iter().map(|t| speed(*t) + error()).collect(),
            drag: vec![0.0; time.len()],
            load: vec![rig.mean_load_n; time.len()],
            torque: vec![0.0; time.len()],
            command: vec![0.0; time.len()],
            column: vec![0.0; time.len()],
            angle: vec![0.0; time.len()],
            distance: vec![0.0; time.len()],
            time,
        }
    }

    /// The same run without and with the effect, and as often with errors.
    fn shown<'a>(
        plain: &'a Readings,
        nudged: &'a Readings,
        erring: &'a [Readings],
    ) -> Vec<Shown<'a>> {
        let run = |erring| Shown {
            plain,
            nudged,
            erring,
        };
        erring.iter().map(run).collect()
    }

    #[test]
    fn a_grade_is_as_sharp_as_the_slope_of_a_straight_line() {
        let mut draw = Draw::new(1, &[9]);
        let mut rig = Rig::draw(
            Needs {
                coasting: true,
                ..Needs::default()
            },
            &mut draw,
        );
        rig.rate_hz = 100.0;
        rig.mass_kg = 400.0;
        rig.sigmas.vehicle_speed_m_s = 0.02;
        rig.sigmas.drag_force_n = 1e-9;
        let base = Base {
            peak_friction: 0.9,
            critical_slip: 0.1,
        };
        let (plain, nudged) = (coasting(&rig, 50.0, || 0.0), coasting(&rig, 51.0, || 0.0));
        // Thirty runs, so that the variance over blocks has settled.
        let erring: Vec<Readings> = (0..30)
            .map(|run| {
                let draw = std::cell::RefCell::new(Draw::new(run, &[8]));
                coasting(&rig, 50.0, || 0.02 * draw.borrow_mut().normal())
            })
            .collect();
        let runs = shown(&plain, &nudged, &erring);
        let std = attainable_std("vehicle", &rig, base, &runs, false);
        // Variance of a slope through n points at spacing dt: 12 sigma² / (dt² n³); the step is 1 N.
        let slope = (12.0 * 0.02f64.powi(2) / (0.01f64.powi(2) * 1000f64.powi(3)) / 30.0).sqrt();
        assert!(
            (std / (slope * 400.0) - 1.0).abs() < 0.12,
            "{std} N instead of {} N",
            slope * 400.0
        );
    }

    #[test]
    fn a_gain_is_as_sharp_as_the_noise_and_the_number_of_samples_allow() {
        // Slip that cycles at constant speed: a part of the drag that the two parameters cannot take up.
        let mut draw = Draw::new(2, &[9]);
        let mut rig = Rig::draw(Needs::default(), &mut draw);
        rig.rate_hz = 100.0;
        let base = Base {
            peak_friction: 0.9,
            critical_slip: 0.1,
        };
        let run = |cube: f64, error: &dyn Fn() -> f64| {
            let mut readings = coasting(&rig, 0.0, || 0.0);
            for index in 0..readings.time.len() {
                let slip = 0.15 * (0.5 * (1.0 - (3.0 * readings.time[index]).cos()));
                readings.wheel[index] = 20.0 * (1.0 - slip) / rig.radius_m;
                readings.drag[index] =
                    base_drag(&rig, base, &readings, index) + cube * (slip / 0.1).powi(3) + error();
            }
            readings
        };
        let (plain, nudged) = (run(0.0, &|| 0.0), run(1.0, &|| 0.0));
        let erring: Vec<Readings> = (0..40)
            .map(|seed| {
                let draw = std::cell::RefCell::new(Draw::new(seed, &[7]));
                run(0.0, &|| 50.0 * draw.borrow_mut().normal())
            })
            .collect();
        let std = |erring: &[Readings]| {
            attainable_std("tyre", &rig, base, &shown(&plain, &nudged, erring), false)
        };
        let (all, half) = (std(&erring), std(&erring[..20]));
        assert!((half / all / 2f64.sqrt() - 1.0).abs() < 0.15, "{half} {all}");
        // A lower bound without the two parameters: sigma over the root of the sum of squares.
        let squares: f64 = (0..plain.time.len())
            .map(|i| (nudged.drag[i] - plain.drag[i]).powi(2))
            .sum::<f64>()
            * 40.0;
        assert!(all > 0.95 * 50.0 / squares.sqrt(), "{all}");
    }
}
