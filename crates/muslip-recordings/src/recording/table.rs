//! A file of another format, as the columns of a recording.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use muslip_formats::convert::{Converted, convert};
use muslip_formats::map::Map;
use muslip_formats::{Format, SourceFile};

use super::header::{Channel, Header, Required};
use crate::input_error::{InputError, InputProblem};

/// Bytes in which the header of a CSV is looked for.
const HEAD_BYTES: u64 = 1 << 16;

/// The columns of a file that is no CSV of the contract.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) header: Header,
    pub(super) converted: Converted,
}

impl Table {
    /// The columns of a file; `None` for a CSV of the contract, which is read row by row and tells what is wrong with it by line and column.
    pub(super) fn of(
        path: &Path,
        file: &File,
        text_start: u64,
        map: Option<&Map>,
    ) -> Result<Option<Self>, InputError> {
        let fail = |error| InputError::unreadable(path, &error);
        let head = head(file).map_err(fail)?;
        let text = head.get(text_start as usize..).unwrap_or_default();
        if text.trim_ascii().is_empty() || (map.is_none() && is_contract(text)) {
            return Ok(None);
        }
        let another = || file.try_clone().map_err(fail);
        let format = SourceFile::format_of(path, another()?)?;
        let mut source = match SourceFile::of_file(path, another()?) {
            Ok(source) => source,
            // Text without a table in it: what is missing of the contract's is said of it.
            Err(_) if format == Format::Csv && map.is_none() => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let converted = convert(&mut source, map)?;
        Ok(Some(Self {
            header: Header::new(converted.names.clone()),
            converted,
        }))
    }

    pub(super) fn rows(&self) -> usize {
        self.converted.columns.first().map_or(0, Vec::len)
    }

    /// An error where a column that the work needs was not found.
    pub(super) fn has(&self, path: &Path, required: Required) -> Result<(), InputError> {
        let fail = |problem| Err(InputError::whole_file(path, problem));
        let missing = required
            .channels()
            .find(|&channel| self.header.index(channel).is_none());
        if let Some(channel) = missing {
            return fail(InputProblem::missing(
                channel.name(),
                &self.converted.refused,
            ));
        }
        if self.rows() == 0 {
            return fail(InputProblem::NoUsableSample("no row".to_owned()));
        }
        Ok(())
    }
}

fn head(mut file: &File) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(0))?;
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(head)
}

/// Whether the first line that is no comment names a column of the contract, parted by commas.
fn is_contract(text: &[u8]) -> bool {
    let mut lines = text.split(|&byte| matches!(byte, b'\n' | b'\r'));
    let header = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"));
    header.is_some_and(|header| {
        header.split(|&byte| byte == b',').any(|cell| {
            let cell = cell.trim_ascii();
            let cell = cell
                .strip_prefix(b"\"")
                .and_then(|cell| cell.strip_suffix(b"\""))
                .unwrap_or(cell);
            Channel::ALL
                .iter()
                .any(|channel| channel.name().as_bytes() == cell.trim_ascii())
        })
    })
}
