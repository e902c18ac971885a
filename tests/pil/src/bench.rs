//! Rig, image, native controller and host, sample by sample.

use std::collections::VecDeque;
use std::path::Path;

use anyhow::{Result, bail, ensure};
use muslip_control::board::RawSample;
use muslip_control::brake::BrakeOutput;
use muslip_control::emulation::{Delays, FromFirmware};
use muslip_record::{
    Answer, Command, Envelope, FrameReader, LINK_BYTES_PER_SECOND, Parameters, Profile, Refusal,
    SAMPLE_RATE_HZ, State, Telemetry,
};

use crate::host::{Host, until};
use crate::native::Native;
use crate::qemu::Qemu;
use crate::rig::Rig;
use crate::target::{Input, Output, Target};

/// Bytes that the link's wire takes in a sample.
pub const WIRE_BYTES: u16 = (LINK_BYTES_PER_SECOND / SAMPLE_RATE_HZ) as u16;

/// The most that anything took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Worst {
    /// Instructions of the sampling interrupt, the control step, and the step with the link's work.
    pub instructions: [u32; 3],
    /// What can hold an interrupt off.
    pub delays: Delays,
    /// Instructions of one look at the chip's own sensors.
    pub sensors: u32,
    /// Priorities of the link's interrupt and of sampling; 0 goes first.
    pub priorities: [u8; 2],
    /// Stack in bytes.
    pub stack_bytes: u32,
}

impl Worst {
    /// The larger of each.
    #[must_use]
    pub fn most(self, other: Self) -> Self {
        let mut instructions = self.instructions;
        for (most, other) in instructions.iter_mut().zip(other.instructions) {
            *most = (*most).max(other);
        }
        let (a, b) = (self.delays, other.delays);
        Self {
            instructions,
            delays: Delays {
                receive: a.receive.max(b.receive),
                send: a.send.max(b.send),
                masked: a.masked.max(b.masked),
                held_off: a.held_off.max(b.held_off),
            },
            sensors: self.sensors.max(other.sensors),
            priorities: [0, 1].map(|at: usize| self.priorities[at].max(other.priorities[at])),
            stack_bytes: self.stack_bytes.max(other.stack_bytes),
        }
    }
}

/// Everything together.
pub struct Bench {
    /// The image.
    pub qemu: Qemu,
    /// The same natively; what differs ends the run.
    native: Native,
    /// Telemetry of image and native controller that is still to be compared, with the readers it comes from.
    native_said: (FrameReader, VecDeque<Envelope<Telemetry>>),
    image_said: (FrameReader, VecDeque<Envelope<Telemetry>>),
    /// The rig.
    pub rig: Rig,
    /// The host.
    pub host: Host,
    /// What the sensors read last.
    pub raw: RawSample,
    /// What the valves were told last.
    pub brake: BrakeOutput,
    /// Energy in the brake in J, of what the valves were told and how fast the wheel truly turned, nothing cooled.
    pub brake_energy_j: f64,
    /// Samples so far.
    pub samples: u64,
    /// Estimates that were compared bit for bit.
    pub estimates_compared: u64,
    /// The most that anything took so far.
    pub worst: Worst,
    /// Sum of step instructions, for the mean.
    pub step_instructions: u64,
    /// Bytes that the wire takes in a sample.
    pub room: u16,
    /// Instructions to waste in the next sample.
    pub burn: u32,
}

impl Bench {
    /// A fresh image on a rig rolling at 20 m/s.
    ///
    /// # Errors
    /// The image does not come up.
    pub fn start(image: &Path, law: &str, seed: u64) -> Result<Self> {
        let (qemu, first) = Qemu::start(image)?;
        let FromFirmware::Ready {
            sampling_instructions,
            registers_hold,
            priorities,
        } = first
        else {
            bail!("at start-up: {first:?}");
        };
        // The emulator has not run the chip's start-up: a check that found nothing wrong there would find nothing.
        ensure!(!registers_hold, "the check of the registers finds nothing");
        let mut bench = Self {
            qemu,
            native: Native::new()?,
            native_said: (FrameReader::new(), VecDeque::new()),
            image_said: (FrameReader::new(), VecDeque::new()),
            rig: Rig::rolling(law, 20.0, seed, &Parameters::default())?,
            host: Host::new(),
            raw: RawSample::default(),
            brake: BrakeOutput::DUMPED,
            brake_energy_j: 0.0,
            samples: 0,
            estimates_compared: 0,
            worst: Worst {
                sensors: sampling_instructions,
                priorities,
                ..Worst::default()
            },
            step_instructions: 0,
            room: WIRE_BYTES,
            burn: 0,
        };
        bench.set_parameters(Parameters::default())?;
        Ok(bench)
    }

    /// Sets parameters, which the emulator cannot store.
    ///
    /// # Errors
    /// As [`Bench::say`], or they are refused.
    pub fn set_parameters(&mut self, parameters: Parameters) -> Result<()> {
        let answer = self.say(Command::SetParameters { parameters })?;
        ensure!(answer == Answer::Refused(Refusal::Storage), "{answer:?}");
        Ok(())
    }

    /// One sample of everything.
    ///
    /// # Errors
    /// The image is gone, or differs from the native controller.
    pub fn sample(&mut self) -> Result<()> {
        let link = self.host.outgoing()?;
        self.sample_with(&link)
    }

    /// One sample with these bytes on the link instead of the host's own.
    ///
    /// # Errors
    /// As [`Bench::sample`].
    pub fn sample_with(&mut self, link: &[u8]) -> Result<()> {
        let raw = self.rig.sample(self.brake);
        self.brake_energy_j += 1e-3 * self.rig.brake_power_w(self.brake);
        self.raw = raw;
        let input = Input {
            raw,
            link,
            room: self.room,
            burn: self.burn,
        };
        let output = self.qemu.sample(&input)?;
        let native = self.native.sample(&input)?;
        self.samples += 1;
        self.compare(&output, &native)?;
        self.worst = self.worst.most(Worst {
            // What is wasted on purpose does not count.
            instructions: if self.burn == 0 {
                output.instructions
            } else {
                [0; 3]
            },
            delays: output.delays,
            sensors: 0,
            priorities: [0; 2],
            stack_bytes: output.stack_bytes,
        });
        self.step_instructions += u64::from(output.instructions[2]);
        self.brake = output.brake;
        self.host.incoming(&output.link);
        Ok(())
    }

    /// Outputs and telemetry must be equal, byte for byte; but for a status, which counts instructions and
    /// stack that the native controller has none of.
    fn compare(&mut self, image: &Output, native: &Output) -> Result<()> {
        ensure!(
            image.brake == native.brake,
            "sample {}: valves of the image {:?}, natively {:?}",
            self.samples,
            image.brake,
            native.brake
        );
        for ((reader, said), bytes) in [
            (&mut self.image_said, &image.link),
            (&mut self.native_said, &native.link),
        ] {
            let messages = bytes
                .iter()
                .filter_map(|&byte| reader.push::<Envelope<Telemetry>>(byte));
            for message in messages {
                said.push_back(message?);
            }
        }
        while let (Some(image), Some(native)) =
            (self.image_said.1.front(), self.native_said.1.front())
        {
            let statuses = matches!(image.body, Telemetry::Status(_))
                && matches!(native.body, Telemetry::Status(_));
            // As bytes, so that NaN equals itself and -0 is not 0.
            let bytes = |message| postcard::to_slice(message, &mut [0; 256]).map(|b| b.to_vec());
            ensure!(
                statuses || bytes(image)? == bytes(native)?,
                "sample {}: the image says {image:?}, natively {native:?}",
                self.samples
            );
            if matches!(image.body, Telemetry::Estimate(_)) {
                self.estimates_compared += 1;
            }
            self.image_said.1.pop_front();
            self.native_said.1.pop_front();
        }
        Ok(())
    }

    /// Several samples.
    ///
    /// # Errors
    /// As [`Bench::sample`].
    pub fn run(&mut self, samples: u32) -> Result<()> {
        (0..samples).try_for_each(|_| self.sample())
    }

    /// Says a command and waits for its answer.
    ///
    /// # Errors
    /// As [`Bench::sample`], or no answer within a second.
    pub fn say(&mut self, command: Command) -> Result<Answer> {
        let number = self.host.say(command);
        for _ in 0..1000 {
            self.sample()?;
            if !self.host.waits()
                && let Some((answered, answer)) = self.host.heard.answer
                && answered == number
            {
                return Ok(answer);
            }
        }
        bail!("no answer to {command:?}")
    }

    /// Says a command that must be done.
    ///
    /// # Errors
    /// As [`Bench::say`], or a refusal.
    pub fn must(&mut self, command: Command) -> Result<()> {
        match self.say(command)? {
            Answer::Done => Ok(()),
            Answer::Refused(refusal) => bail!("{command:?}: {refusal:?}"),
        }
    }

    /// Settles, arms and starts a run.
    ///
    /// # Errors
    /// As [`Bench::must`].
    pub fn begin(&mut self, profile: Profile) -> Result<()> {
        self.run(50)?;
        self.must(Command::Arm)?;
        self.must(Command::Start { profile })
    }

    /// State of the newest sample that the host has.
    pub fn state(&self) -> State {
        self.host.heard.state()
    }

    /// Runs until a state is reached, or so many samples have passed.
    ///
    /// # Errors
    /// As [`Bench::sample`], or the state is not reached.
    pub fn until(&mut self, state: State, samples: u32) -> Result<()> {
        until(
            self,
            |bench| &bench.host.heard,
            Self::sample,
            state,
            samples,
        )
    }
}
