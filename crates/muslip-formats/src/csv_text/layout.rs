//! Where things are in a text: delimiter, decimal mark, preamble, names and units.

use super::cell::{is_blank, is_missing, is_value, split};
use crate::error::Problem;
use crate::units;

/// Lines of the head that are looked at.
pub(super) const HEAD_LINES: usize = 400;

/// Where things are in the text.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    /// `None`: any run of blanks.
    pub(super) delimiter: Option<char>,
    pub(super) decimal_comma: bool,
    pub(super) columns: usize,
    /// Lines before the first row of data.
    pub(super) skip_lines: u64,
    pub(super) names: Vec<String>,
    pub(super) units: Vec<String>,
}

impl Layout {
    /// Finds the layout that makes most of the lines rows of numbers, all of one length.
    pub(super) fn of(lines: &[&str]) -> Result<Self, Problem> {
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
