//! Ripple of the wheel speed: lines over the wheel's angle.

use core::f64::consts::TAU;

use nalgebra::{SMatrix, SVector};

use super::constants::{
    CALM, FEWEST_TURNED, ORDERS, READ_SHARE, RIPPLE_RATIO, ROLLING_SHARE, SMOOTH_S, TOLD_SIGMAS,
};
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

/// A relative ripple of the wheel speed in one stretch, or a piece of it.
#[derive(Clone, Copy, Debug, Default)]
struct Amplitude {
    cos: f64,
    sin: f64,
    /// What that counts.
    weight: f64,
}

impl Amplitude {
    /// Its square.
    fn power(self) -> f64 {
        self.cos * self.cos + self.sin * self.sin
    }
}

/// The wheel speed's relative ripple of an order in each stretch, by what the drag leaves beside the law.
fn ripples(left: &[Stretch], rests: &[Vec<f64>], order: f64, reach: usize) -> Vec<Amplitude> {
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
                return Amplitude::default();
            }
            // What is read too fast is taken for a smaller slip: the law has it brake too little, and leaves the opposite.
            Amplitude {
                cos: -(ss * cx - cs * sx) / det,
                sin: -(cc * sx - cs * cx) / det,
                weight: 0.5 * (cc + ss),
            }
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
            .map(|own| own.power() * own.weight)
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

/// Turns of the wheel that one piece of a stretch is read over.
const TURNS: f64 = 3.0;
/// Fewest readings of such a piece, and the share of its turns that they have to span.
const FEWEST_READINGS: usize = 18;
const MOST_OF_PIECE: f64 = 0.8;
/// Share of the pieces that none weighs more than: the rest weigh as much as the largest of these.
const NONE_HEAVIER: f64 = 0.9;
/// A stretch shows a ripple of so many times the power that its noise has there.
const TOLD_POWERS: f64 = 8.0;

/// By how much of a ripple that the law's slip shows the wheel speed itself varies, in pieces of a few turns of the stretches
/// that show it, each with its weight: in phase, and a quarter of a turn later.
fn shares_read(
    left: &[Stretch],
    of_law: &[Amplitude],
    order: f64,
    shows: impl Fn(&Amplitude) -> bool,
) -> [Vec<(f64, f64)>; 2] {
    let mut shares = [Vec::new(), Vec::new()];
    for (stretch, own) in left.iter().zip(of_law).filter(|(_, own)| shows(own)) {
        let turn = |k: &usize| (stretch.angle[*k] / (TAU * TURNS)) as i64;
        let all: Vec<usize> = (0..stretch.angle.len()).collect();
        for piece in all.chunk_by(|a, b| turn(a) == turn(b)) {
            let turned = stretch.angle[piece[piece.len() - 1]] - stretch.angle[piece[0]];
            if piece.len() < FEWEST_READINGS || turned < MOST_OF_PIECE * TAU * TURNS {
                continue;
            }
            if let Some(Amplitude { cos, sin, weight }) = read_in(stretch, piece, order) {
                let weight = weight * own.power();
                shares[0].push(((own.cos * cos + own.sin * sin) / own.power(), weight));
                shares[1].push(((own.cos * sin - own.sin * cos) / own.power(), weight));
            }
        }
    }
    shares
}

/// The wheel speed's relative ripple in a piece of a stretch, beside a cubic and under a window: it weighs by what is left there
/// beside both, for where the slip changes that is much.
fn read_in(stretch: &Stretch, piece: &[usize], order: f64) -> Option<Amplitude> {
    const WIDTH: usize = 6;
    let mut products = SMatrix::<f64, WIDTH, WIDTH>::zeros();
    let mut right = SVector::<f64, WIDTH>::zeros();
    let (mut squares, mut whole) = (0.0, 0.0);
    for (i, &k) in piece.iter().enumerate() {
        let at = (i as f64 + 0.5) / piece.len() as f64;
        let x = 2.0 * at - 1.0;
        let (sin, cos) = (order * stretch.angle[k]).sin_cos();
        let row = SVector::from([1.0, x, x * x, x * x * x, cos, sin]);
        let weight = (core::f64::consts::PI * at).sin().powi(4);
        products += weight * row * row.transpose();
        let reading = stretch.omega[k].max(1e-3).ln();
        right += weight * reading * row;
        squares += weight * reading * reading;
        whole += weight;
    }
    let solved = products.cholesky()?.solve(&right);
    // Six unknowns take their part of the readings that the window leaves: half of them, for it is the fourth power of a sine.
    let free = 1.0 - WIDTH as f64 / (0.51 * piece.len() as f64);
    let left = (squares - solved.dot(&right)).max(1e-12 * squares) / (whole * free);
    let own = Amplitude {
        cos: solved[4],
        sin: solved[5],
        weight: piece.len() as f64 / left,
    };
    let finite = [own.cos, own.sin, own.weight].iter().all(|x| x.is_finite());
    finite.then_some(own)
}

/// Whether so many shares, each with its weight, are surely less than an encoder's on the mean: neither of one sign nor of the
/// other.
fn lacks(shares: &[(f64, f64)]) -> bool {
    if shares.is_empty() {
        return false;
    }
    // A reading that stands still leaves nothing beside itself, and would be all that counts.
    let mut weights: Vec<f64> = shares.iter().map(|own| own.1).collect();
    weights.sort_by(f64::total_cmp);
    let most = weights[(NONE_HEAVIER * (weights.len() - 1) as f64) as usize];
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        shares
            .iter()
            .map(|(x, weight)| of(*x, weight.min(most)))
            .sum()
    };
    let whole = sum(&|_, weight| weight);
    let mean = sum(&|x, weight| weight * x) / whole;
    // By how they scatter, for what is left in a piece is no white noise.
    let std = sum(&|x, weight| (weight * (x - mean)).powi(2)).sqrt() / whole;
    let count = whole * whole / sum(&|_, weight| weight * weight);
    count >= FEWEST_TURNED && mean.abs() + TOLD_SIGMAS * std < READ_SHARE
}

/// What the law's slip shows of a ripple.
pub struct OfLaw {
    /// Ripple of the wheel speed; nothing where its reading varies by less.
    pub ripple: Option<Finding>,
    /// Whether it is one once a revolution that the reading has less of.
    pub unread: bool,
}

/// An order with its power, the power beside it, and its stretches' amplitudes.
type Order = (usize, f64, f64, Vec<Amplitude>);

/// Ripple of the wheel speed by what it makes of the law's slip: also while the brake works.
#[must_use]
pub fn ripple_of_law(left: &[Stretch], step: f64) -> Option<OfLaw> {
    let reach = (0.5 * SMOOTH_S / step).ceil() as usize;
    let rests: Vec<Vec<f64>> = left.iter().map(|s| high_passed(&s.law, reach)).collect();
    let hz = left.iter().map(|s| s.hz).fold(0.0, f64::max);
    let mean = |parts: &[Amplitude]| {
        let weight: f64 = parts.iter().map(|p| p.weight).sum();
        parts.iter().map(|p| p.power() * p.weight).sum::<f64>() / weight.max(1e-300)
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
    let weight: f64 = parts.iter().map(|p| p.weight).sum();
    // Left out in turn, each stretch by its weight.
    let spread = parts
        .iter()
        .map(|p| (p.weight / weight * (p.power() - power)).powi(2))
        .sum::<f64>()
        .sqrt();
    let std = (0.5 * spread / value).max(0.03 * value);
    let shown = 0.25 * power;
    let several = parts.iter().filter(|p| p.power() > shown).count();
    if !(value > 4.0 * std && several >= 2) {
        return None;
    }
    // In a stretch near the peak the law says nothing of the slip, and noise looks like a ripple.
    let shows = |own: &Amplitude| {
        own.power() > f64::max(shown, TOLD_POWERS * 2.0 * variance / own.weight.max(1e-300))
    };
    let shares = shares_read(left, &parts, order as f64, shows);
    let unread = shares.iter().all(|own| lacks(own));
    let said = || {
        Finding::of("wheel_speed_rad_s", Word::Ripple, (value, std), "1").saying(format!(
            "The wheel speed varies by {:.2} % {order} times a revolution.",
            100.0 * value
        ))
    };
    Some(OfLaw {
        ripple: (!unread).then(said),
        unread: unread && order == 1,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_lacks_a_ripple_where_it_surely_has_less_than_an_encoder_of_either_sign() {
        // Half of the pieces read so much more than the mean, the others so much less.
        let shares = |mean: f64, off: f64, pieces: usize| -> Vec<(f64, f64)> {
            let signed = |k: usize| if k.is_multiple_of(2) { off } else { -off };
            (0..pieces).map(|k| (mean + signed(k), 7.0)).collect()
        };
        let lacks_at = |mean: f64, off: f64, pieces: usize| lacks(&shares(mean, off, pieces));
        // Of 64 pieces the mean is known to an eighth of what they are off by.
        assert!(lacks_at(0.4, 1.0, 64) && lacks_at(-0.4, 1.0, 64));
        assert!(!lacks_at(0.5, 1.0, 64) && !lacks_at(0.9, 0.1, 64) && !lacks_at(-0.9, 0.1, 64));
        assert!(!lacks_at(0.0, 0.1, 5) && !lacks(&[]), "too few to tell");
        // Pieces that tell little say little, whatever they are.
        let vague = [shares(0.1, 0.1, 17), vec![(9.0, 0.01); 16]].concat();
        assert!(lacks(&vague));
        // A piece that stands still does not outweigh all others.
        let still = [shares(1.0, 0.1, 16), vec![(0.0, 1e6)]].concat();
        assert!(!lacks(&still));
    }

    #[test]
    fn a_piece_that_leaves_much_beside_the_ripple_weighs_little() {
        // A tenth as much noise weighs a hundred times as much.
        let weight = |noise: f64| {
            let angle: Vec<f64> = (0..300).map(|k| 0.0628 * f64::from(k)).collect();
            let jitter = |k: usize| if k.is_multiple_of(2) { noise } else { -noise };
            let read = |(k, at): (usize, &f64)| 60.0 * (1.0 + 0.01 * at.cos() + jitter(k));
            let stretch = Stretch {
                omega: angle.iter().enumerate().map(read).collect(),
                angle,
                ..Stretch::default()
            };
            let all: Vec<usize> = (0..300).collect();
            let own = read_in(&stretch, &all, 1.0).unwrap();
            assert!(
                (own.cos - 0.01).abs() < 2e-3 && own.sin.abs() < 2e-3,
                "{own:?}"
            );
            own.weight
        };
        let ratio = weight(0.001) / weight(0.01);
        assert!((ratio / 100.0 - 1.0).abs() < 0.3, "{ratio}");
    }
}
