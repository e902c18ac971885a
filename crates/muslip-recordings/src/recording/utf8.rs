//! A reader that passes on UTF-8 and stops at the first byte that is not.

use std::io::{self, Read};

/// Marks the error that [`Utf8Reader`] ends with; carries the offset of the first bad byte.
#[derive(Debug, thiserror::Error)]
#[error("byte {0} is not UTF-8")]
pub(super) struct NotUtf8At(pub(super) u64);

/// Passes bytes on as long as they are UTF-8. Everything before a bad byte comes through first, so
/// that an earlier complaint of the caller's is still made first.
#[derive(Debug)]
pub(super) struct Utf8Reader<R> {
    inner: R,
    /// Bytes that were checked and passed on.
    passed: u64,
    /// The tail of a chunk that may be the start of a character: at most three bytes.
    pending: Vec<u8>,
    broken: bool,
}

impl<R: Read> Utf8Reader<R> {
    pub(super) fn new(inner: R) -> Self {
        Self {
            inner,
            passed: 0,
            pending: Vec::with_capacity(4),
            broken: false,
        }
    }

    pub(super) fn bytes_passed(&self) -> u64 {
        self.passed
    }

    fn failure(&self) -> io::Error {
        io::Error::new(io::ErrorKind::InvalidData, NotUtf8At(self.passed))
    }
}

impl<R: Read> Read for Utf8Reader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.broken {
            return Err(self.failure());
        }
        // Read only through a buffer of many bytes: one too small for a character could not advance.
        debug_assert!(buffer.len() >= 8);
        loop {
            let held = self.pending.len();
            buffer[..held].copy_from_slice(&self.pending);
            let read = self.inner.read(&mut buffer[held..])?;
            let filled = held + read;
            let (valid, broken) = match str::from_utf8(&buffer[..filled]) {
                Ok(_) => (filled, false),
                // A character cut off by the end of the chunk may go on in the next one.
                Err(error) => (
                    error.valid_up_to(),
                    error.error_len().is_some() || read == 0,
                ),
            };
            self.broken = broken;
            self.pending.clear();
            if !broken {
                self.pending.extend_from_slice(&buffer[valid..filled]);
            }
            self.passed += valid as u64;
            if valid == 0 && broken {
                return Err(self.failure());
            }
            if valid > 0 || read == 0 {
                return Ok(valid);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::io::{BufRead, BufReader};

    /// Hands out its bytes in pieces of one size.
    struct Pieces<'a>(&'a [u8], usize);

    impl Read for Pieces<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let size = self.1.min(self.0.len()).min(buffer.len());
            let (now, later) = self.0.split_at(size);
            buffer[..size].copy_from_slice(now);
            self.0 = later;
            Ok(size)
        }
    }

    proptest! {
        #[test]
        fn passes_on_exactly_the_valid_beginning(
            text in "\\PC{0,20}",
            tail in proptest::collection::vec(any::<u8>(), 0..5),
            piece in 1usize..9,
        ) {
            let bytes = [text.as_bytes(), &tail].concat();
            let valid = match str::from_utf8(&bytes) {
                Ok(_) => bytes.len(),
                Err(error) => error.valid_up_to(),
            };
            let mut passed = Vec::new();
            let mut reader = BufReader::with_capacity(16, Utf8Reader::new(Pieces(&bytes, piece)));
            let outcome = loop {
                match reader.fill_buf() {
                    Ok([]) => break Ok(()),
                    Ok(chunk) => passed.extend_from_slice(chunk),
                    Err(error) => break Err(error),
                }
                reader.consume(reader.buffer().len());
            };
            prop_assert_eq!(&passed, &bytes[..valid]);
            prop_assert_eq!(outcome.is_ok(), valid == bytes.len());
        }
    }
}
