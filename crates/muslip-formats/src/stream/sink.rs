//! Who takes the rows of a conversion.

use std::io;

use crate::error::FormatError;

/// Who takes the rows of a conversion.
pub trait RowSink {
    /// Takes rows, by column: `time_s` first.
    ///
    /// # Errors
    /// The sink's own.
    fn rows(&mut self, columns: &[Vec<f64>]) -> io::Result<()>;
}

/// Why there is none.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The sink.
    #[error(transparent)]
    Sink(#[from] io::Error),
}

/// Where the rows go.
pub(super) struct Out<'a> {
    pub(super) sink: &'a mut dyn RowSink,
    pub(super) progress: &'a mut dyn FnMut(u64),
    pub(super) rows: u64,
    /// Empty cells of each column.
    pub(super) empty: Vec<u64>,
}

impl Out<'_> {
    pub(super) fn rows(&mut self, columns: &[Vec<f64>]) -> Result<(), StreamError> {
        let columns_of_channels = columns.iter().skip(1);
        for (empty, values) in self.empty.iter_mut().zip(columns_of_channels) {
            *empty += values.iter().filter(|value| value.is_nan()).count() as u64;
        }
        self.rows += columns.first().map_or(0, Vec::len) as u64;
        self.sink.rows(columns)?;
        (self.progress)(self.rows);
        Ok(())
    }
}
