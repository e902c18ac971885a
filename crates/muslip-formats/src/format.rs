//! Which format a file is in, by its bytes.

use crate::error::Problem;
use crate::file_bytes::FileBytes;

/// A format of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// Text with a delimiter.
    Csv,
    /// ASAM MDF 2 and 3.
    Mdf3,
    /// ASAM MDF 4.
    Mdf4,
    /// TDMS of LabVIEW and DIAdem.
    Tdms,
    /// MAT v4 to v7.
    Mat,
    /// MAT v7.3, which is HDF5.
    Mat73,
    /// HDF5.
    Hdf5,
    /// Parquet.
    Parquet,
    /// Arrow IPC, which is Feather v2.
    Arrow,
}

impl Format {
    /// The word for it in `muslip channels --json`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Mdf3 => "mdf3",
            Self::Mdf4 => "mdf4",
            Self::Tdms => "tdms",
            Self::Mat => "mat",
            Self::Mat73 => "mat73",
            Self::Hdf5 => "hdf5",
            Self::Parquet => "parquet",
            Self::Arrow => "arrow",
        }
    }

    /// Whether each of its channels has a time by its group, and none is looked for among the other channels.
    pub(crate) fn has_own_time(self) -> bool {
        matches!(self, Self::Mdf3 | Self::Mdf4)
    }

    /// Tells the format by the file's bytes, never by its name.
    ///
    /// # Errors
    /// [`Problem`]: the file cannot be read, or is of a known format that is not supported (Feather v1, TDMS indices, encrypted archives).
    pub(crate) fn of(file: &FileBytes) -> Result<Self, Problem> {
        let head = file.up_to(0, 512)?;
        let starts = |magic: &[u8]| head.starts_with(magic);
        if starts(b"MDF     ") || starts(b"UnFinMF ") {
            // The number behind the program's name in both; its text where that is no number.
            let version = head.get(8..16).unwrap_or_default();
            let four = version.first() == Some(&b'4')
                || head
                    .get(28..30)
                    .is_some_and(|v| u16::from_le_bytes([v[0], v[1]]) >= 400);
            return Ok(if four { Self::Mdf4 } else { Self::Mdf3 });
        }
        if starts(b"TDSm") {
            return Ok(Self::Tdms);
        }
        if starts(b"TDSh") {
            return Err(Problem::whole(
                "a TDMS index: give the .tdms file beside it",
            ));
        }
        if starts(b"PAR1") {
            return Ok(Self::Parquet);
        }
        if starts(b"PARE") {
            return Err(Problem::whole(
                "Parquet with an encrypted footer is not supported",
            ));
        }
        if starts(b"ARROW1") {
            return Ok(Self::Arrow);
        }
        if starts(b"FEA1") {
            return Err(Problem::whole(
                "Feather v1 is not supported: write Feather v2 or Parquet",
            ));
        }
        if let Some(name) = archive(&head) {
            return Err(Problem::whole(format!(
                "{name} is no format of recordings: unpack or export it"
            )));
        }
        let mut offset = 0;
        while offset < file.length().min(1 << 30) {
            if file.up_to(offset, 8)? == b"\x89HDF\r\n\x1a\n" {
                return Ok(if starts(b"MATLAB") {
                    Self::Mat73
                } else {
                    Self::Hdf5
                });
            }
            offset = if offset == 0 { 512 } else { offset * 2 };
        }
        if starts(b"MATLAB ")
            || matches!(
                head.get(124..128),
                Some([0, 1, b'I', b'M'] | [1, 0, b'M', b'I'])
            )
        {
            return Ok(Self::Mat);
        }
        if is_text(&head) {
            return Ok(Self::Csv);
        }
        if is_mat4(&head, file.length()) {
            return Ok(Self::Mat);
        }
        Err(Problem::whole(
            "not a recording: neither text nor MDF, TDMS, MAT, HDF5, Parquet or Arrow",
        ))
    }
}

fn archive(head: &[u8]) -> Option<&'static str> {
    [
        (&b"PK\x03\x04"[..], "a ZIP archive or Office document"),
        (b"\x1f\x8b", "a gzip archive"),
        (b"\x28\xb5\x2f\xfd", "a zstd archive"),
        (b"7z\xbc\xaf", "a 7z archive"),
        (b"\xd0\xcf\x11\xe0", "an Office document"),
        (b"%PDF", "a PDF document"),
    ]
    .into_iter()
    .find(|(magic, _)| head.starts_with(magic))
    .map(|(_, name)| name)
}

/// Text has no zero bytes, but for UTF-16 with its mark.
fn is_text(head: &[u8]) -> bool {
    head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") || !head.contains(&0)
}

/// MAT v4 has no magic: five numbers of which each has few values, and whose product fits the file.
fn is_mat4(head: &[u8], length: u64) -> bool {
    let Some(words) = head.get(..20) else {
        return false;
    };
    let header = |big: bool| {
        let mut numbers = words.chunks_exact(4).map(|word| {
            let bytes = [word[0], word[1], word[2], word[3]];
            if big {
                u32::from_be_bytes(bytes)
            } else {
                u32::from_le_bytes(bytes)
            }
        });
        let [kind, rows, columns, complex, name] =
            std::array::from_fn(|_| numbers.next().unwrap_or(u32::MAX));
        let digits = [kind / 1000, kind / 100 % 10, kind / 10 % 10, kind % 10];
        let size = [8, 4, 4, 2, 2, 1]
            .get(digits[2] as usize)
            .copied()
            .unwrap_or(0);
        let bytes = u64::from(rows)
            .saturating_mul(u64::from(columns))
            .saturating_mul(size);
        kind < 5000
            && digits[1] == 0
            && digits[2] <= 5
            && digits[3] <= 2
            && complex <= 1
            && (2..=64).contains(&name)
            && bytes <= length
    };
    header(false) || header(true)
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn what_cannot_be_read_is_named_with_what_to_do() {
        let told = |start: &[u8]| {
            let mut file = tempfile::tempfile().unwrap();
            file.write_all(start).unwrap();
            file.write_all(&[0; 600]).unwrap();
            let format = Format::of(&FileBytes::new(file).unwrap());
            format.expect_err("is refused").reason
        };
        for (start, reason) in [
            (
                &b"FEA1"[..],
                "Feather v1 is not supported: write Feather v2 or Parquet",
            ),
            (b"TDSh", "a TDMS index: give the .tdms file beside it"),
            (b"PARE", "Parquet with an encrypted footer is not supported"),
            (
                b"PK\x03\x04",
                "a ZIP archive or Office document is no format of recordings: unpack or export it",
            ),
        ] {
            assert_eq!(told(start), reason);
        }
    }
}
