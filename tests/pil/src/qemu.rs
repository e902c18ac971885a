//! The image in QEMU: process, sockets, lock-step.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use muslip_control::board::RawSample;
use muslip_control::emulation::{FromFirmware, ToFirmware};
use muslip_record::{FRAME_BYTES, FrameReader, encode};
use tempfile::TempDir;

use crate::target::{Input, Output, Target};

/// The emulator that has an STM32F405.
pub const EMULATOR: &str = "qemu-system-arm";
/// How long the image may be silent in wall time.
const PATIENCE: Duration = Duration::from_secs(30);

/// A running image.
pub struct Qemu {
    child: Child,
    link: UnixStream,
    rig: UnixStream,
    reader: FrameReader,
    waiting: Vec<u8>,
    link_to: u32,
    link_from: u32,
    log: PathBuf,
    _folder: TempDir,
}

impl Qemu {
    /// Starts an image and waits until it is ready, or has come to its end before.
    ///
    /// # Errors
    /// QEMU cannot be started, or the image says nothing.
    pub fn start(image: &Path) -> Result<(Self, FromFirmware)> {
        Self::start_at(image, 0)
    }

    /// As [`Qemu::start`], an instruction taken for so many nanoseconds, as their base-two logarithm.
    ///
    /// # Errors
    /// As [`Qemu::start`].
    pub fn start_at(image: &Path, ns_per_instruction_log2: u32) -> Result<(Self, FromFirmware)> {
        let folder = tempfile::tempdir()?;
        let path = |name: &str| folder.path().join(name);
        let link = UnixListener::bind(path("link"))?;
        let rig = UnixListener::bind(path("rig"))?;
        let log = path("log");
        // The n-th serial is USARTn. shift=0: one instruction is 1 ns of the guest's time, so that its timers
        // count instructions; sleep=off: time jumps to the next event when the core sleeps.
        let count = format!("shift={ns_per_instruction_log2},sleep=off");
        let mut child = Command::new(EMULATOR)
            .args(["-M", "netduinoplus2", "-icount", &count])
            .args(["-display", "none", "-monitor", "none", "-nodefaults"])
            .arg("-serial")
            .arg(format!("file:{}", log.display()))
            // A multiplexer keeps 32 received bytes for a UART that holds one, so that the core takes them in one
            // interrupt instead of one each: half the time. No byte is its escape character.
            .args(["-echr", "256"])
            .arg("-chardev")
            .arg(format!(
                "socket,id=link,path={},mux=on",
                path("link").display()
            ))
            .args(["-serial", "chardev:link"])
            .arg("-chardev")
            .arg(format!(
                "socket,id=rig,path={},mux=on",
                path("rig").display()
            ))
            .args(["-serial", "chardev:rig"])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            // It warns of every run that has no timer.
            .stderr(std::fs::File::create(path("errors"))?)
            .spawn()
            .with_context(|| format!("cannot start {EMULATOR}"))?;
        let accepted =
            accept(&link, &mut child).and_then(|link| Ok((link, accept(&rig, &mut child)?)));
        let (link, rig) = match accepted {
            Ok(streams) => streams,
            Err(error) => {
                let _ = child.kill();
                let _ = child.wait();
                let said = std::fs::read_to_string(path("errors")).unwrap_or_default();
                return Err(error.context(said));
            }
        };
        let mut qemu = Self {
            child,
            link,
            rig,
            reader: FrameReader::new(),
            waiting: Vec::new(),
            link_to: 0,
            link_from: 0,
            log,
            _folder: folder,
        };
        for stream in [&qemu.link, &qemu.rig] {
            stream.set_read_timeout(Some(PATIENCE))?;
        }
        let first = qemu.hear()?;
        Ok((qemu, first))
    }

    /// What the image has logged so far, as it was sent.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn log(&self) -> Result<Vec<u8>> {
        Ok(std::fs::read(&self.log)?)
    }

    /// Waits for the image to have started again after a reset of its own, and what its link said last.
    ///
    /// # Errors
    /// As [`Qemu::hear`], or it says something else.
    pub fn restarted(&mut self) -> Result<()> {
        let said = self.hear()?;
        ensure!(matches!(said, FromFirmware::Ready { .. }), "{said:?}");
        (self.link_to, self.link_from) = (0, 0);
        Ok(())
    }

    /// Tells the image something.
    ///
    /// # Errors
    /// The image is gone.
    pub fn say(&mut self, message: &ToFirmware) -> Result<()> {
        let mut buffer = [0; FRAME_BYTES];
        let frame = encode(message, &mut buffer)?;
        self.rig.write_all(frame).context("the emulator is gone")
    }

    /// The next thing that the image says.
    ///
    /// # Errors
    /// The image is gone, silent, or does not make sense.
    pub fn hear(&mut self) -> Result<FromFirmware> {
        loop {
            let mut taken = 0;
            let mut found = None;
            for &byte in &self.waiting {
                taken += 1;
                if let Some(message) = self.reader.push::<FromFirmware>(byte) {
                    found = Some(message);
                    break;
                }
            }
            self.waiting.drain(..taken);
            if let Some(message) = found {
                return Ok(message?);
            }
            let mut bytes = [0; 512];
            let count = self.rig.read(&mut bytes).context("the image is silent")?;
            ensure!(count > 0, "the emulator is gone");
            self.waiting.extend(bytes.iter().take(count));
        }
    }

    /// One sample at the pace of the wire, which brings these bytes during it; what the image says of the sample before,
    /// and the bytes that it has sent since.
    ///
    /// # Errors
    /// As [`Qemu::hear`].
    pub fn pace(&mut self, raw: &RawSample, link: &[u8]) -> Result<(FromFirmware, Vec<u8>)> {
        self.say(&ToFirmware::Pace {
            raw: *raw,
            link_bytes: u16::try_from(link.len())?,
        })?;
        self.link.write_all(link)?;
        let said = self.hear()?;
        let mut sent = Vec::new();
        if let FromFirmware::Paced { link_sent, .. } = said {
            sent = vec![0; (link_sent - self.link_from) as usize];
            self.link.read_exact(&mut sent)?;
            self.link_from = link_sent;
        }
        Ok((said, sent))
    }

    /// Lets the image's own timer run.
    ///
    /// # Errors
    /// As [`Qemu::hear`].
    pub fn free_run(&mut self, raw: &RawSample, samples: u16, burn: u32) -> Result<FromFirmware> {
        self.say(&ToFirmware::FreeRun {
            raw: *raw,
            samples,
            burn,
        })?;
        // Telemetry must be taken, or the emulator waits for its reader.
        self.link.set_read_timeout(Some(Duration::from_millis(1)))?;
        self.rig.set_nonblocking(true)?;
        let start = Instant::now();
        let mut bytes = [0; 4096];
        let result = loop {
            let _ = self.link.read(&mut bytes);
            match self.hear() {
                Ok(message) => break Ok(message),
                Err(error) if start.elapsed() > PATIENCE || !would_block(&error) => {
                    break Err(error);
                }
                Err(_) => {}
            }
        };
        self.rig.set_nonblocking(false)?;
        self.link.set_read_timeout(Some(PATIENCE))?;
        result
    }
}

fn would_block(error: &anyhow::Error) -> bool {
    error
        .downcast_ref::<std::io::Error>()
        .is_some_and(|error| error.kind() == ErrorKind::WouldBlock)
}

fn accept(listener: &UnixListener, child: &mut Child) -> Result<UnixStream> {
    listener.set_nonblocking(true)?;
    let start = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        if let Some(status) = child.try_wait()? {
            bail!("{EMULATOR} ended with {status}");
        }
        ensure!(start.elapsed() < PATIENCE, "{EMULATOR} does not connect");
        std::thread::sleep(Duration::from_millis(2));
    }
}

impl Target for Qemu {
    fn sample(&mut self, input: &Input<'_>) -> Result<Output> {
        self.link.write_all(input.link)?;
        self.link_to += u32::try_from(input.link.len())?;
        self.say(&ToFirmware::Sample {
            raw: input.raw,
            link_sent: self.link_to,
            link_room: input.room,
            burn: input.burn,
        })?;
        match self.hear()? {
            FromFirmware::Sample {
                output,
                interrupt_instructions,
                control_instructions,
                step_instructions,
                delays,
                stack_bytes,
                link_sent,
                ..
            } => {
                let mut link = vec![0; (link_sent - self.link_from) as usize];
                self.link.read_exact(&mut link)?;
                self.link_from = link_sent;
                Ok(Output {
                    brake: output,
                    link,
                    instructions: [
                        interrupt_instructions,
                        control_instructions,
                        step_instructions,
                    ],
                    delays,
                    stack_bytes,
                })
            }
            other => bail!("answer to a sample: {other:?}"),
        }
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
