//! Rows of plain numbers, read at once from the bytes.

use super::cell::{Cells, is_filled, number};
use super::layout::Layout;

/// Rows that are read straight from the bytes: those whose wanted cells are plain numbers or empty, without quotes. Nearly all rows are such; every
/// other one is left to the way that tells what is wrong with it.
pub(super) struct PlainRows {
    delimiter: u8,
    point: u8,
    /// Of each column, whether it is wanted.
    wanted: Vec<bool>,
    /// Of each wanted column, in the order of the file, its place among those that were asked for.
    pub(super) targets: Vec<usize>,
}

impl PlainRows {
    pub(super) fn of(layout: &Layout, cells: &[Cells], wanted: &[usize]) -> Option<Self> {
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
    pub(super) fn row(&self, text: &[u8], row: &mut Vec<f64>) -> Option<usize> {
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
pub(super) fn plain_number(
    text: &[u8],
    mut at: usize,
    point: u8,
    delimiter: u8,
) -> Option<(f64, usize)> {
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
