//! What lies below the controller: timer, fault handlers, log; and all of it for long.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use muslip_control::brake::BrakeOutput;
use muslip_control::emulation::{FromFirmware, ToFirmware};
use muslip_record::{Command, End, Envelope, FrameReader, PostMortem, State, Telemetry};

use super::{FOR_EVER, Found, LAW, RAMP, found};
use crate::bench::{Bench, Worst};
use crate::log;
use crate::qemu::Qemu;
use crate::target::{Input, Target};

/// The log says who starts up, every change of state, and the fault; each frame decodes.
pub fn log(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 12)?;
    bench.begin(RAMP)?;
    bench.until(State::Ramp, 1_000)?;
    bench.run(100)?;
    bench.rig.trouble.emergency_stop = [true; 2];
    bench.run(10)?;
    let lines = log::decode(&std::fs::read(image)?, &bench.qemu.log()?)?;
    let wanted = [
        "muslip: emulated true, core 168000000 Hz, watchdog reset false, parameters BuiltIn",
        "Idle -> Armed, fault None",
        "Armed -> SpinUp, fault None",
        "SpinUp -> Ramp, fault None",
        "Ramp -> Fault, fault Some(EmergencyStop)",
    ];
    ensure!(lines == wanted, "{lines:#?}");
    Ok(found(
        &bench,
        format!("{} lines, the last: {}", lines.len(), wanted[4]),
    ))
}

/// Runs of ramps for so many simulated seconds, without a lost sample and within the work's budget.
pub fn endurance(image: &Path, seconds: u32) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 7)?;
    bench.begin(FOR_EVER)?;
    while bench.samples < u64::from(seconds) * 1_000 {
        bench.sample()?;
        if bench.state() == State::Done {
            bench.must(Command::Arm)?;
            bench.must(Command::Start { profile: FOR_EVER })?;
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
    let skids = bench.host.heard.skids();
    Ok(found(
        &bench,
        format!(
            "{} samples, {skids} skids, none lost; mean step {} instructions; {:.0} kJ into the brake, {:.0} kJ left",
            bench.samples,
            bench.step_instructions / bench.samples,
            bench.brake_energy_j * 1e-3,
            f64::from(status.brake_energy_j) * 1e-3
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

/// How the program came to its end, as it tells in its hello after the reset that it made; and the energy in J that is
/// in its brake.
fn told_after_reset(bench: &mut Bench) -> Result<(PostMortem, u32)> {
    bench.qemu.restarted()?;
    let hello = bench.host.framed(Command::Hello)?;
    let status = bench.host.framed(Command::ReadStatus)?;
    let (mut reader, mut end) = (FrameReader::new(), None);
    for link in [&hello[..], &status[..], &[], &[]] {
        let output = bench.qemu.sample(&Input {
            raw: bench.rig.sample(bench.brake),
            link,
            room: crate::bench::WIRE_BYTES,
            burn: 0,
        })?;
        ensure!(output.brake == BrakeOutput::DUMPED);
        for byte in output.link {
            let Some(message) = reader.push::<Envelope<Telemetry>>(byte) else {
                continue;
            };
            match message?.body {
                Telemetry::Hello(hello) => end = hello.end,
                Telemetry::Status(status) => {
                    return Ok((end.context("no word of an end")?, status.brake_energy_j));
                }
                _ => {}
            }
        }
    }
    bail!("no status after the reset")
}

/// A hard fault, an exhausted stack and the end of the crystal in the image, and a panic in the image made for it, dump the brake before
/// anything else.
pub fn fault_handlers(image: &Path, panic_image: &Path) -> Result<Found> {
    let mut worst = Worst::default();
    for (message, expected) in [
        (ToFirmware::HardFault, End::HardFault),
        (ToFirmware::ExhaustStack, End::Stack),
        (ToFirmware::NonMaskable, End::Crystal),
    ] {
        let mut bench = Bench::start(image, LAW, 9)?;
        bench.begin(RAMP)?;
        bench.until(State::Ramp, 1_000)?;
        bench.run(100)?;
        ensure!(bench.brake.hold_pressure);
        bench.must(Command::ReadStatus)?;
        let energy_j = bench.host.heard.status.context("no status")?.brake_energy_j;
        ensure!(energy_j > 100, "{energy_j} J");
        bench.qemu.say(&message)?;
        let said = bench.qemu.hear()?;
        ensure!(
            said == FromFirmware::Dumped {
                panic: false,
                output: BrakeOutput::DUMPED
            },
            "{message:?}: {said:?}"
        );
        let (end, kept_j) = told_after_reset(&mut bench)?;
        // A sample or two went on after that status, two cooled; whole joules.
        ensure!(
            (energy_j - 1..energy_j + 50).contains(&kept_j),
            "{message:?}: {energy_j} J before, {kept_j} J after"
        );
        ensure!(
            end.end == expected && end.state == State::Ramp && end.tick > 100,
            "{message:?}: {end:?}"
        );
        worst = worst.most(bench.worst);
    }
    let (_, said) = Qemu::start(panic_image)?;
    ensure!(
        said == FromFirmware::Dumped {
            panic: true,
            output: BrakeOutput::DUMPED
        },
        "{said:?}"
    );
    Ok(Found {
        line:
            "hard fault, exhausted stack, crystal and panic; the first three told after their reset, the brake as hot as before"
                .to_owned(),
        worst,
    })
}
