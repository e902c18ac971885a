//! A text of any encoding, line by line.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use encoding_rs::Encoding;
use encoding_rs_io::{DecodeReaderBytes, DecodeReaderBytesBuilder};

use crate::error::{Place, Problem};

/// Longest line, in bytes: what has longer ones is no table.
pub(super) const LONGEST_LINE: usize = 1 << 24;
/// Bytes of the text that are fetched at a time.
pub(super) const PIECE_BYTES: usize = 1 << 18;

/// A file from its beginning, wherever others read the same one.
pub(super) struct FromStart {
    file: File,
    at: u64,
}

impl Read for FromStart {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.file.seek(SeekFrom::Start(self.at))?;
        let read = self.file.read(bytes)?;
        self.at += read as u64;
        Ok(read)
    }
}

/// A file as text in UTF-8, but for bytes that are no characters.
pub(super) enum Text {
    /// As it lies there.
    Utf8(FromStart),
    /// Recoded.
    Other(Box<DecodeReaderBytes<FromStart, Vec<u8>>>),
}

impl Text {
    pub(super) fn new(encoding: &'static Encoding, file: File) -> Self {
        let file = FromStart { file, at: 0 };
        if encoding == encoding_rs::UTF_8 {
            return Self::Utf8(file);
        }
        Self::Other(Box::new(decoder(encoding, file)))
    }

    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::Utf8(file) => file.read(bytes),
            Self::Other(file) => file.read(bytes),
        }
    }
}

/// The text line by line, each with its number; none is copied.
pub(super) struct Lines {
    text: Text,
    /// A piece of the text.
    buffer: Vec<u8>,
    /// Where in it what was not gone through begins, its last whole line ends, and the text so far.
    from: usize,
    whole: usize,
    filled: usize,
    ended: bool,
    /// The line that was gone to, without its end.
    line: std::ops::Range<usize>,
    pub(super) number: u64,
}

impl Lines {
    pub(super) fn new(text: Text) -> Self {
        Self {
            text,
            buffer: vec![0; PIECE_BYTES],
            from: 0,
            whole: 0,
            filled: 0,
            ended: false,
            line: 0..0,
            number: 0,
        }
    }

    /// Sees to it that there is a whole line ahead; false at the end.
    pub(super) fn fill(&mut self) -> Result<bool, Problem> {
        while self.from == self.whole {
            self.buffer.copy_within(self.from..self.filled, 0);
            self.filled -= self.from;
            (self.from, self.whole, self.line) = (0, 0, 0..0);
            if self.filled == self.buffer.len() {
                if self.filled >= LONGEST_LINE {
                    return Err(Problem {
                        place: Place::Text {
                            line: self.number + 1,
                            column: 1,
                        },
                        reason: format!("a line of over {LONGEST_LINE} bytes: not a table"),
                    });
                }
                self.buffer.resize(2 * self.filled, 0);
            }
            let Some(free) = self.buffer.get_mut(self.filled..) else {
                return Ok(false);
            };
            let read = match self.text.read(free) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
                read => read?,
            };
            if read == 0 && (self.ended || self.filled == 0) {
                return Ok(false);
            }
            let mut end = self.filled + read;
            if read == 0 {
                // The last line may have no end of its own.
                self.ended = true;
                self.buffer[end] = b'\n';
                end += 1;
            }
            if let Some(last) = memchr::memrchr(b'\n', &self.buffer[self.filled..end]) {
                self.whole = self.filled + last + 1;
            }
            self.filled = end;
        }
        Ok(true)
    }

    /// The whole lines ahead.
    pub(super) fn ahead(&self) -> &[u8] {
        &self.buffer[self.from..self.whole]
    }

    /// Leaves so many bytes behind, which are one line.
    pub(super) fn pass(&mut self, bytes: usize) {
        self.from += bytes;
        self.number += 1;
    }

    /// Goes to the next line; false at the end.
    pub(super) fn next(&mut self) -> Result<bool, Problem> {
        if !self.fill()? {
            return Ok(false);
        }
        let mut start = self.from;
        let ahead = self.ahead();
        let mut length = memchr::memchr(b'\n', ahead).unwrap_or(ahead.len());
        self.from = (start + length + 1).min(self.whole);
        while length > 0 && matches!(self.buffer[start + length - 1], b'\n' | b'\r') {
            length -= 1;
        }
        let end = start + length;
        if self.number == 0 && self.buffer[start..end].starts_with("\u{feff}".as_bytes()) {
            start += "\u{feff}".len();
        }
        self.line = start..end;
        self.number += 1;
        Ok(true)
    }

    /// The line that was gone to.
    pub(super) fn line(&self) -> &[u8] {
        &self.buffer[self.line.clone()]
    }
}

/// Where a byte of a line is, as a line and a character.
pub(super) fn place(number: u64, line: &str, byte: usize) -> Place {
    let before = line.get(..byte).unwrap_or_default();
    Place::Text {
        line: number,
        column: before.chars().count() as u64 + 1,
    }
}

pub(super) fn encoding_of(head: &[u8]) -> &'static Encoding {
    if let Some((encoding, _)) = Encoding::for_bom(head) {
        return encoding;
    }
    let valid = match str::from_utf8(head) {
        Ok(_) => true,
        // The head may end inside a character.
        Err(error) => error.error_len().is_none(),
    };
    if valid {
        return encoding_rs::UTF_8;
    }
    let mut detector = chardetng::EncodingDetector::new(chardetng::Iso2022JpDetection::Allow);
    detector.feed(head, true);
    detector.guess(None, chardetng::Utf8Detection::Allow)
}

pub(super) fn decoder<R: Read>(
    encoding: &'static Encoding,
    bytes: R,
) -> DecodeReaderBytes<R, Vec<u8>> {
    DecodeReaderBytesBuilder::new()
        .encoding(Some(encoding))
        .bom_override(true)
        .build(bytes)
}
