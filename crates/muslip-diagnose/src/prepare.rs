//! From a recorded run to what the models run on: cleaned, smoothed, with derived variables.
//!
//! Nothing is deleted: a value that cannot be used is replaced for the sake of its neighbours and its
//! sample taken out of the balances that it would have entered; what was found is a [`DataFault`].

use core::ops::Range;

use crate::campaign::{Rig, Run};
use crate::cleaning::{clean, stretches};
use crate::number::Number;
use crate::series::{Channel, DataFault, GAP_STEPS, Series};
use crate::slip::slip;
use crate::smooth::{Smoothed, difference_sigma, median_in_place, noise_sigma, smooth};
use crate::turn;

/// Slowest speed at which slip is defined, in m/s.
const MIN_SPEED: f64 = 0.5;
/// Smallest usable normal force as a share of the recording's median.
const MIN_LOAD_SHARE: f64 = 0.02;
/// Longest half-window of the smoother in s.
const MAX_REACH_S: f64 = 0.04;
/// Shortest half-window of the smoother in samples: a derivative needs neighbours.
const LEAST_REACH: f64 = 1.2;
/// Factors by which the smoother's windows may be widened.
pub const REACH_FACTORS: [f64; 3] = [1.0, 2.0, 4.0];

/// Reach in s of the means of the wheel's speed that leave in it what makes a load cell ring: two fifths of what swings at a
/// quarter of its inverse.
pub const BRISK_S: f64 = 0.003;
/// Reach of the means that leave the slow part of a channel, in s.
const SLOW_REACH_S: f64 = 0.08;

fn channel(
    time: &[f64],
    raw: Vec<f64>,
    segments: &[Range<usize>],
    sigma: f64,
    reach: &[f64],
) -> Channel {
    let Smoothed {
        value,
        rate,
        variance_share,
    } = smooth(time, &raw, segments, sigma, reach);
    // One step further in the direction of more smoothing: a triangle over a quarter of the reach.
    let mut smoother = value.clone();
    for segment in segments {
        for k in segment.clone() {
            let quarter = 0.25 * reach[k];
            let (mut sum, mut total) = (value[k], 1.0);
            let mut step = 1;
            loop {
                let back = k.checked_sub(step).filter(|j| *j >= segment.start);
                let ahead = Some(k + step).filter(|j| *j < segment.end);
                let (Some(b), Some(a)) = (back, ahead) else {
                    break;
                };
                let distance = 0.5 * (time[a] - time[b]);
                if distance >= quarter {
                    break;
                }
                let w = 1.0 - distance / quarter;
                sum += w * (value[a] + value[b]);
                total += 2.0 * w;
                step += 1;
            }
            smoother[k] = sum / total;
        }
    }
    let slow = mean_twice_about(time, &value, segments, SLOW_REACH_S);
    Channel {
        raw,
        smooth: value,
        smoother,
        rate,
        slow,
        sigma,
        variance_share,
    }
}

/// Mean over so many seconds on either side, as many samples on one as on the other; the ends keep what they have.
#[must_use]
pub fn mean_about<T: Number>(
    time: &[f64],
    x: &[T],
    segments: &[Range<usize>],
    reach: f64,
) -> Vec<T> {
    let mut out = x.to_vec();
    let nothing = T::constant(0.0);
    let mut sums = vec![nothing; x.len() + 1];
    for (k, v) in x.iter().enumerate() {
        sums[k + 1] = sums[k] + if v.value().is_finite() { *v } else { nothing };
    }
    for segment in segments {
        let Some(last) = segment.clone().last() else {
            continue;
        };
        let span = time[last] - time[segment.start];
        if !(span > 0.0) {
            continue;
        }
        let samples = (reach * (segment.len() - 1) as f64 / span) as usize;
        for k in segment.clone() {
            let half = samples.min(k - segment.start).min(last - k);
            out[k] = (sums[k + half + 1] - sums[k - half]) / (2 * half + 1) as f64;
        }
    }
    out
}

/// The mean of [`mean_about`], taken twice: weights that fall off to both sides.
#[must_use]
pub fn mean_twice_about<T: Number>(
    time: &[f64],
    x: &[T],
    segments: &[Range<usize>],
    reach: f64,
) -> Vec<T> {
    let once = mean_about(time, x, segments, reach);
    mean_about(time, &once, segments, reach)
}

/// Prepares one run. `extra_names` fixes the order of the other columns over the campaign, `reach_factor`,
/// one of [`REACH_FACTORS`], widens the smoothing windows.
#[must_use]
pub fn prepare(
    rig: &Rig,
    run: &Run,
    extra_names: &[String],
    index: usize,
    reach_factor: f64,
) -> (Series, Vec<DataFault>) {
    let mut faults = Vec::new();
    let (name, time) = (run.name.as_str(), &run.time_s);
    let n = time.len();
    let Steps {
        typical_dt,
        dt,
        breaks,
    } = steps(name, time, &mut faults);
    let mut cleaned = |column: &str, values: &[f64]| clean(name, column, time, values, &mut faults);
    let (omega, omega_ok) = cleaned("wheel_speed_rad_s", &run.wheel_speed_rad_s);
    let (v, v_ok) = cleaned("vehicle_speed_m_s", &run.vehicle_speed_m_s);
    let (load, load_ok) = cleaned("normal_force_n", &run.normal_force_n);
    let has_drag = run.drag_force_n.len() == n && n > 0;
    let (drag, mut drag_ok) = if has_drag {
        cleaned("drag_force_n", &run.drag_force_n)
    } else {
        (Vec::new(), vec![false; n])
    };
    if has_drag {
        keep_clipped(&run.drag_force_n, &drag, &mut drag_ok);
    }
    let brake = brake(rig, run).map(|(column, values)| cleaned(column, &values));

    let finite = |k: usize| omega[k].is_finite() && v[k].is_finite() && load[k].is_finite();
    let continuous = stretches(finite, &breaks, 3);
    let [omega_sigma, v_sigma] = [&omega, &v].map(|x| noise_sigma(time, x, typical_dt));
    let load_sigma = difference_sigma(&load);
    // No window may average over more than a sixth of a wheel revolution on either side.
    let reach: Vec<f64> = (0..n)
        .map(|k| {
            let revolution = core::f64::consts::TAU / omega[k].abs().max(1.0);
            let reach = MAX_REACH_S.min(revolution / 6.0).max(2.2 * typical_dt);
            (reach_factor * reach).max(LEAST_REACH * typical_dt)
        })
        .collect();
    let slow = (2.0 * MAX_REACH_S).max(4.2 * typical_dt);
    let slow_reach: Vec<f64> = vec![(reach_factor * slow).max(LEAST_REACH * typical_dt); n];
    let own_stretches = |x: &[f64]| stretches(|k| x[k].is_finite(), &breaks, 3);
    let (torque, brake_ok) = brake.map_or((None, Vec::new()), |(values, ok)| {
        let sigma = difference_sigma(&values);
        let segments = own_stretches(&values);
        (Some(channel(time, values, &segments, sigma, &reach)), ok)
    });
    let (drag_sigma, drag_smooth) = if has_drag {
        let sigma = difference_sigma(&drag);
        let smoothed = smooth(time, &drag, &own_stretches(&drag), sigma, &reach);
        (sigma, smoothed.value)
    } else {
        (0.0, Vec::new())
    };
    let mut series = Series {
        name: run.name.clone(),
        time: time.clone(),
        typical_dt,
        wheel: channel(time, omega, &continuous, omega_sigma, &reach),
        speed: channel(time, v, &continuous, v_sigma, &slow_reach),
        load: channel(time, load, &continuous, load_sigma, &reach),
        drag,
        drag_smooth,
        drag_sigma,
        torque,
        index,
        ..Series::default()
    };
    let sound = Sound {
        wheel: omega_ok,
        speed: v_ok,
        load: load_ok,
        drag: drag_ok,
        brake: brake_ok,
    };
    classify(&mut series, rig);
    faults.extend(too_slow(&series));
    form_balances(&mut series, rig, &sound, &breaks);
    let known = counted(time, &series.still, &breaks, &dt);
    series.distance = travelled(&series.speed.smooth, &known);
    series.angle = travelled(&series.wheel.smooth, &known);
    series.dt = dt;
    let wheel = &series.wheel;
    series.wheel_smoothing =
        turn::smoothing(&series.angle, &wheel.raw, &wheel.smooth, &series.rolling);
    series.extra = extra_names
        .iter()
        .map(|wanted| extra(run, wanted, &mut faults))
        .collect();
    (series, faults)
}

/// The steps of a recording's time.
struct Steps {
    typical_dt: f64,
    dt: Vec<f64>,
    /// Whether a gap lies before the sample.
    breaks: Vec<bool>,
}

fn steps(name: &str, time: &[f64], faults: &mut Vec<DataFault>) -> Steps {
    let n = time.len();
    let mut all: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let typical_dt = if all.is_empty() {
        1.0
    } else {
        median_in_place(&mut all)
    };
    let mut dt = vec![typical_dt; n];
    let mut breaks = vec![false; n];
    for k in 1..n {
        dt[k] = time[k] - time[k - 1];
        breaks[k] = dt[k] > GAP_STEPS * typical_dt;
        if breaks[k] && dt[k] > 0.1 {
            faults.push(DataFault {
                recording: name.to_owned(),
                channel: "time_s".to_owned(),
                start_s: time[k - 1],
                end_s: time[k],
                what: format!("gap of {:.3} s", dt[k]),
            });
        }
    }
    if n > 1 {
        dt[0] = dt[1];
    }
    Steps {
        typical_dt,
        dt,
        breaks,
    }
}

/// A drag channel frozen at its own extreme clips: that is the channel's physics (`force_saturation`), reported as a
/// fault of the data but kept for the fit.
fn keep_clipped(recorded: &[f64], drag: &[f64], usable: &mut [bool]) {
    let largest = drag.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for ((usable, recorded), drag) in usable.iter_mut().zip(recorded).zip(drag) {
        let clipped = recorded.is_finite() && *drag >= largest * (1.0 - 1e-9) && largest > 0.0;
        *usable |= clipped;
    }
}

/// Brake torque by column: the commanded pressure's where there is one, else as recorded.
fn brake(rig: &Rig, run: &Run) -> Option<(&'static str, Vec<f64>)> {
    let known = |x: &&Vec<f64>| x.iter().any(|x| x.is_finite());
    let pressure = run.brake_pressure_pa.as_ref().filter(known);
    if let (Some(pressure), Some(gain)) = (pressure, rig.torque_per_pressure_nm_pa) {
        let torque = pressure.iter().map(|x| x * gain).collect();
        return Some(("brake_pressure_pa", torque));
    }
    let torque = run.brake_torque_nm.as_ref().filter(known)?;
    Some(("brake_torque_nm", torque.clone()))
}

/// Another column, cleaned; told of is only one that says nothing at all.
fn extra(run: &Run, wanted: &str, faults: &mut Vec<DataFault>) -> Vec<f64> {
    let Some((column, values)) = run.extra.iter().find(|(column, _)| column == wanted) else {
        return vec![f64::NAN; run.time_s.len()];
    };
    let mut own = Vec::new();
    let (x, _) = clean(&run.name, column, &run.time_s, values, &mut own);
    faults.extend(own.into_iter().filter(|f| f.what.contains("all values")));
    x
}

/// Where the wheel stands still and where it rolls.
fn classify(series: &mut Series, rig: &Rig) {
    let (wheel, speed, load) = (&series.wheel, &series.speed, &series.load);
    let mut loads: Vec<f64> = load.smooth.clone();
    loads.retain(|x| x.is_finite());
    let minimum_load = MIN_LOAD_SHARE * median_in_place(&mut loads).abs();
    let still = |k: usize| {
        let slow = 0.02_f64
            .max(3.0 * speed.sigma * speed.variance_share[k].sqrt())
            .min(0.2);
        speed.smooth[k].abs() < slow
            && wheel.smooth[k].abs() * rig.radius_m < slow.max(3.0 * wheel.sigma * rig.radius_m)
    };
    let rolling = |k: usize| {
        speed.smooth[k] >= MIN_SPEED && load.smooth[k] >= minimum_load && load.smooth[k] > 0.0
    };
    let samples = 0..series.time.len();
    (series.still, series.rolling) = samples.map(|k| (still(k), rolling(k))).unzip();
}

/// A run that moves but never fast enough for a slip.
fn too_slow(series: &Series) -> Option<DataFault> {
    let speeds = series.speed.smooth.iter().copied();
    let fastest = speeds.filter(|v| v.is_finite()).fold(0.0, f64::max);
    (fastest > 0.0 && fastest < MIN_SPEED).then(|| DataFault {
        recording: series.name.clone(),
        channel: "vehicle_speed_m_s".to_owned(),
        start_s: series.time.first().copied().unwrap_or(0.0),
        end_s: series.time.last().copied().unwrap_or(0.0),
        what: format!(
            "never faster than {fastest:.1e} m/s: below {MIN_SPEED} m/s a slip says nothing"
        ),
    })
}

/// Whether each sample of a channel may be used.
struct Sound {
    wheel: Vec<bool>,
    speed: Vec<bool>,
    load: Vec<bool>,
    drag: Vec<bool>,
    /// Empty where there is no brake column.
    brake: Vec<bool>,
}

/// The stretches in which each balance can be formed.
fn form_balances(series: &mut Series, rig: &Rig, sound: &Sound, breaks: &[bool]) {
    let (wheel, speed) = (&series.wheel.smooth, &series.speed.smooth);
    let load = &series.load.smooth;
    let slip_sane = |k: usize| (-0.3..=1.3).contains(&slip(rig.radius_m, wheel[k], speed[k]));
    let base_ok = |k: usize| {
        let finite = wheel[k].is_finite() && speed[k].is_finite() && load[k].is_finite();
        finite && sound.wheel[k] && sound.speed[k]
    };
    let formed = |ok: &dyn Fn(usize) -> bool| stretches(ok, breaks, 10);
    let tyre = formed(&|k| {
        let known = series.still[k] || (series.rolling[k] && slip_sane(k));
        base_ok(k) && sound.load[k] && sound.drag[k] && known
    });
    let wheel_balance = series.torque.as_ref().map_or(Vec::new(), |torque| {
        formed(&|k| {
            // A locked wheel's brake torque is whatever holds it: the balance says nothing.
            let turning = wheel[k].abs() * rig.radius_m > 0.02 * speed[k];
            let known = sound.drag[k] && sound.brake[k] && torque.smooth[k].is_finite();
            base_ok(k) && known && speed[k] >= MIN_SPEED && turning
        })
    });
    let vehicle_balance = if rig.coasting {
        formed(&|k| base_ok(k) && sound.drag[k] && speed[k] >= MIN_SPEED)
    } else {
        Vec::new()
    };
    series.tyre = tyre;
    series.wheel_balance = wheel_balance;
    series.vehicle_balance = vehicle_balance;
}

/// Time in s before a gap within which a vehicle is seen to stand: one sample of a noisy speed at the end of a stretch says
/// little.
const STOOD_S: f64 = 0.2;

/// Steps of time over which a way is known: how far a vehicle came in a gap that begins at a standstill, nobody recorded, so
/// its way counts from there on.
fn counted(time: &[f64], still: &[bool], breaks: &[bool], dt: &[f64]) -> Vec<f64> {
    let mut known = dt.to_vec();
    for k in (1..dt.len()).filter(|k| breaks[*k]) {
        let before = (0..k).rev();
        let stood = before
            .take_while(|j| time[k - 1] - time[*j] < STOOD_S)
            .any(|j| still[j]);
        if stood {
            known[k] = 0.0;
        }
    }
    known
}

/// What a rate has come to since the first sample.
fn travelled(rate: &[f64], dt: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    (0..rate.len())
        .map(|k| {
            if k > 0 {
                let mean = 0.5 * (rate[k] + rate[k - 1]);
                sum += if mean.is_finite() { mean * dt[k] } else { 0.0 };
            }
            sum
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_counts_from_where_a_vehicle_that_stood_is_recorded_moving() {
        let dt = [0.1, 0.1, 3.0, 0.1, 3.0];
        let gap = dt.map(|dt| dt > 1.0);
        let way = |still: [bool; 5], speed: [f64; 5]| {
            let time = [0.0, 0.1, 3.1, 3.2, 6.2];
            let all = travelled(&speed, &counted(&time, &still, &gap, &dt));
            *all.last().unwrap()
        };
        let stood = [true, true, false, false, false];
        // 0.2 m in the step at 2 m/s, and 6 m in a gap at that speed, which it drove through.
        let speed = [0.0, 0.0, 2.0, 2.0, 2.0];
        assert!((way(stood, speed) - 6.2).abs() < 1e-12);
        assert!((way([false; 5], [2.0; 5]) - 12.4).abs() < 1e-12);
        // The last sample before the gap seems to move.
        let seems_to_move = [true, false, false, false, false];
        assert!((way(seems_to_move, speed) - 6.2).abs() < 1e-12);
    }
}
