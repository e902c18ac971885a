//! CSV of any dialect: delimiter, decimal mark, encoding, preamble and unit row are found from the text.

mod cell;
mod layout;
mod lines;
mod plain;

use std::fs::File;
use std::io::Read;

use encoding_rs::Encoding;

use self::cell::{
    Cells, cell_count, is_blank, is_filled, is_missing, kind_of, number, spans, split, truth,
    unquoted,
};
use self::layout::{HEAD_LINES, Layout};
use self::lines::{Lines, Text, decoder, encoding_of, place};
use self::plain::PlainRows;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::made::{COMMENT_BYTES, Made};
use crate::source::{Channel, Kind, Pieces, Series, Source};
use crate::time_text::stamp;

/// Bytes that the dialect is told from.
const HEAD_BYTES: u64 = 1 << 18;
/// Rows of a piece.
const ROWS_A_PIECE: usize = 1 << 16;

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

#[cfg(test)]
mod tests {
    use super::lines::{LONGEST_LINE, PIECE_BYTES};
    use super::plain::plain_number;
    use super::*;
    use crate::error::Place;
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
