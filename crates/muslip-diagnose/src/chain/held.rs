//! Channels that hold their last reading, drawn as straight lines between the readings.

use core::ops::Range;

use crate::audit::hold::hold;
use crate::campaign::Run;
use crate::cleaning::stretches;
use crate::constants::LEAST_REPEATED;
use crate::series::GAP_STEPS;
use crate::smooth::{median_in_place, median_step};

/// A stand of so many typical ones is a standstill, or a speed that does not change.
const LONG_STAND: f64 = 3.0;
/// Fewest stands of a channel that is held.
const LEAST_STANDS: usize = 20;

/// A reading: the middle in s of the time for which it stands, and a sample that has it.
type Reading = (f64, usize);

/// A held channel with every reading at the middle of the time for which it stands, and straight lines in between, and on
/// to the ends: as late on average as the staircase, without its steps. Any other channel as it is.
fn unheld(time: &[f64], x: &[f64]) -> Vec<f64> {
    let mut out = x.to_vec();
    for (part, readings) in parts(time, x) {
        draw(
            &time[part.clone()],
            &x[part.clone()],
            &readings,
            &mut out[part],
        );
    }
    out
}

/// Time in s at which a channel was last read: its last sample, or the middle of the time for which its last reading stands, where
/// it is held.
pub fn last_reading(time: &[f64], x: &[f64]) -> Option<f64> {
    let end = *time.last()?;
    let last = parts(time, x).pop();
    let last = last.filter(|(part, _)| part.end == time.len());
    let read = last.and_then(|(_, readings)| Some(readings.last()?.0));
    Some(read.map_or(end, |read| read.min(end)))
}

/// Readings of a held channel, see [`readings`], by the parts between its gaps that have two or more; none of any other channel.
fn parts(time: &[f64], x: &[f64]) -> Vec<(Range<usize>, Vec<Reading>)> {
    let after = |begins: &dyn Fn(usize) -> bool| -> Vec<bool> {
        (0..x.len()).map(|k| k > 0 && begins(k)).collect()
    };
    let changes = after(&|k| x[k] != x[k - 1]);
    if !is_held(&between(&changes)) {
        return Vec::new();
    }
    let period = hold(time, x).map(|hold| hold.period_s);
    let step = median_step(time);
    let gaps = after(&|k| time[k] - time[k - 1] > GAP_STEPS * step);
    let with_readings = between(&gaps).into_iter().filter_map(|part| {
        let stands = between(&changes[part.clone()]);
        let readings =
            (stands.len() > 1).then(|| readings(&time[part.clone()], step, &stands, period));
        Some((part, readings?))
    });
    with_readings.collect()
}

/// Stretches of samples from one of these breaks to the next.
fn between(breaks: &[bool]) -> Vec<Range<usize>> {
    stretches(|_| true, breaks, 1)
}

/// Whether a channel repeats its readings where it moves at all: a standstill repeats without being held.
fn is_held(stands: &[Range<usize>]) -> bool {
    let mut lengths: Vec<f64> = stands.iter().map(|stand| stand.len() as f64).collect();
    let typical = median_in_place(&mut lengths);
    let moving = lengths
        .iter()
        .filter(|length| **length <= LONG_STAND * typical);
    let (repeated, moving) = moving.fold((0.0, 0.0), |(repeated, moving), length| {
        (repeated + length - 1.0, moving + length)
    });
    repeated > LEAST_REPEATED * moving && stands.len() >= LEAST_STANDS
}

/// Readings of a held channel of two stands or more: the middle of the time for which each stands, and a sample that has it. Where the `period` is
/// known, a stand of several of them is as many readings that happen to be equal: as one, at the middle of all of them, an
/// equal reading more or less would move the mean. Where it is not, a stand that is much longer than others is. The recording
/// cuts the first and the last stand short: they are taken to be as long as the others, for a line to the middle of what is
/// left would be up to twice too steep.
fn readings(time: &[f64], step: f64, stands: &[Range<usize>], period: Option<f64>) -> Vec<Reading> {
    let stood = |stand: &Range<usize>| time[stand.end - 1] - time[stand.start] + step;
    let inner = &stands[1..stands.len() - 1];
    let mut lengths: Vec<f64> = inner.iter().map(stood).collect();
    let one = period.unwrap_or_else(|| median_in_place(&mut lengths));
    let mut readings = Vec::new();
    for (at, stand) in stands.iter().enumerate() {
        let stood = stood(stand);
        let cut = at == 0 || at + 1 == stands.len();
        let count = match period {
            // How long it stood is known to a step.
            Some(_) if cut => ((stood - step) / one).ceil(),
            Some(_) => (stood / one).round(),
            None if stood > LONG_STAND * one => (stood / one).round(),
            None => 1.0,
        };
        let count = if count >= 1.0 { count } else { 1.0 };
        let each = if cut {
            one.max(stood / count)
        } else {
            stood / count
        };
        let begin = if at == 0 {
            time[stand.start] + stood - count * each
        } else {
            time[stand.start]
        };
        for reading in 0..count as usize {
            // The middle of the samples, half a step before the middle of the time to the next reading.
            let middle = begin + (reading as f64 + 0.5) * each - 0.5 * step;
            readings.push((middle, stand.start));
        }
    }
    readings
}

/// Draws a channel without a gap as straight lines between its readings, and along the first and the last of them on to its ends.
fn draw(time: &[f64], x: &[f64], readings: &[Reading], out: &mut [f64]) {
    let mut at = 0;
    for k in 0..time.len() {
        while at + 2 < readings.len() && readings[at + 1].0 <= time[k] {
            at += 1;
        }
        let [(a, from), (b, to)] = [readings[at], readings[at + 1]];
        let (from, to) = (x[from], x[to]);
        let value = from + (to - from) * (time[k] - a) / (b - a);
        if !(b > a) || !value.is_finite() {
            continue;
        }
        // What comes to rest does not turn round.
        let nearest = if time[k] < a { from } else { to };
        let beyond = time[k] < a || time[k] > b;
        out[k] = if beyond && value * nearest <= 0.0 {
            0.0
        } else {
            value
        };
    }
}

/// A run whose speeds are lines where they were held.
#[must_use]
pub fn without_holds(run: &Run) -> Run {
    Run {
        wheel_speed_rad_s: unheld(&run.time_s, &run.wheel_speed_rad_s),
        vehicle_speed_m_s: unheld(&run.time_s, &run.vehicle_speed_m_s),
        ..run.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staircase_becomes_the_line_it_was_read_from() {
        let time: Vec<f64> = (0..300).map(|k| 0.004 * f64::from(k)).collect();
        let held: Vec<f64> = (0..300)
            .map(|k| 20.0 - 3.0 * 0.004 * f64::from(5 * (k / 5)))
            .collect();
        let line = unheld(&time, &held);
        for k in 10..290 {
            assert!((line[k] - (20.0 - 3.0 * (time[k] - 0.008))).abs() < 1e-9);
        }
        assert_eq!(unheld(&time, &line)[10..290], line[10..290]);
    }

    #[test]
    fn a_channel_was_last_read_in_the_middle_of_its_last_stand() {
        let time: Vec<f64> = (0..300).map(|k| 0.004 * f64::from(k)).collect();
        let held: Vec<f64> = (0..300).map(|k| f64::from(5 * (k / 5))).collect();
        // Five samples from the last but five on.
        let last = last_reading(&time, &held).unwrap();
        assert!((last - (time[295] + 0.008)).abs() < 1e-9, "{last}");
        assert_eq!(last_reading(&time, &time), Some(time[299]));
        assert_eq!(last_reading(&[], &[]), None);
    }

    #[test]
    fn equal_readings_after_one_another_leave_the_mean_as_it_is() {
        // A counter of whole steps, renewed every 9.3 ms, of a speed of 15 steps and a third.
        let time: Vec<f64> = (0..3000).map(|k| 0.002 * f64::from(k)).collect();
        let counted: Vec<f64> = time
            .iter()
            .map(|t| {
                let window = (t / 0.0093).floor();
                (15.333 * (window + 1.0)).floor() - (15.333 * window).floor()
            })
            .collect();
        let drawn = unheld(&time, &counted);
        let mean = |x: &[f64]| x[100..2900].iter().sum::<f64>() / 2800.0;
        assert!((mean(&counted) - 15.333).abs() < 0.005);
        assert!((mean(&drawn) - 15.333).abs() < 0.005, "{}", mean(&drawn));
        // Nor does a gap in time draw a line across itself.
        let paused: Vec<f64> = time
            .iter()
            .map(|t| t + if *t < 3.0 { 0.0 } else { 5.0 })
            .collect();
        let apart: Vec<f64> = counted
            .iter()
            .zip(&time)
            .map(|(x, t)| if *t < 3.0 { *x } else { x + 40.0 })
            .collect();
        let drawn = unheld(&paused, &apart);
        assert!(drawn[..1500].iter().all(|x| *x < 16.5));
        assert!(drawn[1500..].iter().all(|x| *x > 54.5));
    }

    #[test]
    fn a_speed_that_does_not_change_is_no_ramp_however_unevenly_it_is_renewed() {
        // Every 0.1 s and up to 40 ms later: no period. It drives on, brakes to rest, and stands.
        let time: Vec<f64> = (0..2500).map(|k| 0.004 * f64::from(k)).collect();
        let speed = |t: f64| (20.0 - 8.0 * (t - 4.0).max(0.0)).max(0.0);
        let held: Vec<f64> = time
            .iter()
            .map(|t| {
                let uneven = |n: f64| 0.1 * n + 0.04 * (n * 2.399).sin().abs();
                let n = (t / 0.1).floor();
                speed(uneven(if uneven(n) <= *t { n } else { n - 1.0 }))
            })
            .collect();
        assert!(hold(&time, &held).is_none());
        let drawn = unheld(&time, &held);
        for (t, x) in time.iter().zip(&drawn) {
            let moves = *t > 3.9 && *t < 6.7;
            assert!(moves || (x - speed(*t)).abs() < 1e-9, "{t}: {x}");
        }
    }

    #[test]
    fn a_reading_that_the_recording_cuts_short_stands_for_as_long_as_the_others() {
        // Its first and its last reading stand for one sample of twenty-five.
        let time: Vec<f64> = (0..527).map(|k| 0.004 * f64::from(k)).collect();
        let truth = |k: i32| 20.0 - 3.0 * 0.004 * f64::from(k - 12);
        let held: Vec<f64> = (0..527)
            .map(|k: i32| truth(25 * ((k + 24) / 25) - 24 + 12))
            .collect();
        let line = unheld(&time, &held);
        for (k, own) in line.iter().enumerate() {
            let expected = truth(k as i32);
            assert!((own - expected).abs() < 1e-9, "{k}: {own} {expected}");
        }
        // What comes to rest neither turns round nor goes on.
        for last in [0.0, 0.02] {
            let stops: Vec<f64> = held[..524].iter().map(|x| x - held[523] + last).collect();
            let stopped = unheld(&time[..524], &stops);
            assert!(stopped.iter().all(|x| *x >= 0.0), "{:?}", &stopped[490..]);
            assert!(stopped[523] < 0.16, "{}", stopped[523]);
        }
    }
}
