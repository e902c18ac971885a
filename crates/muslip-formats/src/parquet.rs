//! Parquet, column by column as it lies in the file. Types and units come from the schema that Arrow leaves in the metadata, where it did.

use arrow_schema::Schema;
use base64::Engine;
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, FixedLenByteArray, Int96};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use crate::cells;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::made::{MADE, Made};
use crate::source::{Channel, Kind, Series, Source};
use crate::units;

/// Rows decoded at a time.
const BATCH: usize = 1 << 16;

/// How the stored numbers become readings.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Reading {
    Number,
    /// Without a sign.
    Unsigned,
    /// So many in a unit.
    Scaled(f64),
    /// Time stamps, so many a second.
    Stamps(i64),
    /// IEEE half precision in two bytes.
    Half,
    None,
}

/// A Parquet file.
pub(crate) struct ParquetSource {
    file: SerializedFileReader<std::fs::File>,
    channels: Vec<Channel>,
    readings: Vec<Reading>,
    /// What the table says of a conversion that it came from; `None` where it is of another program.
    made: Option<Made>,
}

fn problem(error: parquet::errors::ParquetError) -> Problem {
    Problem::whole(error.to_string())
}

impl ParquetSource {
    pub(crate) fn open(bytes: &FileBytes) -> Result<Self, Problem> {
        // Each announced run of bytes is held against the file by the library; what is not there at all is told here.
        let end = bytes.exact(bytes.length().saturating_sub(8), 8)?;
        if &end[4..] != b"PAR1" {
            return Err(Problem::whole(
                "no footer: the file is cut off, or was never closed",
            ));
        }
        let file = SerializedFileReader::new(bytes.file().try_clone()?).map_err(problem)?;
        let metadata = file.metadata().file_metadata().clone();
        let entry = |key: &str| {
            let all = metadata.key_value_metadata()?;
            all.iter().find(|entry| entry.key == key)?.value.clone()
        };
        let schema = entry("ARROW:schema").and_then(|text| arrow_schema(&text));
        let made = entry(MADE).map(|text| Made::of_lines(text.lines()));
        let rows = u64::try_from(metadata.num_rows())
            .map_err(|_| Problem::whole("a negative number of rows"))?;
        let descriptor = metadata.schema_descr_ptr();
        let (mut channels, mut readings) = (Vec::new(), Vec::new());
        for column in descriptor.columns() {
            let path = column.path().parts();
            let (name, group) = path
                .split_last()
                .map_or(("", String::new()), |(name, group)| {
                    (name.as_str(), group.join("."))
                });
            let field = schema
                .as_ref()
                .filter(|_| group.is_empty())
                .and_then(|schema| schema.field_with_name(name).ok());
            let reading = reading_of(column);
            let mut channel = match field {
                Some(field) => cells::channel(field, rows),
                None => {
                    let (name, unit) = units::part(name);
                    Channel {
                        group,
                        name,
                        unit,
                        samples: rows,
                        comment: String::new(),
                        kind: Kind::Numeric,
                        is_time: false,
                    }
                }
            };
            channel.kind = if column.max_rep_level() > 0 {
                Kind::Array
            } else {
                match (reading, column.physical_type(), column.converted_type()) {
                    (_, Physical::BOOLEAN, _) => Kind::Bool,
                    (Reading::None, Physical::BYTE_ARRAY | Physical::FIXED_LEN_BYTE_ARRAY, _) => {
                        Kind::Text
                    }
                    (Reading::None, ..) => Kind::Array,
                    _ => Kind::Numeric,
                }
            };
            if matches!(reading, Reading::Stamps(_)) {
                channel.unit = "s".to_owned();
            }
            channels.push(channel);
            readings.push(reading);
        }
        Ok(Self {
            file,
            channels,
            readings,
            made,
        })
    }

    fn column(&self, index: usize) -> Result<Series, Problem> {
        let channel = &self.channels[index];
        let of = |reason: String| Problem::of(channel.shown(), reason);
        if !channel.kind.is_number() {
            return Err(of(format!("{}, not a number", channel.kind.word())));
        }
        let reading = self.readings[index];
        let mut column = Column::default();
        for group in 0..self.file.num_row_groups() {
            let group = self
                .file
                .get_row_group(group)
                .map_err(|error| of(error.to_string()))?;
            let descriptor = group.metadata().schema_descr().column(index);
            let reader = group
                .get_column_reader(index)
                .map_err(|error| of(error.to_string()))?;
            let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            column
                .append(reader, rows, descriptor.max_def_level(), reading)
                .map_err(of)?;
        }
        if column.values.len() as u64 != channel.samples {
            return Err(of(format!(
                "{} of {} readings are there",
                column.values.len(),
                channel.samples
            )));
        }
        // A conversion leaves cells empty, and has said why.
        let says_invalid = self.made.is_none() && column.invalid.contains(&true);
        Ok(Series {
            time_s: None,
            invalid: says_invalid.then_some(column.invalid),
            values: column.values,
        })
    }
}

fn arrow_schema(text: &str) -> Option<Schema> {
    let bytes = base64::engine::general_purpose::STANDARD
        .decode(text)
        .ok()?;
    let message = if bytes.starts_with(&[0xff; 4]) {
        bytes.get(8..)?
    } else {
        &bytes
    };
    let schema = arrow_ipc::root_as_message(message)
        .ok()?
        .header_as_schema()?;
    Some(arrow_ipc::convert::fb_to_schema(schema))
}

fn reading_of(column: &ColumnDescriptor) -> Reading {
    let per_second = |unit: &TimeUnit| match unit {
        TimeUnit::MILLIS => 1_000,
        TimeUnit::MICROS => 1_000_000,
        TimeUnit::NANOS => 1_000_000_000,
    };
    let integer = matches!(column.physical_type(), Physical::INT32 | Physical::INT64);
    match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Timestamp(stamp)), _) if integer => {
            return Reading::Stamps(per_second(&stamp.unit));
        }
        (_, ConvertedType::TIMESTAMP_MILLIS) => return Reading::Stamps(1_000),
        (_, ConvertedType::TIMESTAMP_MICROS) => return Reading::Stamps(1_000_000),
        (Some(LogicalType::Date), _) | (_, ConvertedType::DATE) => {
            return Reading::Scaled(1.0 / 86_400.0);
        }
        (Some(LogicalType::Time(time)), _) if integer => {
            return Reading::Scaled(per_second(&time.unit) as f64);
        }
        (Some(LogicalType::Integer(int)), _) if !int.is_signed => return Reading::Unsigned,
        (
            _,
            ConvertedType::UINT_8
            | ConvertedType::UINT_16
            | ConvertedType::UINT_32
            | ConvertedType::UINT_64,
        ) => return Reading::Unsigned,
        (Some(LogicalType::Decimal(decimal)), _) if integer => {
            return Reading::Scaled(10_f64.powi(decimal.scale));
        }
        (_, ConvertedType::DECIMAL) if integer => {
            return Reading::Scaled(10_f64.powi(column.type_scale()));
        }
        (Some(LogicalType::Float16), _) => return Reading::Half,
        _ => {}
    }
    match column.physical_type() {
        Physical::BOOLEAN
        | Physical::INT32
        | Physical::INT64
        | Physical::FLOAT
        | Physical::DOUBLE => Reading::Number,
        Physical::INT96 => Reading::Stamps(1_000_000_000),
        Physical::BYTE_ARRAY | Physical::FIXED_LEN_BYTE_ARRAY => Reading::None,
    }
}

/// A column as it grows.
#[derive(Debug, Default)]
struct Column {
    values: Vec<f64>,
    invalid: Vec<bool>,
    origin: Option<i64>,
}

impl Column {
    fn append(
        &mut self,
        reader: ColumnReader,
        rows: usize,
        deepest: i16,
        reading: Reading,
    ) -> Result<(), String> {
        macro_rules! all {
            ($reader:expr, $kind:ty, $number:expr) => {{
                let mut reader = $reader;
                let mut left = rows;
                while left > 0 {
                    let (mut levels, mut values): (Vec<i16>, Vec<$kind>) = (Vec::new(), Vec::new());
                    let (records, ..) = reader
                        .read_records(
                            left.min(BATCH),
                            (deepest > 0).then_some(&mut levels),
                            None,
                            &mut values,
                        )
                        .map_err(|error| error.to_string())?;
                    if records == 0 {
                        break;
                    }
                    left = left.saturating_sub(records);
                    let numbers: Vec<f64> = values.iter().map($number).collect();
                    self.extend(numbers, &levels, deepest)?;
                }
            }};
        }
        match (reader, reading) {
            (ColumnReader::BoolColumnReader(reader), _) => {
                all!(reader, bool, |&value| f64::from(u8::from(value)))
            }
            (ColumnReader::Int32ColumnReader(reader), Reading::Unsigned) => {
                all!(reader, i32, |&value| f64::from(value.cast_unsigned()))
            }
            (ColumnReader::Int32ColumnReader(reader), Reading::Scaled(by)) => {
                all!(reader, i32, |&value| f64::from(value) / by)
            }
            (ColumnReader::Int32ColumnReader(reader), _) => {
                all!(reader, i32, |&value| f64::from(value))
            }
            (ColumnReader::Int64ColumnReader(reader), Reading::Unsigned) => {
                all!(reader, i64, |&value| value.cast_unsigned() as f64)
            }
            (ColumnReader::Int64ColumnReader(reader), Reading::Scaled(by)) => {
                all!(reader, i64, |&value| value as f64 / by)
            }
            (ColumnReader::Int64ColumnReader(reader), Reading::Stamps(per_second)) => {
                let origin = &mut self.origin.take();
                all!(reader, i64, |&value| cells::seconds(
                    value, per_second, origin
                ));
                self.origin = *origin;
            }
            (ColumnReader::Int64ColumnReader(reader), _) => {
                all!(reader, i64, |&value| value as f64)
            }
            (ColumnReader::Int96ColumnReader(reader), _) => {
                let origin = &mut self.origin.take();
                all!(reader, Int96, |value: &Int96| cells::seconds(
                    value.to_nanos(),
                    1_000_000_000,
                    origin
                ));
                self.origin = *origin;
            }
            (ColumnReader::FloatColumnReader(reader), _) => {
                all!(reader, f32, |&value| f64::from(value))
            }
            (ColumnReader::DoubleColumnReader(reader), _) => all!(reader, f64, |&value| value),
            (ColumnReader::FixedLenByteArrayColumnReader(reader), Reading::Half) => {
                all!(reader, FixedLenByteArray, |value: &FixedLenByteArray| half(
                    value
                ))
            }
            _ => return Err("its type is not supported".to_owned()),
        }
        Ok(())
    }

    /// Adds values, with a `NaN` for each null between them.
    fn extend(&mut self, numbers: Vec<f64>, levels: &[i16], deepest: i16) -> Result<(), String> {
        if deepest == 0 {
            self.invalid
                .resize(self.invalid.len() + numbers.len(), false);
            self.values.extend(numbers);
            return Ok(());
        }
        let mut numbers = numbers.into_iter();
        for &level in levels {
            let there = level == deepest;
            self.invalid.push(!there);
            self.values.push(if there {
                numbers.next().ok_or("fewer values than its levels say")?
            } else {
                f64::NAN
            });
        }
        Ok(())
    }
}

/// IEEE 754 half precision.
fn half(value: &ByteArray) -> f64 {
    let bits = match value.data() {
        [low, high] => u16::from_le_bytes([*low, *high]),
        _ => return f64::NAN,
    };
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2_f64.powi(exponent - 15),
    }
}

impl Source for ParquetSource {
    fn start_time(&self) -> Option<String> {
        None
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn made(&self) -> Made {
        self.made.clone().unwrap_or_default()
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        wanted.iter().map(|&column| self.column(column)).collect()
    }

    fn faults(&self) -> Vec<String> {
        Vec::new()
    }
}
