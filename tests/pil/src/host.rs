//! The host's end of the link, with a wire that may be bad.

use anyhow::{Result, bail};
use muslip_record::{
    Answer, Command, Envelope, Estimate, Event, FRAME_BYTES, FrameError, FrameReader, Hello,
    QuarterCar, Sample, State, Status, Telemetry, encode,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Samples between two signs of life, unless told otherwise.
const KEEP_ALIVE_SAMPLES: u64 = 20;
/// Samples after which an unanswered command is sent again.
const AGAIN_SAMPLES: u64 = 20;

/// A host.
pub struct Host {
    sequence: u16,
    reader: FrameReader,
    expected: Option<u16>,
    open: Option<(u16, Command, u64)>,
    samples: u64,
    last_word: u64,
    /// Whether it keeps the link alive by itself.
    pub alive: bool,
    keep_alive_samples: u64,
    /// The wire repeats what was said last, instead of what the host says.
    pub repeats: bool,
    said: Vec<u8>,
    corruption: f64,
    random: ChaCha8Rng,
    /// Everything that it was told.
    pub heard: Heard,
}

/// What a host was told.
#[derive(Debug, Default)]
pub struct Heard {
    /// Who is there.
    pub hello: Option<Hello>,
    /// The newest answer and its command's number.
    pub answer: Option<(u16, Answer)>,
    /// Answers, in all.
    pub answers: u64,
    /// The newest status.
    pub status: Option<Status>,
    /// The newest estimate.
    pub estimate: Option<Estimate>,
    /// The newest estimate of the quarter-car filter.
    pub quarter_car: Option<QuarterCar>,
    /// The newest sample.
    pub sample: Option<Sample>,
    /// Samples, in all.
    pub samples: u64,
    /// Samples whose tick does not follow the one before.
    pub sample_gaps: u64,
    /// All events.
    pub events: Vec<(u32, Event)>,
    /// Frames that were none, by their kind.
    pub bad_frames: u64,
    /// Numbers missing between frames.
    pub lost: u64,
}

impl Heard {
    /// State of the newest sample.
    pub fn state(&self) -> State {
        self.sample.map_or(State::Idle, |sample| sample.state)
    }

    /// Skids so far.
    pub fn skids(&self) -> usize {
        let skids = |(_, event): &&(u32, Event)| {
            matches!(
                event,
                Event::StateChanged {
                    to: State::Skid,
                    ..
                }
            )
        };
        self.events.iter().filter(skids).count()
    }
}

/// Samples until the host hears of a state.
///
/// # Errors
/// As a sample's, or it is not heard of within so many samples.
pub fn until<S>(
    of: &mut S,
    heard: impl Fn(&S) -> &Heard,
    sample: impl Fn(&mut S) -> Result<()>,
    state: State,
    samples: u32,
) -> Result<()> {
    for _ in 0..samples {
        if heard(of).state() == state {
            return Ok(());
        }
        sample(of)?;
    }
    bail!(
        "{state:?} is not reached within {samples} samples, but {:?}; events {:?}",
        heard(of).state(),
        heard(of).events
    )
}

impl Host {
    /// A host on a perfect wire.
    pub fn new() -> Self {
        Self {
            sequence: 0,
            reader: FrameReader::new(),
            expected: None,
            open: None,
            samples: 0,
            last_word: 0,
            alive: true,
            keep_alive_samples: KEEP_ALIVE_SAMPLES,
            repeats: false,
            said: Vec::new(),
            corruption: 0.0,
            random: ChaCha8Rng::seed_from_u64(5),
            heard: Heard::default(),
        }
    }

    /// From now on this share of all bytes is changed, both ways.
    pub fn set_corruption(&mut self, share: f64) {
        self.corruption = share;
    }

    /// From now on there is a sign of life this often, in samples.
    pub fn set_keep_alive_samples(&mut self, samples: u64) {
        self.keep_alive_samples = samples.max(1);
    }

    /// Sends a command with the next sample, and again until it is answered.
    pub fn say(&mut self, command: Command) -> u16 {
        self.sequence = self.sequence.wrapping_add(1);
        self.open = Some((self.sequence, command, self.samples));
        self.heard.answer = None;
        self.sequence
    }

    /// The frame of a command that nobody waits for.
    ///
    /// # Errors
    /// It does not fit.
    pub fn framed(&mut self, command: Command) -> Result<Vec<u8>> {
        self.sequence = self.sequence.wrapping_add(1);
        let envelope = Envelope {
            sequence: self.sequence,
            body: command,
        };
        Ok(encode(&envelope, &mut [0; FRAME_BYTES])?.to_vec())
    }

    /// Whether a command waits for its answer.
    pub fn waits(&self) -> bool {
        self.open.is_some()
    }

    /// Samples since the last one that it said anything with.
    pub fn silent_samples(&self) -> u64 {
        self.samples - self.last_word
    }

    /// Bytes to send before the next sample.
    ///
    /// # Errors
    /// A command does not fit a frame.
    pub fn outgoing(&mut self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut buffer = [0; FRAME_BYTES];
        if let Some((sequence, body, since)) = self.open {
            if (self.samples - since).is_multiple_of(AGAIN_SAMPLES) {
                bytes.extend_from_slice(encode(&Envelope { sequence, body }, &mut buffer)?);
            }
        } else if self.alive && self.samples.is_multiple_of(self.keep_alive_samples) {
            bytes = self.framed(Command::KeepAlive)?;
        }
        self.samples += 1;
        if self.repeats {
            bytes = if self.samples.is_multiple_of(self.keep_alive_samples) {
                self.said.clone()
            } else {
                Vec::new()
            };
        } else if !bytes.is_empty() {
            self.last_word = self.samples;
            self.said.clone_from(&bytes);
        }
        self.corrupt(&mut bytes);
        Ok(bytes)
    }

    fn corrupt(&mut self, bytes: &mut [u8]) {
        if self.corruption > 0.0 {
            for byte in bytes {
                if self.random.random_bool(self.corruption) {
                    *byte ^= self.random.random_range(1..=255_u8);
                }
            }
        }
    }

    /// Takes bytes that were received.
    pub fn incoming(&mut self, bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        self.corrupt(&mut bytes);
        for byte in bytes {
            if self.reader.ends(byte) {
                let frame = self.reader.take::<Envelope<Telemetry>>();
                self.take(frame);
            }
        }
    }

    fn take(&mut self, frame: Result<Envelope<Telemetry>, FrameError>) {
        let heard = &mut self.heard;
        let Ok(Envelope { sequence, body }) = frame else {
            heard.bad_frames += 1;
            return;
        };
        if let Some(expected) = self.expected {
            heard.lost += u64::from(sequence.wrapping_sub(expected));
        }
        self.expected = Some(sequence.wrapping_add(1));
        match body {
            Telemetry::Hello(hello) => heard.hello = Some(hello),
            Telemetry::Answer { command, answer } => {
                heard.answer = Some((command, answer));
                heard.answers += 1;
                if self.open.is_some_and(|(sequence, ..)| sequence == command) {
                    self.open = None;
                }
            }
            Telemetry::Sample(sample) => {
                if heard
                    .sample
                    .is_some_and(|last| sample.tick != last.tick.wrapping_add(1))
                {
                    heard.sample_gaps += 1;
                }
                heard.samples += 1;
                heard.sample = Some(sample);
            }
            Telemetry::Estimate(estimate) => heard.estimate = Some(estimate),
            Telemetry::Event { tick, event } => heard.events.push((tick, event)),
            Telemetry::Status(status) => heard.status = Some(status),
            Telemetry::QuarterCar(estimate) => heard.quarter_car = Some(estimate),
            Telemetry::Parameters(_) => {}
        }
    }
}

impl Default for Host {
    fn default() -> Self {
        Self::new()
    }
}
