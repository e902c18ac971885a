//! A speed channel that reports late: shared by vehicle and wheel speed.
//!
//! The true value at t is the reading at t + delay. What is shifted is the smoothed channel, as the cubic through its
//! values and rates (Hermite), so that the derivative in the delay is that of the very curve that is read.

use core::ops::Range;

use super::late;
use super::{Compensation, Context, Parameter, Reported};
use crate::cleaning::stretches;
use crate::number::Number;
use crate::series::{Channel, GAP_STEPS, Series};

/// Largest delay either way, in s.
const MOST_S: f64 = 0.15;
/// Delays either way from which a search may start, in s.
const STARTS_S: [f64; 5] = [0.0015, 0.005, 0.015, 0.04, 0.09];

/// Why neither speed's delay is compensated.
pub const COMPENSATION: Compensation = Compensation::Not(
    "all other channels would have to wait for the late one, and the filter keeps no line of them",
);

/// The delay and its bounds.
pub fn parameters(context: &Context) -> Vec<Parameter> {
    let most = late::longest(MOST_S, context);
    vec![Parameter::new("delay", "s", -most, most)]
}

/// Delays from which a search may start, late and early.
pub fn starts(context: &Context) -> Vec<Vec<f64>> {
    let most = late::longest(MOST_S, context);
    late::seen(STARTS_S.into_iter(), context)
        .filter(|s| *s < most)
        .flat_map(|s| [vec![s], vec![-s]])
        .collect()
}

/// The figure by the contract.
pub fn report<T: Number>(p: &[T]) -> Vec<Reported<T>> {
    vec![Reported::new("delay", "s", p[0])]
}

/// The sentence of a channel.
pub fn statement(channel: &str, delay_s: f64) -> String {
    format!(
        "the {channel} channel reports {:.1} ms {} than the analogue channels (drag, load, brake)",
        1e3 * delay_s.abs(),
        if delay_s < 0.0 { "earlier" } else { "later" }
    )
}

/// Adds to values read at t what the channel shows at t + delay beyond what it shows at t.
pub fn shift<T: Number>(values: &mut [T], channel: &Channel, series: &Series, delay: T) {
    if delay == T::constant(0.0) {
        return;
    }
    let by = delay.value();
    for stretch in without_gap(series) {
        let mut at = stretch.start;
        for k in stretch.clone() {
            let wanted = series.time[k] + by;
            while at + 1 < stretch.end && series.time[at + 1] <= wanted {
                at += 1;
            }
            let (value, slope) = read(channel, &series.time, &stretch, at, wanted);
            values[k] += (delay - by) * slope + (value - channel.smooth[k]);
        }
    }
}

/// Value and rate of the smoothed channel at a time; `at` is the last sample of the stretch not after it. Beyond the
/// ends of a stretch it goes on as it was going.
fn read(
    channel: &Channel,
    time: &[f64],
    stretch: &Range<usize>,
    at: usize,
    wanted: f64,
) -> (f64, f64) {
    let (value, rate) = (&channel.smooth, &channel.rate);
    let since = wanted - time[at];
    if since < 0.0 || at + 1 >= stretch.end {
        return (value[at] + rate[at] * since, rate[at]);
    }
    let step = time[at + 1] - time[at];
    let u = since / step;
    let rise = value[at + 1] - value[at];
    // Cubic of the deviation from the chord: u (1 - u) ((1 - u) a - u b).
    let (a, b) = (rate[at] * step - rise, rate[at + 1] * step - rise);
    let bend = u * (1.0 - u) * ((1.0 - u) * a - u * b);
    let turn = (1.0 - u) * (1.0 - 3.0 * u) * a - u * (2.0 - 3.0 * u) * b;
    (value[at] + u * rise + bend, (rise + turn) / step)
}

/// Stretches of a run without a gap in time.
fn without_gap(series: &Series) -> Vec<Range<usize>> {
    let gap = |dt: &f64| *dt > GAP_STEPS * series.typical_dt;
    let breaks: Vec<bool> = series.dt.iter().map(gap).collect();
    stretches(|_| true, &breaks, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Dual;

    /// A second of x(t) at 200 Hz with its exact rate, a gap of 0.3 s after the 100th sample.
    fn channel(x: fn(f64) -> f64, rate: fn(f64) -> f64) -> (Channel, Series) {
        let time: Vec<f64> = (0..200)
            .map(|k| f64::from(k) * 0.005 + if k >= 100 { 0.3 } else { 0.0 })
            .collect();
        let mut dt = vec![0.005; 200];
        dt[100] = 0.305;
        let channel = Channel {
            smooth: time.iter().map(|t| x(*t)).collect(),
            rate: time.iter().map(|t| rate(*t)).collect(),
            ..Channel::default()
        };
        let series = Series {
            time,
            dt,
            typical_dt: 0.005,
            ..Series::default()
        };
        (channel, series)
    }

    fn shifted(channel: &Channel, series: &Series, delay: f64) -> Vec<f64> {
        let mut values = channel.smooth.clone();
        shift(&mut values, channel, series, delay);
        values
    }

    #[test]
    fn a_late_channel_is_read_later_and_an_early_one_earlier() {
        let (channel, series) = channel(|t| (5.0 * t).sin(), |t| 5.0 * (5.0 * t).cos());
        for delay in [0.0123, -0.0123, 0.005, -0.02] {
            let values = shifted(&channel, &series, delay);
            for k in (5..95).chain(105..195) {
                let expected = (5.0 * (series.time[k] + delay)).sin();
                assert!((values[k] - expected).abs() < 1e-6, "{delay} {k}");
            }
        }
    }

    #[test]
    fn beyond_the_end_of_a_stretch_a_channel_goes_on_as_it_was_going() {
        let (channel, series) = channel(|t| 3.0 - 2.0 * t, |_| -2.0);
        for delay in [0.1, -0.1] {
            for (k, value) in shifted(&channel, &series, delay).iter().enumerate() {
                let expected = 3.0 - 2.0 * (series.time[k] + delay);
                assert!((value - expected).abs() < 1e-12, "{delay} {k}");
            }
        }
    }

    #[test]
    fn no_delay_changes_nothing() {
        let (channel, series) = channel(|t| t * t, |t| 2.0 * t);
        assert_eq!(shifted(&channel, &series, 0.0), channel.smooth);
    }

    #[test]
    fn the_derivative_in_the_delay_is_that_of_the_value() {
        let (channel, series) = channel(|t| (9.0 * t).cos(), |t| -9.0 * (9.0 * t).sin() + 0.3);
        for delay in [0.0, 0.0007, 0.0113, -0.0042] {
            let mut values: Vec<Dual<1>> =
                channel.smooth.iter().map(|x| Dual::constant(*x)).collect();
            shift(&mut values, &channel, &series, Dual::variable(delay, 0));
            let h = 1e-7;
            let (more, less) = (
                shifted(&channel, &series, delay + h),
                shifted(&channel, &series, delay - h),
            );
            for k in 0..200 {
                let difference = (more[k] - less[k]) / (2.0 * h);
                assert!(
                    (values[k].slope[0] - difference).abs() < 1e-4,
                    "{delay} {k}: {} {difference}",
                    values[k].slope[0]
                );
            }
        }
    }
}
