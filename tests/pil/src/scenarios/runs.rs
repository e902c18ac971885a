//! Runs with the simulator in the loop.

use std::path::Path;

use anyhow::{Result, bail, ensure};
use muslip_control::brake::BrakeOutput;
use muslip_record::{Event, Parameters, Profile, Program, STEPS, State};

use super::{Found, LAW, RAMP, found};
use crate::bench::{Bench, Worst};

/// Two ramps: the skid is found and released, the estimate is near the truth and the same as natively.
pub fn ramps(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 2)?;
    bench.begin(RAMP)?;
    bench.until(State::Done, 12_000)?;
    let states: Vec<State> = bench
        .host
        .heard
        .events
        .iter()
        .filter_map(|(_, event)| match event {
            Event::StateChanged { to, .. } => Some(*to),
            _ => None,
        })
        .collect();
    use State::{Armed, Cool, Done, Ramp, Release, Skid, SpinUp};
    ensure!(
        states
            == [
                Armed, SpinUp, Ramp, Skid, Release, Cool, SpinUp, Ramp, Skid, Release, Cool, Done
            ],
        "{states:?}"
    );
    let Some(estimate) = bench.host.heard.estimate else {
        bail!("no estimate");
    };
    let (friction, slip) = (estimate.peak_friction, estimate.critical_slip);
    ensure!(
        (friction - 0.85).abs() < 0.02 && (slip - 0.14).abs() < 0.01,
        "{estimate:?}"
    );
    ensure!(bench.estimates_compared > 300);
    Ok(found(
        &bench,
        format!(
            "peak {friction:.4} at slip {slip:.4} (true 0.85, 0.14) from {} updates; {} samples and {} estimates equal natively bit for bit",
            estimate.updates, bench.samples, bench.estimates_compared
        ),
    ))
}

/// The wheel locks, is held for the longest time that a profile may ask for, and rolls again: no interlock takes
/// that for a fault.
pub fn full_lock(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 11)?;
    bench.begin(Profile {
        skid_slip: 0.97,
        skid_hold_s: 0.15,
        ..RAMP
    })?;
    let mut locked = 0;
    while bench.state() != State::Done {
        bench.sample()?;
        locked += u32::from(bench.rig.slip_ratio() >= 1.0);
        ensure!(
            bench.state() != State::Fault && bench.samples < 12_000,
            "{:?}",
            bench.host.heard.events
        );
    }
    ensure!((200..400).contains(&locked), "{locked} samples locked");
    Ok(found(
        &bench,
        format!("locked for {locked} ms in two applications, no fault"),
    ))
}

/// Stepped holds short of the peak: no skid, every level held.
pub fn steps(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 3)?;
    let mut levels = [0.0; STEPS];
    for (level, share) in levels.iter_mut().zip([0.1, 0.2, 0.3, 0.4]) {
        *level = share;
    }
    bench.begin(Profile {
        program: Program::Steps {
            levels,
            count: 4,
            hold_s: 0.25,
        },
        applications: 1,
        ..RAMP
    })?;
    bench.until(State::Ramp, 1_000)?;
    let mut held = Vec::new();
    while bench.state() == State::Ramp {
        bench.sample()?;
        if bench.brake.hold_pressure && held.last() != Some(&bench.brake.valve_duty) {
            held.push(bench.brake.valve_duty);
        }
    }
    bench.until(State::Done, 2_000)?;
    let brake = Parameters::default().brake;
    let wanted: Vec<u16> = levels
        .iter()
        .take(4)
        .map(|&level| BrakeOutput::for_demand(level, &brake).valve_duty)
        .collect();
    ensure!(held == wanted, "{held:?} instead of {wanted:?}");
    Ok(found(&bench, format!("{} levels held", held.len())))
}

/// Slip held below and near the peak: it converges, stays, and the wheel does not skid.
pub fn slip_hold(image: &Path) -> Result<Found> {
    let mut lines = Vec::new();
    let mut worst = Worst::default();
    for target_slip in [0.05, 0.1] {
        let mut bench = Bench::start(image, LAW, 10)?;
        bench.begin(Profile {
            program: Program::SlipHold {
                target_slip,
                hold_s: 2.0,
            },
            applications: 1,
            ..RAMP
        })?;
        bench.until(State::Ramp, 1_000)?;
        let mut slips = Vec::new();
        while bench.state() == State::Ramp {
            bench.sample()?;
            slips.push(bench.rig.slip_ratio());
        }
        ensure!(bench.state() == State::Release, "{:?}", bench.state());
        ensure!(slips.len() > 1_900, "{} samples", slips.len());
        let target = f64::from(target_slip);
        let settled = slips
            .iter()
            .rposition(|slip| (slip / target - 1.0).abs() > 0.2);
        let last = slips.iter().rev().skip(50).take(1_000);
        let (count, sum, largest) = last.fold((0.0, 0.0, 0.0_f64), |(n, sum, largest), slip| {
            (n + 1.0, sum + slip, largest.max((slip - target).abs()))
        });
        let mean = sum / count;
        let settled = settled.unwrap_or(0);
        ensure!(
            settled < 1_000,
            "slip {target} is only within 20 % from {settled} ms on"
        );
        ensure!(
            (mean / target - 1.0).abs() < 0.05,
            "mean {mean} for {target}"
        );
        let Some(estimate) = bench.host.heard.quarter_car else {
            bail!("no estimate of the quarter car");
        };
        let [_, speed, _, _, mass] = estimate.state;
        ensure!(
            (speed - 20.0).abs() < 0.1 && (mass - 420.0).abs() < 10.0,
            "{estimate:?}"
        );
        lines.push(format!("{target_slip}: within 20 % after {settled} ms, then mean {mean:.4}, at most {largest:.4} off"));
        worst = worst.most(bench.worst);
    }
    Ok(Found {
        line: lines.join("; "),
        worst,
    })
}
