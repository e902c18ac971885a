//! The slip as speeds and drag together know it.
//!
//! Where the curve is steep, the drag tells the slip far better than the speeds do. A model that is evaluated at the
//! speeds' own slip holds their noise there, and whatever makes the curve flatter would buy that noise away: a curve
//! that starts too flat, friction that falls at low sliding speed. So the curve is taken at the slip that speeds and
//! drag agree on, s = s₀ + K (F − N mu(s₀)) with K = g σs² / (g² σs² + σF²), and the row is F − N mu(s) − g (s₀ − s): to
//! first order the same, but with the noise of the speeds where it belongs, beside the curve (orthogonal regression;
//! W. A. Fuller, Measurement Error Models, Wiley 1987, section 3.2). What a run's drag is off by throughout is taken off F
//! first, and no slip moves farther than the curve is a line.

use super::hypothesis::Judged;
use super::noise::{BalanceParts, Slopes};
use crate::data::Data;
use crate::mechanism::Balance;
use crate::prepare::{BRISK_S, mean_twice_about};
use crate::series::Series;

/// Reach in s of the means of what the drag says of the slip.
const REACH_S: f64 = 0.008;
/// Farthest that the slip is moved, in its standard deviations.
const FARTHEST_STDS: f64 = 3.0;
/// The same as a share of the slip at the peak: farther the curve is no line, as near standstill, where the slip is all noise.
const FARTHEST_SHARE: f64 = 0.25;

/// The campaign with its slip reconciled with the drag under a base law and its noise; the drag's own readings, and
/// what the wheel and the vehicle are weighed by, stay as they are.
#[must_use]
pub fn reconciled(mut data: Data, base: &Judged) -> Data {
    let tyre = |p: &&BalanceParts| p.balance == Balance::Tyre;
    let Some(parts) = base.parts.iter().find(tyre) else {
        return data;
    };
    let slopes = Slopes::new(&data, &base.model);
    let radius = data.context.radius;
    let farthest_slip = FARTHEST_SHARE * base.model.base[1].exp();
    for (run, s) in data.series.iter_mut().enumerate() {
        let blocks = &data.blocks[run][Balance::Tyre as usize];
        let left: Vec<f64> = s
            .drag_smooth
            .iter()
            .zip(&slopes.force[run])
            .map(|(drag, law)| drag - law)
            .collect();
        // What is faster is the drag's own noise.
        let left = mean_twice_about(&s.time, &left, &s.tyre, REACH_S);
        // What a run's drag is off by throughout is no error of its slip.
        let of_run = parts.of_run(run, blocks.apart_s(), &blocks.mean(&left));
        let mut beside = vec![0.0; s.len()];
        let fast = fast_force(s, &slopes.slip[run], radius, farthest_slip);
        for (block, samples) in blocks.samples.iter().enumerate() {
            let [of_slip, of_force] = parts.variances(run, block);
            for k in samples.clone() {
                let g = slopes.slip[run][k];
                let per_slip = s.speed.smooth[k] / radius;
                if g == 0.0 || !(per_slip > 0.0) || !(of_slip > 0.0) {
                    continue;
                }
                let share = of_slip / (of_slip + of_force);
                let farthest = f64::min(FARTHEST_STDS * of_slip.sqrt(), farthest_slip * g.abs());
                let force = (share * (left[k] - of_run[block])).clamp(-farthest, farthest);
                if force.is_finite() {
                    // Where the curve is flat the force says nothing of the slip.
                    let by = force / g;
                    s.wheel.smooth[k] -= by * per_slip;
                    beside[k] = force;
                }
            }
        }
        s.fast_force = fast;
        let quiet = quiet_load(s);
        for k in s.tyre.iter().flat_map(Clone::clone) {
            let removed = s.load.smooth[k] - quiet[k];
            let friction = slopes.force[run][k] / s.load.smooth[k];
            if removed.is_finite() && friction.is_finite() {
                s.load.smooth[k] = quiet[k];
                beside[k] -= friction * removed;
            }
        }
        s.beside_law = beside;
    }
    data
}

/// What of the force in N, of this slope in the slip, is faster than the smoother leaves of it, by the wheel's speed; no more
/// than this slip makes.
fn fast_force(s: &Series, per_slip: &[f64], radius: f64, farthest_slip: f64) -> Vec<f64> {
    let wheel = &s.wheel;
    // As many samples as lie within the reach, to the nearest.
    let reach = BRISK_S + 0.5 * s.typical_dt;
    let brisk = mean_twice_about(&s.time, &wheel.raw, &s.tyre, reach);
    let mut fast = vec![0.0; s.len()];
    for k in s.tyre.iter().flat_map(Clone::clone) {
        let slip = (wheel.smooth[k] - brisk[k]) * radius / s.speed.smooth[k];
        let force = per_slip[k] * slip.clamp(-farthest_slip, farthest_slip);
        if force.is_finite() {
            fast[k] = force;
        }
    }
    fast
}

/// The load without what of its fast part is no more than its sensor's noise.
fn quiet_load(s: &Series) -> Vec<f64> {
    let load = &s.load;
    let (mut all, mut noise) = (0.0, 0.0);
    for k in s.tyre.iter().flat_map(Clone::clone) {
        let fast = load.smooth[k] - load.slow[k];
        if fast.is_finite() {
            all += fast * fast;
            noise += load.sigma * load.sigma * load.variance_share[k];
        }
    }
    let share = f64::max(1.0 - noise / f64::max(all, 1e-300), 0.0);
    let both = load.smooth.iter().zip(&load.slow);
    both.map(|(smooth, slow)| slow + share * (smooth - slow))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::hypothesis::{Effort, Guess, judge};
    use crate::innovations::noise::parts;
    use crate::innovations::rows::rows_of;
    use crate::innovations::toy::{CRITICAL, Noise, PEAK, stop};
    use crate::model::Model;

    fn judged(data: &Data) -> Judged {
        let effort = Effort {
            steps: 3,
            noise_steps: 15,
            noise_stride: 1,
        };
        let mut base = judge(
            data,
            &Model::of_law(PEAK, CRITICAL),
            &[],
            Guess::None,
            effort,
        )
        .unwrap();
        // The sensors' own sizes: fitted ones may call the speeds' noise the drag's.
        base.parts = parts(data, &Slopes::new(data, &base.model));
        base
    }

    #[test]
    fn what_is_fast_in_the_force_is_the_slope_times_what_smoothing_takes_off_the_slip() {
        let mut data = stop(Noise::TYPICAL, 4);
        let radius = data.context.radius;
        let s = &mut data.series[0];
        let per_slip = vec![4e4; s.len()];
        // 25 Hz, of which a smoother leaves nothing; a mean over 3 ms on either side holds three steps of 5 ms.
        let swing = |t: f64| 0.2 * (core::f64::consts::TAU * 25.0 * t).sin();
        for k in 0..s.len() {
            s.wheel.smooth[k] = 50.0;
            s.wheel.raw[k] = 50.0 + swing(s.time[k]);
        }
        let left = (1.0 + 2.0 * (core::f64::consts::TAU * 25.0 * 5e-3).cos()) / 3.0;
        let of = |farthest: f64| fast_force(s, &per_slip, radius, farthest);
        let fast = of(1.0);
        let own = s.tyre[0].clone();
        let inside = fast.iter().enumerate().take(own.end - 2);
        for (k, fast) in inside.skip(own.start + 2) {
            let slip = -swing(s.time[k]) * radius / s.speed.smooth[k];
            assert!((fast - 4e4 * left * left * slip).abs() < 1e-6, "{k}");
        }
        assert!(of(1e-4).iter().all(|force| force.abs() <= 4.0));
    }

    /// Root of the mean square of what is finite.
    fn rms(x: impl Iterator<Item = f64>) -> f64 {
        let all: Vec<f64> = x.filter(|x| x.is_finite()).collect();
        (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt()
    }

    /// Share of the tyre's residual on free rolling, in blocks, that a factor on the law's force would take away.
    fn bought(data: &Data, model: &Model) -> f64 {
        let blocks = &data.blocks[0][0];
        let e = blocks.mean(&rows_of(data, model, 0).tyre);
        let law = blocks.mean(&Slopes::new(data, model).force[0]);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // Free rolling: what the law says there is noise.
        let rolling: Vec<usize> = (0..e.len()).filter(|k| law[*k].abs() < 150.0).collect();
        assert!(rolling.len() > 200, "{}", rolling.len());
        let take = |x: &[f64]| rolling.iter().map(|k| x[*k]).collect::<Vec<_>>();
        let (e, law) = (take(&e), take(&law));
        -dot(&e, &law) / dot(&e, &e)
    }

    #[test]
    fn rows_stay_what_they_are_to_first_order() {
        let data = stop(Noise::TYPICAL, 1);
        let base = judged(&data);
        let other = reconciled(data.clone(), &base);
        let (a, b) = (
            rows_of(&data, &base.model, 0).tyre,
            rows_of(&other, &base.model, 0).tyre,
        );
        let moved = rms(other.series[0].beside_law.iter().copied());
        let changed = rms(a.iter().zip(&b).map(|(a, b)| a - b));
        assert!(moved > 20.0, "{moved}");
        assert!(changed < 0.1 * moved, "{changed} of {moved}");
    }

    #[test]
    fn a_curve_made_flatter_buys_no_noise_of_the_speeds() {
        let data = stop(Noise::TYPICAL, 2);
        let base = judged(&data);
        let (before, after) = (
            bought(&data, &base.model),
            bought(&reconciled(data.clone(), &base), &base.model),
        );
        assert!(before > 0.8, "{before}");
        assert!(after.abs() < 0.5 * before, "{after} of {before}");
    }

    #[test]
    fn a_zero_of_a_run_moves_no_slip() {
        let data = stop(Noise::TYPICAL, 4);
        let mut base = judged(&data);
        let sources = base.parts.iter_mut().flat_map(|p| &mut p.sources);
        for source in sources.filter(|s| s.name == "zero of a run") {
            source.log_std = f64::ln(300.0);
        }
        let mut shifted = data.clone();
        let s = &mut shifted.series[0];
        for drag in s.drag.iter_mut().chain(&mut s.drag_smooth) {
            *drag += 300.0;
        }
        let wheel = |data: &Data| {
            reconciled(data.clone(), &base).series[0]
                .wheel
                .smooth
                .clone()
        };
        let (own, other) = (wheel(&data), wheel(&shifted));
        let apart = |a: &[f64], b: &[f64]| rms(a.iter().zip(b).map(|(a, b)| a - b));
        let moved = apart(&own, &data.series[0].wheel.smooth);
        let changed = apart(&own, &other);
        assert!(moved > 0.01, "{moved}");
        assert!(changed < 0.1 * moved, "{changed} of {moved}");
    }

    #[test]
    fn no_slip_moves_farther_than_the_curve_is_a_line() {
        let data = stop(Noise::TYPICAL, 5);
        let mut base = judged(&data);
        let sources = base.parts.iter_mut().flat_map(|p| &mut p.sources);
        for source in sources.filter(|s| s.of_slip) {
            source.log_std += f64::ln(100.0);
        }
        // Far off, and by what no zero of a run is.
        let mut off = data.clone();
        let s = &mut off.series[0];
        for k in 0..s.drag_smooth.len() {
            s.drag_smooth[k] += 2000.0 * (2.0 * s.time[k]).sin();
        }
        let radius = data.context.radius;
        let moved = reconciled(off, &base);
        let (before, after) = (&data.series[0], &moved.series[0]);
        let by = (0..before.len()).filter(|k| before.rolling[*k]).map(|k| {
            let turned = after.wheel.smooth[k] - before.wheel.smooth[k];
            (radius * turned / before.speed.smooth[k]).abs()
        });
        let farthest = by.fold(0.0, f64::max);
        let most = FARTHEST_SHARE * base.model.base[1].exp();
        assert!(farthest > 0.9 * most, "{farthest} of {most}");
        assert!(farthest < 1.000_1 * most, "{farthest} of {most}");
    }

    #[test]
    fn a_load_that_only_its_noise_moves_is_taken_as_steady() {
        let data = stop(Noise::TYPICAL, 3);
        let quiet = reconciled(data.clone(), &judged(&data));
        let spread = |data: &Data| {
            let load = &data.series[0].load.smooth;
            let mean = load.iter().sum::<f64>() / load.len() as f64;
            (load.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / load.len() as f64).sqrt()
        };
        assert!(
            spread(&quiet) < 0.6 * spread(&data),
            "{} {}",
            spread(&quiet),
            spread(&data)
        );
    }
}
