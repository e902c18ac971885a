//! What TDMS says of a file, a group or a channel beside its readings.

/// The value of a property.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Property {
    Number(f64),
    Text(String),
    /// Nanoseconds since 1970.
    Time(i64),
}
