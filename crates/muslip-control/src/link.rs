//! The host link: commands out of bytes, telemetry into bytes, everything counted.
//!
//! Bytes come and go by a port of `embedded-io` that never makes the controller wait: it is asked whether it is ready
//! before each call. What a port does not take at once waits here, and goes first at the next sample.

use embedded_io::{Read, ReadReady, Write, WriteReady};
use muslip_record::{
    Answer, Command, Envelope, FRAME_BYTES, FrameError, FrameReader, LinkCounters, Telemetry,
    encode,
};

/// Bytes that wait for the port: the rest of one frame, and answers and events behind it.
const WAITING_BYTES: usize = 512;
const _: () = assert!(WAITING_BYTES >= 2 * FRAME_BYTES);

/// A port whose other end empties and fills it at its own pace: a UART with its buffers.
pub trait Port: Read + ReadReady + Write + WriteReady {}

impl<P: Read + ReadReady + Write + WriteReady> Port for P {}

/// Whether a message may be dropped before others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// Samples and estimates: only while nothing waits.
    Stream,
    /// Answers and events: while there is room to wait.
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
    waiting: Waiting,
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
            waiting: Waiting::new(),
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

    /// Received bytes, as many as there are and fit; none where there are none or the port fails.
    pub fn take<'a>(&mut self, buffer: &'a mut [u8], port: &mut impl Port) -> &'a [u8] {
        let count = match port.read_ready() {
            Ok(true) => port.read(buffer).unwrap_or(0),
            _ => 0,
        };
        buffer.get(..count).unwrap_or_default()
    }

    /// Sends what waits, as much of it as the port takes.
    pub fn flush(&mut self, port: &mut impl Port) {
        let taken = written(self.waiting.bytes(), port);
        self.waiting.drop_first(taken);
    }

    /// Sends a message, or drops and counts it. Its number is used up either way, so that the host sees
    /// the gap.
    pub fn send(&mut self, message: Telemetry, urgency: Urgency, port: &mut impl Port) {
        let envelope = Envelope {
            sequence: self.sequence,
            body: message,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.flush(port);
        let mut buffer = [0; FRAME_BYTES];
        let sent = encode(&envelope, &mut buffer).is_ok_and(|frame| {
            if self.waiting.bytes().is_empty() {
                let taken = written(frame, port);
                self.waiting.add(frame.get(taken..).unwrap_or_default())
            } else {
                urgency == Urgency::Prompt && self.waiting.add(frame)
            }
        });
        if !sent {
            self.counters.dropped = self.counters.dropped.saturating_add(1);
        }
    }
}

/// Writes as much as a port takes without a wait, and says how much that was. A port that fails takes nothing.
fn written(bytes: &[u8], port: &mut impl Port) -> usize {
    let mut taken = 0;
    while let Some(rest) = bytes.get(taken..).filter(|rest| !rest.is_empty()) {
        let count = match port.write_ready() {
            Ok(true) => port.write(rest).unwrap_or(0),
            _ => 0,
        };
        if count == 0 {
            break;
        }
        taken += count;
    }
    taken
}

/// Bytes in the order in which they go out.
#[derive(Debug, Clone)]
struct Waiting {
    buffer: [u8; WAITING_BYTES],
    start: usize,
    end: usize,
}

impl Waiting {
    const fn new() -> Self {
        Self {
            buffer: [0; WAITING_BYTES],
            start: 0,
            end: 0,
        }
    }

    fn bytes(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }

    fn drop_first(&mut self, count: usize) {
        self.start += count;
        if self.start >= self.end {
            (self.start, self.end) = (0, 0);
        }
    }

    /// Adds all of it or nothing; whether it did.
    fn add(&mut self, bytes: &[u8]) -> bool {
        if self.end + bytes.len() > WAITING_BYTES {
            self.move_to_front();
        }
        let end = self.end + bytes.len();
        let Some(place) = self.buffer.get_mut(self.end..end) else {
            return false;
        };
        place.copy_from_slice(bytes);
        self.end = end;
        true
    }

    fn move_to_front(&mut self) {
        let length = self.end - self.start;
        // One by one: a copy within a slice has bounds that may panic.
        for at in 0..length {
            let byte = self.buffer.get(self.start + at).copied();
            if let (Some(place), Some(byte)) = (self.buffer.get_mut(at), byte) {
                *place = byte;
            }
        }
        (self.start, self.end) = (0, length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_that_wait_go_out_in_order_and_whole_or_not_at_all() {
        let mut waiting = Waiting::new();
        let (mut into, mut out) = (0_u32, 0_u32);
        for round in 0..2_000_u32 {
            let frame: [u8; 97] = core::array::from_fn(|at| (into + at as u32) as u8);
            let before = waiting.bytes().len();
            let fits = before + 97 <= WAITING_BYTES;
            assert_eq!(waiting.add(&frame), fits);
            into += if fits { 97 } else { 0 };
            let taken = (round * 37 % 150).min(waiting.bytes().len() as u32);
            for &byte in &waiting.bytes()[..taken as usize] {
                assert_eq!(byte, out as u8);
                out += 1;
            }
            waiting.drop_first(taken as usize);
        }
        assert!(out > 97 * 700, "{out}");
        assert_eq!(waiting.bytes().len() as u32, into - out);
    }
}
