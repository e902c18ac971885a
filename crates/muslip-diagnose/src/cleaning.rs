//! Values that cannot be used: found, told, and replaced for the sake of their neighbours.

use core::ops::Range;

use crate::series::DataFault;
use crate::smooth::difference_sigma;

/// Anything larger is no measurement.
const ABSURD: f64 = 1e15;
/// Longest run of missing values that is bridged by a straight line, in samples.
const BRIDGE: usize = 4;

/// Cleans one channel: absurd values, spikes, short gaps. Returns the cleaned values and whether each
/// sample may be used.
pub(crate) fn clean(
    name: &str,
    channel: &str,
    time: &[f64],
    values: &[f64],
    faults: &mut Vec<DataFault>,
) -> (Vec<f64>, Vec<bool>) {
    let n = values.len();
    let mut x: Vec<f64> = values
        .iter()
        .map(|v| if v.abs() < ABSURD { *v } else { f64::NAN })
        .collect();
    let mut report = |from: usize, to: usize, what: String| {
        faults.push(DataFault {
            recording: name.to_owned(),
            channel: channel.to_owned(),
            start_s: time.get(from).copied().unwrap_or(0.0),
            end_s: time.get(to).copied().unwrap_or(0.0),
            what,
        });
    };
    let absurd: Vec<usize> = (0..n)
        .filter(|&k| !values[k].is_nan() && !x[k].is_finite())
        .collect();
    if let (Some(&first), Some(&last)) = (absurd.first(), absurd.last()) {
        report(
            first,
            last,
            format!("{} values beyond any measurement", absurd.len()),
        );
    }
    // Spikes: far from the median of four neighbours, by the noise and by the neighbours' own spread.
    let sigma = difference_sigma(&x);
    let mut spikes = Vec::new();
    if sigma > 0.0 && n >= 7 {
        let original = x.clone();
        for k in 2..n - 2 {
            if !original[k].is_finite() {
                continue;
            }
            let mut near = [
                original[k - 2],
                original[k - 1],
                original[k + 1],
                original[k + 2],
            ];
            if near.iter().any(|v| !v.is_finite()) {
                continue;
            }
            near.sort_by(f64::total_cmp);
            let centre = 0.5 * (near[1] + near[2]);
            let spread = near[3] - near[0];
            if (original[k] - centre).abs() > 7.0 * sigma + 3.0 * spread {
                spikes.push(k);
            }
        }
        for &k in &spikes {
            x[k] = f64::NAN;
        }
        if let (Some(&first), Some(&last)) = (spikes.first(), spikes.last()) {
            let outliers = match spikes.len() {
                1 => "1 isolated outlier".to_owned(),
                many => format!("{many} isolated outliers"),
            };
            report(first, last, outliers);
        }
    }
    // Frozen: the very same non-zero value for long, in a channel that otherwise moves.
    let moving = sigma > 0.0;
    let mut usable = vec![true; n];
    let hold = 0.08_f64;
    let mut k = 0;
    while k < n {
        let mut end = k + 1;
        while end < n && x[end] == x[k] && x[k].is_finite() {
            end += 1;
        }
        let long = end - k >= 20 && time[end - 1] - time[k] >= hold;
        let everything = end - k > n * 3 / 4;
        if moving && long && !everything && x[k] != 0.0 {
            report(k, end - 1, "frozen or clipped".to_owned());
            usable[k..end].fill(false);
        }
        k = end;
    }
    // Bridge what is missing.
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
        report(from, to - 1, what);
    }
    (x, usable)
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
