//! Arrow columns as numbers.

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Date32Type, Date64Type, Decimal128Type, DurationMicrosecondType, DurationMillisecondType,
    DurationNanosecondType, DurationSecondType, Float16Type, Float32Type, Float64Type, Int8Type,
    Int16Type, Int32Type, Int64Type, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrowPrimitiveType};
use arrow_schema::{DataType, Field, TimeUnit};

use crate::source::{Channel, Kind};

/// What a column is, by its type.
pub(crate) fn kind_of(kind: &DataType) -> Kind {
    match kind {
        DataType::Boolean => Kind::Bool,
        DataType::Utf8
        | DataType::LargeUtf8
        | DataType::Utf8View
        | DataType::Binary
        | DataType::LargeBinary
        | DataType::BinaryView
        | DataType::Null => Kind::Text,
        DataType::Dictionary(_, values) => match kind_of(values) {
            Kind::Numeric => Kind::Array,
            other => other,
        },
        DataType::List(_)
        | DataType::LargeList(_)
        | DataType::FixedSizeList(..)
        | DataType::ListView(_)
        | DataType::LargeListView(_)
        | DataType::Struct(_)
        | DataType::Union(..)
        | DataType::Map(..)
        | DataType::RunEndEncoded(..)
        | DataType::Interval(_)
        | DataType::FixedSizeBinary(_)
        | DataType::Decimal256(..)
        | DataType::Decimal32(..)
        | DataType::Decimal64(..)
        | DataType::Time32(_)
        | DataType::Time64(_) => Kind::Array,
        _ => Kind::Numeric,
    }
}

/// The channel of a field; its unit is the metadata `unit` or `units`.
pub(crate) fn channel(field: &Field, samples: u64) -> Channel {
    let text = |keys: [&str; 2]| {
        keys.iter()
            .find_map(|key| field.metadata().get(*key))
            .cloned()
            .unwrap_or_default()
    };
    let timed = matches!(
        field.data_type(),
        DataType::Timestamp(..) | DataType::Duration(_) | DataType::Date32 | DataType::Date64
    );
    let (name, own) = crate::units::part(field.name());
    let unit = text(["unit", "units"]);
    Channel {
        group: String::new(),
        name,
        unit: if timed {
            "s".to_owned()
        } else if unit.is_empty() {
            own
        } else {
            unit
        },
        samples,
        comment: text(["comment", "description"]),
        kind: kind_of(field.data_type()),
        is_time: false,
    }
}

/// Appends a column's values; a null is `NaN` and invalid. Time stamps count in s from the first, which `origin` keeps, so that their differences
/// keep their digits. `None` where the type is no number.
pub(crate) fn append(
    array: &dyn Array,
    origin: &mut Option<i64>,
    values: &mut Vec<f64>,
    invalid: &mut Vec<bool>,
) -> Option<()> {
    fn plain<T: ArrowPrimitiveType>(
        array: &dyn Array,
        number: impl Fn(T::Native) -> f64,
        values: &mut Vec<f64>,
    ) -> Option<()> {
        let array = array.as_primitive_opt::<T>()?;
        values.extend(array.iter().map(|value| value.map_or(f64::NAN, &number)));
        Some(())
    }
    fn stamps<T: ArrowPrimitiveType<Native = i64>>(
        array: &dyn Array,
        per_second: i64,
        origin: &mut Option<i64>,
        values: &mut Vec<f64>,
    ) -> Option<()> {
        let array = array.as_primitive_opt::<T>()?;
        values.extend(array.iter().map(|value| match value {
            Some(value) => seconds(value, per_second, origin),
            None => f64::NAN,
        }));
        Some(())
    }
    let per_second = |unit: &TimeUnit| match unit {
        TimeUnit::Second => 1,
        TimeUnit::Millisecond => 1_000,
        TimeUnit::Microsecond => 1_000_000,
        TimeUnit::Nanosecond => 1_000_000_000,
    };
    match array.data_type() {
        DataType::Boolean => {
            let array = array.as_boolean_opt()?;
            values.extend(
                array
                    .iter()
                    .map(|value| value.map_or(f64::NAN, |value| f64::from(u8::from(value)))),
            );
        }
        DataType::Int8 => plain::<Int8Type>(array, f64::from, values)?,
        DataType::Int16 => plain::<Int16Type>(array, f64::from, values)?,
        DataType::Int32 => plain::<Int32Type>(array, f64::from, values)?,
        DataType::Int64 => plain::<Int64Type>(array, |value| value as f64, values)?,
        DataType::UInt8 => plain::<UInt8Type>(array, f64::from, values)?,
        DataType::UInt16 => plain::<UInt16Type>(array, f64::from, values)?,
        DataType::UInt32 => plain::<UInt32Type>(array, f64::from, values)?,
        DataType::UInt64 => plain::<UInt64Type>(array, |value| value as f64, values)?,
        DataType::Float16 => plain::<Float16Type>(array, |value| value.to_f64(), values)?,
        DataType::Float32 => plain::<Float32Type>(array, f64::from, values)?,
        DataType::Float64 => plain::<Float64Type>(array, |value| value, values)?,
        DataType::Decimal128(_, scale) => {
            let scale = 10_f64.powi(i32::from(*scale));
            plain::<Decimal128Type>(array, |value| value as f64 / scale, values)?;
        }
        DataType::Timestamp(unit, _) => match unit {
            TimeUnit::Second => {
                stamps::<TimestampSecondType>(array, per_second(unit), origin, values)?
            }
            TimeUnit::Millisecond => {
                stamps::<TimestampMillisecondType>(array, per_second(unit), origin, values)?
            }
            TimeUnit::Microsecond => {
                stamps::<TimestampMicrosecondType>(array, per_second(unit), origin, values)?
            }
            TimeUnit::Nanosecond => {
                stamps::<TimestampNanosecondType>(array, per_second(unit), origin, values)?
            }
        },
        // A duration has a zero of its own.
        DataType::Duration(unit) => match unit {
            TimeUnit::Second => plain::<DurationSecondType>(array, |value| value as f64, values)?,
            TimeUnit::Millisecond => {
                plain::<DurationMillisecondType>(array, |value| value as f64 / 1e3, values)?
            }
            TimeUnit::Microsecond => {
                plain::<DurationMicrosecondType>(array, |value| value as f64 / 1e6, values)?
            }
            TimeUnit::Nanosecond => {
                plain::<DurationNanosecondType>(array, |value| value as f64 / 1e9, values)?
            }
        },
        DataType::Date32 => {
            plain::<Date32Type>(array, |value| f64::from(value) * 86_400.0, values)?
        }
        DataType::Date64 => plain::<Date64Type>(array, |value| value as f64 / 1e3, values)?,
        _ => return None,
    }
    match array.nulls() {
        Some(nulls) => invalid.extend(nulls.iter().map(|valid| !valid)),
        None => invalid.resize(values.len(), false),
    }
    Some(())
}

/// Seconds since the first time stamp.
pub(crate) fn seconds(stamp: i64, per_second: i64, origin: &mut Option<i64>) -> f64 {
    let since = stamp.wrapping_sub(*origin.get_or_insert(stamp));
    (since / per_second) as f64 + (since % per_second) as f64 / per_second as f64
}
