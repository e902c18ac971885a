//! The host's link: greeting, damage, a slow wire.

use std::path::Path;

use anyhow::{Result, bail, ensure};
use muslip_control::emulation::Delays;
use muslip_record::{
    Answer, Command, Event, PROTOCOL_VERSION, Profile, Refusal, SCHEMA_HASH, State,
};

use super::{Found, LAW, RAMP, found};
use crate::bench::Bench;

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
    Ok(found(&bench, format!("schema {SCHEMA_HASH:08x}")))
}

/// One byte a sample in each direction, as the chip's UART moves them: what one byte costs the link's interrupt, and
/// no byte is lost.
pub fn byte_by_byte(image: &Path) -> Result<Found> {
    let mut bench = Bench::start(image, LAW, 13)?;
    bench.run(20)?;
    bench.room = 1;
    bench.host.alive = false;
    let frame = bench.host.framed(Command::Hello)?;
    for &byte in &frame {
        bench.sample_with(&[byte])?;
    }
    bench.room = crate::bench::WIRE_BYTES;
    bench.host.alive = true;
    bench.run(100)?;
    bench.must(Command::ReadStatus)?;
    let Some(status) = bench.host.heard.status else {
        bail!("no status");
    };
    ensure!(bench.host.heard.hello.is_some(), "no hello");
    ensure!(
        status.link.overrun_bytes == 0 && status.link.corrupt == 0,
        "{status:?}"
    );
    let Delays { receive, send, .. } = bench.worst.delays;
    ensure!(receive > 0 && send > 0, "{:?}", bench.worst);
    Ok(found(
        &bench,
        format!("a byte in {receive}, a byte out {send} instructions"),
    ))
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
