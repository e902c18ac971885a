//! Cutting a stream of bytes into frames and back.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use serde::{Deserialize, Serialize};

/// Longest body of a frame, without its checksum.
pub const BODY_BYTES: usize = 224;

/// Longest frame on the wire: body, checksum, one byte of COBS for each 254 and the closing zero.
pub const FRAME_BYTES: usize = BODY_BYTES + 4 + 1 + 1;

/// Bytes of the checksum.
const CRC_BYTES: usize = 4;

/// CRC-32 of IEEE 802.3 by a table of 1 KiB.
static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// A message longer than [`BODY_BYTES`], or a buffer too short for its frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EncodeError;

/// Why a frame was thrown away.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// Wrong checksum, or no COBS.
    Corrupt,
    /// Longer than [`FRAME_BYTES`].
    Oversized,
    /// Whole, but not a message of the type expected.
    Foreign,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("message does not fit a frame")
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Corrupt => "corrupt frame",
            Self::Oversized => "frame too long",
            Self::Foreign => "frame of another protocol",
        })
    }
}

impl core::error::Error for EncodeError {}
impl core::error::Error for FrameError {}

/// Writes a message as a frame, closing zero included, and returns the bytes used.
///
/// # Errors
/// [`EncodeError`]; the buffer's content is then of no use.
pub fn encode<'a, T: Serialize>(
    message: &T,
    buffer: &'a mut [u8; FRAME_BYTES],
) -> Result<&'a [u8], EncodeError> {
    // The body is written one byte in, so that COBS can be done in place: below 254 bytes it moves
    // nothing and replaces each zero by the distance to the next.
    let (code, rest) = buffer.split_first_mut().ok_or(EncodeError)?;
    let body_room = rest.get_mut(..BODY_BYTES).ok_or(EncodeError)?;
    let body = postcard::to_slice(message, body_room)
        .map_err(|_| EncodeError)?
        .len();
    let checksum = CRC.checksum(rest.get(..body).ok_or(EncodeError)?);
    let length = body + CRC_BYTES;
    rest.get_mut(body..length)
        .ok_or(EncodeError)?
        .copy_from_slice(&checksum.to_le_bytes());
    *rest.get_mut(length).ok_or(EncodeError)? = 0;

    // Backwards: each zero becomes the distance to the one after it.
    let mut distance = 1_u8;
    for byte in rest.get_mut(..length).ok_or(EncodeError)?.iter_mut().rev() {
        if *byte == 0 {
            *byte = distance;
            distance = 1;
        } else {
            distance = distance.wrapping_add(1);
        }
    }
    *code = distance;
    buffer.get(..length + 2).ok_or(EncodeError)
}

// COBS in place needs every group shorter than 254 bytes.
const _: () = assert!(BODY_BYTES + CRC_BYTES < 254);

/// Collects bytes until a zero and reads what came before it.
#[derive(Debug, Clone)]
pub struct FrameReader {
    buffer: [u8; FRAME_BYTES],
    length: usize,
    oversized: bool,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameReader {
    /// Between two frames.
    pub const fn new() -> Self {
        Self {
            buffer: [0; FRAME_BYTES],
            length: 0,
            oversized: false,
        }
    }

    /// Takes the next byte; at the end of a frame, what it held. Zeros between frames are nothing.
    pub fn push<'a, T: Deserialize<'a>>(&'a mut self, byte: u8) -> Option<Result<T, FrameError>> {
        self.ends(byte).then(|| self.take())
    }

    /// Takes the next byte and tells whether it ends a frame; read it with [`FrameReader::take`].
    #[inline]
    pub fn ends(&mut self, byte: u8) -> bool {
        if byte == 0 {
            return self.length > 0 || self.oversized;
        }
        match self.buffer.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length += 1;
            }
            None => self.oversized = true,
        }
        false
    }

    /// Reads the frame that has ended and makes room for the next.
    ///
    /// # Errors
    /// [`FrameError`]; the frame is gone either way.
    pub fn take<'a, T: Deserialize<'a>>(&'a mut self) -> Result<T, FrameError> {
        let length = core::mem::take(&mut self.length);
        if core::mem::take(&mut self.oversized) {
            return Err(FrameError::Oversized);
        }
        let encoded = self.buffer.get_mut(..length).ok_or(FrameError::Oversized)?;
        let payload = unstuff(encoded).ok_or(FrameError::Corrupt)?;
        let (body, checksum) = payload
            .split_last_chunk::<CRC_BYTES>()
            .ok_or(FrameError::Corrupt)?;
        if CRC.checksum(body) != u32::from_le_bytes(*checksum) {
            return Err(FrameError::Corrupt);
        }
        match postcard::take_from_bytes(body) {
            Ok((message, [])) => Ok(message),
            _ => Err(FrameError::Foreign),
        }
    }
}

/// Undoes COBS in place; the payload is all but the first byte. None where a distance leads outside.
fn unstuff(encoded: &mut [u8]) -> Option<&[u8]> {
    let (first, rest) = encoded.split_first_mut()?;
    let mut distance = *first;
    for byte in rest.iter_mut() {
        distance = distance.checked_sub(1)?;
        if distance == 0 {
            distance = *byte;
            *byte = 0;
            // 0xFF would begin a group without a zero after it; none of our frames is as long.
            if distance == u8::MAX {
                return None;
            }
        }
    }
    (distance == 1).then_some(rest)
}
