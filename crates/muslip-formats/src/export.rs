//! Tables as Parquet: recordings, estimates, diagnoses.

use std::io::{self, Write};

use crate::convert::Converted;

/// Rows of a recording that are in memory a second time while they are written.
const GROUP_ROWS: usize = 1 << 20;

/// What a column of a table holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Numbers (`DOUBLE`).
    Numbers,
    /// Text (`STRING`).
    Texts,
    /// Truths (`BOOLEAN`).
    Truths,
}

/// Some rows of a column.
#[derive(Debug, Clone, Copy)]
pub enum Cells<'a> {
    /// Numbers; one that is not finite is missing.
    Numbers(&'a [f64]),
    /// Texts.
    Texts(&'a [Option<String>]),
    /// Truths.
    Truths(&'a [Option<bool>]),
}

/// Writes the columns as `DOUBLE`, a missing value as null, what was done as metadata (`muslip.read` in words, one line each, and [`MADE`](crate::made::MADE)).
///
/// # Errors
/// What the sink answers; [`io::ErrorKind::Unsupported`] in a build without the feature `parquet`.
pub fn write_parquet<W: Write + Send>(sink: W, converted: &Converted) -> io::Result<W> {
    let columns: Vec<(&str, ColumnKind)> = converted
        .names
        .iter()
        .map(|name| (name.as_str(), ColumnKind::Numbers))
        .collect();
    let mut table = ParquetTable::new(sink, &columns)?;
    table.note_making(&converted.notes, &converted.made);
    if let Some(start) = &converted.start_time {
        table.note("start_time", start);
    }
    let rows = converted.columns.first().map_or(0, Vec::len);
    let mut from = 0;
    while from < rows {
        let to = (from + GROUP_ROWS).min(rows);
        let group: Vec<Cells<'_>> = converted
            .columns
            .iter()
            .map(|column| Cells::Numbers(column.get(from..to).unwrap_or_default()))
            .collect();
        table.rows(&group)?;
        from = to;
    }
    table.finish()
}

/// A table that is written some rows at a time.
#[cfg(not(feature = "parquet"))]
#[derive(Debug)]
pub struct ParquetTable<W: Write + Send> {
    sink: W,
}

#[cfg(not(feature = "parquet"))]
impl<W: Write + Send> ParquetTable<W> {
    /// Starts a table.
    ///
    /// # Errors
    /// [`io::ErrorKind::Unsupported`]: this build has no Parquet.
    pub fn new(_sink: W, _columns: &[(&str, ColumnKind)]) -> io::Result<Self> {
        Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "this build has no Parquet",
        ))
    }

    /// Adds to what stands beside the table.
    pub fn note(&mut self, _key: &str, _text: &str) {}

    /// Says beside the table how it was made.
    pub fn note_making(&mut self, _notes: &[String], _made: &crate::made::Made) {}

    /// Writes rows.
    ///
    /// # Errors
    /// None: there is no such table.
    pub fn rows(&mut self, _columns: &[Cells<'_>]) -> io::Result<()> {
        Ok(())
    }

    /// Ends the table.
    ///
    /// # Errors
    /// None: there is no such table.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.sink)
    }
}

#[cfg(feature = "parquet")]
pub use with_parquet::ParquetTable;

#[cfg(feature = "parquet")]
mod with_parquet {
    use std::fmt;
    use std::io::{self, Write};
    use std::sync::Arc;

    use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
    use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType};
    use parquet::errors::ParquetError;
    use parquet::file::metadata::KeyValue;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
    use parquet::schema::types::Type;

    use super::{Cells, ColumnKind};
    use crate::made::{MADE, Made};

    /// A table that is written some rows at a time: every column may have missing values, which are nulls.
    pub struct ParquetTable<W: Write + Send> {
        file: SerializedFileWriter<W>,
    }

    impl<W: Write + Send> fmt::Debug for ParquetTable<W> {
        fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
            out.debug_struct("ParquetTable").finish_non_exhaustive()
        }
    }

    impl<W: Write + Send> ParquetTable<W> {
        /// Starts a table.
        ///
        /// # Errors
        /// What the sink answers.
        pub fn new(sink: W, columns: &[(&str, ColumnKind)]) -> io::Result<Self> {
            let field = |&(name, kind): &(&str, ColumnKind)| {
                let (physical, logical) = match kind {
                    ColumnKind::Numbers => (Physical::DOUBLE, None),
                    ColumnKind::Texts => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
                    ColumnKind::Truths => (Physical::BOOLEAN, None),
                };
                Type::primitive_type_builder(name, physical)
                    .with_repetition(Repetition::OPTIONAL)
                    .with_logical_type(logical)
                    .build()
                    .map(Arc::new)
            };
            let fields: Result<Vec<_>, _> = columns.iter().map(field).collect();
            let schema = fields.and_then(|fields| {
                Type::group_type_builder("table")
                    .with_fields(fields)
                    .build()
            });
            let schema = Arc::new(schema.map_err(io::Error::other)?);
            let properties = WriterProperties::builder()
                .set_compression(Compression::ZSTD(ZstdLevel::default()))
                .build();
            let file = SerializedFileWriter::new(sink, schema, Arc::new(properties));
            Ok(Self {
                file: file.map_err(io::Error::other)?,
            })
        }

        /// Adds to what stands beside the table: a text under a key.
        pub fn note(&mut self, key: &str, text: &str) {
            let note = KeyValue::new(key.to_owned(), text.to_owned());
            self.file.append_key_value_metadata(note);
        }

        /// Says beside the table how it was made: in words, and in lines that are read back.
        pub fn note_making(&mut self, notes: &[String], made: &Made) {
            self.note("muslip.read", &notes.join("\n"));
            let lines = [made.resampled_lines(), made.fault_lines()].concat();
            self.note(MADE, &lines.join("\n"));
        }

        /// Writes rows: as many columns as the table has, all of one length.
        ///
        /// # Errors
        /// What the sink answers.
        pub fn rows(&mut self, columns: &[Cells<'_>]) -> io::Result<()> {
            let mut group = self.file.next_row_group().map_err(io::Error::other)?;
            let mut columns = columns.iter();
            while let Some(column) = group.next_column().map_err(io::Error::other)? {
                let Some(cells) = columns.next() else {
                    return Err(io::Error::from(io::ErrorKind::InvalidInput));
                };
                write(column, cells).map_err(io::Error::other)?;
            }
            group.close().map_err(io::Error::other)?;
            Ok(())
        }

        /// Ends the table and gives the sink back.
        ///
        /// # Errors
        /// What the sink answers.
        pub fn finish(self) -> io::Result<W> {
            self.file.into_inner().map_err(io::Error::other)
        }
    }

    /// Writes one column of a group. Of no sink's type, so that it is compiled, and optimised, here and not once for every sink.
    fn write(
        mut column: SerializedColumnWriter<'_>,
        cells: &Cells<'_>,
    ) -> Result<(), ParquetError> {
        match cells {
            Cells::Numbers(numbers) => {
                let (levels, values) = there(numbers, |value| value.is_finite().then_some(*value));
                let typed = column.typed::<DoubleType>();
                typed.write_batch(&values, Some(&levels), None)?;
            }
            Cells::Texts(texts) => {
                let text = |text: &Option<String>| text.as_deref().map(ByteArray::from);
                let (levels, values) = there(texts, text);
                let typed = column.typed::<ByteArrayType>();
                typed.write_batch(&values, Some(&levels), None)?;
            }
            Cells::Truths(truths) => {
                let (levels, values) = there(truths, |truth| *truth);
                let typed = column.typed::<BoolType>();
                typed.write_batch(&values, Some(&levels), None)?;
            }
        }
        column.close()
    }

    /// Which cells are there, and what they hold.
    fn there<T, V>(cells: &[T], value: impl Fn(&T) -> Option<V>) -> (Vec<i16>, Vec<V>) {
        let mut values = Vec::with_capacity(cells.len());
        let levels = cells
            .iter()
            .map(|cell| {
                let value = value(cell);
                let level = i16::from(value.is_some());
                values.extend(value);
                level
            })
            .collect();
        (levels, values)
    }
}
