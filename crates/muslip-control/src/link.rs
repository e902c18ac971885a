//! The host link: commands out of bytes, telemetry into bytes, everything counted.

use muslip_record::{
    Answer, Command, Envelope, FRAME_BYTES, FrameError, FrameReader, LinkCounters, Telemetry,
    encode,
};

/// Bytes of the transmit buffer that samples and estimates leave to answers and events.
pub const RESERVED_BYTES: usize = 256;

/// Where outgoing bytes go: a buffer that a UART empties at its own pace.
pub trait Transmit {
    /// Bytes that it can take now.
    fn room(&self) -> usize;
    /// Takes bytes, no more than [`Transmit::room`].
    fn send(&mut self, bytes: &[u8]);
}

/// Whether a message may be dropped before others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// Samples and estimates: leave room for the rest.
    Stream,
    /// Answers and events.
    Prompt,
}

/// What has just arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "no heap to box it in")]
pub enum Arrival {
    /// A command to do, and its number.
    Command(u16, Command),
    /// The last command once more: repeat its answer, do nothing.
    Repeated(u16, Answer),
}

/// One end of the link.
#[derive(Debug, Clone)]
pub struct Link {
    reader: FrameReader,
    counters: LinkCounters,
    last: Option<(u16, Answer)>,
    /// The number that was furthest ahead.
    newest: Option<u16>,
    sequence: u16,
    silent_samples: u32,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// Nothing sent, nothing received.
    pub const fn new() -> Self {
        Self {
            reader: FrameReader::new(),
            counters: LinkCounters {
                received: 0,
                corrupt: 0,
                oversized: 0,
                foreign: 0,
                duplicate: 0,
                lost: 0,
                overrun_bytes: 0,
                dropped: 0,
            },
            last: None,
            newest: None,
            sequence: 0,
            silent_samples: u32::MAX,
        }
    }

    /// What the link has seen.
    pub fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// Samples since the last whole frame with a number of its own: a wire that repeats frames says nothing of its host.
    pub fn silent_samples(&self) -> u32 {
        self.silent_samples
    }

    /// Counts a sample of silence.
    pub fn tick(&mut self) {
        self.silent_samples = self.silent_samples.saturating_add(1);
    }

    /// Counts bytes that were lost before they got here, as the receiver's total so far.
    pub fn set_overrun_bytes(&mut self, total: u32) {
        self.counters.overrun_bytes = total;
    }

    /// Takes a byte; what has arrived with it, if that was the last of a frame.
    pub fn receive(&mut self, byte: u8) -> Option<Arrival> {
        if !self.reader.ends(byte) {
            return None;
        }
        let counter = match self.reader.take::<Envelope<Command>>() {
            Ok(Envelope { sequence, body }) => {
                self.counters.received = self.counters.received.saturating_add(1);
                if self.is_news(sequence, &body) {
                    self.silent_samples = 0;
                    self.newest = Some(sequence);
                }
                return self.accept(sequence, body);
            }
            Err(FrameError::Corrupt) => &mut self.counters.corrupt,
            Err(FrameError::Oversized) => &mut self.counters.oversized,
            Err(FrameError::Foreign) => &mut self.counters.foreign,
        };
        *counter = counter.saturating_add(1);
        None
    }

    /// Whether a frame comes from a host that goes on: numbers count up, but for a host that begins with a hello.
    fn is_news(&self, sequence: u16, command: &Command) -> bool {
        self.newest.is_none_or(|newest| {
            let ahead = sequence.wrapping_sub(newest);
            ahead != 0 && (ahead < 1 << 15 || *command == Command::Hello)
        })
    }

    fn accept(&mut self, sequence: u16, command: Command) -> Option<Arrival> {
        // A host that has just started says hello with any number: there is nothing to be lost from.
        if command != Command::Hello
            && let Some((last, answer)) = self.last
        {
            if sequence == last {
                self.counters.duplicate = self.counters.duplicate.saturating_add(1);
                return Some(Arrival::Repeated(sequence, answer));
            }
            // More than half of the numbers missing is a frame from before, or a host that began anew.
            let missing = sequence.wrapping_sub(last).wrapping_sub(1);
            if missing < 1 << 15 {
                self.counters.lost = self.counters.lost.saturating_add(u32::from(missing));
            }
        }
        Some(Arrival::Command(sequence, command))
    }

    /// Remembers an answer, to be repeated if its command is.
    pub fn answered(&mut self, sequence: u16, answer: Answer) {
        self.last = Some((sequence, answer));
    }

    /// Sends a message, or drops and counts it. Its number is used up either way, so that the host sees
    /// the gap.
    pub fn send(&mut self, message: Telemetry, urgency: Urgency, wire: &mut impl Transmit) {
        let envelope = Envelope {
            sequence: self.sequence,
            body: message,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let reserve = match urgency {
            Urgency::Stream => RESERVED_BYTES,
            Urgency::Prompt => 0,
        };
        let mut buffer = [0; FRAME_BYTES];
        match encode(&envelope, &mut buffer) {
            Ok(frame) if frame.len() + reserve <= wire.room() => wire.send(frame),
            _ => self.counters.dropped = self.counters.dropped.saturating_add(1),
        }
    }
}
