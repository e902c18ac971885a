//! CSV of any dialect: delimiter, decimal mark, encoding, preamble and unit row are found from the text.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};

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
const LONGEST_LINE: u64 = 1 << 24;

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
        let mut file = &self.file;
        file.seek(SeekFrom::Start(0))?;
        let mut lines = Lines {
            text: Text::new(self.encoding, self.file.try_clone()?),
            line: String::new(),
            number: 0,
        };
        while lines.number < self.layout.skip_lines && lines.next()? {}
        Ok(lines)
    }

    /// Counts rows, and tells of torn ones.
    fn count(&mut self) -> Result<u64, Problem> {
        let mut lines = self.lines()?;
        let mut rows = 0;
        while lines.next()? {
            if is_blank(&lines.line) {
                continue;
            }
            rows += 1;
            let found = cell_count(&lines.line, self.layout.delimiter);
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
    /// Second of the first time stamp: the others count from there.
    first_stamp: Option<i64>,
    spans: Vec<(usize, usize)>,
}

impl Rows<'_> {
    /// Appends so many rows at most to the columns; false at the end of the text.
    fn read(&mut self, most: usize, columns: &mut [Vec<f64>]) -> Result<bool, Problem> {
        let CsvSource { layout, cells, .. } = self.source;
        let mut rows = 0;
        while rows < most {
            if !self.lines.next()? {
                return Ok(false);
            }
            let line = self.lines.line.as_str();
            if is_blank(line) {
                continue;
            }
            rows += 1;
            spans(line, layout.delimiter, &mut self.spans);
            if self.spans.len() != layout.columns {
                let cell = self.spans.len().min(layout.columns);
                let at = self.spans.get(cell).map_or(line.len(), |span| span.0);
                return Err(Problem {
                    place: self.lines.place(at),
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
                        place: self.lines.place(from),
                        reason: format!("{}: {shown:?} is not a number", layout.names[column]),
                    });
                };
                values.push(value);
            }
        }
        Ok(true)
    }
}

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

/// A file as text.
enum Text {
    /// As it lies there.
    Utf8(BufReader<File>),
    /// Recoded.
    Other(BufReader<DecodeReaderBytes<File, Vec<u8>>>),
}

impl Text {
    fn new(encoding: &'static Encoding, file: File) -> Self {
        if encoding == encoding_rs::UTF_8 {
            return Self::Utf8(BufReader::with_capacity(1 << 16, file));
        }
        Self::Other(BufReader::with_capacity(1 << 16, decoder(encoding, file)))
    }

    /// Appends the next line to an empty one, with its end; answers with its bytes in this encoding.
    fn next(&mut self, line: &mut String) -> Result<u64, Problem> {
        let read = match self {
            Self::Utf8(text) => {
                let mut bytes = std::mem::take(line).into_bytes();
                let read = text.take(LONGEST_LINE).read_until(b'\n', &mut bytes)?;
                *line = match String::from_utf8(bytes) {
                    Ok(line) => line,
                    // As a decoder does: what is no character is marked as such.
                    Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
                };
                read
            }
            Self::Other(text) => text.take(LONGEST_LINE).read_line(line)?,
        };
        Ok(read as u64)
    }
}

/// The text line by line, each with its number.
struct Lines {
    text: Text,
    line: String,
    number: u64,
}

impl Lines {
    /// Goes to the next line; false at the end.
    fn next(&mut self) -> Result<bool, Problem> {
        self.line.clear();
        let read = self.text.next(&mut self.line)?;
        if read == LONGEST_LINE {
            return Err(Problem {
                place: Place::Text {
                    line: self.number + 1,
                    column: 1,
                },
                reason: format!("a line of over {LONGEST_LINE} bytes: not a table"),
            });
        }
        while self.line.ends_with(['\n', '\r']) {
            self.line.pop();
        }
        if self.number == 0 && self.line.starts_with('\u{feff}') {
            self.line.remove(0);
        }
        self.number += 1;
        Ok(read > 0)
    }

    fn place(&self, byte: usize) -> Place {
        let before = self.line.get(..byte).unwrap_or_default();
        Place::Text {
            line: self.number,
            column: before.chars().count() as u64 + 1,
        }
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

fn cell_count(line: &str, delimiter: Option<char>) -> usize {
    if let Some(delimiter) = delimiter
        && !line.as_bytes().contains(&b'"')
    {
        let delimiter = delimiter as u32 as u8;
        return 1 + line.bytes().filter(|&byte| byte == delimiter).count();
    }
    let mut all = Vec::new();
    spans(line, delimiter, &mut all);
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
fn unquoted(cell: &str) -> std::borrow::Cow<'_, str> {
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

    #[test]
    fn what_is_no_table_is_refused() {
        for text in ["one line", "a\nb\nc\n", "1,2\n3,4\n", "\n\n"] {
            assert!(source(text.as_bytes()).is_err(), "{text}");
        }
    }
}
