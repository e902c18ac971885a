//! Text for a terminal: running text and tables, within a width.

use std::io::{self, Write};

/// Narrowest terminal that lines are broken for.
const NARROWEST: usize = 40;

/// Widest line of running text: longer ones are hard to read.
pub const WIDEST_RUNNING_TEXT: usize = 84;

/// Columns of the terminal, or as many as `COLUMNS` says; `None` in a pipe or a file otherwise.
#[must_use]
pub fn columns() -> Option<usize> {
    let told = std::env::var("COLUMNS").ok();
    let told = told.and_then(|columns| columns.parse().ok());
    let columns: Option<usize> = told.filter(|columns| *columns > 0).or_else(|| {
        let (columns, _) = terminal_size::terminal_size_of(io::stdout())?;
        Some(usize::from(columns.0))
    });
    columns.map(|columns| columns.max(NARROWEST))
}

/// Lines of at most `width` characters, broken at spaces and nowhere else: a longer word stays whole, and a
/// no-break space holds a number and its unit together.
#[must_use]
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split([' ', '\n']).filter(|word| !word.is_empty()) {
        let Some(line) = lines.last_mut() else { break };
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
        .into_iter()
        .map(|line| line.replace('\u{a0}', " "))
        .collect()
}

/// A table of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Heads of the columns.
    pub head: Vec<String>,
    /// Rows, each as long as the head.
    pub rows: Vec<Vec<String>>,
}

/// Between two columns.
const GAP: usize = 2;

impl Table {
    /// Lines with columns aligned to the left. Where they would be longer than `width`, cells are wrapped;
    /// where that is not enough, each row becomes running text.
    #[must_use]
    pub fn lines(&self, width: Option<usize>) -> Vec<String> {
        let length = |cell: &String| cell.chars().count();
        let longest_word = |cell: &String| cell.split(' ').map(|w| w.chars().count()).max();
        let natural = self.of_columns(length);
        let least = self.of_columns(|cell| longest_word(cell).unwrap_or(0));
        let gaps = GAP * natural.len().saturating_sub(1);
        let room = width.map_or(usize::MAX, |width| width.saturating_sub(gaps));
        if least.iter().sum::<usize>() > room {
            return self.running(width.unwrap_or(usize::MAX));
        }
        let mut widths = natural;
        while widths.iter().sum::<usize>() > room {
            let shrinkable = widths
                .iter_mut()
                .zip(&least)
                .filter(|(width, least)| **width > **least);
            // There is one as long as the sum of the least fits.
            let Some((widest, _)) = shrinkable.max_by_key(|(width, _)| **width) else {
                break;
            };
            *widest -= 1;
        }
        let rule = "-".repeat(widths.iter().sum::<usize>() + gaps);
        let mut lines = aligned(&self.head, &widths);
        lines.push(rule);
        lines.extend(self.rows.iter().flat_map(|row| aligned(row, &widths)));
        lines
    }

    /// The largest of a figure of the cells, column by column.
    fn of_columns(&self, of: impl Fn(&String) -> usize) -> Vec<usize> {
        let all = || std::iter::once(&self.head).chain(&self.rows);
        (0..self.head.len())
            .map(|column| all().filter_map(|row| row.get(column)).map(&of).max())
            .map(|largest| largest.unwrap_or(0))
            .collect()
    }

    /// Every row as running text: what each cell is, and the cell.
    fn running(&self, width: usize) -> Vec<String> {
        const INDENT: usize = 2;
        let row = |row: &Vec<String>| {
            let cells = row.iter().zip(&self.head);
            let told: Vec<String> = cells
                .filter(|(cell, _)| !cell.is_empty())
                .map(|(cell, head)| format!("{head}: {cell}").replace(' ', "\u{a0}"))
                .collect();
            let lines = wrapped(&told.join("; "), width.saturating_sub(INDENT));
            // A cell that is longer than a line is broken after all.
            let lines = lines
                .into_iter()
                .flat_map(|line| wrapped(&line, width.saturating_sub(INDENT)));
            let indented = lines.enumerate().map(|(index, line)| {
                let indent = if index == 0 { 0 } else { INDENT };
                format!("{:indent$}{line}", "")
            });
            indented.collect::<Vec<_>>()
        };
        self.rows.iter().flat_map(row).collect()
    }

    /// As Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let row = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let rule = format!("|{}\n", " --- |".repeat(self.head.len()));
        let body: String = self.rows.iter().map(|cells| row(cells)).collect();
        row(&self.head) + &rule + &body
    }
}

/// Writes tables under their headings, then paragraphs, as wide as the terminal is.
///
/// # Errors
/// What `out` answers.
pub fn write_tables(
    out: &mut impl Write,
    tables: &[(&str, Table)],
    paragraphs: &[String],
) -> io::Result<()> {
    let columns = columns();
    let room = columns.unwrap_or(usize::MAX);
    for (heading, table) in tables {
        for line in wrapped(heading, room)
            .into_iter()
            .chain(table.lines(columns))
        {
            writeln!(out, "{line}")?;
        }
        writeln!(out)?;
    }
    for paragraph in paragraphs {
        for line in wrapped(paragraph, room.min(WIDEST_RUNNING_TEXT)) {
            writeln!(out, "{line}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// A row's lines.
fn aligned(row: &[String], widths: &[usize]) -> Vec<String> {
    let cells: Vec<Vec<String>> = row
        .iter()
        .zip(widths)
        .map(|(cell, &width)| wrapped(cell, width))
        .collect();
    let height = cells.iter().map(Vec::len).max().unwrap_or(0);
    (0..height)
        .map(|line| {
            let parts: Vec<String> = cells
                .iter()
                .zip(widths)
                .map(|(cell, &width)| {
                    format!("{:width$}", cell.get(line).map_or("", String::as_str))
                })
                .collect();
            parts.join("  ").trim_end().to_owned()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(head: &[&str], rows: &[&[&str]]) -> Table {
        let owned = |cells: &[&str]| cells.iter().map(|&cell| cell.to_owned()).collect();
        Table {
            head: owned(head),
            rows: rows.iter().map(|row| owned(row)).collect(),
        }
    }

    #[test]
    fn text_is_wrapped_between_words_and_not_before_a_unit() {
        assert_eq!(wrapped("aa bb cc", 5), ["aa bb", "cc"]);
        assert_eq!(wrapped("aaaaaaa bb", 5), ["aaaaaaa", "bb"]);
        assert_eq!(wrapped("a 12\u{a0}N", 4), ["a", "12 N"]);
        assert_eq!(wrapped("", 5), [""]);
    }

    #[test]
    fn columns_line_up_and_bars_do_not_break_markdown() {
        let table = table(&["a", "bb"], &[&["|x|", "é"], &["1", "2"]]);
        assert_eq!(
            table.lines(None),
            ["a    bb", "-------", "|x|  é", "1    2"]
        );
        assert_eq!(
            table.markdown(),
            "| a | bb |\n| --- | --- |\n| \\|x\\| | é |\n| 1 | 2 |\n"
        );
    }

    #[test]
    fn a_table_keeps_to_its_width_and_loses_no_cell() {
        let table = table(
            &["who it is", "far", "verdict"],
            &[
                &["a filter that knows", "1.5", "kept"],
                &["another", "", "not kept"],
            ],
        );
        assert_eq!(
            table.lines(Some(26)),
            [
                "who it is    far  verdict",
                "--------------------------",
                "a filter     1.5  kept",
                "that knows",
                "another           not kept",
            ]
        );
        assert_eq!(
            table.lines(Some(16)),
            [
                "who it is: a",
                "  filter that",
                "  knows;",
                "  far: 1.5;",
                "  verdict: kept",
                "who it is:",
                "  another;",
                "  verdict: not",
                "  kept",
            ]
        );
        for width in 16..50 {
            let lines = table.lines(Some(width));
            assert!(lines.iter().all(|line| line.chars().count() <= width));
        }
    }
}
