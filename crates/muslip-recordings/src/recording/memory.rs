//! A whole recording in memory, its columns shared with whoever made them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use muslip_formats::made::Made;
use muslip_formats::roles::Refused;

use super::header::{Channel, Header, Required};
use crate::input_error::{InputError, InputProblem, quoted, shown};

/// A column that may belong to somebody else, such as an array of another language. A missing value is `NaN`.
pub type SharedColumn = Arc<dyn AsRef<[f64]> + Send + Sync>;

/// A whole recording in memory: cheap to clone, and opened as often as wanted by [`super::Recording::of_memory`].
#[derive(Clone)]
pub struct Memory {
    pub(super) path: PathBuf,
    pub(super) header: Header,
    pub(super) columns: Vec<SharedColumn>,
    pub(super) rows: usize,
    pub(super) notes: Vec<String>,
    pub(super) made: Made,
    pub(super) refused: Vec<Refused>,
}

impl fmt::Debug for Memory {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Memory")
            .field("path", &self.path)
            .field("names", &self.header.names())
            .field("rows", &self.rows)
            .finish_non_exhaustive()
    }
}

impl Memory {
    /// A recording of columns with the contract's names and units, none of them copied; `name` stands for the file in errors and results. The
    /// line of an error is the row, from 1.
    ///
    /// # Errors
    /// [`InputError`]: no row, a column without a name or twice, columns of different lengths, a time that repeats or goes back.
    pub fn of_columns(
        name: &Path,
        columns: Vec<(String, SharedColumn)>,
    ) -> Result<Self, InputError> {
        let fail = |problem| InputError::whole_file(name, problem);
        let (names, columns): (Vec<String>, Vec<SharedColumn>) = columns.into_iter().unzip();
        for (index, column) in names.iter().enumerate() {
            if column.is_empty() {
                return Err(fail(InputProblem::UnnamedColumn(index + 1)));
            }
            if names.iter().take(index).any(|before| before == column) {
                return Err(fail(InputProblem::ColumnTwice(quoted(column))));
            }
        }
        let rows = columns
            .first()
            .map_or(0, |column| column.as_ref().as_ref().len());
        if rows == 0 {
            return Err(fail(InputProblem::NoUsableSample("no row".to_owned())));
        }
        for (index, column) in columns.iter().enumerate() {
            let found = column.as_ref().as_ref().len();
            if found != rows {
                return Err(InputError {
                    path: name.to_owned(),
                    line: rows.min(found) as u64 + 1,
                    column: index as u64 + 1,
                    problem: InputProblem::ColumnLength {
                        column: names.get(index).cloned().unwrap_or_default(),
                        expected: rows,
                        found,
                    },
                });
            }
        }
        let memory = Self {
            path: name.to_owned(),
            header: Header::new(names),
            columns,
            rows,
            notes: Vec::new(),
            made: Made::default(),
            refused: Vec::new(),
        };
        memory.check_time()?;
        Ok(memory)
    }

    /// The same under another name.
    #[must_use]
    pub fn named(mut self, name: &Path) -> Self {
        name.clone_into(&mut self.path);
        self
    }

    /// The file, or the name that stands for one.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of all columns.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The columns, in the order of the header.
    #[must_use]
    pub fn columns(&self) -> &[SharedColumn] {
        &self.columns
    }

    /// Number of rows; at least one.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// What was done to read it; empty for columns of the contract.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What a diagnosis must know of how it was read.
    #[must_use]
    pub fn made(&self) -> &Made {
        &self.made
    }

    /// Bytes of its values.
    pub(super) fn length_bytes(&self) -> u64 {
        (self.rows * self.columns.len() * size_of::<f64>()) as u64
    }

    /// An error where a column that the work needs is not there.
    pub(super) fn has(&self, required: Required) -> Result<(), InputError> {
        let missing = required
            .channels()
            .find(|&channel| self.header.index(channel).is_none());
        let Some(channel) = missing else {
            return Ok(());
        };
        let problem = InputProblem::missing(channel.name(), &self.refused);
        Err(InputError::whole_file(&self.path, problem))
    }

    /// Copies a row; a cell that is not there is `NaN`.
    pub(super) fn copy_row(&self, row: usize, cells: &mut [f64]) {
        for (cell, column) in cells.iter_mut().zip(&self.columns) {
            let column = column.as_ref().as_ref();
            *cell = column.get(row).copied().unwrap_or(f64::NAN);
        }
    }

    fn check_time(&self) -> Result<(), InputError> {
        let Some((index, column)) = self
            .header
            .index(Channel::Time)
            .and_then(|index| Some((index, self.columns.get(index)?)))
        else {
            return Ok(());
        };
        let mut before = f64::NEG_INFINITY;
        for (row, &now) in column.as_ref().as_ref().iter().enumerate() {
            // A missing or infinite time orders nothing; the rows around it must still be in order.
            if !now.is_finite() {
                continue;
            }
            if now <= before {
                let problem = if now == before {
                    InputProblem::TimeRepeats(shown(now))
                } else {
                    InputProblem::TimeGoesBack {
                        before: shown(before),
                        now: shown(now),
                    }
                };
                return Err(InputError {
                    path: self.path.clone(),
                    line: row as u64 + 1,
                    column: index as u64 + 1,
                    problem,
                });
            }
            before = now;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared(values: &[f64]) -> SharedColumn {
        Arc::new(values.to_vec())
    }

    #[test]
    fn columns_that_make_no_recording_are_refused_with_row_and_column() {
        let complaint = |columns: Vec<(&str, SharedColumn)>| {
            let columns = columns
                .into_iter()
                .map(|(name, column)| (name.to_owned(), column))
                .collect();
            Memory::of_columns(Path::new("frame"), columns)
                .expect_err("must be refused")
                .to_string()
        };
        assert_eq!(
            complaint(vec![("time_s", shared(&[0.0, 1.0, f64::NAN, 0.5]))]),
            "frame:4:1: time_s goes back: 0.5 s after 1 s"
        );
        assert_eq!(
            complaint(vec![("a", shared(&[0.0])), ("a", shared(&[0.0]))]),
            "frame:1:1: column \"a\" appears twice"
        );
        assert_eq!(
            complaint(vec![
                ("time_s", shared(&[0.0, 1.0])),
                ("drag_force_n", shared(&[0.0]))
            ]),
            "frame:2:2: drag_force_n: 1 values where the first column has 2"
        );
        assert_eq!(complaint(vec![]), "frame:1:1: no usable sample: no row");
    }
}
