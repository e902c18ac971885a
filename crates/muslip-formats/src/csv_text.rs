//! CSV of any dialect: delimiter, decimal mark, encoding, preamble and unit row are found from the text.

use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use encoding_rs::Encoding;
use encoding_rs_io::{DecodeReaderBytes, DecodeReaderBytesBuilder};

use crate::error::{Place, Problem};
use crate::file_bytes::FileBytes;
use crate::made::{COMMENT_BYTES, Made};
use crate::source::{Channel, Kind, Pieces, Series, Source};
use crate::time_text::stamp;
use crate::units;

/// Bytes that the dialect is told from.
const HEAD_BYTES: u64 = 1 << 18;
/// Lines of the head that are looked at.
const HEAD_LINES: usize = 400;
/// Rows of a piece.
const ROWS_A_PIECE: usize = 1 << 16;
/// Longest line, in bytes: what has longer ones is no table.
const LONGEST_LINE: usize = 1 << 24;
/// Bytes of the text that are fetched at a time.
const PIECE_BYTES: usize = 1 << 18;

/// A text file with a delimiter.
pub(crate) struct CsvSource {
    file: File,
    encoding: &'static Encoding,
    layout: Layout,
    channels: Vec<Channel>,
    /// How each column is read.
    cells: Vec<Cells>,
    made: Made,
    faults: Vec<String>,
}

/// Where things are in the text.
#[derive(Debug, Clone, PartialEq)]
struct Layout {
    /// `None`: any run of blanks.
    delimiter: Option<char>,
    decimal_comma: bool,
    columns: usize,
    /// Lines before the first row of data.
    skip_lines: u64,
    names: Vec<String>,
    units: Vec<String>,
}

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cells {
    Numbers,
    Stamps,
    Truths,
    Text,
}

impl CsvSource {
    pub(crate) fn open(bytes: FileBytes) -> Result<Self, Problem> {
        let head = bytes.up_to(0, HEAD_BYTES)?;
        let encoding = encoding_of(&head);
        let mut text = String::new();
        // An unfinished character at the head's end becomes a mark of its own, in a line that is not looked at.
        decoder(encoding, &head[..]).read_to_string(&mut text)?;
        let whole = (head.len() as u64) == bytes.length();
        let mut lines: Vec<&str> = text.lines().collect();
        if !whole {
            lines.pop();
        }
        lines.truncate(HEAD_LINES);
        let layout = Layout::of(&lines)?;
        let first = usize::try_from(layout.skip_lines).unwrap_or(usize::MAX);
        let sample: Vec<Vec<String>> = lines
            .iter()
            .skip(first)
            .filter(|line| !is_blank(line))
            .map(|line| split(line, layout.delimiter))
            .collect();
        let cells: Vec<Cells> = (0..layout.columns)
            .map(|column| {
                let cells = sample.iter().filter_map(|row| row.get(column));
                kind_of(cells.map(String::as_str), layout.decimal_comma)
            })
            .collect();
        let mut source = Self {
            file: bytes.file().try_clone()?,
            encoding,
            channels: Vec::new(),
            cells,
            made: made_of(&bytes)?,
            faults: Vec::new(),
            layout,
        };
        let rows = source.count()?;
        source.channels = source
            .layout
            .names
            .iter()
            .zip(&source.layout.units)
            .zip(&source.cells)
            .map(|((name, unit), cells)| Channel {
                group: String::new(),
                name: name.clone(),
                unit: if *cells == Cells::Stamps {
                    "s".to_owned()
                } else {
                    unit.clone()
                },
                samples: rows,
                comment: String::new(),
                kind: match cells {
                    Cells::Numbers | Cells::Stamps => Kind::Numeric,
                    Cells::Truths => Kind::Bool,
                    Cells::Text => Kind::Text,
                },
                is_time: false,
            })
            .collect();
        Ok(source)
    }

    /// The rows' lines, from the first row of data.
    fn lines(&self) -> Result<Lines, Problem> {
        let mut lines = Lines::new(Text::new(self.encoding, self.file.try_clone()?));
        while lines.number < self.layout.skip_lines && lines.next()? {}
        Ok(lines)
    }

    /// Counts rows, and tells of torn ones.
    fn count(&mut self) -> Result<u64, Problem> {
        let mut lines = self.lines()?;
        let mut rows = 0;
        while lines.next()? {
            let line = lines.line();
            if !is_filled(line) && is_blank(&String::from_utf8_lossy(line)) {
                continue;
            }
            rows += 1;
            let found = cell_count(line, self.layout.delimiter);
            if found != self.layout.columns && self.faults.len() < 10 {
                self.faults.push(format!(
                    "line {}: {found} cells where the header has {}",
                    lines.number, self.layout.columns
                ));
            }
        }
        Ok(rows)
    }

    /// The rows of some columns.
    fn rows<'a>(&'a self, wanted: &[usize]) -> Result<Rows<'a>, Problem> {
        for &column in wanted {
            let text = self
                .cells
                .get(column)
                .is_none_or(|&cells| cells == Cells::Text);
            if text {
                let name = self.layout.names.get(column).cloned().unwrap_or_default();
                return Err(Problem::of(name, "its cells are text, not numbers"));
            }
        }
        Ok(Rows {
            source: self,
            lines: self.lines()?,
            wanted: wanted.to_vec(),
            plain: PlainRows::of(&self.layout, &self.cells, wanted),
            row: Vec::with_capacity(wanted.len()),
            first_stamp: None,
            spans: Vec::new(),
        })
    }
}

/// A pass over the rows of some columns.
struct Rows<'a> {
    source: &'a CsvSource,
    lines: Lines,
    wanted: Vec<usize>,
    /// How rows of nothing but plain numbers are read.
    plain: Option<PlainRows>,
    /// Values of such a row.
    row: Vec<f64>,
    /// Second of the first time stamp: the others count from there.
    first_stamp: Option<i64>,
    spans: Vec<(usize, usize)>,
}

impl Rows<'_> {
    /// Appends so many rows at most to the columns; false at the end of the text.
    fn read(&mut self, most: usize, columns: &mut [Vec<f64>]) -> Result<bool, Problem> {
        let mut rows = 0;
        while rows < most {
            if !self.lines.fill()? {
                return Ok(false);
            }
            if let Some(plain) = &self.plain
                && let Some(used) = plain.row(self.lines.ahead(), &mut self.row)
            {
                self.lines.pass(used);
                for (&value, &target) in self.row.iter().zip(&plain.targets) {
                    columns[target].push(value);
                }
                rows += 1;
                continue;
            }
            rows += usize::from(self.any_row(columns)?);
        }
        Ok(true)
    }

    /// Appends the next line's cells, whatever they are; false where it is no row.
    fn any_row(&mut self, columns: &mut [Vec<f64>]) -> Result<bool, Problem> {
        let CsvSource { layout, cells, .. } = self.source;
        if !self.lines.next()? {
            return Ok(false);
        }
        // As a decoder does: what is no character is marked as such.
        let line = String::from_utf8_lossy(self.lines.line());
        let line = line.as_ref();
        if is_blank(line) {
            return Ok(false);
        }
        spans(line, layout.delimiter, &mut self.spans);
        if self.spans.len() != layout.columns {
            let cell = self.spans.len().min(layout.columns);
            let at = self.spans.get(cell).map_or(line.len(), |span| span.0);
            return Err(Problem {
                place: place(self.lines.number, line, at),
                reason: format!(
                    "{} cells where the header has {}",
                    self.spans.len(),
                    layout.columns
                ),
            });
        }
        for (&column, values) in self.wanted.iter().zip(&mut *columns) {
            let (from, to) = self.spans[column];
            let cell = unquoted(&line[from..to]);
            let value = match cells[column] {
                Cells::Stamps if is_missing(&cell) => Some(f64::NAN),
                Cells::Stamps => stamp(&cell).map(|(second, fraction)| {
                    let first = *self.first_stamp.get_or_insert(second);
                    (second - first) as f64 + fraction
                }),
                Cells::Truths => truth(&cell).or_else(|| number(&cell, layout.decimal_comma)),
                Cells::Numbers | Cells::Text => number(&cell, layout.decimal_comma),
            };
            let Some(value) = value else {
                let shown: String = cell.chars().take(40).collect();
                return Err(Problem {
                    place: place(self.lines.number, line, from),
                    reason: format!("{}: {shown:?} is not a number", layout.names[column]),
                });
            };
            values.push(value);
        }
        Ok(true)
    }
}

/// Rows that are read straight from the bytes: those whose wanted cells are plain numbers or empty, without quotes. Nearly all rows are such; every
/// other one is left to the way that tells what is wrong with it.
struct PlainRows {
    delimiter: u8,
    point: u8,
    /// Of each column, whether it is wanted.
    wanted: Vec<bool>,
    /// Of each wanted column, in the order of the file, its place among those that were asked for.
    targets: Vec<usize>,
}

impl PlainRows {
    fn of(layout: &Layout, cells: &[Cells], wanted: &[usize]) -> Option<Self> {
        let delimiter = layout.delimiter? as u32 as u8;
        let point = if layout.decimal_comma { b',' } else { b'.' };
        let mut targets: Vec<usize> = (0..wanted.len()).collect();
        targets.sort_by_key(|&target| wanted[target]);
        let is_once = targets
            .windows(2)
            .all(|pair| wanted[pair[0]] != wanted[pair[1]]);
        let are_numbers = wanted.iter().all(|&column| cells[column] == Cells::Numbers);
        (delimiter != point && is_once && are_numbers).then(|| Self {
            delimiter,
            point,
            wanted: (0..layout.columns)
                .map(|column| wanted.contains(&column))
                .collect(),
            targets,
        })
    }

    /// The wanted numbers of the first line of a text that ends with a line's end; answers with the line's bytes, its end included.
    fn row(&self, text: &[u8], row: &mut Vec<f64>) -> Option<usize> {
        if !is_filled(text) {
            return None;
        }
        row.clear();
        let (last, others) = self.wanted.split_last()?;
        let mut at = 0;
        for &wanted in others {
            at = self.cell(text, at, wanted, row)?;
            if *text.get(at)? != self.delimiter {
                return None;
            }
            at += 1;
        }
        at = self.cell(text, at, *last, row)?;
        match text.get(at)? {
            b'\n' => Some(at + 1),
            b'\r' if text.get(at + 1) == Some(&b'\n') => Some(at + 2),
            _ => None,
        }
    }

    /// Goes over a cell: answers with the byte behind it.
    fn cell(&self, text: &[u8], at: usize, wanted: bool, row: &mut Vec<f64>) -> Option<usize> {
        if wanted {
            let (value, end) = plain_number(text, at, self.point, self.delimiter)?;
            row.push(value);
            return Some(end);
        }
        let ends = |byte: &u8| *byte == self.delimiter || matches!(byte, b'\n' | b'\r' | b'"');
        Some(at + text.get(at..)?.iter().position(ends)?)
    }
}

/// A number without blanks inside it, and the byte behind it and the blanks around it; `NaN` where there are blanks only.
fn plain_number(text: &[u8], mut at: usize, point: u8, delimiter: u8) -> Option<(f64, usize)> {
    let blanks = |mut at: usize| {
        while text.get(at) == Some(&b' ') {
            at += 1;
        }
        at
    };
    at = blanks(at);
    let start = at;
    let sign = *text.get(at)?;
    if sign == delimiter || matches!(sign, b'\n' | b'\r') {
        return Some((f64::NAN, at));
    }
    at += usize::from(matches!(sign, b'-' | b'+'));
    let mut digits = 0_u64;
    let mut run = |mut at: usize| {
        while let Some(digit) = text.get(at).map(|byte| byte.wrapping_sub(b'0'))
            && digit < 10
        {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        at
    };
    let whole = at;
    at = run(at);
    let mut count = at - whole;
    let mut exponent = 0;
    if *text.get(at)? == point {
        let decimals = at + 1;
        at = run(decimals);
        count += at - decimals;
        exponent = -i32::try_from(at - decimals).ok()?;
    }
    if count == 0 {
        return None;
    }
    if *text.get(at)? | 0x20 == b'e' {
        at += 1;
        let sign = *text.get(at)?;
        at += usize::from(matches!(sign, b'-' | b'+'));
        let from = at;
        let mut power = 0;
        while let Some(digit) = text.get(at).map(|byte| byte.wrapping_sub(b'0'))
            && digit < 10
        {
            power = 10 * power + i32::from(digit);
            at += 1;
            if at - from > 4 {
                return None;
            }
        }
        if at == from {
            return None;
        }
        exponent += if sign == b'-' { -power } else { power };
    }
    // Digits and power of ten are exact numbers of their own then, and one operation rounds once.
    let is_exact = count <= 19 && digits <= 1 << 53;
    let power = POWERS.get(exponent.unsigned_abs() as usize);
    let value = match power.filter(|_| is_exact) {
        Some(power) => {
            let digits = digits as f64;
            let size = if exponent < 0 {
                digits / power
            } else {
                digits * power
            };
            if sign == b'-' { -size } else { size }
        }
        None => {
            let cell = str::from_utf8(text.get(start..at)?).ok()?;
            number(cell, point == b',')?
        }
    };
    Some((value, blanks(at)))
}

/// The powers of ten that are exact.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// What the comments say of a conversion that the text came from.
fn made_of(bytes: &FileBytes) -> Result<Made, Problem> {
    let length = bytes.length();
    let first = bytes.up_to(0, COMMENT_BYTES)?;
    let last = bytes.up_to(length.saturating_sub(COMMENT_BYTES), COMMENT_BYTES)?;
    Ok(Made::of_text(&first, &last, length <= COMMENT_BYTES))
}

/// Columns as series.
fn series(columns: Vec<Vec<f64>>) -> Vec<Series> {
    let of = |values| Series {
        values,
        ..Series::default()
    };
    columns.into_iter().map(of).collect()
}

impl Source for CsvSource {
    fn start_time(&self) -> Option<String> {
        None
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn made(&self) -> Made {
        self.made.clone()
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let counted = self.channels.first().map_or(0, |channel| channel.samples);
        let rows = usize::try_from(counted).unwrap_or(0);
        // Each row was seen once, so there is room for as many.
        let mut columns: Vec<Vec<f64>> = wanted.iter().map(|_| Vec::with_capacity(rows)).collect();
        self.rows(wanted)?.read(usize::MAX, &mut columns)?;
        Ok(series(columns))
    }

    fn pieces(&self, wanted: &[usize]) -> Result<Option<Pieces<'_>>, Problem> {
        let mut rows = self.rows(wanted)?;
        let count = wanted.len();
        let mut goes_on = true;
        let mut piece = move || -> Result<Option<Vec<Series>>, Problem> {
            if !goes_on {
                return Ok(None);
            }
            let mut columns = vec![Vec::new(); count];
            goes_on = rows.read(ROWS_A_PIECE, &mut columns)?;
            Ok(Some(series(columns)))
        };
        Ok(Some(Box::new(std::iter::from_fn(move || {
            piece().transpose()
        }))))
    }

    fn faults(&self) -> Vec<String> {
        self.faults.clone()
    }
}

/// A file from its beginning, wherever others read the same one.
struct FromStart {
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
enum Text {
    /// As it lies there.
    Utf8(FromStart),
    /// Recoded.
    Other(Box<DecodeReaderBytes<FromStart, Vec<u8>>>),
}

impl Text {
    fn new(encoding: &'static Encoding, file: File) -> Self {
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
struct Lines {
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
    number: u64,
}

impl Lines {
    fn new(text: Text) -> Self {
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
    fn fill(&mut self) -> Result<bool, Problem> {
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
    fn ahead(&self) -> &[u8] {
        &self.buffer[self.from..self.whole]
    }

    /// Leaves so many bytes behind, which are one line.
    fn pass(&mut self, bytes: usize) {
        self.from += bytes;
        self.number += 1;
    }

    /// Goes to the next line; false at the end.
    fn next(&mut self) -> Result<bool, Problem> {
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
    fn line(&self) -> &[u8] {
        &self.buffer[self.line.clone()]
    }
}

/// Where a byte of a line is, as a line and a character.
fn place(number: u64, line: &str, byte: usize) -> Place {
    let before = line.get(..byte).unwrap_or_default();
    Place::Text {
        line: number,
        column: before.chars().count() as u64 + 1,
    }
}

fn encoding_of(head: &[u8]) -> &'static Encoding {
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

fn decoder<R: Read>(encoding: &'static Encoding, bytes: R) -> DecodeReaderBytes<R, Vec<u8>> {
    DecodeReaderBytesBuilder::new()
        .encoding(Some(encoding))
        .bom_override(true)
        .build(bytes)
}

/// Comments and empty lines.
fn is_blank(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty()
        || line.starts_with('#')
        || line
            .chars()
            .all(|c| matches!(c, ',' | ';' | '\t' | '|' | ' '))
}

/// Byte ranges of the cells of a line, with their quotes.
fn spans(line: &str, delimiter: Option<char>, spans: &mut Vec<(usize, usize)>) {
    spans.clear();
    let Some(delimiter) = delimiter else {
        let mut from = None;
        for (at, c) in line.char_indices() {
            match (c.is_whitespace(), from) {
                (false, None) => from = Some(at),
                (true, Some(start)) => {
                    spans.push((start, at));
                    from = None;
                }
                _ => {}
            }
        }
        spans.extend(from.map(|start| (start, line.len())));
        return;
    };
    // All delimiters are ASCII, and so no byte of another character.
    let delimiter = delimiter as u32 as u8;
    let (mut from, mut quoted) = (0, false);
    for (at, byte) in line.bytes().enumerate() {
        if byte == b'"' {
            quoted = !quoted;
        } else if byte == delimiter && !quoted {
            spans.push((from, at));
            from = at + 1;
        }
    }
    spans.push((from, line.len()));
}

/// Whether a line begins with a character that tells it from comments and empty lines at once.
fn is_filled(line: &[u8]) -> bool {
    let first = line.first().copied().unwrap_or(b' ');
    first.is_ascii_graphic() && !matches!(first, b'#' | b',' | b';' | b'|')
}

fn cell_count(line: &[u8], delimiter: Option<char>) -> usize {
    if let Some(delimiter) = delimiter {
        let delimiter = delimiter as u32 as u8;
        let (mut cells, mut quotes) = (1, 0);
        for &byte in line {
            cells += usize::from(byte == delimiter);
            quotes += usize::from(byte == b'"');
        }
        if quotes == 0 {
            return cells;
        }
    }
    let mut all = Vec::new();
    spans(&String::from_utf8_lossy(line), delimiter, &mut all);
    all.len()
}

fn split(line: &str, delimiter: Option<char>) -> Vec<String> {
    let mut all = Vec::new();
    spans(line, delimiter, &mut all);
    all.into_iter()
        .map(|(from, to)| unquoted(&line[from..to]).into_owned())
        .collect()
}

/// A cell without blanks and quotes around it.
fn unquoted(cell: &str) -> Cow<'_, str> {
    let cell = cell.trim();
    match cell
        .strip_prefix('"')
        .and_then(|cell| cell.strip_suffix('"'))
    {
        Some(inner) if inner.contains("\"\"") => {
            inner.replace("\"\"", "\"").trim().to_owned().into()
        }
        Some(inner) => inner.trim().into(),
        None => cell.into(),
    }
}

fn is_missing(cell: &str) -> bool {
    matches!(cell, "" | "-" | "--" | "?" | "*")
        || ["nan", "na", "n/a", "#n/a", "null", "none", "nil", "missing"]
            .iter()
            .any(|word| cell.eq_ignore_ascii_case(word))
}

/// A cell as a number, `NaN` where it is missing.
fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
    let first = cell.as_bytes().first().copied().unwrap_or(b' ');
    if first.is_ascii_digit() || matches!(first, b'+' | b'-' | b'.' | b',') {
        let value = if decimal_comma {
            with_comma(cell)
        } else {
            cell.parse().ok()
        };
        return value.or_else(|| is_missing(cell).then_some(f64::NAN));
    }
    if is_missing(cell) {
        return Some(f64::NAN);
    }
    let infinite = cell
        .as_bytes()
        .first_chunk::<3>()
        .is_some_and(|start| start.eq_ignore_ascii_case(b"inf"));
    infinite.then(|| cell.parse().ok()).flatten()
}

/// A number whose decimals stand behind a comma.
fn with_comma(cell: &str) -> Option<f64> {
    let Some((whole, rest)) = cell.split_once(',') else {
        // Without a comma a point parts thousands, or it is a whole number.
        return match cell.contains('.') {
            true => thousands(cell)?.parse().ok(),
            false => cell.parse().ok(),
        };
    };
    if rest.contains(['.', ',']) {
        return None;
    }
    if whole.contains('.') {
        return format!("{}.{rest}", thousands(whole)?).parse().ok();
    }
    // Most numbers are short: no allocation for them.
    let mut plain = [0_u8; 40];
    match plain.get_mut(..cell.len()) {
        Some(plain) => {
            plain.copy_from_slice(cell.as_bytes());
            if let Some(comma) = plain.get_mut(whole.len()) {
                *comma = b'.';
            }
            str::from_utf8(plain).ok()?.parse().ok()
        }
        None => format!("{whole}.{rest}").parse().ok(),
    }
}

/// Digits in threes parted by points, without the points.
fn thousands(whole: &str) -> Option<String> {
    let mut parts = whole.split('.');
    let first = parts.next()?;
    let mut digits = first.to_owned();
    for part in parts {
        if part.len() != 3 || first.trim_start_matches(['+', '-']).len() > 3 {
            return None;
        }
        digits.push_str(part);
    }
    Some(digits)
}

fn truth(cell: &str) -> Option<f64> {
    if is_missing(cell) {
        return Some(f64::NAN);
    }
    let is = |words: [&str; 4]| words.iter().any(|word| cell.eq_ignore_ascii_case(word));
    if is(["true", "on", "wahr", "vrai"]) {
        Some(1.0)
    } else if is(["false", "off", "falsch", "faux"]) {
        Some(0.0)
    } else {
        None
    }
}

fn kind_of<'a>(cells: impl Iterator<Item = &'a str>, decimal_comma: bool) -> Cells {
    let (mut numbers, mut stamps, mut truths, mut others) = (0, 0, 0, 0);
    for cell in cells.filter(|cell| !is_missing(cell)) {
        if number(cell, decimal_comma).is_some() {
            numbers += 1;
        } else if stamp(cell).is_some() {
            stamps += 1;
        } else if truth(cell).is_some() {
            truths += 1;
        } else {
            others += 1;
        }
    }
    // A stray word among numbers is an error of its cell, told when the column is read.
    let known = numbers + stamps + truths;
    if others * 4 > known || (others > 0 && known == 0) {
        Cells::Text
    } else if stamps > numbers && stamps > truths {
        Cells::Stamps
    } else if truths > numbers {
        Cells::Truths
    } else {
        Cells::Numbers
    }
}

fn is_value(cell: &str, decimal_comma: bool) -> bool {
    !is_missing(cell) && (number(cell, decimal_comma).is_some() || stamp(cell).is_some())
}

impl Layout {
    /// Finds the layout that makes most of the lines rows of numbers, all of one length.
    fn of(lines: &[&str]) -> Result<Self, Problem> {
        let mut best: Option<(f64, Self)> = None;
        for delimiter in [Some('\t'), Some(';'), Some(','), Some('|'), None] {
            for decimal_comma in [false, true] {
                if decimal_comma
                    && delimiter == Some(',')
                    && !lines.iter().any(|line| line.contains('"'))
                {
                    continue;
                }
                let Some((score, layout)) = Self::try_of(lines, delimiter, decimal_comma) else {
                    continue;
                };
                // The first of equals: a blank inside cells parts no columns where tabs do.
                if best
                    .as_ref()
                    .is_none_or(|(before, _)| score > before + 1e-9)
                {
                    best = Some((score, layout));
                }
            }
        }
        best.map(|(_, layout)| layout).ok_or_else(|| {
            Problem::whole("no table found: rows of numbers below a row of names, parted by tab, semicolon, comma, bar or blanks, are needed")
        })
    }

    fn try_of(lines: &[&str], delimiter: Option<char>, decimal_comma: bool) -> Option<(f64, Self)> {
        let rows: Vec<(usize, Vec<String>)> = lines
            .iter()
            .enumerate()
            .filter(|(_, line)| !is_blank(line))
            .map(|(line, text)| (line, split(text, delimiter)))
            .collect();
        let is_data = |row: &[String]| {
            let filled = row.iter().filter(|cell| !is_missing(cell)).count();
            let values = row
                .iter()
                .filter(|cell| is_value(cell, decimal_comma))
                .count();
            values > 0 && values * 2 >= filled
        };
        // The number of cells that most rows of data have.
        let mut counts = std::collections::BTreeMap::new();
        for (_, row) in rows.iter().filter(|(_, row)| is_data(row)) {
            *counts.entry(row.len()).or_insert(0_usize) += 1;
        }
        let (&columns, &of_them) = counts.iter().max_by_key(|&(&cells, &rows)| (rows, cells))?;
        if columns < 2 {
            return None;
        }
        let first = rows
            .iter()
            .position(|(_, row)| row.len() == columns && is_data(row))?;
        let above: Vec<&(usize, Vec<String>)> = rows[..first]
            .iter()
            .filter(|(_, row)| row.len() == columns)
            .collect();
        let (names, unit_row) = header(&above)?;
        let mut parted: Vec<(String, String)> =
            names.iter().map(|name| units::part(name)).collect();
        if let Some(row) = unit_row {
            for ((_, unit), cell) in parted.iter_mut().zip(row) {
                let bare = units::bare(cell);
                if !bare.is_empty() {
                    *unit = bare.to_owned();
                }
            }
        }
        let (names, units) = parted.into_iter().unzip();
        let data: Vec<&Vec<String>> = rows[first..].iter().map(|(_, row)| row).collect();
        let cells: usize = data.iter().map(|row| row.len()).sum();
        let good: usize = data
            .iter()
            .filter(|row| row.len() == columns)
            .map(|row| {
                row.iter()
                    .filter(|cell| is_missing(cell) || is_value(cell, decimal_comma))
                    .count()
            })
            .sum();
        // Numbers that need the comma speak for it; those that read either way do not.
        let score = good as f64 / cells.max(1) as f64 + of_them as f64 / data.len().max(1) as f64
            - if decimal_comma { 1e-6 } else { 0.0 };
        let layout = Self {
            delimiter,
            decimal_comma,
            columns,
            skip_lines: rows.get(first)?.0 as u64,
            names,
            units,
        };
        Some((score, layout))
    }
}

/// The row of names and, where there is one, the row of units among the rows above the data.
fn header<'a>(above: &[&'a (usize, Vec<String>)]) -> Option<(&'a [String], Option<&'a [String]>)> {
    let (_, last) = above.last()?;
    if above.len() > 1 && units::is_unit_row(last) {
        let (_, names) = above.get(above.len() - 2)?;
        return Some((names, Some(last)));
    }
    // Names, units, and one more row of words such as types below them.
    if let [.., (_, names), (_, row), _] = above
        && units::is_unit_row(row)
    {
        return Some((names, Some(row)));
    }
    Some((last, None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    fn source(bytes: &[u8]) -> Result<CsvSource, Problem> {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        CsvSource::open(FileBytes::new(file).unwrap())
    }

    fn read(text: &[u8]) -> (Vec<(String, String)>, Vec<Vec<f64>>) {
        let mut source = source(text).unwrap();
        let listed = source
            .channels()
            .iter()
            .map(|c| (c.name.clone(), c.unit.clone()))
            .collect();
        let all: Vec<usize> = (0..source.channels().len())
            .filter(|&k| source.channels()[k].kind.is_number())
            .collect();
        let values = source
            .read(&all)
            .unwrap()
            .into_iter()
            .map(|s| s.values)
            .collect();
        (listed, values)
    }

    #[test]
    fn a_german_table_with_unit_row_and_preamble_is_read() {
        let text = "Messung 12;Halle 3\nBediener;x\n\nZeit;Geschwindigkeit;Radlast;Text\ns;km/h;kN;-\n0,0;72,5;1.234,5;an\n0,01;;4;aus\n";
        let (listed, values) = read(text.as_bytes());
        let names: Vec<&str> = listed.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["Zeit", "Geschwindigkeit", "Radlast", "Text"]);
        assert_eq!(listed[1].1, "km/h");
        assert_eq!(values[0], [0.0, 0.01]);
        assert_eq!(values[1][0], 72.5);
        assert!(values[1][1].is_nan());
        assert_eq!(values[2], [1234.5, 4.0]);
    }

    #[test]
    fn brackets_hold_units_and_are_no_part_of_the_name() {
        let (listed, _) = read(b"time [s],v (km/h),n / rpm\n0,1,2\n1,2,3\n");
        let of = |name: &str, unit: &str| (name.to_owned(), unit.to_owned());
        assert_eq!(listed, [of("time", "s"), of("v", "km/h"), of("n", "rpm")]);
    }

    #[test]
    fn encodings_tabs_and_blanks() {
        let utf16: Vec<u8> = "\u{feff}Zeit [s]\tKraft [N]\n0,5\t1\n1\t2\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        let (listed, values) = read(&utf16);
        assert_eq!(listed[1].0, "Kraft");
        assert_eq!(values[0], [0.5, 1.0]);
        let (sjis, ..) =
            encoding_rs::SHIFT_JIS.encode("時間[s],車速[km/h],車輪回転数[rpm]\n0,1,2\n1,2,3\n");
        assert_eq!(read(&sjis).0[1], ("車速".to_owned(), "km/h".to_owned()));
        let (listed, values) = read(b"time   speed\n0.0    1\n 0.5    2\n");
        assert_eq!(listed[1].0, "speed");
        assert_eq!(values[1], [1.0, 2.0]);
    }

    #[test]
    fn torn_rows_are_listed_and_not_read() {
        let mut torn = source(b"t;v\n0;1\n1;2\n2;3\n3\n").unwrap();
        assert_eq!(torn.faults(), ["line 5: 1 cells where the header has 2"]);
        assert_eq!(torn.channels()[0].samples, 4);
        let told = torn.read(&[0]).unwrap_err();
        assert_eq!(told.place, Place::Text { line: 5, column: 2 });
    }

    #[test]
    fn a_word_among_numbers_is_placed() {
        let mut bad = source(b"t;v\n0;1\n1;2\n2;oops\n3;1\n4;2\n5;3\n").unwrap();
        let told = bad.read(&[1]).unwrap_err();
        assert_eq!(told.place, Place::Text { line: 4, column: 3 });
        assert!(told.reason.contains("oops"), "{}", told.reason);
    }

    #[test]
    fn time_stamps_keep_their_digits() {
        let (_, values) = read(b"when,v\n2026-03-04 09:15:00.001,1\n2026-03-04 09:15:00.002,2\n");
        assert_eq!(values[0], [0.001, 0.002]);
    }

    /// Numbers without a pattern that matters here (Marsaglia's xorshift64).
    fn dice(state: &mut u64, sides: usize) -> usize {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state % sides as u64) as usize
    }

    #[test]
    fn a_plain_number_is_the_one_that_the_library_reads_to_the_last_bit() {
        let mut state = 0x2545_f491_4f6c_dd1d;
        let words = [
            "0",
            "1",
            "9",
            "123",
            "00",
            "+",
            "-",
            ".",
            ",",
            "e",
            "E",
            "e-",
            "e+",
            "22",
            "23",
            "308",
            "9007199254740993",
            "18446744073709551616",
            " ",
            "inf",
            "nan",
            "x",
            "_",
        ];
        let (mut plain, mut others) = (0, 0);
        for k in 0..400_000 {
            let cell: String = match k % 3 {
                // Random bits as they are written, and short decimals.
                0 => {
                    let bits =
                        (dice(&mut state, 1 << 32) as u64) << 32 | dice(&mut state, 1 << 32) as u64;
                    format!("{:?}", f64::from_bits(bits))
                }
                1 => format!(
                    "{}.{:04}",
                    dice(&mut state, 5000) as i64 - 2500,
                    dice(&mut state, 10_000)
                ),
                _ => (0..=dice(&mut state, 5))
                    .map(|_| words[dice(&mut state, words.len())])
                    .collect(),
            };
            for comma in [false, true] {
                let cell = if comma {
                    cell.replace('.', ",")
                } else {
                    cell.clone()
                };
                let text = format!("{cell};7\n");
                let point = if comma { b',' } else { b'.' };
                let Some((value, end)) = plain_number(text.as_bytes(), 0, point, b';') else {
                    others += 1;
                    continue;
                };
                // What is left of the cell sends the row the other way.
                if text.as_bytes()[end] != b';' {
                    continue;
                }
                plain += 1;
                let expected = number(unquoted(&cell).as_ref(), comma).unwrap();
                assert!(
                    value.to_bits() == expected.to_bits() || (value.is_nan() && expected.is_nan()),
                    "{cell:?}: {value:?} {expected:?}"
                );
            }
        }
        assert!(plain > 400_000 && others > 10_000, "{plain} {others}");
    }

    #[test]
    fn rows_read_the_quick_way_are_those_read_the_other_way() {
        let cells = [
            "1",
            "-2.5",
            "+.5",
            "5.",
            "1e3",
            "",
            " ",
            " 7 ",
            "nan",
            "inf",
            "\"3\"",
            "0.1234567890123456789012",
            "1,5",
            "--",
            "1.234,5",
            "123456789012345678901234567890",
        ];
        let mut state = 0x9e37_79b9_7f4a_7c15;
        let mut both = 0;
        for delimiter in [';', '\t', ',', '|'] {
            for _ in 0..60 {
                let mut text = format!("a{delimiter}b{delimiter}c{delimiter}d\n");
                for _ in 0..40 {
                    text.push_str(&format!("1{delimiter}2{delimiter}3{delimiter}x\r\n"));
                }
                for _ in 0..20 {
                    let row: Vec<&str> = (0..3)
                        .map(|_| cells[dice(&mut state, cells.len())])
                        .collect();
                    let row = row.join(&delimiter.to_string());
                    text.push_str(&format!(
                        "{row}{delimiter}{}\n",
                        ["x", "ü", "\"y\"", ""][dice(&mut state, 4)]
                    ));
                    text.push_str(["", "# note\n", "\n", ";;\n"][dice(&mut state, 4)]);
                }
                let Ok(source) = source(text.as_bytes()) else {
                    continue;
                };
                for wanted in [&[0, 1, 2][..], &[2, 0], &[1]] {
                    let read = |is_quick: bool| {
                        let mut rows = source.rows(wanted).unwrap();
                        assert!(rows.plain.is_some() || source.layout.decimal_comma);
                        rows.plain = rows.plain.filter(|_| is_quick);
                        let mut columns = vec![Vec::new(); wanted.len()];
                        let told = rows.read(usize::MAX, &mut columns);
                        let bits: Vec<Vec<u64>> = columns
                            .iter()
                            .map(|column| {
                                column.iter().map(|value: &f64| value.to_bits()).collect()
                            })
                            .collect();
                        (bits, rows.lines.number, told)
                    };
                    if source.layout.columns != 4 {
                        continue;
                    }
                    both += 1;
                    assert_eq!(read(true), read(false), "{text}");
                }
            }
        }
        assert!(both > 300, "{both}");
    }

    #[test]
    fn lines_are_whole_wherever_a_piece_of_the_text_ends() {
        let mut text = String::from("t;v\n");
        let row = "1;2.25\n";
        while text.len() < 3 * PIECE_BYTES {
            text.push_str(row);
        }
        let rows = (text.len() - 4) / row.len();
        // A line longer than a piece, and a last one without an end.
        text.push_str(&format!("2;{}3\n4;5", " ".repeat(PIECE_BYTES + 7)));
        let (_, values) = read(text.as_bytes());
        assert_eq!(values[1].len(), rows + 2);
        assert!(values[1][..rows].iter().all(|&value| value == 2.25));
        assert_eq!(values[1][rows..], [3.0, 5.0]);
        let endless = format!("t;v\n1;2\n3;4\n{}", "5".repeat(LONGEST_LINE));
        let told = source(endless.as_bytes()).err().unwrap();
        assert_eq!(told.place, Place::Text { line: 4, column: 1 });
    }

    #[test]
    fn what_is_no_table_is_refused() {
        for text in ["one line", "a\nb\nc\n", "1,2\n3,4\n", "\n\n"] {
            assert!(source(text.as_bytes()).is_err(), "{text}");
        }
    }
}
