//! Ripple of the wheel speed: lines over the wheel's angle.

use super::constants::{CALM, ORDERS, RIPPLE_RATIO, ROLLING_SHARE, SMOOTH_S};
use super::finding::{Finding, Word};
use super::recording::Recording;
use super::signal::Signal;
use super::tyre::Stretch;
use crate::smooth::median_in_place;

/// Power of a line at given phases in rad: a quarter of the squared amplitude.
pub(super) fn power(series: &[f64], phases: impl Iterator<Item = f64>) -> f64 {
    let (mut cos, mut sin) = (0.0, 0.0);
    for (x, phase) in series.iter().zip(phases) {
        let (s, c) = phase.sin_cos();
        cos += x * c;
        sin += x * s;
    }
    (cos * cos + sin * sin) / (series.len().max(1) as f64).powi(2)
}

/// Share of a sine of a frequency that the smooth course takes away.
pub(super) fn taken(hz: f64) -> f64 {
    let angle = core::f64::consts::PI * hz * SMOOTH_S;
    if angle < 1e-6 {
        1.0
    } else {
        angle.sin() / angle
    }
}

/// Readings less their own smooth course, and how much of a line of a frequency that leaves.
pub(super) fn rough(time: &[f64], clean: &[f64], from: usize, to: usize) -> Vec<f64> {
    let signal = Signal::new(&time[from..to], &clean[from..to]);
    (from..to)
        .map(|k| clean[k] - signal.averages(time[k], 1.0, 1, SMOOTH_S)[0])
        .collect()
}

/// Ripple of the wheel speed that is locked to the wheel's angle: relative amplitude of its strongest order.
#[must_use]
pub fn ripple(runs: &[Recording]) -> Option<Finding> {
    let mut found: Vec<(usize, Vec<f64>, f64)> = Vec::new();
    let parts: Vec<(Vec<f64>, Vec<f64>, f64)> = runs.iter().flat_map(relative).collect();
    if parts.len() < 2 {
        return None;
    }
    for order in ORDERS {
        let at = |order: f64| -> Vec<f64> {
            parts
                .iter()
                .map(|(series, angle, hz)| {
                    let power = power(series, angle.iter().map(|a| order * a));
                    2.0 * power.sqrt() / (1.0 - taken(hz * order)).max(0.2)
                })
                .collect()
        };
        let power = |amplitudes: &[f64]| {
            amplitudes.iter().map(|a| a * a).sum::<f64>() / amplitudes.len() as f64
        };
        let own = at(order as f64);
        let mut beside: Vec<f64> = [-0.45, -0.3, 0.3, 0.45]
            .iter()
            .map(|off| power(&at(order as f64 + off)))
            .collect();
        let floor = median_in_place(&mut beside);
        if power(&own) > RIPPLE_RATIO * floor {
            found.push((order, own, floor));
        }
    }
    let (order, amplitudes, floor) = found
        .into_iter()
        .max_by(|a, b| a.1.iter().sum::<f64>().total_cmp(&b.1.iter().sum::<f64>()))?;
    let count = amplitudes.len() as f64;
    let mut sorted = amplitudes.clone();
    let middle = median_in_place(&mut sorted);
    let value = (middle * middle - floor).max(0.25 * middle * middle).sqrt();
    let spread =
        (amplitudes.iter().map(|a| (a - middle).powi(2)).sum::<f64>() / count / count).sqrt();
    let times = if order == 1 {
        "once".to_owned()
    } else {
        format!("{order} times")
    };
    (value > 3.0 * spread).then(|| {
        Finding::of(
            "wheel_speed_rad_s",
            Word::Ripple,
            (value, spread.max(0.03 * value)),
            "1",
        )
        .saying(format!(
            "The wheel speed varies by {:.2} % {times} a revolution.",
            100.0 * value
        ))
    })
}

/// Readings less their mean over so many on either side.
fn high_passed(values: &[f64], reach: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    for x in values {
        sums.push(sums[sums.len() - 1] + x);
    }
    (0..values.len())
        .map(|k| {
            let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(values.len()));
            values[k] - (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect()
}

/// Squared amplitude of the wheel speed's relative ripple of an order in each stretch, by what the drag leaves beside the
/// law, and the weight of each.
fn ripples(left: &[Stretch], rests: &[Vec<f64>], order: f64, reach: usize) -> Vec<(f64, f64)> {
    left.iter()
        .zip(rests)
        .map(|(stretch, rest)| {
            let columns: (Vec<f64>, Vec<f64>) = stretch
                .angle
                .iter()
                .zip(&stretch.slope)
                .map(|(angle, slope)| {
                    let (sin, cos) = (order * angle).sin_cos();
                    (slope * cos, slope * sin)
                })
                .unzip();
            let (c, s) = (
                high_passed(&columns.0, reach),
                high_passed(&columns.1, reach),
            );
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let (cc, cs, ss) = (dot(&c, &c), dot(&c, &s), dot(&s, &s));
            let (cx, sx) = (dot(&c, rest), dot(&s, rest));
            let det = cc * ss - cs * cs;
            if !(det > 1e-6 * cc * ss) {
                return (0.0, 0.0);
            }
            let (a, b) = ((ss * cx - cs * sx) / det, (cc * sx - cs * cx) / det);
            (a * a + b * b, 0.5 * (cc + ss))
        })
        .collect()
}

/// Variance of what the drag leaves beside the law that turns with the wheel and grows with the force.
#[must_use]
pub fn locked(left: &[Stretch], step: f64) -> f64 {
    let reach = (0.5 * SMOOTH_S / step).ceil() as usize;
    let forced: Vec<Stretch> = left
        .iter()
        .map(|s| Stretch {
            slope: s.drag.clone(),
            angle: s.angle.clone(),
            hz: s.hz,
            ..Stretch::default()
        })
        .collect();
    let rests: Vec<Vec<f64>> = left.iter().map(|s| high_passed(&s.law, reach)).collect();
    let rows: usize = rests.iter().map(Vec::len).sum();
    let explained = |order: f64| -> f64 {
        ripples(&forced, &rests, order, reach)
            .iter()
            .map(|(power, weight)| power * weight)
            .sum::<f64>()
    };
    // Less what lies beside: noise has some everywhere.
    (1..=4)
        .map(|order| {
            let order = f64::from(order);
            (explained(order) - 0.5 * (explained(order - 0.4) + explained(order + 0.4))).max(0.0)
        })
        .sum::<f64>()
        / rows.max(1) as f64
}

/// An order with its power, the power beside it, and its stretches' powers and weights.
type Order = (usize, f64, f64, Vec<(f64, f64)>);

/// Ripple of the wheel speed by what it makes of the law's slip: also while the brake works.
#[must_use]
pub fn ripple_of_law(left: &[Stretch], step: f64) -> Option<Finding> {
    let reach = (0.5 * SMOOTH_S / step).ceil() as usize;
    let rests: Vec<Vec<f64>> = left.iter().map(|s| high_passed(&s.law, reach)).collect();
    let hz = left.iter().map(|s| s.hz).fold(0.0, f64::max);
    let mean = |parts: &[(f64, f64)]| {
        let weight: f64 = parts.iter().map(|p| p.1).sum();
        parts.iter().map(|p| p.0 * p.1).sum::<f64>() / weight.max(1e-300)
    };
    // What white residuals give: no order is looked at beside that has less.
    let squares = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let rows: usize = rests.iter().map(Vec::len).sum();
    let variance = rests.iter().map(|r| squares(r)).sum::<f64>() / rows.max(1) as f64;
    let weight: f64 = left.iter().map(|s| 0.5 * squares(&s.slope)).sum();
    let chance = 2.0 * variance * left.len() as f64 / weight.max(1e-300);
    let mut best: Option<Order> = None;
    for order in ORDERS {
        // Fewer than four readings a period show none of it.
        if order as f64 * hz * step > 0.25 {
            continue;
        }
        let own = ripples(left, &rests, order as f64, reach);
        let power = mean(&own);
        if power < 1.5 * chance {
            continue;
        }
        let mut beside: Vec<f64> = [-0.45, -0.3, -0.2, 0.2, 0.3, 0.45]
            .iter()
            .map(|off| mean(&ripples(left, &rests, order as f64 + off, reach)))
            .collect();
        let most = beside.iter().copied().fold(0.0, f64::max);
        let floor = median_in_place(&mut beside);
        if power > RIPPLE_RATIO * floor
            && power > 3.0 * most
            && best.as_ref().is_none_or(|b| power > b.1)
        {
            best = Some((order, power, floor, own));
        }
    }
    let (order, power, floor, parts) = best?;
    let value = (power - floor).sqrt();
    let weight: f64 = parts.iter().map(|p| p.1).sum();
    // Left out in turn, each stretch by its weight.
    let spread = parts
        .iter()
        .map(|p| (p.1 / weight * (p.0 - power)).powi(2))
        .sum::<f64>()
        .sqrt();
    let std = (0.5 * spread / value).max(0.03 * value);
    let several = parts.iter().filter(|p| p.0 > 0.25 * power).count();
    (value > 4.0 * std && several >= 2).then(|| {
        Finding::of("wheel_speed_rad_s", Word::Ripple, (value, std), "1").saying(format!(
            "The wheel speed varies by {:.2} % {order} times a revolution.",
            100.0 * value
        ))
    })
}

/// Relative roughness of the wheel speed over stretches in which it turns, with the wheel's angle and its mean frequency.
fn relative(run: &Recording) -> Vec<(Vec<f64>, Vec<f64>, f64)> {
    let mut out = Vec::new();
    for moving in &run.moving {
        let wheel = &run.wheel.clean[moving.clone()];
        let mut sorted = wheel.to_vec();
        let middle = median_in_place(&mut sorted);
        if !(middle > 0.0) || moving.len() < 100 {
            continue;
        }
        let rough = rough(&run.time, &run.wheel.clean, moving.start, moving.end);
        let mut angle = 0.0;
        let (mut series, mut angles) = (Vec::new(), Vec::new());
        let course = Signal::new(&run.time[moving.clone()], wheel);
        let hurry: Vec<f64> = moving
            .clone()
            .map(|k| {
                let ends = [-SMOOTH_S, SMOOTH_S]
                    .map(|off| course.averages(run.time[k] + off, 1.0, 1, SMOOTH_S)[0]);
                (ends[1] - ends[0]).abs()
                    / course.averages(run.time[k], 1.0, 1, SMOOTH_S)[0].max(0.2 * middle)
            })
            .collect();
        let mut sorted = hurry.clone();
        sorted.sort_by(f64::total_cmp);
        // Where slip changes, its course is no ripple: the calm third, and whatever else is as calm as rolling.
        let calm = sorted[sorted.len() / 3].max(CALM);
        // Turning with the vehicle, not braked: ripple is there too.
        let ratio: Vec<f64> = moving
            .clone()
            .zip(wheel)
            .map(|(k, w)| w / run.speed.clean[k].max(1e-3))
            .collect();
        let mut ratios = ratio.clone();
        ratios.sort_by(f64::total_cmp);
        let free = ROLLING_SHARE * ratios[ratios.len() * 9 / 10];
        for (i, k) in moving.clone().enumerate() {
            if i > 0 {
                angle += 0.5 * (wheel[i] + wheel[i - 1]) * (run.time[k] - run.time[k - 1]);
            }
            if hurry[i] <= calm && ratio[i] > free {
                series.push(rough[i] / wheel[i].max(0.2 * middle));
                angles.push(angle);
            }
        }
        // What changes far more than usual is slip, not ripple.
        let mut sizes: Vec<f64> = series.iter().map(|x| x.abs()).collect();
        let most = 4.0 * median_in_place(&mut sizes);
        for x in &mut series {
            *x = x.clamp(-most, most);
        }
        if series.len() < 100 {
            continue;
        }
        out.push((series, angles, middle / core::f64::consts::TAU));
    }
    out
}
