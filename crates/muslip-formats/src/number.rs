//! Types of numbers as files hold them, as `f64`.

/// A type of number as files hold it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F32,
    F64,
}

impl Number {
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Appends the numbers in the bytes, one after the other; a rest that is none is left.
    #[cfg(any(feature = "mat", feature = "tdms"))]
    pub(crate) fn extend(self, bytes: &[u8], big_endian: bool, out: &mut Vec<f64>) {
        fn all<const N: usize>(
            bytes: &[u8],
            big_endian: bool,
            out: &mut Vec<f64>,
            number: impl Fn([u8; N]) -> f64,
        ) {
            let (cells, _) = bytes.as_chunks::<N>();
            if big_endian {
                out.extend(cells.iter().map(|&(mut cell)| {
                    cell.reverse();
                    number(cell)
                }));
            } else {
                out.extend(cells.iter().map(|&cell| number(cell)));
            }
        }
        match self {
            Self::I8 => all(bytes, big_endian, out, |b| f64::from(i8::from_le_bytes(b))),
            Self::I16 => all(bytes, big_endian, out, |b| f64::from(i16::from_le_bytes(b))),
            Self::I32 => all(bytes, big_endian, out, |b| f64::from(i32::from_le_bytes(b))),
            Self::I64 => all(bytes, big_endian, out, |b| i64::from_le_bytes(b) as f64),
            Self::U8 => all(bytes, big_endian, out, |b| f64::from(u8::from_le_bytes(b))),
            Self::U16 => all(bytes, big_endian, out, |b| f64::from(u16::from_le_bytes(b))),
            Self::U32 => all(bytes, big_endian, out, |b| f64::from(u32::from_le_bytes(b))),
            Self::U64 => all(bytes, big_endian, out, |b| u64::from_le_bytes(b) as f64),
            Self::F32 => all(bytes, big_endian, out, |b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => all(bytes, big_endian, out, f64::from_le_bytes),
        }
    }

    /// The number at the start of the bytes; `NaN` where there are too few.
    #[cfg(any(feature = "hdf5", feature = "tdms"))]
    pub(crate) fn read(self, bytes: &[u8], big_endian: bool) -> f64 {
        fn array<const N: usize>(bytes: &[u8], big: bool) -> Option<[u8; N]> {
            let mut array: [u8; N] = bytes.get(..N)?.try_into().ok()?;
            if big {
                array.reverse();
            }
            Some(array)
        }
        let value = match self {
            Self::I8 => array(bytes, big_endian).map(|b| f64::from(i8::from_le_bytes(b))),
            Self::I16 => array(bytes, big_endian).map(|b| f64::from(i16::from_le_bytes(b))),
            Self::I32 => array(bytes, big_endian).map(|b| f64::from(i32::from_le_bytes(b))),
            Self::I64 => array(bytes, big_endian).map(|b| i64::from_le_bytes(b) as f64),
            Self::U8 => array(bytes, big_endian).map(|b| f64::from(u8::from_le_bytes(b))),
            Self::U16 => array(bytes, big_endian).map(|b| f64::from(u16::from_le_bytes(b))),
            Self::U32 => array(bytes, big_endian).map(|b| f64::from(u32::from_le_bytes(b))),
            Self::U64 => array(bytes, big_endian).map(|b| u64::from_le_bytes(b) as f64),
            Self::F32 => array(bytes, big_endian).map(|b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => array(bytes, big_endian).map(f64::from_le_bytes),
        };
        value.unwrap_or(f64::NAN)
    }
}
