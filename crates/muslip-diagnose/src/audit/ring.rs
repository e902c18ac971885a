//! Ringing of the drag: a peak of its spectrum that stays at one frequency of the clock in all runs and is wider than a line.
//!
//! What excites a load cell and its mount is faster than the speeds can tell, so a tyre law, fed with their noise, hardly
//! sees the ring that the drag's own spectrum shows. The peak is told from what is beside it by Whittle's likelihood of the
//! spectrum (P. Whittle, The analysis of multiple stationary time series, J. R. Stat. Soc. B 15, 1953): background, a line of
//! the logarithms with a step where a mode cuts the force off, times one and so many times the mode's power response.

use nalgebra::{DMatrix, DVector};
use rustfft::Fft;
use rustfft::num_complex::Complex;

use super::constants::{
    RING_ALIKE_T, RING_FASTEST, RING_LEAST_NATS, RING_NEAR_ORDER, RING_ORDERS, RING_SLOWEST_HZ,
    RING_WINDOW_S,
};
use super::hum::{pieces, transform};
use super::recording::Recording;
use crate::constants::MOST_AGAINST;
use crate::number::mean_and_std;
use crate::smooth::median_in_place;

/// Step of the search for its frequency, as a factor.
const FREQUENCY_STEP: f64 = 1.03;
/// Damping ratios that are tried.
const DAMPINGS: [f64; 4] = [0.02, 0.04, 0.08, 0.15];
/// Heights over the background that are tried.
const HEIGHTS: [f64; 12] = [
    0.0, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0, 8.0, 13.0, 20.0, 40.0, 80.0,
];
/// Band about its frequency that is looked at, as factors.
const BAND: [f64; 2] = [0.6, 1.6];
/// The same where a ring that is there is measured: nearer, where the background is closer to a line.
const NEAR_BAND: [f64; 2] = [0.75, 1.33];
/// Share of its largest power response from which a line is of the peak, not of what is beside it.
const OF_PEAK: f64 = 0.12;
/// What a line counts: the window makes neighbours alike, and windows overlap.
const COUNTS: f64 = 0.5;
/// Share of a window's power that it leaves in a line, and in each beside it.
const SPREAD: [f64; 2] = [4.0 / 6.0, 1.0 / 6.0];
/// Lines of the mains, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];
/// Orders of a line that are left out, and how many lines about each.
const LINE_ORDERS: usize = 4;
const LINE_REACH: f64 = 3.2;
/// Share by which the length of a window may differ from that of as many even steps.
const UNEVEN: f64 = 0.01;
/// Fewest lines on either side of a peak, and in it.
const FEWEST_BESIDE: usize = 3;
const FEWEST_OF_PEAK: usize = 2;
/// Share of its fastest from which a wheel turns.
const TURNING: f64 = 0.1;
/// Fewest runs that can show that it is the same in all.
const FEWEST_RUNS: usize = 3;

/// A ring of the drag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Its standard deviation.
    pub frequency_std_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Its standard deviation.
    pub damping_std: f64,
    /// What all runs gain by it in nats, each with its height from the others.
    pub gain: f64,
}

/// Power of one run's drag at multiples of the windows' frequency, summed over its windows.
struct Spectrum {
    power: Vec<f64>,
    windows: f64,
}

/// Fits of a run's background and how far its power lies over it, in the lines of the band.
struct Beside {
    /// Mode's power response over its largest.
    response: Vec<f64>,
    /// Power over the background, summed over the windows, by run.
    over: Vec<Vec<f64>>,
}

/// A line of readings less the polynomial of fourth degree that is closest, under a window of von Hann.
fn windowed(readings: &[f64]) -> Option<Vec<Complex<f64>>> {
    let n = readings.len();
    let at = |k: usize| 2.0 * k as f64 / (n - 1) as f64 - 1.0;
    let powers = DMatrix::from_fn(n, 5, |k, i| at(k).powi(i as i32));
    let x = DVector::from_column_slice(readings);
    let fitted = (powers.transpose() * &powers).cholesky()?;
    let left = &x - &powers * fitted.solve(&(powers.transpose() * &x));
    let window = |k: usize| 0.5 - 0.5 * (core::f64::consts::TAU * k as f64 / (n - 1) as f64).cos();
    Some((0..n).map(|k| Complex::from(window(k) * left[k])).collect())
}

/// The spectra of all runs with a window in them; the frequency of their first line in Hz.
fn spectra(runs: &[Recording]) -> Option<(Vec<Spectrum>, f64)> {
    let mut steps: Vec<f64> = runs.iter().map(|run| run.step).collect();
    let step = if steps.is_empty() {
        return None;
    } else {
        median_in_place(&mut steps)
    };
    let mut spans: Vec<f64> = runs
        .iter()
        .filter_map(|run| Some(run.time.last()? - run.time.first()?))
        .collect();
    if spans.is_empty() || !(step > 0.0) {
        return None;
    }
    let length = RING_WINDOW_S.min(0.5 * median_in_place(&mut spans));
    let readings = (length / step).round();
    if !(readings > 32.0) {
        return None;
    }
    let readings = readings as usize;
    if !runs.iter().any(|run| run.drag.clean.len() >= readings) {
        return None;
    }
    let transform = transform(readings);
    // What is held, or drawn between readings, has images of its spectrum, alike in all runs.
    let alike = runs
        .iter()
        .filter(|run| (run.step / step - 1.0).abs() < UNEVEN && !run.drag.is_coarse());
    let of_run = |run: &Recording| {
        let mut sum = Spectrum {
            power: vec![0.0; readings / 2 + 1],
            windows: 0.0,
        };
        for (from, to) in pieces(run) {
            let starts = (from..).step_by(readings.div_ceil(2));
            for start in starts.take_while(|start| start + readings <= to) {
                let end = start + readings;
                let lasts = run.time[end - 1] - run.time[start];
                // Rows that are missing would shift what comes after them.
                let even = (lasts / (step * (readings - 1) as f64) - 1.0).abs() < UNEVEN;
                let windowed = even.then(|| windowed(&run.drag.clean[start..end]));
                let Some(mut own) = windowed.flatten() else {
                    continue;
                };
                transform.process(&mut own);
                for (power, own) in sum.power.iter_mut().zip(own) {
                    *power += own.norm_sqr();
                }
                sum.windows += 1.0;
            }
        }
        sum
    };
    let spectra = alike.map(of_run).filter(|spectrum| spectrum.windows > 0.0);
    Some((spectra.collect(), 1.0 / (readings as f64 * step)))
}

/// Power response of a mode, at a frequency over its own.
fn response(relative: f64, damping: f64) -> f64 {
    1.0 / ((1.0 - relative * relative).powi(2) + (2.0 * damping * relative).powi(2))
}

impl Beside {
    /// About this frequency; `None` where there are too few lines. Those of a hum are left out.
    fn new(
        spectra: &[Spectrum],
        first_hz: f64,
        lines: &[f64],
        (frequency, damping): (f64, f64),
        band: [f64; 2],
    ) -> Option<Self> {
        let count = spectra.first()?.power.len();
        let of_line = |hz: f64| {
            let near = |line: f64| (hz - line).abs() < LINE_REACH * first_hz;
            lines
                .iter()
                .any(|line| (1..=LINE_ORDERS).any(|order| near(order as f64 * line)))
        };
        let relative = |k: usize| k as f64 * first_hz / frequency;
        let is_near = |k: &usize| {
            let at = relative(*k);
            at > band[0] && at < band[1] && !of_line(*k as f64 * first_hz)
        };
        let band: Vec<usize> = (1..count - 1).filter(is_near).collect();
        let spread = |k: usize| {
            SPREAD[0] * response(relative(k), damping)
                + SPREAD[1] * response(relative(k - 1), damping)
                + SPREAD[1] * response(relative(k + 1), damping)
        };
        let mut own: Vec<f64> = band.iter().map(|k| spread(*k)).collect();
        let largest = own.iter().copied().fold(0.0, f64::max);
        own.iter_mut().for_each(|x| *x /= largest);
        let beside: Vec<usize> = (0..band.len()).filter(|i| own[*i] < OF_PEAK).collect();
        let below = beside.iter().filter(|i| relative(band[**i]) < 1.0).count();
        let fewest = below.min(beside.len() - below) < FEWEST_BESIDE;
        if fewest || band.len() - beside.len() < FEWEST_OF_PEAK {
            return None;
        }
        // The step is as wide as the mode.
        let row = |i: usize| {
            let x = relative(band[i]).ln();
            [1.0, x, (0.5 + x / (6.0 * damping)).clamp(0.0, 1.0)]
        };
        let columns = DMatrix::from_fn(beside.len(), 3, |i, j| row(beside[i])[j]);
        let squares = (columns.transpose() * &columns).cholesky()?;
        let over = spectra.iter().map(|spectrum| {
            let power = |i: usize| (spectrum.power[band[i]] / spectrum.windows).max(1e-300);
            let logs = DVector::from_fn(beside.len(), |i, _| power(beside[i]).ln());
            let fitted = squares.solve(&(columns.transpose() * logs));
            let background = |i: usize| {
                let row = row(i);
                (fitted[0] * row[0] + fitted[1] * row[1] + fitted[2] * row[2]).exp()
            };
            let over = (0..band.len()).map(|i| spectrum.windows * power(i) / background(i));
            over.collect()
        });
        Some(Self {
            over: over.collect(),
            response: own,
        })
    }

    /// What a run gains by a peak of this height, nats.
    fn gain(&self, spectra: &[Spectrum], run: usize, height: f64) -> f64 {
        let lines = self.response.iter().zip(&self.over[run]);
        let sum: f64 = lines
            .map(|(response, over)| {
                let times = 1.0 + height * response;
                over * (1.0 - 1.0 / times) - spectra[run].windows * times.ln()
            })
            .sum();
        COUNTS * sum
    }

    /// What all runs gain by the best height.
    fn best(&self, spectra: &[Spectrum]) -> f64 {
        let all = |height: f64| {
            (0..spectra.len())
                .map(|run| self.gain(spectra, run, height))
                .sum()
        };
        HEIGHTS.into_iter().map(all).fold(0.0, f64::max)
    }

    /// What each run gains, by the height that all others make best.
    fn gains(&self, spectra: &[Spectrum]) -> Vec<f64> {
        let by_height: Vec<Vec<f64>> = HEIGHTS
            .iter()
            .map(|height| {
                (0..spectra.len())
                    .map(|run| self.gain(spectra, run, *height))
                    .collect()
            })
            .collect();
        let all: Vec<f64> = by_height.iter().map(|own| own.iter().sum()).collect();
        let unseen = (0..spectra.len()).map(|run| {
            let others = |at: &usize| all[*at] - by_height[*at][run];
            let best = (0..HEIGHTS.len()).max_by(|a, b| others(a).total_cmp(&others(b)));
            by_height[best.unwrap_or(0)][run]
        });
        unseen.collect()
    }
}

/// Whether so many nats, by run, are alike, and hardly a run speaks against them.
fn are_alike(gains: &[f64]) -> bool {
    let roots: Vec<f64> = gains.iter().map(|g| g.signum() * g.abs().sqrt()).collect();
    let (mean, std) = mean_and_std(&roots);
    let t = mean / std.max(1e-9) * (roots.len() as f64).sqrt();
    let sum_of = |sign: f64| gains.iter().map(|g| (sign * g).max(0.0)).sum::<f64>();
    t > RING_ALIKE_T && sum_of(-1.0) < MOST_AGAINST * sum_of(1.0)
}

/// Whether a frequency is an order of the wheel's turning in most runs: what is eccentric makes that.
fn turns(runs: &[Recording], hz: f64) -> bool {
    let near = |run: &&Recording| {
        let speeds = || {
            run.wheel
                .clean
                .iter()
                .map(|x| x.abs())
                .filter(|x| x.is_finite())
        };
        let fastest = speeds().fold(0.0, f64::max);
        let mut turning: Vec<f64> = speeds().filter(|x| *x > TURNING * fastest).collect();
        let turn_hz = median_in_place(&mut turning) / core::f64::consts::TAU;
        RING_ORDERS
            .into_iter()
            .any(|order| (hz / (order * turn_hz) - 1.0).abs() < RING_NEAR_ORDER)
    };
    2 * runs.iter().filter(near).count() > runs.len()
}

/// Whether a ring is wider than a line of the spectrum: else it could be a hum.
fn is_wide(frequency: f64, damping: f64, first_hz: f64) -> bool {
    2.0 * damping * frequency > 1.5 * first_hz
}

/// Frequency and damping of a ring that is near these.
fn measured(spectra: &[Spectrum], first_hz: f64, lines: &[f64], at: (f64, f64)) -> (f64, f64) {
    let gain = |own: &(f64, f64)| {
        let beside = Beside::new(spectra, first_hz, lines, *own, NEAR_BAND);
        beside.map_or(f64::NEG_INFINITY, |beside| beside.best(spectra))
    };
    let near = (-25..=25).flat_map(|i| {
        let frequency = at.0 * (1.0 + 0.005 * f64::from(i));
        (-7..=3).map(move |j| (frequency, at.1 * 1.25_f64.powi(j)))
    });
    let near = near.filter(|own| is_wide(own.0, own.1, first_hz));
    let best = near
        .map(|own| (gain(&own), own))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|best| best.0.is_finite())
        .map_or(at, |best| best.1)
}

/// The ring of the drag, where there is one; lines at these frequencies and their orders are a hum's.
#[must_use]
pub fn ring(runs: &[Recording], hum_hz: Option<f64>) -> Option<Ring> {
    let (spectra, first_hz) = spectra(runs)?;
    if spectra.len() < FEWEST_RUNS {
        return None;
    }
    let lines: Vec<f64> = MAINS_HZ.into_iter().chain(hum_hz).collect();
    let fastest = RING_FASTEST * 2.0 * first_hz * spectra[0].power.len() as f64;
    let mut tried: Vec<(f64, Vec<f64>, (f64, f64))> = Vec::new();
    let mut frequency = RING_SLOWEST_HZ;
    while frequency < fastest {
        let wide = |damping: &f64| is_wide(frequency, *damping, first_hz);
        for damping in DAMPINGS.into_iter().filter(wide) {
            let at = (frequency, damping);
            if let Some(beside) = Beside::new(&spectra, first_hz, &lines, at, BAND) {
                let gains = beside.gains(&spectra);
                tried.push((gains.iter().sum(), gains, at));
            }
        }
        frequency *= FREQUENCY_STEP;
    }
    let (gain, gains, at) = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    if gain < RING_LEAST_NATS || !are_alike(&gains) {
        return None;
    }
    let (frequency, damping) = measured(&spectra, first_hz, &lines, at);
    if turns(runs, frequency) {
        return None;
    }
    Some(Ring {
        frequency_hz: frequency,
        // What the step beside it may move a peak by, and a line's own width.
        frequency_std_hz: (0.5 * damping * frequency).max(0.25 * first_hz),
        damping_ratio: damping,
        damping_std: 0.5 * damping,
        gain,
    })
}

#[cfg(test)]
mod tests {
    use super::super::recording::Column;
    use super::super::toy::white;
    use super::*;

    /// Runs of a drag that is white noise through two slow poles, in N at 1 kHz, then what `then` makes of it.
    fn runs(count: u64, then: impl Fn(u64, &[f64]) -> Vec<f64>) -> Vec<Recording> {
        (0..count)
            .map(|seed| {
                let mut noise = white(seed + 1);
                let mut poles = [0.0; 2];
                let force: Vec<f64> = (0..8000)
                    .map(|_| {
                        poles[0] += 0.05 * (1000.0 * noise.next().unwrap() - poles[0]);
                        poles[1] += 0.05 * (poles[0] - poles[1]);
                        poles[1]
                    })
                    .collect();
                let mut own = then(seed, &force);
                own.iter_mut()
                    .for_each(|x| *x += 0.5 * noise.next().unwrap());
                Recording {
                    time: (0..8000).map(|k| 0.001 * f64::from(k)).collect(),
                    step: 0.001,
                    drag: Column {
                        clean: own,
                        ..Column::default()
                    },
                    wheel: Column {
                        clean: vec![60.0; 8000],
                        ..Column::default()
                    },
                    ..Recording::default()
                }
            })
            .collect()
    }

    /// Through a mode.
    fn rung(force: &[f64], hz: f64, damping: f64) -> Vec<f64> {
        let (w, dt) = (core::f64::consts::TAU * hz, 0.001);
        let (mut y, mut rate) = (0.0, 0.0);
        let of = |x: &f64| {
            for _ in 0..10 {
                rate += 0.1 * dt * (w * w * (x - y) - 2.0 * damping * w * rate);
                y += 0.1 * dt * rate;
            }
            y
        };
        force.iter().map(of).collect()
    }

    #[test]
    fn a_mode_shows_its_frequency_and_damping() {
        let rings = runs(5, |_, force| rung(force, 33.0, 0.06));
        let ring = ring(&rings, None).unwrap();
        assert!((ring.frequency_hz / 33.0 - 1.0).abs() < 0.03, "{ring:?}");
        assert!((ring.damping_ratio / 0.06).ln().abs() < 0.4, "{ring:?}");
    }

    #[test]
    fn neither_smooth_noise_nor_a_line_nor_what_one_run_has_rings() {
        let plain = runs(5, |_, force| force.to_vec());
        assert_eq!(ring(&plain, None), None);
        let line = |hz: f64| {
            runs(5, |_, force| {
                let wave = |k: usize| 30.0 * (core::f64::consts::TAU * hz * 0.001 * k as f64).sin();
                force.iter().enumerate().map(|(k, x)| x + wave(k)).collect()
            })
        };
        assert_eq!(ring(&line(50.0), None), None);
        assert_eq!(ring(&line(33.0), Some(33.0)), None);
        let one = runs(5, |seed, force| {
            if seed == 0 {
                rung(force, 33.0, 0.06)
            } else {
                force.to_vec()
            }
        });
        assert_eq!(ring(&one, None), None);
    }

    #[test]
    fn a_drag_that_is_held_or_lacks_rows_shows_none() {
        let mut held = runs(5, |_, force| rung(force, 33.0, 0.06));
        held.iter_mut().for_each(|run| run.drag.coarse = true);
        assert_eq!(ring(&held, None), None);
        // Every tenth row: what comes after it would be taken for earlier.
        let mut torn = runs(5, |_, force| rung(force, 33.0, 0.06));
        for run in &mut torn {
            let kept = |k: &usize| !k.is_multiple_of(10);
            run.time = (0..8000).filter(kept).map(|k| 0.001 * k as f64).collect();
            run.drag.clean = (0..8000).filter(kept).map(|k| run.drag.clean[k]).collect();
        }
        assert_eq!(ring(&torn, None), None);
        assert_eq!(ring(&[], None), None);
    }

    #[test]
    fn what_goes_with_the_wheel_s_turning_is_no_ring() {
        // 60 rad/s are 9.55 turns a second.
        let mut of_turn = runs(5, |_, force| rung(force, 19.1, 0.06));
        assert_eq!(ring(&of_turn, None), None);
        // It counts as it turns, not as it stands at the end, and whichever way it does.
        for run in &mut of_turn {
            run.wheel.clean[..3000].fill(-60.0);
            run.wheel.clean[3000..].fill(0.0);
        }
        assert_eq!(ring(&of_turn, None), None);
    }
}
