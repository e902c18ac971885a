//! Reading pieces of a file without believing what it says of itself.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use crate::error::Problem;

/// Bytes fetched at a time, so that they stay near the processor.
const PIECE: u64 = 1 << 18;

/// A file of known length.
#[derive(Debug)]
pub(crate) struct FileBytes {
    file: File,
    length: u64,
}

impl FileBytes {
    pub(crate) fn new(file: File) -> Result<Self, Problem> {
        let length = file.metadata()?.len();
        Ok(Self { file, length })
    }

    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// As many bytes from there as the file has, `wanted` at most.
    pub(crate) fn up_to(&self, offset: u64, wanted: u64) -> Result<Vec<u8>, Problem> {
        let mut bytes = Vec::new();
        self.fill(offset, wanted, &mut bytes)?;
        Ok(bytes)
    }

    /// As [`FileBytes::up_to`], in place of what is in `bytes`.
    fn fill(&self, offset: u64, wanted: u64, bytes: &mut Vec<u8>) -> Result<(), Problem> {
        let there = self.length.saturating_sub(offset).min(wanted);
        let there = usize::try_from(there).map_err(|_| too_large(offset, there))?;
        // What was in it is written over, so it is cleared only where it grows.
        bytes.resize(there, 0);
        (&self.file).seek(SeekFrom::Start(offset))?;
        let mut filled = 0;
        while filled < bytes.len() {
            match (&self.file).read(&mut bytes[filled..])? {
                0 => break,
                read => filled += read,
            }
        }
        bytes.truncate(filled);
        Ok(())
    }

    /// Exactly so many numbers, one after the other, appended; they are fetched a piece at a time.
    #[allow(dead_code, reason = "of binary formats")]
    pub(crate) fn numbers(
        &self,
        offset: u64,
        count: u64,
        (number, big_endian): (Number, bool),
        out: &mut Vec<f64>,
    ) -> Result<(), Problem> {
        let size = number.size() as u64;
        let end = count
            .checked_mul(size)
            .and_then(|bytes| bytes.checked_add(offset))
            .filter(|&end| end <= self.length);
        let Some(end) = end else {
            return Err(short(offset, count, size, self.length));
        };
        out.reserve(usize::try_from(count).map_err(|_| too_large(offset, count))?);
        let mut bytes = Vec::new();
        let mut at = offset;
        while at < end {
            let now = (end - at).min(PIECE / size * size);
            self.fill(at, now, &mut bytes)?;
            if bytes.len() as u64 != now {
                return Err(Problem::at_byte(at, "the file has become shorter"));
            }
            number.extend(&bytes, big_endian, out);
            at += now;
        }
        Ok(())
    }

    #[allow(dead_code, reason = "of binary formats")]
    /// Exactly so many bytes; an error before anything is allocated if the file ends before.
    pub(crate) fn exact(&self, offset: u64, wanted: u64) -> Result<Vec<u8>, Problem> {
        let fits = offset
            .checked_add(wanted)
            .is_some_and(|end| end <= self.length);
        if !fits {
            return Err(Problem::at_byte(
                offset,
                format!(
                    "{wanted} bytes are announced, the file ends at byte {}",
                    self.length
                ),
            ));
        }
        let bytes = self.up_to(offset, wanted)?;
        if bytes.len() as u64 == wanted {
            return Ok(bytes);
        }
        Err(Problem::at_byte(offset, "the file has become shorter"))
    }

    #[allow(dead_code, reason = "not every format streams")]
    pub(crate) fn file(&self) -> &File {
        &self.file
    }
}

fn short(offset: u64, count: u64, size: u64, length: u64) -> Problem {
    Problem::at_byte(
        offset,
        format!("{count} numbers of {size} bytes are announced, the file ends at byte {length}"),
    )
}

fn too_large(offset: u64, bytes: u64) -> Problem {
    Problem::at_byte(
        offset,
        format!("{bytes} bytes are more than this machine can address"),
    )
}

/// Reads numbers out of bytes, in one order; `None` past the end.
#[allow(dead_code, reason = "of binary formats")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

#[allow(dead_code, reason = "each format uses some")]
impl<'a> Cursor<'a> {
    pub(crate) fn new(bytes: &'a [u8], big_endian: bool) -> Self {
        Self {
            bytes,
            at: 0,
            big: big_endian,
        }
    }

    pub(crate) fn at(&self) -> usize {
        self.at
    }

    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(count)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let mut array: [u8; N] = self.take(N)?.try_into().ok()?;
        if self.big {
            array.reverse();
        }
        Some(array)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.array().map(i32::from_le_bytes)
    }

    pub(crate) fn i64(&mut self) -> Option<i64> {
        self.array().map(i64::from_le_bytes)
    }

    pub(crate) fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
    }
}

/// A type of number as files hold it.
#[allow(dead_code, reason = "of binary formats")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F32,
    F64,
}

#[allow(dead_code, reason = "of binary formats")]
impl Number {
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Appends the numbers in the bytes, one after the other; a rest that is none is left.
    pub(crate) fn extend(self, bytes: &[u8], big_endian: bool, out: &mut Vec<f64>) {
        fn all<const N: usize>(
            bytes: &[u8],
            big_endian: bool,
            out: &mut Vec<f64>,
            number: impl Fn([u8; N]) -> f64,
        ) {
            let (cells, _) = bytes.as_chunks::<N>();
            if big_endian {
                out.extend(cells.iter().map(|&(mut cell)| {
                    cell.reverse();
                    number(cell)
                }));
            } else {
                out.extend(cells.iter().map(|&cell| number(cell)));
            }
        }
        match self {
            Self::I8 => all(bytes, big_endian, out, |b| f64::from(i8::from_le_bytes(b))),
            Self::I16 => all(bytes, big_endian, out, |b| f64::from(i16::from_le_bytes(b))),
            Self::I32 => all(bytes, big_endian, out, |b| f64::from(i32::from_le_bytes(b))),
            Self::I64 => all(bytes, big_endian, out, |b| i64::from_le_bytes(b) as f64),
            Self::U8 => all(bytes, big_endian, out, |b| f64::from(u8::from_le_bytes(b))),
            Self::U16 => all(bytes, big_endian, out, |b| f64::from(u16::from_le_bytes(b))),
            Self::U32 => all(bytes, big_endian, out, |b| f64::from(u32::from_le_bytes(b))),
            Self::U64 => all(bytes, big_endian, out, |b| u64::from_le_bytes(b) as f64),
            Self::F32 => all(bytes, big_endian, out, |b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => all(bytes, big_endian, out, f64::from_le_bytes),
        }
    }

    /// The number at the start of the bytes; `NaN` where there are too few.
    pub(crate) fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        fn array<const N: usize>(bytes: &[u8], big: bool) -> Option<[u8; N]> {
            let mut array: [u8; N] = bytes.get(..N)?.try_into().ok()?;
            if big {
                array.reverse();
            }
            Some(array)
        }
        let value = match self {
            Self::I8 => array(bytes, big_endian).map(|b| f64::from(i8::from_le_bytes(b))),
            Self::I16 => array(bytes, big_endian).map(|b| f64::from(i16::from_le_bytes(b))),
            Self::I32 => array(bytes, big_endian).map(|b| f64::from(i32::from_le_bytes(b))),
            Self::I64 => array(bytes, big_endian).map(|b| i64::from_le_bytes(b) as f64),
            Self::U8 => array(bytes, big_endian).map(|b| f64::from(u8::from_le_bytes(b))),
            Self::U16 => array(bytes, big_endian).map(|b| f64::from(u16::from_le_bytes(b))),
            Self::U32 => array(bytes, big_endian).map(|b| f64::from(u32::from_le_bytes(b))),
            Self::U64 => array(bytes, big_endian).map(|b| u64::from_le_bytes(b) as f64),
            Self::F32 => array(bytes, big_endian).map(|b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => array(bytes, big_endian).map(f64::from_le_bytes),
        };
        value.unwrap_or(f64::NAN)
    }
}
