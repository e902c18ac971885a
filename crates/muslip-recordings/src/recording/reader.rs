//! Reading a recording row by row, in bounded memory.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use csv::ByteRecord;
use muslip::sample::RigSample;
use muslip_formats::made::{COMMENT_BYTES, Made};
use muslip_formats::map::Map;

use super::header::{Channel, Header, Required};
use super::memory::{Memory, SharedColumn};
use super::position::{Place, line_and_column};
use super::table::Table;
use super::utf8::{NotUtf8At, Utf8Reader};
use crate::input_error::{InputError, InputProblem, quoted, shown};

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A recording on disk or in memory, to be read as often as needed.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    length_bytes: u64,
    source: Source,
}

/// What the rows are in.
#[derive(Debug)]
enum Source {
    /// A CSV of the contract.
    Text {
        file: File,
        /// Where the text starts: after the byte order mark, if there is one.
        text_start: u64,
        /// What its comments say of a conversion that it came from.
        made: Made,
    },
    /// A file in another format than the contract's.
    Table(Table),
    /// No file.
    Memory(Memory),
}

impl Recording {
    /// Opens a recording: a CSV with the contract's columns, or a file of any other format whose channels are told by their names and units.
    ///
    /// # Errors
    /// As [`Recording::open_mapped`].
    pub fn open(path: &Path) -> Result<Self, InputError> {
        Self::open_mapped(path, None)
    }

    /// Opens a recording whose channels a map names. A CSV with the contract's columns needs none; with one it is read by it. What comes through a pipe is first copied to an unnamed temporary file,
    /// because most jobs read it twice.
    ///
    /// # Errors
    /// [`InputError`] if there is no such file, it cannot be read, or its channels cannot be brought to columns: as
    /// [`muslip_formats::convert::convert`].
    pub fn open_mapped(path: &Path, map: Option<&Map>) -> Result<Self, InputError> {
        let fail = |error| InputError::unreadable(path, &error);
        let mut file = File::open(path).map_err(fail)?;
        let metadata = file.metadata().map_err(fail)?;
        if metadata.is_dir() {
            return Err(fail(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        let length_bytes = if metadata.is_file() {
            metadata.len()
        } else {
            let mut copy = tempfile::tempfile().map_err(fail)?;
            let length = io::copy(&mut file, &mut copy).map_err(fail)?;
            file = copy;
            length
        };
        file.rewind().map_err(fail)?;
        let mut start = Vec::with_capacity(BYTE_ORDER_MARK.len());
        (&file)
            .take(BYTE_ORDER_MARK.len() as u64)
            .read_to_end(&mut start)
            .map_err(fail)?;
        let text_start = if start == BYTE_ORDER_MARK { 3 } else { 0 };
        let source = match Table::of(path, &file, text_start, map)? {
            Some(table) => Source::Table(table),
            None => Source::Text {
                made: made_of(&file, length_bytes).map_err(fail)?,
                file,
                text_start,
            },
        };
        Ok(Self {
            path: path.to_owned(),
            length_bytes,
            source,
        })
    }

    /// A recording that is in memory already.
    #[must_use]
    pub fn of_memory(memory: Memory) -> Self {
        Self {
            path: memory.path().to_owned(),
            length_bytes: memory.length_bytes(),
            source: Source::Memory(memory),
        }
    }

    /// Reads a file of any format whole into memory, by a map or without one.
    ///
    /// # Errors
    /// [`InputError`] as for [`Recording::open_mapped`], [`Recording::rows`] and [`Rows::next_row`]; the drag may be missing.
    pub fn read_whole(path: &Path, map: Option<&Map>) -> Result<Memory, InputError> {
        let mut recording = Self::open_mapped(path, map)?;
        let (mut notes, mut refused) = (Vec::new(), Vec::new());
        if let Some(converted) = recording.converted() {
            notes.clone_from(&converted.notes);
            refused.clone_from(&converted.refused);
        }
        let made = recording.made().clone();
        let mut rows = recording.rows(Required::DragOptional)?;
        let header = rows.header().clone();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); header.names().len()];
        while let Some(row) = rows.next_row()? {
            for (column, &value) in columns.iter_mut().zip(row.cells()) {
                column.push(value);
            }
        }
        let rows = columns.first().map_or(0, Vec::len);
        let columns = columns
            .into_iter()
            .map(|column| Arc::new(column) as SharedColumn)
            .collect();
        Ok(Memory {
            path: path.to_owned(),
            header,
            columns,
            rows,
            notes,
            made,
            refused,
        })
    }

    /// What was read, converted, interpolated, decimated or dropped to get the columns from a file of another format; empty for a CSV of the
    /// contract.
    pub fn notes(&self) -> &[String] {
        match &self.source {
            Source::Text { .. } => &[],
            Source::Table(table) => &table.converted.notes,
            Source::Memory(memory) => memory.notes(),
        }
    }

    /// How the columns were made of a file of another format.
    pub fn converted(&self) -> Option<&muslip_formats::convert::Converted> {
        match &self.source {
            Source::Table(table) => Some(&table.converted),
            Source::Text { .. } | Source::Memory(_) => None,
        }
    }

    /// What a diagnosis must know of how the columns were made: of a file of another format, or of one that a recording says it was converted from.
    pub fn made(&self) -> &Made {
        match &self.source {
            Source::Text { made, .. } => made,
            Source::Table(table) => &table.converted.made,
            Source::Memory(memory) => memory.made(),
        }
    }

    /// Size of a recording before it is opened, for progress bars: of a pipe, which can be opened only
    /// once, nothing.
    ///
    /// # Errors
    /// [`InputError`] if there is no such file.
    pub fn announced_length_bytes(path: &Path) -> Result<u64, InputError> {
        let metadata =
            std::fs::metadata(path).map_err(|error| InputError::unreadable(path, &error))?;
        Ok(if metadata.is_file() {
            metadata.len()
        } else {
            0
        })
    }

    /// The file as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size of the file, for progress bars.
    pub fn length_bytes(&self) -> u64 {
        self.length_bytes
    }

    /// Starts a pass over the rows from the beginning.
    ///
    /// # Errors
    /// [`InputError`] if the file is empty or its header lacks a required column, has one twice, or one
    /// without a name.
    pub fn rows(&mut self, required: Required) -> Result<Rows<'_>, InputError> {
        let pass = match &self.source {
            Source::Table(table) => {
                table.has(&self.path, required)?;
                Some((table.header.clone(), Pass::Table(table)))
            }
            Source::Memory(memory) => {
                memory.has(required)?;
                Some((memory.header().clone(), Pass::Memory(memory)))
            }
            Source::Text { .. } => None,
        };
        if let Some((header, pass)) = pass {
            return Ok(Rows {
                recording: self,
                cells: vec![f64::NAN; header.names().len()],
                header,
                pass,
                rows_read: 0,
                last_time_s: f64::NEG_INFINITY,
            });
        }
        let text = Utf8Reader::new(self.rewound()?);
        let mut csv = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .buffer_capacity(1 << 16)
            .from_reader(text);
        let mut record = ByteRecord::new();
        match csv.read_byte_record(&mut record) {
            Ok(true) => {}
            Ok(false) => return Err(InputError::whole_file(&self.path, InputProblem::Empty)),
            Err(error) => return Err(self.read_failure(error)),
        }
        let header = self.header(&record, required)?;
        Ok(Rows {
            recording: self,
            pass: Pass::Text(Box::new(csv), record),
            cells: vec![f64::NAN; header.names().len()],
            header,
            rows_read: 0,
            last_time_s: f64::NEG_INFINITY,
        })
    }

    fn header(&self, record: &ByteRecord, required: Required) -> Result<Header, InputError> {
        let mut names: Vec<String> = Vec::with_capacity(record.len());
        for (cell, name) in record.iter().enumerate() {
            let name = String::from_utf8_lossy(name).trim().to_owned();
            let problem = if name.is_empty() {
                InputProblem::UnnamedColumn(cell + 1)
            } else if names.contains(&name) {
                InputProblem::ColumnTwice(quoted(&name))
            } else {
                names.push(name);
                continue;
            };
            return Err(self.error_at_cell(0, cell, problem));
        }
        let header = Header::new(names);
        for channel in required.channels() {
            if header.index(channel).is_none() {
                let problem = InputProblem::MissingColumn(channel.name());
                return Err(self.error_at_cell(0, 0, problem));
            }
        }
        Ok(header)
    }

    /// The file at the start of its text.
    fn rewound(&self) -> Result<&File, InputError> {
        let fail = |error| InputError::unreadable(&self.path, &error);
        match &self.source {
            Source::Text {
                file, text_start, ..
            } => {
                let mut at = file;
                at.seek(SeekFrom::Start(*text_start)).map_err(fail)?;
                Ok(file)
            }
            // Columns have no text to go back to, and nothing asks for it.
            Source::Table(_) | Source::Memory(_) => {
                Err(fail(io::Error::from(io::ErrorKind::Unsupported)))
            }
        }
    }

    fn error_at_cell(&self, record_from: u64, cell: usize, problem: InputProblem) -> InputError {
        self.error_at(Place::Cell { record_from, cell }, problem)
    }

    fn error_at(&self, place: Place, problem: InputProblem) -> InputError {
        // If the second look at the file fails, the problem is still told, at its beginning.
        let (line, column) = self
            .rewound()
            .ok()
            .and_then(|file| line_and_column(file, place).ok())
            .unwrap_or((1, 1));
        InputError {
            path: self.path.clone(),
            line,
            column,
            problem,
        }
    }

    fn read_failure(&self, error: csv::Error) -> InputError {
        let error = match error.into_kind() {
            csv::ErrorKind::Io(error) => error,
            // Nothing else is asked of the CSV reader here.
            other => io::Error::other(format!("{other:?}")),
        };
        match error
            .get_ref()
            .and_then(|inner| inner.downcast_ref::<NotUtf8At>())
        {
            Some(&NotUtf8At(byte)) => self.error_at(Place::Byte(byte), InputProblem::NotUtf8),
            None => InputError::unreadable(&self.path, &error),
        }
    }
}

/// What the comments of a text say of a conversion that it came from.
fn made_of(mut file: &File, length_bytes: u64) -> io::Result<Made> {
    let mut piece = |from: u64| {
        file.seek(SeekFrom::Start(from))?;
        let mut bytes = Vec::new();
        file.take(COMMENT_BYTES).read_to_end(&mut bytes)?;
        Ok::<_, io::Error>(bytes)
    };
    let first = piece(0)?;
    let last = piece(length_bytes.saturating_sub(COMMENT_BYTES))?;
    let is_whole = length_bytes <= COMMENT_BYTES;
    Ok(Made::of_text(&first, &last, is_whole))
}

/// Where the rows come from.
#[derive(Debug)]
enum Pass<'a> {
    Text(Box<csv::Reader<Utf8Reader<&'a File>>>, ByteRecord),
    Table(&'a Table),
    Memory(&'a Memory),
}

/// One pass over the rows of a recording.
#[derive(Debug)]
pub struct Rows<'a> {
    recording: &'a Recording,
    pass: Pass<'a>,
    header: Header,
    cells: Vec<f64>,
    rows_read: u64,
    last_time_s: f64,
}

impl Rows<'_> {
    /// The header row.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Bytes of the file gone through so far, for progress bars.
    pub fn bytes_read(&self) -> u64 {
        match &self.pass {
            Pass::Text(csv, _) => csv.get_ref().bytes_passed(),
            Pass::Table(table) => self.share_of_bytes(table.rows()),
            Pass::Memory(memory) => self.share_of_bytes(memory.rows()),
        }
    }

    fn share_of_bytes(&self, rows: usize) -> u64 {
        let share = self.rows_read as f64 / rows.max(1) as f64;
        (self.recording.length_bytes as f64 * share) as u64
    }

    /// Reads the next row; `None` after the last one.
    ///
    /// # Errors
    /// [`InputError`] with line and column: a row with too many or too few cells, a cell that is no
    /// number, bytes that are not UTF-8, a time that repeats or goes back, or no row at all.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, InputError> {
        let (csv, record) = match &mut self.pass {
            Pass::Text(csv, record) => (csv, record),
            Pass::Table(table) => {
                let row = usize::try_from(self.rows_read).unwrap_or(usize::MAX);
                if row >= table.rows() {
                    return Ok(None);
                }
                for (cell, column) in self.cells.iter_mut().zip(&table.converted.columns) {
                    *cell = column.get(row).copied().unwrap_or(f64::NAN);
                }
                self.rows_read += 1;
                return Ok(Some(Row {
                    header: &self.header,
                    cells: &self.cells,
                }));
            }
            Pass::Memory(memory) => {
                let row = usize::try_from(self.rows_read).unwrap_or(usize::MAX);
                if row >= memory.rows() {
                    return Ok(None);
                }
                memory.copy_row(row, &mut self.cells);
                self.rows_read += 1;
                return Ok(Some(Row {
                    header: &self.header,
                    cells: &self.cells,
                }));
            }
        };
        match csv.read_byte_record(record) {
            Ok(true) => {}
            Ok(false) if self.rows_read == 0 => {
                return Err(self
                    .recording
                    .error_at_cell(0, usize::MAX, InputProblem::HeaderOnly));
            }
            Ok(false) => return Ok(None),
            Err(error) => return Err(self.recording.read_failure(error)),
        }
        self.rows_read += 1;
        let (expected, found) = (self.cells.len(), record.len());
        if expected != found {
            return Err(self.error(
                expected.min(found),
                InputProblem::CellCount { expected, found },
            ));
        }
        let mut stray = None;
        for (index, (cell, value)) in record.iter().zip(&mut self.cells).enumerate() {
            match parse_cell(cell) {
                Some(number) => *value = number,
                None => {
                    let problem = InputProblem::NotANumber {
                        column: self.header.names().get(index).cloned().unwrap_or_default(),
                        cell: quoted(&String::from_utf8_lossy(cell)),
                    };
                    stray = Some((index, problem));
                    break;
                }
            }
        }
        if let Some((index, problem)) = stray {
            return Err(self.error(index, problem));
        }
        self.check_time()?;
        Ok(Some(Row {
            header: &self.header,
            cells: &self.cells,
        }))
    }

    fn check_time(&mut self) -> Result<(), InputError> {
        let now = self.header.value(&self.cells, Channel::Time);
        // A missing or infinite time orders nothing; the rows around it must still be in order.
        if !now.is_finite() {
            return Ok(());
        }
        let before = self.last_time_s;
        if now <= before {
            let problem = if now == before {
                InputProblem::TimeRepeats(shown(now))
            } else {
                InputProblem::TimeGoesBack {
                    before: shown(before),
                    now: shown(now),
                }
            };
            let cell = self.header.index(Channel::Time).unwrap_or_default();
            return Err(self.error(cell, problem));
        }
        self.last_time_s = now;
        Ok(())
    }

    fn error(&self, cell: usize, problem: InputProblem) -> InputError {
        let record_from = match &self.pass {
            Pass::Text(_, record) => record.position().map_or(0, csv::Position::byte),
            Pass::Table(_) | Pass::Memory(_) => 0,
        };
        self.recording.error_at_cell(record_from, cell, problem)
    }
}

/// A cell as a number; missing is `NaN`, and text that is neither is `None`.
fn parse_cell(cell: &[u8]) -> Option<f64> {
    let cell = cell.trim_ascii();
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    str::from_utf8(cell).ok()?.parse().ok()
}

/// One row of a recording.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    header: &'a Header,
    cells: &'a [f64],
}

impl Row<'_> {
    /// All cells in file order; a missing one is `NaN`.
    pub fn cells(&self) -> &[f64] {
        self.cells
    }

    /// The value of a channel; `NaN` where it is missing or the recording has no such column.
    pub fn value(&self, channel: Channel) -> f64 {
        self.header.value(self.cells, channel)
    }

    /// Time of the row in s.
    pub fn time_s(&self) -> f64 {
        self.value(Channel::Time)
    }

    /// The four channels of which slip and friction are made.
    pub fn rig_sample(&self) -> RigSample<f64> {
        self.header.rig_sample(self.cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_in_memory_are_those_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        std::fs::write(
            &path,
            "time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n,x\n0,1,2,3,4,5\n0.1,,2,3,4,6\n",
        )
        .unwrap();
        let memory = Recording::read_whole(&path, None).unwrap();
        assert_eq!(memory.rows(), 2);
        let rows = |recording: &mut Recording| {
            let mut rows = recording.rows(Required::DragIncluded).unwrap();
            let mut found = Vec::new();
            while let Some(row) = rows.next_row().unwrap() {
                found.push(row.cells().iter().map(|v| v.to_bits()).collect::<Vec<_>>());
            }
            found
        };
        assert_eq!(
            rows(&mut Recording::of_memory(memory)),
            rows(&mut Recording::open(&path).unwrap())
        );
    }
}
