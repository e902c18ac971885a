//! MDF files as `falcon_mdf` reads them without loss.
//!
//! It loses records of an unsorted group that straddle two data blocks, and says nothing: the blocks of such a group are joined into one, which lies
//! behind the end of the file. It refuses versions after 4.20 that differ only in what is not read here: the version is told as 4.20. It refuses a
//! version 4 file with a link into what was cut off: the link is taken out, and what it led to is told as lost. It refuses a version 3 file that was
//! cut off: its counts are lowered to what is there. Everything else is read as it lies.

use std::collections::{HashMap, HashSet};
use std::io::Read;
use std::sync::Mutex;

use falcon_mdf::error::{Mf4Error, Result as MdfResult};
use falcon_mdf::io::{ByteSlice, ByteSource};

use crate::MOST_BYTES;
use crate::error::Problem;
use crate::file_bytes::FileBytes;

/// Most blocks that a chain may have before it is taken for a ring.
const LONGEST_CHAIN: usize = 1_000_000;

/// A file with some of its bytes replaced and some added behind its end.
pub(crate) struct Patched {
    file: Mutex<FileBytes>,
    length: u64,
    replaced: Vec<(u64, Vec<u8>)>,
    added: Vec<u8>,
}

/// A file that can be read, and what had to be said of it.
pub(crate) struct Mended {
    pub(crate) source: Patched,
    /// Readings that a channel group announces, by the place of its block.
    pub(crate) announced: HashMap<u64, u64>,
    pub(crate) faults: Vec<String>,
}

impl ByteSource for Patched {
    fn len(&self) -> u64 {
        self.length + self.added.len() as u64
    }

    fn read_bytes(&self, offset: u64, len: usize) -> MdfResult<ByteSlice<'_>> {
        if len == 0 {
            return Ok(ByteSlice::Borrowed(&[]));
        }
        let end = offset
            .checked_add(len as u64)
            .filter(|&end| end <= self.len());
        let Some(end) = end else {
            let there = self.len().saturating_sub(offset);
            return Err(Mf4Error::truncated(
                offset,
                len,
                usize::try_from(there).unwrap_or(usize::MAX),
            ));
        };
        if offset >= self.length {
            let from = usize::try_from(offset - self.length).unwrap_or(usize::MAX);
            let added = self.added.get(from..from + len);
            return added
                .map(ByteSlice::Borrowed)
                .ok_or_else(|| Mf4Error::truncated(offset, len, 0));
        }
        let of_file = self.length.min(end) - offset;
        let mut bytes = {
            let file = self
                .file
                .lock()
                .map_err(|_| Mf4Error::parse_error("the file is in use"))?;
            file.exact(offset, of_file)
                .map_err(|problem| Mf4Error::parse_error(problem.in_words()))?
        };
        let more = len - bytes.len();
        bytes.extend_from_slice(self.added.get(..more).unwrap_or_default());
        for (at, new) in &self.replaced {
            let from = (*at).max(offset);
            let to = (at + new.len() as u64).min(end);
            if from < to {
                let (target, source) = ((from - offset) as usize, (from - at) as usize);
                let count = (to - from) as usize;
                bytes[target..target + count].copy_from_slice(&new[source..source + count]);
            }
        }
        Ok(ByteSlice::Owned(bytes))
    }
}

fn le64(bytes: &[u8], at: usize) -> u64 {
    let word = bytes.get(at..at + 8).and_then(|word| word.try_into().ok());
    u64::from_le_bytes(word.unwrap_or_default())
}

/// A block of version 4: its links and its data; `None` where it is not that block, or not wholly there.
fn block(file: &FileBytes, at: u64, id: &[u8; 4]) -> Option<(Vec<u64>, Vec<u8>)> {
    let head = file.exact(at, 24).ok()?;
    if &head[..4] != id {
        return None;
    }
    let (length, links) = (le64(&head, 8), le64(&head, 16));
    let body = file.exact(at + 24, length.checked_sub(24)?).ok()?;
    let links = usize::try_from(links)
        .ok()
        .filter(|&links| links <= body.len() / 8)?;
    let data = body.get(links * 8..)?.to_vec();
    Some(((0..links).map(|k| le64(&body, k * 8)).collect(), data))
}

/// Prepares a file of version 4.
pub(crate) fn mended4(file: FileBytes) -> Result<Mended, Problem> {
    let mut replaced = Vec::new();
    let mut added = Vec::new();
    let mut faults = Vec::new();
    let mut announced = HashMap::new();
    let length = file.length();
    let head = file.exact(0, 64)?;
    let version = u16::from_le_bytes([head[28], head[29]]);
    if version >= 500 {
        return Err(Problem::at_byte(
            28,
            format!("MDF version {version} is not supported"),
        ));
    }
    if version > 420 {
        replaced.push((8, b"4.20    ".to_vec()));
        replaced.push((28, 420_u16.to_le_bytes().to_vec()));
        faults.push(format!(
            "version {}.{} read as 4.20",
            version / 100,
            version % 100
        ));
    }
    // Links of HD: data group first. Of DG: next, first channel group, data. Of CG: next. (ASAM MDF 4.2, tables of the blocks.)
    let mut next = block(&file, 64, b"##HD")
        .and_then(|(links, _)| links.first().copied())
        .unwrap_or(0);
    let mut seen = HashSet::new();
    // Where the link to the next data group is: it is cut where what it leads to is not there.
    let mut link_at = 64 + 24;
    while next != 0 && seen.len() < LONGEST_CHAIN && seen.insert(next) {
        let at = next;
        let Some((links, data)) = block(&file, at, b"##DG") else {
            faults.push(format!(
                "byte {at}: a data group is damaged or cut off: it and those behind it are not read"
            ));
            replaced.push((link_at, 0_u64.to_le_bytes().to_vec()));
            break;
        };
        let link = |k: usize| links.get(k).copied().unwrap_or(0);
        next = link(0);
        let mut group = link(1);
        if !is_whole(&file, group) {
            faults.push(format!(
                "byte {at}: the channels of a data group are damaged or cut off: it is not read"
            ));
            replaced.push((link_at, next.to_le_bytes().to_vec()));
            continue;
        }
        link_at = at + 24;
        while group != 0 && seen.len() < LONGEST_CHAIN && seen.insert(group) {
            let Some((links, data)) = block(&file, group, b"##CG") else {
                break;
            };
            announced.insert(group, le64(&data, 8));
            group = links.first().copied().unwrap_or(0);
        }
        let has_ids = data.first().is_some_and(|&size| size > 0);
        let records = link(2);
        if let Some(there) = cut_short(&file, records) {
            faults.push(format!("byte {records}: records are cut off"));
            replaced.push((records + 8, there.to_le_bytes().to_vec()));
        }
        let joins = has_ids || !is_list_whole(&file, records);
        if !joins || !is_list(&file, records) {
            continue;
        }
        let stream = joined(&file, records, &mut faults)?;
        if added.len() as u64 + stream.len() as u64 > MOST_BYTES {
            return Err(Problem::at_byte(
                at,
                format!("unsorted records of over {MOST_BYTES} bytes: sort the file first"),
            ));
        }
        // Blocks start at multiples of eight.
        while !(length + added.len() as u64).is_multiple_of(8) {
            added.push(0);
        }
        let place = length + added.len() as u64;
        added.extend_from_slice(b"##DT\0\0\0\0");
        added.extend_from_slice(&(24 + stream.len() as u64).to_le_bytes());
        added.extend_from_slice(&0_u64.to_le_bytes());
        added.extend_from_slice(&stream);
        replaced.push((at + 24 + 16, place.to_le_bytes().to_vec()));
    }
    Ok(Mended {
        source: Patched {
            file: Mutex::new(file),
            length,
            replaced,
            added,
        },
        announced,
        faults,
    })
}

/// Whether a channel group and all its channels can be read.
fn is_whole(file: &FileBytes, group: u64) -> bool {
    let Some((links, _)) = block(file, group, b"##CG") else {
        return false;
    };
    let mut channel = links.get(1).copied().unwrap_or(0);
    let mut seen = HashSet::new();
    while channel != 0 && seen.insert(channel) {
        let Some((links, _)) = block(file, channel, b"##CN") else {
            return false;
        };
        // Text of name and unit.
        let texts = [2, 6].map(|k| links.get(k).copied().unwrap_or(0));
        let is_there =
            |at: u64| at == 0 || end_of(file, at).is_some_and(|end| end <= file.length());
        if !texts.into_iter().all(is_there) {
            return false;
        }
        channel = links.first().copied().unwrap_or(0);
    }
    true
}

/// Where a block says that it ends.
fn end_of(file: &FileBytes, at: u64) -> Option<u64> {
    let head = file.exact(at, 24).ok()?;
    at.checked_add(le64(&head, 8))
}

/// The length of a plain block of records that ends with the file instead of where it says.
fn cut_short(file: &FileBytes, at: u64) -> Option<u64> {
    let head = file.exact(at, 24).ok().filter(|_| at != 0)?;
    let end = end_of(file, at).filter(|&end| end > file.length());
    (&head[..4] == b"##DT" && end.is_some()).then(|| file.length() - at)
}

/// Whether every block of a list is there as long as it says.
fn is_list_whole(file: &FileBytes, at: u64) -> bool {
    let mut list = match block(file, at, b"##HL") {
        Some((links, _)) => links.first().copied().unwrap_or(0),
        None => at,
    };
    let mut seen = HashSet::new();
    while list != 0 && seen.insert(list) {
        let Some((links, _)) = block(file, list, b"##DL") else {
            return false;
        };
        let mut data = links.iter().skip(1).filter(|&&data| data != 0);
        if !data.all(|&data| end_of(file, data).is_some_and(|end| end <= file.length())) {
            return false;
        }
        list = links.first().copied().unwrap_or(0);
    }
    true
}

fn is_list(file: &FileBytes, at: u64) -> bool {
    at != 0
        && file
            .exact(at, 4)
            .is_ok_and(|id| matches!(id.as_slice(), b"##HL" | b"##DL"))
}

/// The bytes of all blocks of a list, in order.
fn joined(file: &FileBytes, at: u64, faults: &mut Vec<String>) -> Result<Vec<u8>, Problem> {
    let mut list = match block(file, at, b"##HL") {
        Some((links, _)) => links.first().copied().unwrap_or(0),
        None => at,
    };
    let mut stream = Vec::new();
    let mut seen = HashSet::new();
    while list != 0 && seen.insert(list) {
        let Some((links, _)) = block(file, list, b"##DL") else {
            faults.push(format!(
                "byte {list}: a list of data blocks is damaged: what follows it is lost"
            ));
            break;
        };
        list = links.first().copied().unwrap_or(0);
        for &data in links.iter().skip(1).filter(|&&data| data != 0) {
            let room = MOST_BYTES.saturating_sub(stream.len() as u64);
            if !append(file, data, room, &mut stream)? {
                faults.push(format!(
                    "byte {data}: a data block is damaged or cut off: what follows it is lost"
                ));
                return Ok(stream);
            }
        }
    }
    Ok(stream)
}

/// Appends one block's bytes; false where they are not wholly there.
fn append(file: &FileBytes, at: u64, room: u64, stream: &mut Vec<u8>) -> Result<bool, Problem> {
    let too_much = || {
        Problem::at_byte(
            at,
            format!("unsorted records of over {MOST_BYTES} bytes: sort the file first"),
        )
    };
    let Ok(head) = file.exact(at, 24) else {
        return Ok(false);
    };
    let length = le64(&head, 8).saturating_sub(24);
    if &head[..4] == b"##DT" {
        if length > room {
            return Err(too_much());
        }
        let there = file.up_to(at + 24, length)?;
        stream.extend_from_slice(&there);
        return Ok(there.len() as u64 == length);
    }
    if &head[..4] != b"##DZ" {
        return Ok(false);
    }
    // DZ: type of the block that was packed (2), method (1), reserved (1), width to transpose (4), size before (8), size (8).
    let Ok(info) = file.exact(at + 24, 24) else {
        return Ok(false);
    };
    let (method, width, plain, packed) = (
        info[2],
        le64(&info, 0) >> 32,
        le64(&info, 8),
        le64(&info, 16),
    );
    if plain > room {
        return Err(too_much());
    }
    if method > 1 {
        return Err(Problem::at_byte(
            at,
            format!(
                "unsorted records packed by method {method} are not supported: sort the file first"
            ),
        ));
    }
    let Ok(bytes) = file.exact(at + 48, packed) else {
        return Ok(false);
    };
    let mut unpacked = Vec::new();
    let whole = flate2::read::ZlibDecoder::new(bytes.as_slice())
        .take(plain)
        .read_to_end(&mut unpacked)
        .is_ok();
    if !whole || unpacked.len() as u64 != plain {
        return Ok(false);
    }
    if method == 1 && width > 1 {
        unpacked = upright(&unpacked, usize::try_from(width).unwrap_or(usize::MAX));
    }
    stream.extend_from_slice(&unpacked);
    Ok(true)
}

/// Undoes the transposition of a block: columns of `width` bytes, and a rest as it is.
fn upright(turned: &[u8], width: usize) -> Vec<u8> {
    let rows = turned.len() / width;
    let mut out = Vec::with_capacity(turned.len());
    for row in 0..rows {
        out.extend((0..width).map(|column| turned[column * rows + row]));
    }
    out.extend_from_slice(&turned[rows * width..]);
    out
}

/// Prepares a file of version 3: sorted groups announce no more than is there.
pub(crate) fn mended3(file: FileBytes) -> Result<Mended, Problem> {
    let mut replaced = Vec::new();
    let mut faults = Vec::new();
    let mut announced = HashMap::new();
    let length = file.length();
    let head = file.exact(0, 64)?;
    let big = u16::from_le_bytes([head[24], head[25]]) != 0;
    let u16_at = |bytes: &[u8], at: usize| {
        let word: [u8; 2] = bytes
            .get(at..at + 2)
            .and_then(|word| word.try_into().ok())
            .unwrap_or_default();
        if big {
            u16::from_be_bytes(word)
        } else {
            u16::from_le_bytes(word)
        }
    };
    let u32_at = |bytes: &[u8], at: usize| {
        let word: [u8; 4] = bytes
            .get(at..at + 4)
            .and_then(|word| word.try_into().ok())
            .unwrap_or_default();
        if big {
            u32::from_be_bytes(word)
        } else {
            u32::from_le_bytes(word)
        }
    };
    // HD: id, size, first data group. DG: id, size, next, first channel group, trigger, data, number of channel groups, of record numbers.
    // CG: id, size, next, first channel, text, record number, channels, size of a record, records. (MDF specification 3.3.)
    let header = file.up_to(64, 164)?;
    let mut next = u64::from(u32_at(&header, 4));
    let mut seen = HashSet::new();
    while next != 0 && seen.len() < LONGEST_CHAIN && seen.insert(next) {
        let data = file.up_to(next, 28)?;
        if data.get(..2) != Some(b"DG") {
            break;
        }
        next = u64::from(u32_at(&data, 4));
        let (group, records) = (u64::from(u32_at(&data, 8)), u64::from(u32_at(&data, 16)));
        let (groups, numbers) = (u16_at(&data, 20), u64::from(u16_at(&data, 22)));
        let block = file.up_to(group, 30)?;
        if block.get(..2) != Some(b"CG") || groups != 1 {
            continue;
        }
        let size = u64::from(u16_at(&block, 20)) + numbers;
        let count = u64::from(u32_at(&block, 22));
        announced.insert(group, count);
        let there = length
            .saturating_sub(records)
            .checked_div(size)
            .unwrap_or(count);
        if records != 0 && count > there {
            faults.push(format!(
                "a group's records end early: {there} of {count} announced readings are there"
            ));
            let lowered = u32::try_from(there).unwrap_or(u32::MAX);
            let bytes = if big {
                lowered.to_be_bytes()
            } else {
                lowered.to_le_bytes()
            };
            replaced.push((group + 22, bytes.to_vec()));
        }
    }
    Ok(Mended {
        source: Patched {
            file: Mutex::new(file),
            length,
            replaced,
            added: Vec::new(),
        },
        announced,
        faults,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposed_bytes_stand_upright_again() {
        // Two records of three bytes, and a rest of one.
        assert_eq!(upright(&[1, 4, 2, 5, 3, 6, 7], 3), [1, 2, 3, 4, 5, 6, 7]);
    }
}
