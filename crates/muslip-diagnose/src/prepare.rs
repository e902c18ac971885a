//! From a recorded run to what the models run on: cleaned, smoothed, with derived variables.
//!
//! Nothing is deleted: a value that cannot be used is replaced for the sake of its neighbours and its
//! sample taken out of the balances that it would have entered; what was found is a [`DataFault`].

use core::ops::Range;

use crate::campaign::{Rig, Run};
use crate::cleaning::{clean, stretches};
use crate::series::{Channel, DataFault, GAP_STEPS, Series};
use crate::smooth::{Smoothed, difference_sigma, median_in_place, smooth};
use crate::turn;

/// Slowest speed at which slip is defined, in m/s.
const MIN_SPEED: f64 = 0.5;
/// Smallest usable normal force as a share of the recording's median.
const MIN_LOAD_SHARE: f64 = 0.02;
/// Longest half-window of the smoother in s.
const MAX_REACH_S: f64 = 0.04;
/// Shortest half-window of the smoother in samples: a derivative needs neighbours.
const LEAST_REACH: f64 = 1.2;
/// Largest factor by which the windows are widened where slip is noisy.
pub const MOST_REACH: f64 = 4.0;

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
pub fn mean_about(time: &[f64], x: &[f64], segments: &[Range<usize>], reach: f64) -> Vec<f64> {
    let mut out = x.to_vec();
    let mut sums = vec![0.0; x.len() + 1];
    for (k, v) in x.iter().enumerate() {
        sums[k + 1] = sums[k] + if v.is_finite() { *v } else { 0.0 };
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
pub fn mean_twice_about(
    time: &[f64],
    x: &[f64],
    segments: &[Range<usize>],
    reach: f64,
) -> Vec<f64> {
    let once = mean_about(time, x, segments, reach);
    mean_about(time, &once, segments, reach)
}

/// Prepares one run. `extra_names` fixes the order of the other columns over the campaign, `reach_factor`
/// (1..=[`MOST_REACH`]) widens the smoothing windows.
#[must_use]
pub fn prepare(
    rig: &Rig,
    run: &Run,
    extra_names: &[String],
    index: usize,
    reach_factor: f64,
) -> (Series, Vec<DataFault>) {
    let mut faults = Vec::new();
    let time = &run.time_s;
    let n = time.len();
    let name = run.name.as_str();
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let typical_dt = if steps.is_empty() {
        1.0
    } else {
        median_in_place(&mut steps)
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
    let (omega, omega_ok) = clean(
        name,
        "wheel_speed_rad_s",
        time,
        &run.wheel_speed_rad_s,
        &mut faults,
    );
    let (v, v_ok) = clean(
        name,
        "vehicle_speed_m_s",
        time,
        &run.vehicle_speed_m_s,
        &mut faults,
    );
    let (load, load_ok) = clean(
        name,
        "normal_force_n",
        time,
        &run.normal_force_n,
        &mut faults,
    );
    let has_drag = run.drag_force_n.len() == n && n > 0;
    let (drag, mut drag_ok) = if has_drag {
        clean(name, "drag_force_n", time, &run.drag_force_n, &mut faults)
    } else {
        (Vec::new(), vec![false; n])
    };
    // A drag channel frozen at its own extreme clips: that is the channel's physics
    // (`force_saturation`), reported as a fault of the data but kept for the fit.
    if has_drag {
        let largest = drag.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for k in 0..n {
            if !drag_ok[k]
                && run.drag_force_n[k].is_finite()
                && drag[k] >= largest * (1.0 - 1e-9)
                && largest > 0.0
            {
                drag_ok[k] = true;
            }
        }
    }
    let commanded = match (&run.brake_pressure_pa, rig.torque_per_pressure_nm_pa) {
        (Some(p), Some(gain)) if p.iter().any(|x| x.is_finite()) => Some((
            "brake_pressure_pa",
            p.iter().map(|x| x * gain).collect::<Vec<f64>>(),
        )),
        _ => None,
    };
    let brake = commanded.or_else(|| {
        run.brake_torque_nm
            .as_ref()
            .filter(|t| t.iter().any(|x| x.is_finite()))
            .map(|t| ("brake_torque_nm", t.clone()))
    });
    let brake = brake.map(|(column, values)| clean(name, column, time, &values, &mut faults));

    let finite = |k: usize| omega[k].is_finite() && v[k].is_finite() && load[k].is_finite();
    let continuous = stretches(finite, &breaks, 3);
    let omega_sigma = difference_sigma(&omega);
    let v_sigma = difference_sigma(&v);
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
    let wheel = channel(time, omega, &continuous, omega_sigma, &reach);
    let speed = channel(time, v, &continuous, v_sigma, &slow_reach);
    let load = channel(time, load, &continuous, load_sigma, &reach);
    let torque = brake.map(|(values, ok)| {
        let sigma = difference_sigma(&values);
        let finite_stretches = stretches(|k| values[k].is_finite(), &breaks, 3);
        (channel(time, values, &finite_stretches, sigma, &reach), ok)
    });
    let (drag_sigma, drag_smooth) = if has_drag {
        let sigma = difference_sigma(&drag);
        let finite_stretches = stretches(|k| drag[k].is_finite(), &breaks, 3);
        (
            sigma,
            smooth(time, &drag, &finite_stretches, sigma, &reach).value,
        )
    } else {
        (0.0, Vec::new())
    };

    let mut loads: Vec<f64> = load
        .smooth
        .iter()
        .copied()
        .filter(|x| x.is_finite())
        .collect();
    let minimum_load = MIN_LOAD_SHARE * median_in_place(&mut loads).abs();
    let still: Vec<bool> = (0..n)
        .map(|k| {
            let slow = 0.02_f64
                .max(3.0 * v_sigma * speed.variance_share[k].sqrt())
                .min(0.2);
            speed.smooth[k].abs() < slow
                && wheel.smooth[k].abs() * rig.radius_m < slow.max(3.0 * omega_sigma * rig.radius_m)
        })
        .collect();
    let rolling: Vec<bool> = (0..n)
        .map(|k| {
            speed.smooth[k] >= MIN_SPEED && load.smooth[k] >= minimum_load && load.smooth[k] > 0.0
        })
        .collect();
    let slip_sane = |k: usize| {
        let v = speed.smooth[k];
        let s = (v - rig.radius_m * wheel.smooth[k]) / v;
        (-0.3..=1.3).contains(&s)
    };
    let base_ok = |k: usize| {
        finite_at(&wheel.smooth, &speed.smooth, &load.smooth, k) && omega_ok[k] && v_ok[k]
    };
    let tyre = stretches(
        |k| base_ok(k) && load_ok[k] && drag_ok[k] && (still[k] || (rolling[k] && slip_sane(k))),
        &breaks,
        10,
    );
    let wheel_balance = match &torque {
        Some((t, ok)) => stretches(
            |k| {
                base_ok(k) && drag_ok[k] && ok[k] && t.smooth[k].is_finite() && speed.smooth[k] >= MIN_SPEED
                // A locked wheel's brake torque is whatever holds it: the balance says nothing.
                && wheel.smooth[k].abs() * rig.radius_m > 0.02 * speed.smooth[k]
            },
            &breaks,
            10,
        ),
        None => Vec::new(),
    };
    let vehicle_balance = if rig.coasting {
        stretches(
            |k| base_ok(k) && drag_ok[k] && speed.smooth[k] >= MIN_SPEED,
            &breaks,
            10,
        )
    } else {
        Vec::new()
    };
    let mut distance = vec![0.0; n];
    let mut angle = vec![0.0; n];
    for k in 1..n {
        let step = |c: &[f64]| {
            let mean = 0.5 * (c[k] + c[k - 1]);
            if mean.is_finite() { mean * dt[k] } else { 0.0 }
        };
        distance[k] = distance[k - 1] + step(&speed.smooth);
        angle[k] = angle[k - 1] + step(&wheel.smooth);
    }
    let extra = extra_names
        .iter()
        .map(|wanted| {
            run.extra
                .iter()
                .find(|(column, _)| column == wanted)
                .map_or_else(
                    || vec![f64::NAN; n],
                    |(column, values)| {
                        let mut quiet = Vec::new();
                        let (x, _) = clean(name, column, time, values, &mut quiet);
                        faults.extend(quiet.into_iter().filter(|f| f.what.contains("all values")));
                        x
                    },
                )
        })
        .collect();
    let wheel_smoothing = turn::smoothing(&angle, &wheel.raw, &wheel.smooth, &rolling);
    let series = Series {
        name: run.name.clone(),
        time: time.clone(),
        dt,
        typical_dt,
        wheel,
        speed,
        load,
        drag,
        drag_smooth,
        drag_sigma,
        beside_law: Vec::new(),
        torque: torque.map(|(c, _)| c),
        distance,
        angle,
        wheel_smoothing,
        still,
        rolling,
        tyre,
        wheel_balance,
        vehicle_balance,
        extra,
        index,
    };
    (series, faults)
}

fn finite_at(a: &[f64], b: &[f64], c: &[f64], k: usize) -> bool {
    a[k].is_finite() && b[k].is_finite() && c[k].is_finite()
}
