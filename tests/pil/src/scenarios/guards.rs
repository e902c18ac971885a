//! What guards arming, a run without a fault, and the way out of a fault.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use muslip_control::brake::BrakeOutput;
use muslip_control::interlock::DISAGREEING_MS;
use muslip_control::stop::DIFFERING_MS;
use muslip_record::{Answer, Command, Fault, Profile, Program, Refusal, State, Status};

use super::{Found, LAW, RAMP};
use crate::bench::{Bench, Worst};

fn status(bench: &mut Bench) -> Result<Status> {
    bench.must(Command::ReadStatus)?;
    bench.host.heard.status.context("no status")
}

fn refused(refusal: Refusal) -> Answer {
    Answer::Refused(refusal)
}

/// Channels of the emergency stop that differ for more than 100 ms, told sample by sample; then no arming until both
/// have been worked again.
fn stop_channels(bench: &mut Bench) -> Result<u64> {
    bench.run(50)?;
    bench.rig.trouble.emergency_stop = [false, true];
    let before = bench.samples;
    let stands = 1 << Fault::StopChannels as u32;
    let mut told = None;
    while told.is_none() {
        let status = status(bench)?;
        let samples = u64::from(status.tick) - before;
        let expected = samples > u64::from(DIFFERING_MS);
        ensure!(
            (status.standing & stands != 0) == expected,
            "after {samples} samples: {status:?}"
        );
        told = expected.then_some(samples);
    }
    bench.rig.trouble.emergency_stop = [false; 2];
    bench.run(5)?;
    let answer = bench.say(Command::Arm)?;
    ensure!(answer == refused(Refusal::StopUntested), "{answer:?}");
    for open in [[true; 2], [false; 2]] {
        bench.rig.trouble.emergency_stop = open;
        bench.run(5)?;
    }
    bench.must(Command::Arm)?;
    bench.must(Command::Stop)?;
    bench.run(5)?;
    Ok(told.unwrap_or_default())
}

/// A wheel that rolls freely on a radius 10 % off: a fault 2 s after it began, while the run waits for it to roll.
fn speeds_disagree(bench: &mut Bench) -> Result<u64> {
    bench.begin(RAMP)?;
    bench.rig.trouble.wheel_rad_s = Some(0.9 * 20.0 / 0.31);
    let before = bench.samples;
    while bench.state() != State::Fault {
        bench.sample()?;
        ensure!(bench.brake == BrakeOutput::DUMPED);
        ensure!(bench.samples < before + 2_100, "{:?}", bench.state());
    }
    let waited = bench.samples - before;
    ensure!(waited == u64::from(DISAGREEING_MS) + 1, "{waited}");
    let latched = status(bench)?.fault;
    ensure!(latched == Some(Fault::SpeedsDisagree), "{latched:?}");
    bench.rig.trouble.wheel_rad_s = None;
    Ok(waited)
}

/// A fault is not left from afar: not without the button, not with one that was pressed all the time.
fn confirmed_at_the_rig(bench: &mut Bench) -> Result<()> {
    bench.run(50)?;
    let not_confirmed = refused(Refusal::NotConfirmed);
    ensure!(bench.say(Command::ClearFault)? == not_confirmed);
    bench.rig.trouble.confirm = true;
    bench.run(5)?;
    bench.rig.trouble.confirm = false;
    bench.run(5)?;
    bench.must(Command::ClearFault)?;
    // Held down before a fault, it says nothing of that fault.
    bench.must(Command::Arm)?;
    bench.rig.trouble.confirm = true;
    bench.run(5)?;
    bench.rig.trouble.emergency_stop = [true; 2];
    bench.run(5)?;
    bench.rig.trouble.emergency_stop = [false; 2];
    bench.run(5)?;
    ensure!(bench.say(Command::ClearFault)? == not_confirmed);
    Ok(())
}

/// Slip that has no meaning, with the brake at work: dumped, and no fault of it.
fn undefined_slip(image: &Path, worst: &mut Worst) -> Result<u64> {
    let mut bench = Bench::start(image, LAW, 14)?;
    bench.begin(Profile {
        program: Program::Ramp { demand_per_s: 0.2 },
        ..RAMP
    })?;
    bench.until(State::Ramp, 1_000)?;
    bench.run(200)?;
    ensure!(bench.brake.hold_pressure);
    // The wheel is faster than the vehicle, by more than noise can make it.
    bench.rig.trouble.wheel_rad_s = Some(1.12 * 20.0 / 0.31);
    let before = bench.samples;
    while bench.brake.hold_pressure {
        bench.sample()?;
        ensure!(bench.samples < before + 10, "the brake is not dumped");
    }
    let samples = bench.samples - before;
    bench.run(5)?;
    let status = status(&mut bench)?;
    ensure!(
        status.fault.is_none() && status.state == State::Release,
        "{status:?}"
    );
    *worst = worst.most(bench.worst);
    Ok(samples)
}

/// The guards that are no dump in the middle of braking.
pub fn guards(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 13)?;
    let differing = stop_channels(&mut bench)?;
    let disagreeing = speeds_disagree(&mut bench)?;
    confirmed_at_the_rig(&mut bench)?;
    let mut worst = bench.worst;
    let undefined = undefined_slip(image, &mut worst)?;
    Ok(Found {
        line: format!(
            "StopChannels not up to 100 samples and told at {differing}; SpeedsDisagree after {disagreeing}; dumped {undefined} after slip lost its meaning; no fault left from afar"
        ),
        worst,
    })
}
