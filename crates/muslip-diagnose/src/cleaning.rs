//! Values that cannot be used: found, told, and replaced for the sake of their neighbours.

use core::ops::Range;

use crate::series::DataFault;
use crate::smooth::difference_sigma;

/// Anything larger is no measurement.
const ABSURD: f64 = 1e15;
/// Longest run of missing values that is bridged by a straight line, in samples.
const BRIDGE: usize = 4;
/// A value that stays the very same for so many s is frozen.
const HOLD_S: f64 = 0.08;

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
    if sigma > 0.0 {
        take_spikes(&mut x, sigma, &mut told);
        mark_frozen(&x, &mut usable, &mut told);
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

/// Takes out what is far from the median of four neighbours, by the noise and by the neighbours' own spread.
fn take_spikes(x: &mut [f64], sigma: f64, told: &mut Told<'_>) {
    let n = x.len();
    if n < 7 {
        return;
    }
    let is_spike = |k: usize| {
        let mut near = [x[k - 2], x[k - 1], x[k + 1], x[k + 2]];
        if !x[k].is_finite() || near.iter().any(|v| !v.is_finite()) {
            return false;
        }
        near.sort_by(f64::total_cmp);
        let centre = 0.5 * (near[1] + near[2]);
        let spread = near[3] - near[0];
        (x[k] - centre).abs() > 7.0 * sigma + 3.0 * spread
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

/// Frozen: the very same non-zero value for long, in a channel that otherwise moves.
fn mark_frozen(x: &[f64], usable: &mut [bool], told: &mut Told<'_>) {
    let n = x.len();
    let mut k = 0;
    while k < n {
        let mut end = k + 1;
        while end < n && x[end] == x[k] && x[k].is_finite() {
            end += 1;
        }
        let long = end - k >= 20 && told.time[end - 1] - told.time[k] >= HOLD_S;
        let everything = end - k > n * 3 / 4;
        if long && !everything && x[k] != 0.0 {
            told.fault(k, end - 1, "frozen or clipped".to_owned());
            usable[k..end].fill(false);
        }
        k = end;
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
