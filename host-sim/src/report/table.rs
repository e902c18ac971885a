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
    /// A file that it links to, relative to the page.
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

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self {
            text,
            ..Self::default()
        }
    }
}
