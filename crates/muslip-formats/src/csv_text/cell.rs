//! The cells of a line, and what is in them.

use std::borrow::Cow;

use crate::time_text::stamp;

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cells {
    Numbers,
    Stamps,
    Truths,
    Text,
}

/// Comments and empty lines.
pub(super) fn is_blank(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty()
        || line.starts_with('#')
        || line
            .chars()
            .all(|c| matches!(c, ',' | ';' | '\t' | '|' | ' '))
}

/// Byte ranges of the cells of a line, with their quotes.
pub(super) fn spans(line: &str, delimiter: Option<char>, spans: &mut Vec<(usize, usize)>) {
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
pub(super) fn is_filled(line: &[u8]) -> bool {
    let first = line.first().copied().unwrap_or(b' ');
    first.is_ascii_graphic() && !matches!(first, b'#' | b',' | b';' | b'|')
}

pub(super) fn cell_count(line: &[u8], delimiter: Option<char>) -> usize {
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

pub(super) fn split(line: &str, delimiter: Option<char>) -> Vec<String> {
    let mut all = Vec::new();
    spans(line, delimiter, &mut all);
    all.into_iter()
        .map(|(from, to)| unquoted(&line[from..to]).into_owned())
        .collect()
}

/// A cell without blanks and quotes around it.
pub(super) fn unquoted(cell: &str) -> Cow<'_, str> {
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

pub(super) fn is_missing(cell: &str) -> bool {
    matches!(cell, "" | "-" | "--" | "?" | "*")
        || ["nan", "na", "n/a", "#n/a", "null", "none", "nil", "missing"]
            .iter()
            .any(|word| cell.eq_ignore_ascii_case(word))
}

/// A cell as a number, `NaN` where it is missing.
pub(super) fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
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

pub(super) fn truth(cell: &str) -> Option<f64> {
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

pub(super) fn kind_of<'a>(cells: impl Iterator<Item = &'a str>, decimal_comma: bool) -> Cells {
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

pub(super) fn is_value(cell: &str, decimal_comma: bool) -> bool {
    !is_missing(cell) && (number(cell, decimal_comma).is_some() || stamp(cell).is_some())
}
