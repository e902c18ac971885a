//! The one shape of every complaint about a file that a person handed in: `path:line:column: what`.

use std::path::{Path, PathBuf};

/// A file that cannot be used, with the place that says why.
///
/// Displays as exactly one line, `path:line:column: problem`; line and column start at 1, and the
/// column counts characters (not bytes), so that editors jump to it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}:{line}:{column}: {problem}", one_line(&path.to_string_lossy()))]
pub struct InputError {
    /// The file as the user named it.
    pub path: PathBuf,
    /// Line, from 1.
    pub line: u64,
    /// Character in the line, from 1.
    pub column: u64,
    /// What is wrong there.
    pub problem: InputProblem,
}

impl InputError {
    /// A problem of the file as a whole, placed at its first character.
    pub fn whole_file(path: &Path, problem: InputProblem) -> Self {
        Self {
            path: path.to_owned(),
            line: 1,
            column: 1,
            problem,
        }
    }

    /// What the system says against reading a file.
    pub fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        Self::whole_file(path, InputProblem::Unreadable(system_reason(error)))
    }
}

/// What can be wrong with a recording or a rig file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InputProblem {
    /// The file does not exist, is a folder, or the system refuses it.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// Bytes that are not UTF-8 text.
    #[error("not UTF-8 text")]
    NotUtf8,
    /// Not a single row, not even a header.
    #[error("the file is empty: a header row is needed")]
    Empty,
    /// A header and nothing below it.
    #[error("no rows below the header")]
    HeaderOnly,
    /// A column without a name.
    #[error("column {0} has no name in the header")]
    UnnamedColumn(usize),
    /// A column that the work needs is not there.
    #[error("required column {0} is missing")]
    MissingColumn(&'static str),
    /// Two columns of one name.
    #[error("column {0} appears twice")]
    ColumnTwice(String),
    /// A row whose number of cells is not the header's.
    #[error("{found} cells where the header has {expected}")]
    CellCount {
        /// Cells of the header.
        expected: usize,
        /// Cells of this row.
        found: usize,
    },
    /// A column in memory whose length is not that of the others.
    #[error("{column}: {found} values where the first column has {expected}")]
    ColumnLength {
        /// Name of the column.
        column: String,
        /// Values of the first column.
        expected: usize,
        /// Values of this one.
        found: usize,
    },
    /// A cell that is neither a number nor missing.
    #[error("{column}: {cell} is not a number")]
    NotANumber {
        /// Header of the cell's column.
        column: String,
        /// The cell, quoted and shortened.
        cell: String,
    },
    /// The time of a row is that of the row before.
    #[error("time_s repeats: {0} s is also the time of the row before")]
    TimeRepeats(String),
    /// The time of a row is before that of the row before.
    #[error("time_s goes back: {now} s after {before} s")]
    TimeGoesBack {
        /// Time of the row before, in s.
        before: String,
        /// Time of this row, in s.
        now: String,
    },
    /// Text that is not TOML, or TOML of the wrong shape (a required key missing, say).
    #[error("{0}")]
    Toml(String),
    /// A value that must be finite and positive is not.
    #[error("{key} = {value}: must be finite and positive")]
    NotPositive {
        /// Key with its table, as in `wheel.radius_m`.
        key: String,
        /// The value as read.
        value: String,
    },
    /// A wheel radius that no rig has; most likely a wrong unit.
    #[error("wheel.radius_m = {0}: must be between 0.005 and 2 m")]
    RadiusOutOfRange(String),
    /// A tyre law that the rig file's format does not know.
    #[error("tyre.law = {0}: unknown tyre law (known: \"rudd\")")]
    UnknownTyreLaw(String),
    /// Every row was read, and none can serve as a measurement.
    #[error("no usable sample: {0}")]
    NoUsableSample(String),
    /// A recording given more than once.
    #[error("given twice: the same file as {0}")]
    GivenTwice(String),
    /// A model file whose content this program cannot run.
    #[error("{key}: {what}")]
    Model {
        /// Key with its tables, as in `tyre[0].id`.
        key: String,
        /// What is wrong with it.
        what: String,
    },
    /// A rig file that is not that of the model.
    #[error("{key} = {found}: the model was made for a rig with {expected}")]
    OtherRig {
        /// Key with its table, as in `wheel.radius_m`.
        key: &'static str,
        /// The rig file's value.
        found: String,
        /// The model's value.
        expected: String,
    },
    /// A file of another format that is damaged or not supported, or whose channels cannot be brought to columns.
    #[error("{0}")]
    Channels(String),
    /// The usable samples do not hold a curve.
    #[error("no curve: {0}")]
    NoCurve(String),
}

impl InputProblem {
    /// A column of the contract that is not there, with the reason where its channel was looked for.
    pub fn missing(column: &'static str, refused: &[muslip_formats::roles::Refused]) -> Self {
        match refused.iter().find(|one| one.column == column) {
            Some(refused) => Self::Channels(refused.reason.clone()),
            None => Self::MissingColumn(column),
        }
    }
}

impl From<muslip_formats::FormatError> for InputError {
    fn from(error: muslip_formats::FormatError) -> Self {
        let (line, column) = error.line();
        Self {
            problem: InputProblem::Channels(error.problem.in_words()),
            path: error.path,
            line,
            column,
        }
    }
}

/// Puts a cell or a name into a message: quoted, on one line, at most 40 characters of it.
pub(crate) fn quoted(text: &str) -> String {
    const LONGEST: usize = 40;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{:?}...", &text[..end]),
        None => format!("{text:?}"),
    }
}

/// A number in a message, short however large or small it is.
pub(crate) fn shown(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// Replaces what would break or disguise a line of a terminal.
pub fn one_line(text: &str) -> String {
    text.split(char::is_control)
        .map(str::trim)
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// The system's reason without the `(os error N)` that only programmers read.
pub fn system_reason(error: &std::io::Error) -> String {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or_default();
    one_line(text).to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complaint_is_one_line_whatever_the_file_is_called() {
        let error = InputError::whole_file(
            Path::new("a\nb\u{1b}[31m.csv"),
            InputProblem::NotANumber {
                column: "drag_force_n".into(),
                cell: quoted("x\ny"),
            },
        );
        let text = error.to_string();
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(!text.contains('\u{1b}'), "{text:?}");
    }

    #[test]
    fn numbers_are_shown_short() {
        let shown = [0.0, 310.0, 0.25, 1e-308, -1e308, f64::NAN].map(shown);
        assert_eq!(shown, ["0", "310", "0.25", "1e-308", "-1e308", "NaN"]);
    }

    #[test]
    fn a_long_cell_is_shortened_between_characters() {
        assert_eq!(quoted(&"é".repeat(50)), format!("{:?}...", "é".repeat(40)));
    }
}
