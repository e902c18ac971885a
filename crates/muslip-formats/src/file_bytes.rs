//! Reading pieces of a file without believing what it says of itself.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use crate::error::Problem;
#[cfg(any(feature = "mat", feature = "tdms"))]
use crate::number::Number;

/// Bytes fetched at a time, so that they stay near the processor.
#[cfg(any(feature = "mat", feature = "tdms"))]
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
    #[cfg(any(feature = "mat", feature = "tdms"))]
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

    /// Exactly so many bytes; an error before anything is allocated if the file ends before.
    #[cfg(any(
        feature = "arrow",
        feature = "mat",
        feature = "mdf",
        feature = "parquet",
        feature = "tdms"
    ))]
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

    /// The file itself, for libraries that read it.
    #[cfg(any(
        feature = "arrow",
        feature = "csv",
        feature = "hdf5",
        feature = "mat",
        feature = "parquet"
    ))]
    pub(crate) fn file(&self) -> &File {
        &self.file
    }
}

#[cfg(any(feature = "mat", feature = "tdms"))]
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
