//! A simulated rig with its controller behind a socket, in real time: for `muslip rig`, without a rig.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Result;
use muslip_control::brake::BrakeOutput;
use muslip_control::interlock::SILENT_MS;
use muslip_record::{Command, Envelope, FRAME_BYTES, Parameters, encode};

use crate::bench::WIRE_BYTES;
use crate::rig::Rig;
use crate::target::{Input, Target};

/// Sets the rig's parameters, and lets it run from nothing until the speed meters have settled.
///
/// # Errors
/// The target is gone.
pub fn settle(target: &mut impl Target, rig: &mut Rig) -> Result<()> {
    let set = Envelope {
        sequence: 0,
        body: Command::SetParameters {
            parameters: Parameters::default(),
        },
    };
    let mut buffer = [0; FRAME_BYTES];
    let mut link = encode(&set, &mut buffer)?.chunks(usize::from(WIRE_BYTES));
    for _ in 0..100 {
        target.sample(&Input {
            raw: rig.sample(BrakeOutput::DUMPED),
            link: link.next().unwrap_or_default(),
            room: WIRE_BYTES,
            burn: 0,
        })?;
    }
    Ok(())
}

/// How simulated time goes on.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Simulated over real time.
    pub speed: f64,
    /// Whether time stands still before a client's silence becomes a fault. For tests: a busy machine may not let
    /// their client run for a quarter of a second.
    pub waits: bool,
}

/// Silence that a server which waits lets pass, in samples.
const PATIENCE_SAMPLES: u32 = SILENT_MS - 50;

/// Samples for a client until it leaves or `stop` is set.
///
/// # Errors
/// The target is gone.
pub fn serve(
    target: &mut impl Target,
    rig: &mut Rig,
    mut client: TcpStream,
    pace: Pace,
    stop: &AtomicBool,
) -> Result<()> {
    client.set_nodelay(true)?;
    client.set_nonblocking(true)?;
    let start = Instant::now();
    let mut brake = BrakeOutput::DUMPED;
    let mut samples = 0_u64;
    let mut silent_samples = 0;
    let mut unsent = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let due = Duration::from_secs_f64(samples as f64 * 1e-3 / pace.speed);
        if let Some(wait) = due.checked_sub(start.elapsed()) {
            std::thread::sleep(wait);
        }
        // What the wire brings in a sample.
        let mut arrived = [0; WIRE_BYTES as usize];
        let count = match client.read(&mut arrived) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                if pace.waits && silent_samples >= PATIENCE_SAMPLES {
                    std::thread::sleep(Duration::from_millis(1));
                    continue;
                }
                0
            }
            Err(_) => return Ok(()),
        };
        samples += 1;
        silent_samples = if count > 0 { 0 } else { silent_samples + 1 };
        let output = target.sample(&Input {
            raw: rig.sample(brake),
            link: arrived.get(..count).unwrap_or_default(),
            room: WIRE_BYTES,
            burn: 0,
        })?;
        brake = output.brake;
        unsent.extend_from_slice(&output.link);
        match client.write(&unsent) {
            Ok(count) => {
                unsent.drain(..count);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => return Ok(()),
        }
    }
    Ok(())
}
