//! What the image must do, one scenario each; an error says what is not as it must be.
#![expect(
    clippy::missing_errors_doc,
    reason = "every scenario's error is its finding"
)]

use std::path::Path;

use anyhow::{Result, bail, ensure};
use muslip_control::board::BridgeQuality;
use muslip_control::brake::BrakeOutput;
use muslip_control::emulation::{FromFirmware, ToFirmware};
use muslip_record::{
    Answer, Command, Event, Fault, PROTOCOL_VERSION, Parameters, Profile, Program, Refusal,
    SCHEMA_HASH, STEPS, State,
};

use crate::bench::{Bench, Worst};
use crate::qemu::Qemu;
use crate::rig::Trouble;

/// Cycles that a sample has at 168 MHz.
pub const CYCLES_PER_SAMPLE: u32 = 168_000;
/// Share of them that the sampling interrupt and the work of a sample may take, in per cent.
pub const WORK_PERCENT: u32 = 20;
/// The road of all scenarios that do not say another.
const LAW: &str = "rudd:0.85,0.14";

const RAMP: Profile = Profile {
    program: Program::Ramp { demand_per_s: 0.8 },
    start_speed_m_s: 15.0,
    skid_slip: 0.5,
    skid_hold_s: 0.05,
    applications: 2,
    cool_s: 0.3,
};

/// What a scenario found, in one line; and the most that anything took.
pub struct Found {
    /// For people.
    pub line: String,
    /// For the budgets.
    pub worst: Worst,
}

fn found(bench: &Bench, line: String) -> Found {
    Found {
        line,
        worst: bench.worst,
    }
}

/// Hello, answers, a status, a foreign profile refused.
pub fn greets(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 1)?;
    bench.run(20)?;
    bench.must(Command::Hello)?;
    let Some(hello) = bench.host.heard.hello else {
        bail!("no hello");
    };
    ensure!(hello.protocol_version == PROTOCOL_VERSION && hello.schema_hash == SCHEMA_HASH);
    ensure!(hello.emulated && hello.core_clock_hz == 168_000_000);
    let bad = Profile {
        skid_hold_s: 0.5,
        ..RAMP
    };
    bench.run(100)?;
    bench.must(Command::Arm)?;
    let refused = bench.say(Command::Start { profile: bad })?;
    ensure!(refused == Answer::Refused(Refusal::Profile), "{refused:?}");
    bench.must(Command::ReadStatus)?;
    ensure!(
        bench
            .host
            .heard
            .status
            .is_some_and(|s| s.state == State::Armed)
    );
    let log = bench.qemu.log()?;
    ensure!(!log.is_empty(), "nothing on the log's UART");
    Ok(found(
        &bench,
        format!("schema {SCHEMA_HASH:08x}, {} bytes of log", log.len()),
    ))
}

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
        worst = most(worst, bench.worst);
    }
    Ok(Found {
        line: lines.join("; "),
        worst,
    })
}

/// One fault injected while the brake is at work.
struct Injection {
    fault: Fault,
    /// Samples from the first on which its condition can hold, as the interlock states it, to the dump.
    within: std::ops::RangeInclusive<u32>,
    inject: fn(&mut Bench),
}

const fn at_once(fault: Fault, inject: fn(&mut Bench)) -> Injection {
    Injection {
        fault,
        within: 1..=1,
        inject,
    }
}

fn trouble(bench: &mut Bench, change: impl FnOnce(&mut Trouble)) {
    change(&mut bench.rig.trouble);
}

/// All faults that a rig or a link can have; watchdog and clock belong to the chip and are tested natively.
fn injections() -> Vec<Injection> {
    vec![
        at_once(Fault::EmergencyStop, |b| {
            trouble(b, |t| t.emergency_stop = true)
        }),
        at_once(Fault::BridgeLost, |b| {
            trouble(b, |t| t.bridge = BridgeQuality::Bad)
        }),
        at_once(Fault::BridgeFrozen, |b| {
            trouble(b, |t| t.bridge = BridgeQuality::Stale)
        }),
        // The fifth time that the codes are the same; the first is the sample before.
        Injection {
            fault: Fault::BridgeFrozen,
            within: 4..=4,
            inject: |b| trouble(b, |t| t.bridge_frozen = true),
        },
        at_once(Fault::BridgeOutOfRange, |b| {
            trouble(b, |t| t.drag_offset_n = 20_000.0)
        }),
        at_once(Fault::NormalForceLost, |b| trouble(b, |t| t.lifted = true)),
        at_once(Fault::BrownOut, |b| trouble(b, |t| t.supply_v = Some(19.9))),
        at_once(Fault::WheelSensorLost, |b| {
            trouble(b, |t| t.wheel_lost = true)
        }),
        at_once(Fault::VehicleSensorLost, |b| {
            trouble(b, |t| t.vehicle_lost = true)
        }),
        // 20 more pulses in a millisecond are 250 rad/s.
        at_once(Fault::Overspeed, |b| {
            trouble(b, |t| t.extra_wheel_pulses = 20)
        }),
        at_once(Fault::WheelSensorOutOfRange, |b| {
            trouble(b, |t| t.extra_wheel_pulses = 5)
        }),
        at_once(Fault::VehicleSensorOutOfRange, |b| {
            trouble(b, |t| t.extra_vehicle_pulses = 2)
        }),
        // The host's last word may be 20 samples old.
        Injection {
            fault: Fault::LinkSilent,
            within: 232..=251,
            inject: |b| b.host.alive = false,
        },
        // Burnt in this sample, found on the next.
        Injection {
            fault: Fault::DeadlineMissed,
            within: 2..=2,
            inject: |b| b.burn = CYCLES_PER_SAMPLE + 1_000,
        },
        // A brake that grabs: the wheel needs some 40 ms to stop and may then stand for 200.
        Injection {
            fault: Fault::WheelLocked,
            within: 200..=300,
            inject: |b| trouble(b, |t| t.stuck_brake_nm = Some(2_500.0)),
        },
    ]
}

/// Every fault dumps the brake on the sample on which its condition holds, and latches.
pub fn interlocks(image: &Path) -> Result<Found> {
    let mut worst = Worst::default();
    let mut lines = Vec::new();
    for injection in injections() {
        let mut bench = Bench::start(image, LAW, 4)?;
        // The skid that ends a ramp would end a lock as well.
        bench.begin(Profile {
            program: Program::Ramp { demand_per_s: 0.2 },
            skid_slip: 1.0,
            ..RAMP
        })?;
        bench.until(State::Ramp, 1_000)?;
        bench.run(200)?;
        ensure!(bench.brake.hold_pressure, "the brake is not at work");
        (injection.inject)(&mut bench);
        let mut samples = 0;
        while bench.brake.hold_pressure {
            bench.sample()?;
            bench.burn = 0;
            samples += 1;
            ensure!(
                samples < 500,
                "{:?}: the brake is not dumped",
                injection.fault
            );
        }
        ensure!(bench.brake == BrakeOutput::DUMPED);
        bench.rig.trouble = Trouble::default();
        bench.host.alive = true;
        bench.run(50)?;
        ensure!(bench.brake == BrakeOutput::DUMPED, "the dump does not last");
        bench.must(Command::ReadStatus)?;
        let latched = bench.host.heard.status.and_then(|status| status.fault);
        ensure!(
            latched == Some(injection.fault),
            "{:?} injected, {latched:?} latched",
            injection.fault
        );
        ensure!(
            injection.within.contains(&samples),
            "{:?} after {samples} samples",
            injection.fault
        );
        lines.push(format!("{:?} {samples}", injection.fault));
        worst = most(worst, bench.worst);
    }
    Ok(Found {
        line: format!("samples to the dump: {}", lines.join(", ")),
        worst,
    })
}

/// The larger of each.
pub fn most(a: Worst, b: Worst) -> Worst {
    let mut instructions = a.instructions;
    for (most, other) in instructions.iter_mut().zip(b.instructions) {
        *most = (*most).max(other);
    }
    Worst {
        instructions,
        stack_bytes: a.stack_bytes.max(b.stack_bytes),
    }
}

/// A tenth of all link bytes is changed, both ways, and the run goes on as if nothing were.
pub fn corruption(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 5)?;
    bench.begin(RAMP)?;
    bench.host.set_corruption(0.1);
    bench.host.set_keep_alive_samples(5);
    for _ in 0..3_000 {
        bench.sample()?;
    }
    bench.host.set_corruption(0.0);
    bench.run(10)?;
    bench.must(Command::ReadStatus)?;
    let heard = &bench.host.heard;
    let Some(status) = heard.status else {
        bail!("no status");
    };
    ensure!(status.fault.is_none(), "{status:?}");
    ensure!(status.link.corrupt > 200 && heard.bad_frames > 1_000);
    ensure!(
        heard.events.iter().any(|(_, event)| matches!(
            event,
            Event::StateChanged {
                to: State::Skid,
                ..
            }
        )) || status.state >= State::Release
    );
    Ok(found(
        &bench,
        format!(
            "{} command frames and {} telemetry frames corrupted, no fault",
            status.link.corrupt, heard.bad_frames
        ),
    ))
}

/// A wire that takes a third of the telemetry: samples are dropped and counted, control goes on.
pub fn back_pressure(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 6)?;
    bench.begin(RAMP)?;
    bench.room = 14;
    bench.until(State::Skid, 6_000)?;
    bench.run(500)?;
    bench.room = crate::bench::WIRE_BYTES;
    bench.run(100)?;
    bench.must(Command::ReadStatus)?;
    let Some(status) = bench.host.heard.status else {
        bail!("no status");
    };
    let lost = bench.host.heard.lost;
    ensure!(status.fault.is_none(), "{status:?}");
    ensure!(status.link.dropped > 500 && lost == u64::from(status.link.dropped));
    Ok(found(
        &bench,
        format!("{lost} frames dropped, all counted on both sides; skid found and released"),
    ))
}

/// Runs of ramps for so many simulated seconds, without a lost sample and within the work's budget.
pub fn endurance(image: &Path, seconds: u32) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 7)?;
    // As many applications as fit, each run after the other.
    bench.begin(Profile {
        applications: 100,
        ..RAMP
    })?;
    while bench.samples < u64::from(seconds) * 1_000 {
        bench.sample()?;
        if bench.state() == State::Done {
            bench.must(Command::Arm)?;
            bench.must(Command::Start {
                profile: Profile {
                    applications: 100,
                    ..RAMP
                },
            })?;
        }
    }
    let heard = &bench.host.heard;
    ensure!(heard.sample_gaps == 0 && heard.lost == 0 && heard.bad_frames == 0);
    // What is still in the queue is on its way.
    ensure!(heard.samples + 40 > bench.samples);
    bench.must(Command::ReadStatus)?;
    let Some(status) = bench.host.heard.status else {
        bail!("no status");
    };
    ensure!(
        status.fault.is_none() && status.link.dropped == 0,
        "{status:?}"
    );
    let skids = bench
        .host
        .heard
        .events
        .iter()
        .filter(|(_, event)| {
            matches!(
                event,
                Event::StateChanged {
                    to: State::Skid,
                    ..
                }
            )
        })
        .count();
    Ok(found(
        &bench,
        format!(
            "{} samples, {skids} skids, none lost; mean step {} instructions",
            bench.samples,
            bench.step_instructions / bench.samples
        ),
    ))
}

/// The image's own 1 kHz timer: on time, in order, and a sample too late dumps the brake in the interrupt.
pub fn free_run(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 8)?;
    bench.run(10)?;
    let raw = bench.rig.sample(bench.brake);
    let FromFirmware::FreeRun {
        samples,
        worked,
        late,
        elapsed_ns,
        ..
    } = bench.qemu.free_run(&raw, 300, 0)?
    else {
        bail!("no free run");
    };
    ensure!(
        (samples, worked, late) == (300, 300, 0),
        "{samples} {worked} {late}"
    );
    let error_ns = i64::from(elapsed_ns) - 300_000_000;
    ensure!(error_ns.abs() < 100_000, "{elapsed_ns} ns");
    // The emulator's timer takes an instruction for a nanosecond: 1.5 million are a sample and a half. At
    // least every other sample then comes too late.
    let FromFirmware::FreeRun {
        late: missed,
        output,
        ..
    } = bench.qemu.free_run(&raw, 100, 1_500_000)?
    else {
        bail!("no free run");
    };
    ensure!(
        missed >= 50 && output == BrakeOutput::DUMPED,
        "{missed} {output:?}"
    );
    Ok(found(
        &bench,
        format!(
            "300 samples in 0.3 s {error_ns:+} ns; with work of 1.5 samples {missed} of 100 late"
        ),
    ))
}

/// A hard fault in the image, and a panic in the image made for it, dump the brake before anything else.
pub fn fault_handlers(image: &Path, panic_image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 9)?;
    bench.begin(RAMP)?;
    bench.until(State::Ramp, 1_000)?;
    bench.run(100)?;
    ensure!(bench.brake.hold_pressure);
    bench.qemu.say(&ToFirmware::HardFault)?;
    let said = bench.qemu.hear()?;
    ensure!(
        said == FromFirmware::Dumped {
            panic: false,
            output: BrakeOutput::DUMPED
        },
        "{said:?}"
    );
    let (_, said) = Qemu::start(panic_image)?;
    ensure!(
        said == FromFirmware::Dumped {
            panic: true,
            output: BrakeOutput::DUMPED
        },
        "{said:?}"
    );
    Ok(found(&bench, "hard fault and panic".to_owned()))
}
