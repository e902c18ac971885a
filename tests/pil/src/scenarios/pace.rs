//! The image at true pace: instructions take their time, the wire brings a byte whenever one is due.

use std::collections::VecDeque;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use muslip_control::brake::BrakeOutput;
use muslip_control::emulation::{FromFirmware, NS_PER_INSTRUCTION_LOG2};
use muslip_record::{Command, LINK_BYTES_PER_SECOND, LinkCounters, Parameters, State};

use super::{FOR_EVER, Found, LAW};
use crate::bench::Worst;
use crate::host::{Host, until};
use crate::qemu::Qemu;
use crate::rig::Rig;

/// Bytes that are kept ready for the wire: more than it brings in a sample.
const READY_BYTES: usize = 96;
/// Core cycles from one byte to the next.
const BYTE_CYCLES: u32 = 168_000_000 / LINK_BYTES_PER_SECOND;
/// Samples within which a command is done.
const PATIENCE_SAMPLES: u32 = 100;

/// The image, its rig, and a host that never lets the wire rest.
struct Paced {
    qemu: Qemu,
    rig: Rig,
    host: Host,
    brake: BrakeOutput,
    /// What the host has said and not given to the wire yet.
    said: VecDeque<u8>,
    commands: u32,
    samples: u32,
    /// Bytes given to the wire, and those of them that it has not brought.
    given: u64,
    ready: usize,
    /// Bytes that the image sent.
    sent: u64,
    /// Longest that a byte waited in core cycles.
    waited: u32,
}

impl Paced {
    fn start(image: &Path) -> Result<Self> {
        let (qemu, _) = Qemu::start_at(image, NS_PER_INSTRUCTION_LOG2)?;
        let mut paced = Self {
            qemu,
            rig: Rig::rolling(LAW, 20.0, 14, &Parameters::default())?,
            host: Host::new(),
            brake: BrakeOutput::DUMPED,
            said: VecDeque::new(),
            commands: 0,
            samples: 0,
            given: 0,
            ready: READY_BYTES,
            sent: 0,
            waited: 0,
        };
        // The first only begins it.
        paced.sample()?;
        Ok(paced)
    }

    fn frame(&mut self, command: Command) -> Result<()> {
        let frame = self.host.framed(command)?;
        self.said.extend(frame);
        self.commands += 1;
        Ok(())
    }

    /// One sample, during which the wire does not rest.
    fn sample(&mut self) -> Result<()> {
        let count = READY_BYTES.saturating_sub(self.ready);
        while self.said.len() < count {
            // The longest command there is; refused but while idle.
            self.frame(Command::SetParameters {
                parameters: Parameters::default(),
            })?;
        }
        self.give_and_sample(count)?;
        ensure!(
            self.samples < 3 || self.ready > 0,
            "sample {}: the wire rested",
            self.samples
        );
        Ok(())
    }

    fn give_and_sample(&mut self, count: usize) -> Result<()> {
        let link: Vec<u8> = self.said.drain(..count).collect();
        let raw = self.rig.sample(self.brake);
        let (said, sent) = self.qemu.pace(&raw, &link)?;
        let FromFirmware::Paced {
            raised,
            worked,
            late,
            output,
            waited,
            ready,
            lost,
            ..
        } = said
        else {
            bail!("answer to a sample at the wire's pace: {said:?}");
        };
        ensure!(
            late == 0 && lost == 0 && worked == raised,
            "sample {}: {raised} raised, {worked} done, {late} late, {lost} bytes lost",
            self.samples
        );
        self.samples += 1;
        self.given += link.len() as u64;
        self.ready = usize::from(ready);
        self.brake = output;
        self.waited = waited;
        self.sent += sent.len() as u64;
        self.host.incoming(&sent);
        Ok(())
    }

    fn until(&mut self, state: State) -> Result<()> {
        until(
            self,
            |paced| &paced.host.heard,
            Self::sample,
            state,
            PATIENCE_SAMPLES,
        )
    }

    /// Says no more, and lets the wire bring what was said.
    fn finish(&mut self) -> Result<()> {
        while !self.said.is_empty() || self.ready > 0 {
            self.give_and_sample(READY_BYTES.min(self.said.len() + self.ready) - self.ready)?;
        }
        (0..PATIENCE_SAMPLES).try_for_each(|_| self.give_and_sample(0))
    }
}

/// Runs of ramps for so many simulated seconds, with the wire to the rig full of commands all the time: no byte lost, no
/// sample late, every command answered, every sample told of.
pub fn true_pace(image: &Path, seconds: u32) -> Result<Found> {
    let mut paced = Paced::start(image)?;
    (0..200).try_for_each(|_| paced.sample())?;
    let (settled, given) = (paced.samples, paced.given);
    let mut runs = 0;
    while paced.samples < seconds * 1_000 {
        if matches!(paced.host.heard.state(), State::Idle | State::Done) {
            paced.frame(Command::Arm)?;
            paced.until(State::Armed)?;
            paced.frame(Command::Start { profile: FOR_EVER })?;
            paced.until(State::SpinUp)?;
            runs += 1;
        }
        paced.sample()?;
    }
    let wire = f64::from(paced.samples - settled) * f64::from(LINK_BYTES_PER_SECOND) * 1e-3;
    let full = 100.0 * (paced.given - given) as f64 / wire;
    ensure!(full > 99.5, "{full} % of the wire to the rig");
    paced.frame(Command::ReadStatus)?;
    paced.finish()?;
    let heard = &paced.host.heard;
    ensure!(
        heard.sample_gaps == 0 && heard.lost == 0 && heard.bad_frames == 0,
        "{} gaps, {} frames lost, {} bad",
        heard.sample_gaps,
        heard.lost,
        heard.bad_frames
    );
    ensure!(
        heard.answers == u64::from(paced.commands),
        "{} answers to {} commands",
        heard.answers,
        paced.commands
    );
    let status = heard.status.context("no status")?;
    let expected = LinkCounters {
        received: paced.commands,
        ..LinkCounters::default()
    };
    ensure!(
        status.fault.is_none() && status.link == expected,
        "{status:?}"
    );
    let skids = heard.skids();
    ensure!(skids > 0, "no skid in {} samples", paced.samples);
    ensure!(
        paced.waited < BYTE_CYCLES,
        "a byte waited {} cycles of {BYTE_CYCLES}",
        paced.waited
    );
    let back = 100.0 * paced.sent as f64
        / (f64::from(paced.samples) * f64::from(LINK_BYTES_PER_SECOND) * 1e-3);
    Ok(Found {
        line: format!(
            "{} samples, {runs} runs, {skids} skids; {full:.1} % of the wire to the rig, {} commands, each answered; {back:.1} % of the wire \
             back; none late, none lost, a byte waited {} of {BYTE_CYCLES} cycles at the most",
            paced.samples, paced.commands, paced.waited,
        ),
        worst: Worst::default(),
    })
}
