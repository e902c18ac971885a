//! Mains hum in the drag: a line at one frequency of the clock, in most windows of all runs.

use std::sync::Arc;

use rustfft::algorithm::{BluesteinsAlgorithm, Radix4};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection};

use super::constants::{
    HUM_LOWEST_HZ, HUM_NEAR, HUM_ORDERS, HUM_SHARE, HUM_SPREAD, HUM_WINDOW_S, LINE_RATIO,
};
use super::finding::{Finding, Word};
use super::line::{power, rough, taken};
use super::recording::Recording;
use crate::smooth::median_in_place;

/// A gap that no window spans, s.
const GAP_S: f64 = 0.05;
/// Fewest readings of a piece.
const FEWEST: usize = 200;
/// Neighbours on either side that a line is compared with.
const REACH: usize = 40;
/// Neighbours on either side that the window spreads a line over.
const FLANK: usize = 3;

/// A piece of a run: the drag beside its own smooth course.
struct Window {
    time: Vec<f64>,
    /// The wheel's angle, rad.
    angle: Vec<f64>,
    rough: Vec<f64>,
    /// Power at multiples of the windows' frequency.
    spectrum: Vec<f64>,
}

/// The wheel's angle at each reading, rad.
fn angle(run: &Recording) -> Vec<f64> {
    let mut angle = 0.0;
    (0..run.time.len())
        .map(|k| {
            if k > 0 && run.wheel.clean.len() == run.time.len() {
                let mean = 0.5 * (run.wheel.clean[k] + run.wheel.clean[k - 1]);
                angle += mean * (run.time[k] - run.time[k - 1]);
            }
            angle
        })
        .collect()
}

/// Pieces of a run without gaps, as first and one past the last reading.
pub(super) fn pieces(run: &Recording) -> Vec<(usize, usize)> {
    let breaks: Vec<bool> = (0..run.time.len())
        .map(|k| k > 0 && run.time[k] - run.time[k - 1] > GAP_S.max(8.0 * run.step))
        .collect();
    let finite = |k: usize| run.drag.clean.get(k).is_some_and(|x| x.is_finite());
    let pieces = crate::cleaning::stretches(finite, &breaks, FEWEST);
    pieces.into_iter().map(|p| (p.start, p.end)).collect()
}

/// All pieces in windows of one length, so that their spectra have the same lines; and that length.
fn windows(runs: &[Recording]) -> (Vec<Window>, f64) {
    let pieces: Vec<Vec<(usize, usize)>> = runs.iter().map(pieces).collect();
    let mut spans: Vec<f64> = runs
        .iter()
        .zip(&pieces)
        .flat_map(|(run, own)| own.iter().map(|(a, b)| run.time[b - 1] - run.time[*a]))
        .collect();
    if spans.is_empty() {
        return (Vec::new(), 0.0);
    }
    // Most pieces hold a window.
    spans.sort_by(f64::total_cmp);
    let length = spans[spans.len() / 4].min(HUM_WINDOW_S);
    let mut out = Vec::new();
    for (run, own) in runs.iter().zip(pieces) {
        // Such a run may have no step, either.
        if own.is_empty() {
            continue;
        }
        let angle = angle(run);
        let transform = transform(((length / run.step).round() as usize).max(8));
        for (start, end) in own {
            let rough = rough(&run.time, &run.drag.clean, start, end);
            let mut from = start;
            while from < end {
                let until = run.time[from] + length;
                let to = from + run.time[from..end].partition_point(|t| *t < until);
                let time = &run.time[from..to];
                let rough = &rough[from - start..to - start];
                if time[time.len() - 1] - time[0] > 0.95 * length {
                    out.push(Window {
                        time: time.to_vec(),
                        angle: angle[from..to].to_vec(),
                        rough: rough.to_vec(),
                        spectrum: spectrum(time, rough, run.step, &transform, length),
                    });
                }
                from = to;
            }
        }
    }
    (out, length)
}

/// The Fourier transform of so many readings. The library's own choice among its algorithms is quicker and compiles all
/// of them, which took a third of what this crate takes to compile.
pub(super) fn transform(readings: usize) -> BluesteinsAlgorithm<f64> {
    let inner = Radix4::new((2 * readings).next_power_of_two(), FftDirection::Forward);
    BluesteinsAlgorithm::new(readings, Arc::new(inner))
}

/// Power of a window's readings, each at its own time: what was dropped leaves a hole.
fn spectrum(
    time: &[f64],
    rough: &[f64],
    step: f64,
    transform: &dyn Fft<f64>,
    length: f64,
) -> Vec<f64> {
    let mut readings = vec![Complex::default(); transform.len()];
    let mut weights = 0.0;
    for (t, x) in time.iter().zip(rough) {
        let since = t - time[0];
        let weight = 0.5 - 0.5 * (core::f64::consts::TAU * since / length).cos();
        if let Some(place) = readings.get_mut((since / step).round() as usize) {
            *place = Complex::from(weight * x);
            weights += weight;
        }
    }
    transform.process(&mut readings);
    let lines = readings.iter().take(readings.len() / 2 + 1);
    lines.map(|c| c.norm_sqr() / (weights * weights)).collect()
}

/// Median of a spectrum around a line, beside it.
fn floor(spectrum: &[f64], line: usize) -> f64 {
    let (from, to) = (
        line.saturating_sub(REACH),
        (line + REACH + 1).min(spectrum.len()),
    );
    let mut around: Vec<f64> = (from..to)
        .filter(|i| i.abs_diff(line) > FLANK)
        .map(|i| spectrum[i])
        .collect();
    median_in_place(&mut around)
}

/// The line that stands out most, where it is narrow and in most windows.
fn line(windows: &[Window], length: f64) -> Option<usize> {
    let count = windows.iter().map(|w| w.spectrum.len()).min()?;
    let mean: Vec<f64> = (0..count)
        .map(|i| windows.iter().map(|w| w.spectrum[i]).sum::<f64>() / windows.len() as f64)
        .collect();
    let first = (HUM_LOWEST_HZ * length).ceil() as usize;
    // The last tenth is what a recorder's own filter leaves.
    let last = (0.96 * count as f64) as usize;
    let ratio = |i: usize| mean[i] / floor(&mean, i);
    let best = (first..last)
        .filter(|&i| i >= 1 && mean[i] >= mean[i - 1] && mean[i] >= mean[i + 1])
        .max_by(|a, b| ratio(*a).total_cmp(&ratio(*b)))?;
    // A resonance is as high a few lines away.
    let flank = [best.saturating_sub(FLANK), (best + FLANK).min(count - 1)]
        .map(|i| mean[i])
        .into_iter()
        .fold(0.0, f64::max);
    let seen = windows.iter().filter(|w| {
        let near = w.spectrum[best - 1..=best + 1]
            .iter()
            .copied()
            .fold(0.0, f64::max);
        near > 4.0 * floor(&w.spectrum, best)
    });
    let everywhere = 4 * seen.count() >= 3 * windows.len();
    (ratio(best) > LINE_RATIO && mean[best] > 6.0 * flank && everywhere).then_some(best)
}

/// Whether an order of the wheel's turning near a frequency explains as much as the clock does: a wheel that turns at one
/// speed makes lines as well.
fn turns(windows: &[Window], hz: f64, by_clock: f64) -> bool {
    let turned: f64 = windows
        .iter()
        .map(|w| w.angle[w.angle.len() - 1] - w.angle[0])
        .sum();
    let lasted: f64 = windows
        .iter()
        .map(|w| w.time[w.time.len() - 1] - w.time[0])
        .sum();
    let turn_hz = turned / lasted / core::f64::consts::TAU;
    HUM_ORDERS.map(|order| order as f64).any(|order| {
        let near = (order * turn_hz / hz - 1.0).abs() < HUM_NEAR;
        let by_angle = |w: &Window| power(&w.rough, w.angle.iter().map(|a| order * a));
        near && windows.iter().map(by_angle).sum::<f64>() > HUM_SHARE * by_clock
    })
}

/// Hum in the drag.
#[derive(Clone, Debug)]
pub struct Hum {
    /// Its amplitude in N, and its frequency in words.
    pub finding: Finding,
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Its share of the square of what is rough in the drag: the rest is noise.
    pub share: f64,
}

/// Mains hum in the drag, where there is a line that the wheel's turning does not make.
#[must_use]
pub fn hum(runs: &[Recording]) -> Option<Hum> {
    let (windows, length) = windows(runs);
    let near = line(&windows, length)? as f64 / length;
    let at = |hz: f64| -> Vec<f64> {
        let of = |w: &Window| {
            power(
                &w.rough,
                w.time.iter().map(|t| core::f64::consts::TAU * hz * t),
            )
        };
        windows.iter().map(of).collect()
    };
    let hz = (-20..=20)
        .map(|i| near + 0.05 * f64::from(i) / length)
        .max_by(|a, b| at(*a).iter().sum::<f64>().total_cmp(&at(*b).iter().sum()))?;
    let by_clock = at(hz);
    if turns(&windows, hz, by_clock.iter().sum()) {
        return None;
    }
    let amplitudes = by_clock.iter().map(|p| 2.0 * p.sqrt() / (1.0 - taken(hz)));
    let amplitudes: Vec<f64> = amplitudes.collect();
    let count = amplitudes.len() as f64;
    let value = (amplitudes.iter().map(|a| a * a).sum::<f64>() / count).sqrt();
    let spread = amplitudes.iter().map(|a| (a - value).powi(2)).sum::<f64>() / count;
    // What a brake's control makes comes and goes.
    if spread.sqrt() > HUM_SPREAD * value {
        return None;
    }
    let std = (spread / count).sqrt().max(0.02 * value);
    let finding = Finding::of("drag_force_n", Word::Hum, (value, std), "N").saying(format!(
        "The drag channel hums at {hz:.2} Hz with an amplitude of {value:.3} N."
    ));
    let squares = |w: &Window| w.rough.iter().map(|x| x * x).sum::<f64>() / w.rough.len() as f64;
    // A line's power is a quarter of its squared amplitude, its mean square a half.
    let share = 2.0 * by_clock.iter().sum::<f64>() / windows.iter().map(squares).sum::<f64>();
    Some(Hum {
        finding,
        frequency_hz: hz,
        share,
    })
}

#[cfg(test)]
mod tests {
    use super::super::toy::white;
    use super::*;
    use crate::campaign::{Rig, Run};

    /// Runs whose drag has a line at a frequency of the clock or of the wheel, some readings dropped.
    fn runs(amplitude: f64, phase: impl Fn(f64, f64) -> f64) -> Vec<Recording> {
        let mut white = white(9);
        (0..4_u32)
            .map(|run| {
                let mut out = Run::default();
                for k in (0..8000_u32).filter(|k| k % 97 != 5) {
                    let t = f64::from(k) * 1e-3;
                    let noise = white.next().unwrap();
                    // A speed that falls from 60 rad/s: angle 60 t - t².
                    let angle = 60.0 * t - t * t;
                    let swing = 500.0 * (1.0 - (1.9 * t + f64::from(run)).cos());
                    out.time_s.push(t);
                    out.wheel_speed_rad_s.push(60.0 - 2.0 * t);
                    out.vehicle_speed_m_s.push(20.0 - 0.6 * t);
                    out.normal_force_n.push(3000.0 + noise);
                    out.drag_force_n
                        .push(swing + 60.0 * noise + amplitude * phase(t, angle).sin());
                }
                super::super::recording::recording(&Rig::default(), &out)
            })
            .collect()
    }

    #[test]
    fn a_line_of_the_clock_is_hum_and_one_of_the_wheel_is_not() {
        let Hum {
            finding,
            frequency_hz,
            share,
        } = hum(&runs(30.0, |t, _| core::f64::consts::TAU * 49.97 * t)).unwrap();
        assert!((frequency_hz - 49.97).abs() < 0.02, "{frequency_hz}");
        assert!((finding.value / 30.0 - 1.0).abs() < 0.1, "{finding:?}");
        assert!(finding.statement.contains("49.9"), "{}", finding.statement);
        // Noise that is even between -30 N and 30 N, a hum of 30 N: 450 of 300 and 450 square newtons.
        assert!((share - 0.6).abs() < 0.03, "{share}");
        assert!(hum(&runs(30.0, |_, angle| 3.0 * angle)).is_none());
        assert!(hum(&runs(0.0, |_, _| 0.0)).is_none());
    }
}
