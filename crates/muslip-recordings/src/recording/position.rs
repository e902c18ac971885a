//! Finds the line and the column of a cell, once something is wrong with it.
//!
//! The fast reader only knows at which byte it began to look for a record: comments and empty lines
//! may lie between, and quoted cells hide commas and line ends. Walking the file a second time, byte
//! by byte, gives the exact place, and only a reader that stops anyway pays for it.

use std::io::{self, BufRead, BufReader, Read};

/// What to find.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// A byte of the file.
    Byte(u64),
    /// A cell (from 0) of the first record at or after a byte.
    Cell {
        /// Where the search for the record begins.
        record_from: u64,
        /// Number of the cell; past the last one it means the end of the record.
        cell: usize,
    },
}

/// Line and column (characters, both from 1) of a place in text that starts after the byte order mark.
pub(super) fn line_and_column(text: impl Read, place: Place) -> io::Result<(u64, u64)> {
    let mut walk = Walk::new(text);
    match place {
        Place::Byte(byte) => walk.walk_to_byte(byte)?,
        Place::Cell { record_from, cell } => {
            walk.walk_to_byte(record_from)?;
            walk.walk_to_record()?;
            walk.walk_to_cell(cell)?;
        }
    }
    Ok((walk.line, walk.column))
}

struct Walk<R> {
    text: BufReader<R>,
    byte: u64,
    line: u64,
    column: u64,
    after_return: bool,
}

impl<R: Read> Walk<R> {
    fn new(text: R) -> Self {
        Self {
            text: BufReader::with_capacity(1 << 16, text),
            byte: 0,
            line: 1,
            column: 1,
            after_return: false,
        }
    }

    fn peek(&mut self) -> io::Result<Option<u8>> {
        Ok(self.text.fill_buf()?.first().copied())
    }

    /// Steps over one byte. A line ends at `\n`, `\r\n` or `\r`, as for the reader.
    fn step(&mut self, byte: u8) {
        self.text.consume(1);
        self.byte += 1;
        match byte {
            b'\n' if self.after_return => {}
            b'\n' | b'\r' => {
                self.line += 1;
                self.column = 1;
            }
            // Only the first byte of a character counts.
            0x80..=0xbf => {}
            _ => self.column += 1,
        }
        self.after_return = byte == b'\r';
    }

    fn walk_to_byte(&mut self, target: u64) -> io::Result<()> {
        while self.byte < target {
            match self.peek()? {
                Some(byte) => self.step(byte),
                None => break,
            }
        }
        Ok(())
    }

    /// Skips line ends and comment lines.
    fn walk_to_record(&mut self) -> io::Result<()> {
        let mut in_comment = false;
        while let Some(byte) = self.peek()? {
            match byte {
                b'\n' | b'\r' => in_comment = false,
                b'#' => in_comment = true,
                _ if in_comment => {}
                _ => break,
            }
            self.step(byte);
        }
        Ok(())
    }

    fn walk_to_cell(&mut self, cell: usize) -> io::Result<()> {
        let mut passed = 0;
        let mut state = InCell::Start;
        while passed < cell {
            let Some(byte) = self.peek()? else { break };
            state = match (state, byte) {
                (InCell::Quoted, b'"') => InCell::QuoteInQuoted,
                (InCell::Quoted, _) => InCell::Quoted,
                // Inside a quoted cell, "" is one quote.
                (InCell::QuoteInQuoted | InCell::Start, b'"') => InCell::Quoted,
                (_, b',') => {
                    passed += 1;
                    InCell::Start
                }
                (_, b'\n' | b'\r') => break,
                _ => InCell::Plain,
            };
            self.step(byte);
        }
        Ok(())
    }
}

#[derive(Clone, Copy)]
enum InCell {
    Start,
    Plain,
    Quoted,
    QuoteInQuoted,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(text: &str, record_from: u64, cell: usize) -> (u64, u64) {
        line_and_column(text.as_bytes(), Place::Cell { record_from, cell }).unwrap()
    }

    #[test]
    fn comments_and_empty_lines_before_a_record_count_as_lines() {
        assert_eq!(cell("a,b\n# note\n\n# more\n1,2\n", 4, 1), (5, 3));
        assert_eq!(cell("# \u{e9}\r\na,b\r\n1,2\r\n", 10, 0), (3, 1));
    }

    #[test]
    fn every_line_end_counts_once() {
        assert_eq!(cell("a,b\r\n1,2\r\n", 4, 1), (2, 3));
        assert_eq!(cell("a,b\r1,2\r", 4, 1), (2, 3));
    }

    #[test]
    fn quoted_cells_hide_commas_quotes_and_line_ends() {
        assert_eq!(cell("\"a,b\",c", 0, 1), (1, 7));
        assert_eq!(cell("\"a\"\",\",c", 0, 1), (1, 8));
        assert_eq!(cell("\"a\nb\",c", 0, 1), (2, 4));
        assert_eq!(cell("5\"\",c", 0, 1), (1, 5));
    }

    #[test]
    fn characters_count_not_bytes() {
        assert_eq!(cell("\u{e9}\u{20ac},c", 0, 1), (1, 4));
        let place = line_and_column("\u{e9}x".as_bytes(), Place::Byte(2)).unwrap();
        assert_eq!(place, (1, 2));
    }

    #[test]
    fn past_the_last_cell_is_the_end_of_the_record() {
        assert_eq!(cell("1,2\n3,4\n", 0, 9), (1, 4));
        assert_eq!(cell("1,2", 0, 9), (1, 4));
    }
}
