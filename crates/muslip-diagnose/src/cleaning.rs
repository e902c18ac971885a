//! Values that cannot be used: found, told, and replaced for the sake of their neighbours.

use core::ops::Range;

use crate::constants::LEAST_REPEATED;
use crate::series::DataFault;
use crate::smooth::{difference_sigma, median_in_place};

/// Anything larger is no measurement.
const ABSURD: f64 = 1e15;
/// Longest run of missing values that is bridged by a straight line, in samples.
const BRIDGE: usize = 4;
/// A value that stays the very same for so many s is frozen.
const HOLD_S: f64 = 0.08;
/// So many times as long as a channel that repeats its readings usually stands, it may be frozen.
const USUAL_STANDS: f64 = 3.0;
/// By so many of its usual steps such a channel may go on after a stand: what was frozen goes on farther.
const USUAL_STEPS: f64 = 3.0;
/// So many steps of a channel that counts are no outlier.
const NO_OUTLIER_STEPS: f64 = 1.5;
/// Largest step that a speed is counted in, as a share of the largest speed.
const LARGEST_STEP: f64 = 0.05;
/// Fewest readings by which it shows how a channel is renewed.
const FEWEST_READINGS: usize = 20;
/// Bend of a straight line by rounding, as a share of the largest value.
const ROUNDING: f64 = 1e-9;

/// Where faults of one channel are told.
struct Told<'a> {
    name: &'a str,
    channel: &'a str,
    time: &'a [f64],
    faults: &'a mut Vec<DataFault>,
}

impl Told<'_> {
    fn fault(&mut self, from: usize, to: usize, what: String) {
        self.faults.push(DataFault {
            recording: self.name.to_owned(),
            channel: self.channel.to_owned(),
            start_s: self.time.get(from).copied().unwrap_or(0.0),
            end_s: self.time.get(to).copied().unwrap_or(0.0),
            what,
        });
    }
}

/// Cleans one channel: absurd values, spikes, short gaps. Returns the cleaned values and whether each
/// sample may be used.
pub(crate) fn clean(
    name: &str,
    channel: &str,
    time: &[f64],
    values: &[f64],
    faults: &mut Vec<DataFault>,
) -> (Vec<f64>, Vec<bool>) {
    let mut told = Told {
        name,
        channel,
        time,
        faults,
    };
    let mut x = without_absurd(values, &mut told);
    let mut usable = vec![true; x.len()];
    let sigma = difference_sigma(&x);
    // A speed may be counted; a force that stands has reached the end of its range.
    let may_count = matches!(channel, "wheel_speed_rad_s" | "vehicle_speed_m_s");
    if sigma > 0.0 {
        let step = if may_count { quantum(&x) } else { 0.0 };
        take_spikes(&mut x, sigma, step, &mut told);
        let renewed = if may_count { Renewed::of(&x) } else { None };
        mark_frozen(&x, renewed.as_ref(), &mut usable, &mut told);
    }
    bridge(&mut x, &mut usable, &mut told);
    (x, usable)
}

fn without_absurd(values: &[f64], told: &mut Told<'_>) -> Vec<f64> {
    let x: Vec<f64> = values
        .iter()
        .map(|v| if v.abs() < ABSURD { *v } else { f64::NAN })
        .collect();
    let absurd: Vec<usize> = (0..x.len())
        .filter(|&k| !values[k].is_nan() && !x[k].is_finite())
        .collect();
    if let (Some(&first), Some(&last)) = (absurd.first(), absurd.last()) {
        let what = format!("{} values beyond any measurement", absurd.len());
        told.fault(first, last, what);
    }
    x
}

/// The step that a channel counts in: next to nothing for one that does not, for a few of its changes are as small. Where
/// nearly all changes are outliers they are no steps.
fn quantum(x: &[f64]) -> f64 {
    let changes = x.windows(2).map(|w| (w[1] - w[0]).abs());
    let mut changes: Vec<f64> = changes.filter(|change| *change > 0.0).collect();
    if changes.is_empty() {
        return 0.0;
    }
    let few = (changes.len() - 1) / 20;
    let quantum = *changes.select_nth_unstable_by(few, f64::total_cmp).1;
    let known = x.iter().filter(|x| x.is_finite());
    let largest = known.fold(0.0, |most: f64, x| most.max(x.abs()));
    quantum.min(LARGEST_STEP * largest)
}

/// Takes out what is far from the median of four neighbours, by the noise, by the neighbours' own spread and by more than a
/// step of a channel that counts: between two steps it reads now one, now the other.
fn take_spikes(x: &mut [f64], sigma: f64, quantum: f64, told: &mut Told<'_>) {
    let n = x.len();
    if n < 7 {
        return;
    }
    let counted = NO_OUTLIER_STEPS * quantum;
    let is_spike = |k: usize| {
        let mut near = [x[k - 2], x[k - 1], x[k + 1], x[k + 2]];
        if !x[k].is_finite() || near.iter().any(|v| !v.is_finite()) {
            return false;
        }
        near.sort_by(f64::total_cmp);
        let centre = 0.5 * (near[1] + near[2]);
        let spread = near[3] - near[0];
        (x[k] - centre).abs() > 7.0 * sigma + 3.0 * spread + counted
    };
    let spikes: Vec<usize> = (2..n - 2).filter(|&k| is_spike(k)).collect();
    for &k in &spikes {
        x[k] = f64::NAN;
    }
    if let (Some(&first), Some(&last)) = (spikes.first(), spikes.last()) {
        let outliers = match spikes.len() {
            1 => "1 isolated outlier".to_owned(),
            many => format!("{many} isolated outliers"),
        };
        told.fault(first, last, outliers);
    }
}

/// Stretches over which a channel repeats the very same reading.
fn stands(x: &[f64]) -> Vec<Range<usize>> {
    let mut all: Vec<Range<usize>> = Vec::new();
    for k in (0..x.len()).filter(|k| x[*k].is_finite()) {
        match all.last_mut() {
            Some(last) if last.end == k && x[last.start] == x[k] => last.end = k + 1,
            _ => all.push(k..k + 1),
        }
    }
    all
}

/// How a channel goes on from one reading to the next where it is renewed seldom or counts in steps: by repeating the
/// last, or, brought to another time, along straight lines.
struct Renewed {
    /// Samples between two readings.
    every: f64,
    /// Change between two readings.
    step: f64,
}

impl Renewed {
    /// Of a channel that is; `None` of one that is renewed with nearly every sample, or too seldom to tell. At nothing a wheel
    /// may stand.
    fn of(x: &[f64]) -> Option<Self> {
        let known = x.iter().filter(|x| x.is_finite());
        let largest = known.fold(0.0, |most: f64, x| most.max(x.abs()));
        let goes_on = |k: usize| {
            let straight = k > 1 && (x[k] - 2.0 * x[k - 1] + x[k - 2]).abs() <= ROUNDING * largest;
            x[k] == x[k - 1] || straight
        };
        let (mut samples, mut going_on, mut went_on) = (0, 0, false);
        let mut readings: Vec<usize> = Vec::new();
        let moves = |k: &usize| x[*k].is_finite() && x[*k - 1].is_finite() && x[*k] != 0.0;
        for k in (1..x.len()).filter(moves) {
            samples += 1;
            let goes_on = goes_on(k);
            if goes_on {
                going_on += 1;
            }
            if goes_on && !went_on {
                readings.push(k);
            }
            went_on = goes_on;
        }
        let renewed = f64::from(going_on) > LEAST_REPEATED * f64::from(samples);
        if !renewed || readings.len() < FEWEST_READINGS {
            return None;
        }
        let pairs = || readings.windows(2);
        let mut every: Vec<f64> = pairs().map(|w| (w[1] - w[0]) as f64).collect();
        let steps = pairs().map(|w| (x[w[1]] - x[w[0]]).abs());
        let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
        (!steps.is_empty()).then(|| Self {
            every: median_in_place(&mut every),
            step: median_in_place(&mut steps),
        })
    }

    /// Whether a stand says no more than that the channel hardly changed: it is no longer than usual, or ends by no more
    /// than steps that are usual, or began so where the recording ends with it.
    fn is_usual(&self, x: &[f64], stand: &Range<usize>) -> bool {
        let after = x.get(stand.end..).unwrap_or_default().iter();
        let before = x.get(..stand.start).unwrap_or_default().iter().rev();
        let beside = after.chain(before).find(|x| x.is_finite());
        stand.len() as f64 <= USUAL_STANDS * self.every
            || beside.is_some_and(|x0| (x0 - x[stand.start]).abs() <= USUAL_STEPS * self.step)
    }
}

/// Frozen: the very same non-zero value for long, in a channel that otherwise moves, and farther on at its end where it
/// repeats readings anyway: a speed that is counted in steps stands as long as it is steady.
fn mark_frozen(x: &[f64], renewed: Option<&Renewed>, usable: &mut [bool], told: &mut Told<'_>) {
    for stand in stands(x) {
        let lasts = told.time[stand.end - 1] - told.time[stand.start];
        let long = stand.len() >= 20 && lasts >= HOLD_S;
        let everything = stand.len() > x.len() * 3 / 4;
        let usual = renewed.is_some_and(|of| of.is_usual(x, &stand));
        if long && !everything && !usual && x[stand.start] != 0.0 {
            told.fault(stand.start, stand.end - 1, "frozen or clipped".to_owned());
            usable[stand].fill(false);
        }
    }
}

/// Bridges what is missing; only what is missing for a short time may be used all the same.
fn bridge(x: &mut [f64], usable: &mut [bool], told: &mut Told<'_>) {
    let (n, time) = (x.len(), told.time);
    let mut missing_cells = 0;
    let mut long_gap: Option<(usize, usize)> = None;
    let mut k = 0;
    while k < n {
        if x[k].is_finite() {
            k += 1;
            continue;
        }
        let mut end = k;
        while end < n && !x[end].is_finite() {
            end += 1;
        }
        missing_cells += end - k;
        let before = if k > 0 { Some(x[k - 1]) } else { None };
        let after = x.get(end).copied();
        let short = end - k <= BRIDGE && before.is_some() && after.is_some();
        for j in k..end {
            x[j] = match (before, after) {
                (Some(b), Some(a)) => {
                    let w = (time[j] - time[k - 1]) / (time[end] - time[k - 1]);
                    b + w * (a - b)
                }
                (Some(b), None) => b,
                (None, Some(a)) => a,
                (None, None) => f64::NAN,
            };
            usable[j] &= short;
        }
        if !short && end - k > long_gap.map_or(0, |(a, b)| b - a) {
            long_gap = Some((k, end));
        }
        k = end;
    }
    if let Some((from, to)) = long_gap {
        let what = if to - from == n {
            "all values missing".to_owned()
        } else {
            format!("{missing_cells} values missing")
        };
        told.fault(from, to - 1, what);
    }
}

pub(crate) fn stretches(
    usable: impl Fn(usize) -> bool,
    breaks: &[bool],
    minimum: usize,
) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut start = None;
    for (k, &cut) in breaks.iter().enumerate() {
        let ok = usable(k);
        if let Some(from) = start
            && (!ok || cut)
        {
            if k - from >= minimum {
                out.push(from..k);
            }
            start = None;
        }
        if ok && start.is_none() {
            start = Some(k);
        }
    }
    if let Some(from) = start
        && breaks.len() - from >= minimum
    {
        out.push(from..breaks.len());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times in s at 500 Hz, and a speed in m/s: steady for 2 s, then braked at 4 m/s² for 2 s.
    fn stop() -> (Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..2000).map(|k| 0.002 * f64::from(k)).collect();
        let speed = time.iter().map(|t| 20.0 - 4.0 * f64::max(t - 2.0, 0.0));
        let speed = speed.collect();
        (time, speed)
    }

    /// A speed as counted in steps of 0.1 m/s over windows of 40 ms.
    fn counted(speed: &[f64]) -> Vec<f64> {
        let windows = speed.chunks(20);
        windows
            .flat_map(|own| vec![0.1 * (own[0] / 0.1).round(); own.len()])
            .collect()
    }

    /// Samples of a speed that may not be used.
    fn refused(time: &[f64], x: &[f64]) -> Vec<usize> {
        refused_of("vehicle_speed_m_s", time, x)
    }

    /// The same of a channel.
    fn refused_of(channel: &str, time: &[f64], x: &[f64]) -> Vec<usize> {
        let mut faults = Vec::new();
        let usable = clean("run", channel, time, x, &mut faults).1;
        assert_eq!(faults.is_empty(), usable.iter().all(|ok| *ok));
        (0..x.len()).filter(|k| !usable[*k]).collect()
    }

    #[test]
    fn a_speed_that_is_counted_in_steps_stands_while_it_is_steady() {
        let (time, speed) = stop();
        assert!(refused(&time, &counted(&speed)).is_empty());
    }

    #[test]
    fn a_counted_speed_that_goes_on_by_many_steps_was_frozen() {
        let (time, mut speed) = stop();
        let stuck = speed[1200];
        speed[1200..1500].fill(stuck);
        assert_eq!(
            refused(&time, &counted(&speed)),
            (1200..1500).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_counted_speed_may_be_steady_until_the_recording_ends_and_a_force_may_not_stand() {
        let (time, speed) = stop();
        let mut late: Vec<f64> = counted(&speed).into_iter().rev().collect();
        assert!(refused(&time, &late).is_empty());
        late.iter_mut().for_each(|x| *x *= 100.0);
        assert!(!refused_of("normal_force_n", &time, &late).is_empty());
    }

    #[test]
    fn a_speed_that_stood_still_or_was_frozen_for_long_is_not_taken_for_a_counted_one() {
        let (time, speed) = stop();
        let noise = |k: usize| 0.01 * (1.3 * k as f64).sin() * (0.7 * k as f64).cos();
        let mut locked: Vec<f64> = (0..2000).map(|k| speed[k] + noise(k)).collect();
        locked[1000..].fill(0.0);
        let stuck = locked[300];
        locked[300..450].fill(stuck);
        assert_eq!(refused(&time, &locked), (300..450).collect::<Vec<_>>());
        let mut long: Vec<f64> = (0..2000).map(|k| speed[k] + noise(k)).collect();
        let stuck = long[500];
        long[500..1400].fill(stuck);
        assert_eq!(refused(&time, &long), (500..1400).collect::<Vec<_>>());
    }

    #[test]
    fn an_outlier_vouches_for_no_other() {
        let (time, _) = stop();
        // All that changes is the outliers.
        let x: Vec<f64> = (0..2000)
            .map(|k| if k % 120 == 60 { 0.1 } else { 20.0 })
            .collect();
        let mut faults = Vec::new();
        let cleaned = clean("run", "vehicle_speed_m_s", &time, &x, &mut faults).0;
        assert!(cleaned.iter().all(|x| *x == 20.0));
        assert_eq!(faults[0].what, "17 isolated outliers");
    }

    #[test]
    fn a_step_of_a_channel_that_counts_is_no_outlier_and_several_are_one() {
        let (time, _) = stop();
        // Between two steps, nearer to one of them.
        let mut dithered: Vec<f64> = (0..2000)
            .map(|k| if k % 9 == 4 { 20.1 } else { 20.0 })
            .collect();
        let told = |x: &[f64]| {
            let mut faults = Vec::new();
            let cleaned = clean("run", "vehicle_speed_m_s", &time, x, &mut faults).0;
            (cleaned == x, faults.len())
        };
        assert_eq!(told(&dithered), (true, 0));
        dithered[1000] = 20.6;
        assert_eq!(told(&dithered), (false, 1));
    }

    #[test]
    fn what_is_renewed_with_every_sample_does_not_stand() {
        let (time, speed) = stop();
        let noisy = |k: usize| 0.01 * (1.3 * k as f64).sin() * (0.7 * k as f64).cos();
        let mut noisy: Vec<f64> = speed
            .iter()
            .enumerate()
            .map(|(k, v)| v + noisy(k))
            .collect();
        assert!(refused(&time, &noisy).is_empty());
        let stuck = noisy[500];
        noisy[500..600].fill(stuck);
        assert_eq!(refused(&time, &noisy), (500..600).collect::<Vec<_>>());
    }
}
