//! Tables of a page.

/// A table with a head; all rows are as long as the head.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Heads of the columns.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Row>,
    /// Whether the reader can sort it by a column.
    pub sortable: bool,
}

/// A row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    /// Cells.
    pub cells: Vec<Cell>,
    /// Whether it stands out.
    pub marked: bool,
}

/// A cell.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cell {
    /// What is read.
    pub text: String,
    /// What it is sorted by, where that is not the text.
    pub key: Option<f64>,
    /// A file that it links to, relative to the page; `#` and the anchor of a heading on it.
    pub target: Option<String>,
}

impl Table {
    /// A table of texts.
    pub fn new<H: Into<String>, R: IntoIterator<Item = String>>(
        head: impl IntoIterator<Item = H>,
        rows: impl IntoIterator<Item = R>,
    ) -> Self {
        Self {
            head: head.into_iter().map(Into::into).collect(),
            rows: rows
                .into_iter()
                .map(|cells| Row {
                    cells: cells.into_iter().map(Cell::from).collect(),
                    marked: false,
                })
                .collect(),
            sortable: false,
        }
    }
}

impl Table {
    /// The head, in which a sigma stays with its number.
    pub(super) fn heads(&self) -> impl Iterator<Item = String> + '_ {
        let whole = |head: &String| typeset(head).replace("-sigma", "\u{2011}sigma");
        self.head.iter().map(whole)
    }
}

impl Cell {
    /// Most characters of a cell that stays on one line.
    const SHORT: usize = 20;

    /// Whether it is a word or a figure rather than a sentence.
    pub(super) fn is_short(&self) -> bool {
        self.text.chars().count() <= Self::SHORT
    }

    /// The text with the signs of print.
    pub(super) fn shown(&self) -> String {
        typeset(&self.text)
    }
}

/// With the minus sign of print before numbers, and numbers on one line with what belongs to them.
pub(super) fn typeset(text: &str) -> String {
    let mut set = String::with_capacity(text.len());
    let mut before = ' ';
    let mut rest = text.chars().peekable();
    while let Some(letter) = rest.next() {
        let next = rest.peek().copied().unwrap_or(' ');
        let set_letter = match letter {
            '-' if matches!(before, ' ' | '(' | '\u{a0}') && next.is_ascii_digit() => '\u{2212}',
            ' ' if matches!(next, '%' | '\u{b1}') || before == '\u{b1}' => '\u{a0}',
            other => other,
        };
        set.push(set_letter);
        before = letter;
    }
    set
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self {
            text,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::typeset;

    #[test]
    fn numbers_are_set_as_in_print_and_names_are_left_alone() {
        assert_eq!(
            typeset("-0.5 to -3 (-1)"),
            "\u{2212}0.5 to \u{2212}3 (\u{2212}1)"
        );
        assert_eq!(
            typeset("run-1.csv --seed 1, a - b"),
            "run-1.csv --seed 1, a - b"
        );
        assert_eq!(
            typeset("1 \u{b1} 2, 95 % of"),
            "1\u{a0}\u{b1}\u{a0}2, 95\u{a0}% of"
        );
    }
}
