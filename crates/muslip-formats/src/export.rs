//! A converted recording as Parquet.

use std::io::{self, Write};

use crate::convert::Converted;

/// Writes the columns as `DOUBLE`, a missing value as null, the SI unit and what was done as metadata (`muslip.read`, one line each).
///
/// # Errors
/// What the sink answers; [`io::ErrorKind::Unsupported`] in a build without the feature `parquet`.
#[cfg(not(feature = "parquet"))]
pub fn write_parquet<W: Write + Send>(_sink: W, _converted: &Converted) -> io::Result<()> {
    Err(io::Error::new(
        io::ErrorKind::Unsupported,
        "this build has no Parquet",
    ))
}

/// Writes the columns as `DOUBLE`, a missing value as null, what was done as metadata (`muslip.read`, one line each).
///
/// # Errors
/// What the sink answers; [`io::ErrorKind::Unsupported`] in a build without the feature `parquet`.
#[cfg(feature = "parquet")]
pub fn write_parquet<W: Write + Send>(sink: W, converted: &Converted) -> io::Result<()> {
    use std::sync::Arc;

    use parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
    use parquet::data_type::DoubleType;
    use parquet::file::metadata::KeyValue;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;

    /// Rows that are in memory a second time while they are written.
    const GROUP_ROWS: usize = 1 << 20;
    let fields: Result<Vec<_>, _> = converted
        .names
        .iter()
        .map(|name| {
            Type::primitive_type_builder(name, Physical::DOUBLE)
                .with_repetition(Repetition::OPTIONAL)
                .build()
                .map(Arc::new)
        })
        .collect();
    let schema = fields.and_then(|fields| {
        Type::group_type_builder("recording")
            .with_fields(fields)
            .build()
    });
    let schema = Arc::new(schema.map_err(io::Error::other)?);
    let mut metadata = vec![KeyValue::new(
        "muslip.read".to_owned(),
        converted.notes.join("\n"),
    )];
    metadata.extend(
        converted
            .start_time
            .clone()
            .map(|start| KeyValue::new("start_time".to_owned(), start)),
    );
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
        .build();
    let mut file =
        SerializedFileWriter::new(sink, schema, Arc::new(properties)).map_err(io::Error::other)?;
    let rows = converted.columns.first().map_or(0, Vec::len);
    let mut from = 0;
    while from < rows {
        let to = (from + GROUP_ROWS).min(rows);
        let mut group = file.next_row_group().map_err(io::Error::other)?;
        let mut columns = converted.columns.iter();
        while let Some(mut writer) = group.next_column().map_err(io::Error::other)? {
            let column = columns
                .next()
                .and_then(|column| column.get(from..to))
                .unwrap_or_default();
            let levels: Vec<i16> = column
                .iter()
                .map(|value| i16::from(value.is_finite()))
                .collect();
            let values: Vec<f64> = column
                .iter()
                .copied()
                .filter(|value| value.is_finite())
                .collect();
            let batch = writer
                .typed::<DoubleType>()
                .write_batch(&values, Some(&levels), None);
            batch.map_err(io::Error::other)?;
            writer.close().map_err(io::Error::other)?;
        }
        group.close().map_err(io::Error::other)?;
        from = to;
    }
    file.close().map_err(io::Error::other)?;
    Ok(())
}
