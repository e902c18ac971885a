//! A whole run in memory, by column.

use std::path::{Path, PathBuf};

use super::header::{Channel, Header, Required};
use super::reader::Recording;
use crate::input_error::InputError;

/// A whole recording, one vector a column; a missing cell is `NaN`.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    path: PathBuf,
    header: Header,
    columns: Vec<Vec<f64>>,
}

impl Run {
    /// Reads a whole recording.
    ///
    /// # Errors
    /// [`InputError`] as for [`Recording::open`], [`Recording::rows`] and
    /// [`super::Rows::next_row`].
    pub fn read(path: &Path, required: Required) -> Result<Self, InputError> {
        let mut recording = Recording::open(path)?;
        let mut rows = recording.rows(required)?;
        let header = rows.header().clone();
        let mut columns = vec![Vec::new(); header.names().len()];
        while let Some(row) = rows.next_row()? {
            for (column, &value) in columns.iter_mut().zip(row.cells()) {
                column.push(value);
            }
        }
        Ok(Self {
            path: path.to_owned(),
            header,
            columns,
        })
    }

    /// The file as the user named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The header row.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Number of rows; at least one.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// All columns, in the order of the header.
    pub fn columns(&self) -> &[Vec<f64>] {
        &self.columns
    }

    /// The column of a channel, where the recording has it.
    pub fn channel(&self, channel: Channel) -> Option<&[f64]> {
        self.header
            .index(channel)
            .and_then(|index| self.columns.get(index))
            .map(Vec::as_slice)
    }

    /// Columns that are no known channel, under their header.
    pub fn extra(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.header
            .extra()
            .zip(
                self.header
                    .extra()
                    .filter_map(|(index, _)| self.columns.get(index)),
            )
            .map(|((_, name), column)| (name, column.as_slice()))
    }
}
