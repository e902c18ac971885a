//! Arrow IPC files, which are Feather v2.

use std::io::{BufReader, Seek, SeekFrom};

use arrow_ipc::reader::FileReader;

use crate::MOST_BYTES;
use crate::cells;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::source::{Channel, Series, Source};

/// An Arrow file.
pub(crate) struct ArrowSource {
    file: FileBytes,
    channels: Vec<Channel>,
}

fn problem(error: impl std::fmt::Display) -> Problem {
    Problem::whole(error.to_string())
}

impl ArrowSource {
    pub(crate) fn open(file: FileBytes) -> Result<Self, Problem> {
        let rows = checked(&file)?;
        let reader = reader(&file, None)?;
        let schema = reader.schema();
        let channels = schema
            .fields()
            .iter()
            .map(|field| cells::channel(field, rows))
            .collect();
        Ok(Self { file, channels })
    }
}

fn reader(
    file: &FileBytes,
    projection: Option<Vec<usize>>,
) -> Result<FileReader<BufReader<std::fs::File>>, Problem> {
    let mut inner = file.file().try_clone()?;
    inner.seek(SeekFrom::Start(0))?;
    FileReader::try_new(BufReader::with_capacity(1 << 16, inner), projection).map_err(problem)
}

/// Holds every block and buffer against the file, because the library allocates what a damaged one claims. Answers with the number of rows.
fn checked(file: &FileBytes) -> Result<u64, Problem> {
    let length = file.length();
    let cut = || Problem::whole("no footer: the file is cut off, or was never closed");
    let end = file.exact(length.saturating_sub(10), 10)?;
    if &end[4..] != b"ARROW1" {
        return Err(cut());
    }
    let footer_bytes = u64::from(u32::from_le_bytes([end[0], end[1], end[2], end[3]]));
    let start = length.checked_sub(10 + footer_bytes).ok_or_else(cut)?;
    let bytes = file.exact(start, footer_bytes)?;
    let footer = arrow_ipc::root_as_footer(&bytes).map_err(problem)?;
    let mut rows = 0_u64;
    let batches = footer
        .recordBatches()
        .into_iter()
        .flatten()
        .map(|block| (block, true));
    let dictionaries = footer
        .dictionaries()
        .into_iter()
        .flatten()
        .map(|block| (block, false));
    for (block, is_batch) in batches.chain(dictionaries) {
        let sizes = (
            u64::try_from(block.offset()),
            u64::try_from(block.metaDataLength()),
            u64::try_from(block.bodyLength()),
        );
        let (Ok(offset), Ok(metadata), Ok(body)) = sizes else {
            return Err(Problem::whole("a block has a negative size"));
        };
        let at = |reason: &str| Problem::at_byte(offset, reason);
        let end = offset
            .checked_add(metadata)
            .and_then(|end| end.checked_add(body));
        if end.is_none_or(|end| end > length) {
            return Err(at("a block reaches beyond the file"));
        }
        let bytes = file.exact(offset, metadata)?;
        // Since version 0.15 four bytes of ones come before the length.
        let skip = if bytes.starts_with(&[0xff; 4]) { 8 } else { 4 };
        let message = arrow_ipc::root_as_message(bytes.get(skip..).unwrap_or_default())
            .map_err(|error| at(&error.to_string()))?;
        let batch = if is_batch {
            message.header_as_record_batch()
        } else {
            message
                .header_as_dictionary_batch()
                .and_then(|dictionary| dictionary.data())
        };
        let batch = batch.ok_or_else(|| at("a block of another kind than the footer says"))?;
        if is_batch {
            rows = rows.saturating_add(
                u64::try_from(batch.length()).map_err(|_| at("a batch of a negative length"))?,
            );
        }
        let mut unpacked = 0_u64;
        for buffer in batch.buffers().into_iter().flatten() {
            let (Ok(from), Ok(size)) = (
                u64::try_from(buffer.offset()),
                u64::try_from(buffer.length()),
            ) else {
                return Err(at("a buffer has a negative size"));
            };
            if from.checked_add(size).is_none_or(|end| end > body) {
                return Err(at("a buffer reaches beyond its block"));
            }
            if batch.compression().is_some() && size >= 8 {
                let prefix = file.exact(offset + metadata + from, 8)?;
                let announced = i64::from_le_bytes(prefix.try_into().unwrap_or_default());
                unpacked = unpacked.saturating_add(u64::try_from(announced).unwrap_or(0));
                if unpacked > MOST_BYTES {
                    return Err(at("a batch unpacks to over 1 GiB"));
                }
            }
        }
    }
    Ok(rows)
}

impl Source for ArrowSource {
    fn start_time(&self) -> Option<String> {
        None
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        if let Some(text) = wanted
            .iter()
            .filter_map(|&k| self.channels.get(k))
            .find(|channel| !channel.kind.is_number())
        {
            return Err(Problem::of(
                text.shown(),
                format!("{}, not a number", text.kind.word()),
            ));
        }
        // A projection keeps the file's order, and each column once.
        let mut columns: Vec<usize> = wanted.to_vec();
        columns.sort_unstable();
        columns.dedup();
        let mut read: Vec<(Option<i64>, Vec<f64>, Vec<bool>)> =
            vec![(None, Vec::new(), Vec::new()); columns.len()];
        for batch in reader(&self.file, Some(columns.clone()))? {
            let batch = batch.map_err(problem)?;
            for (array, (origin, values, invalid)) in batch.columns().iter().zip(&mut read) {
                let taken = cells::append(array.as_ref(), origin, values, invalid);
                taken.ok_or_else(|| {
                    Problem::whole(format!("type {} is not supported", array.data_type()))
                })?;
            }
        }
        wanted
            .iter()
            .map(|column| {
                let channel = &self.channels[*column];
                let place = columns.binary_search(column).unwrap_or_default();
                let (_, values, invalid) = read.get(place).cloned().unwrap_or_default();
                if (values.len() as u64) != channel.samples {
                    return Err(Problem::of(
                        channel.shown(),
                        format!("{} of {} readings are there", values.len(), channel.samples),
                    ));
                }
                Ok(Series {
                    time_s: None,
                    values,
                    invalid: invalid.contains(&true).then_some(invalid),
                })
            })
            .collect()
    }

    fn faults(&self) -> Vec<String> {
        Vec::new()
    }
}
