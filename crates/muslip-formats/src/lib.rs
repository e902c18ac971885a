//! The files that test benches write, as channels.
//!
//! [`SourceFile::open`] tells the format by the file's first bytes and lists its channels; [`SourceFile::read`] reads chosen ones as `f64` with
//! their time and validity. [`map`] and [`roles`] say which channel is which column of a recording, [`units`] brings readings to SI, [`raster`]
//! brings channels of different rates onto one time, and [`convert`] does it all;
//! [`stream`] does it some rows at a time, [`made`] is what a recording says of it afterwards.
//!
//! | feature | format | told by |
//! | --- | --- | --- |
//! | `csv` | text: any delimiter, decimal comma, encoding, unit row, preamble | no zero bytes, or a byte-order mark |
//! | `mdf` | MDF 3 and MDF 4 | `MDF     `, `UnFinMF ` |
//! | `tdms` | TDMS 1 and 2 | `TDSm` |
//! | `mat` | MAT v4 to v7 | `MATLAB 5.0`, or a v4 header that fits its file |
//! | `hdf5` | HDF5 and MAT v7.3 | the HDF5 signature at 0, 512, 1024, ... |
//! | `parquet` | Parquet | `PAR1` |
//! | `arrow` | Arrow IPC, which is Feather v2 | `ARROW1` |
//!
//! No reader believes a count in a header: what is allocated is bounded by the file's length, or by [`MOST_BYTES`] where it unpacks; a Parquet
//! column grows with the rows that are really in its pages. What could not be read is a fault of the source, in words; it is never left
//! out silently. A panic inside a reader of others becomes a [`FormatError`], in builds that unwind; [`quiet_panics`] silences its message.
//!
//! ```no_run
//! # #[cfg(feature = "mdf")]
//! # fn main() -> Result<(), muslip_formats::FormatError> {
//! use muslip_formats::SourceFile;
//!
//! let file = SourceFile::open(std::path::Path::new("run.mf4"))?;
//! for channel in file.channels() {
//!     println!("{} [{}] {}", channel.name, channel.unit, channel.samples);
//! }
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "mdf"))]
//! # fn main() {}
//! ```
#![forbid(unsafe_code)]

#[cfg(feature = "arrow")]
mod arrow;
#[cfg(any(feature = "arrow", feature = "parquet"))]
mod cells;
pub mod convert;
#[cfg(feature = "csv")]
mod csv_text;
#[cfg(any(feature = "mat", feature = "tdms"))]
mod cursor;
mod error;
mod export;
mod file_bytes;
mod format;
mod guard;
#[cfg(feature = "hdf5")]
mod hdf5;
pub mod listing;
#[cfg(feature = "hdf5")]
mod lzf;
pub mod made;
pub mod map;
#[cfg(feature = "mat")]
mod mat;
#[cfg(feature = "mdf")]
mod mdf;
#[cfg(feature = "mdf")]
mod mdf_join;
#[cfg(any(feature = "hdf5", feature = "mat", feature = "tdms"))]
mod number;
#[cfg(feature = "parquet")]
mod parquet;
pub mod raster;
pub mod roles;
mod source;
mod source_file;
mod steps;
pub mod stream;
#[cfg(feature = "tdms")]
mod tdms;
#[cfg(feature = "tdms")]
mod tdms_property;
#[cfg(feature = "tdms")]
mod tdms_scaling;
#[cfg(feature = "tdms")]
mod tdms_sensor;
#[cfg(feature = "tdms")]
mod tdms_thermocouple;
#[cfg(any(feature = "csv", feature = "mdf", feature = "tdms"))]
mod time_text;
pub mod units;

pub use error::{FormatError, Place, Problem};
pub use export::{Cells, ColumnKind, ParquetTable, write_parquet};
pub use format::Format;
pub use guard::quiet_panics;
pub use source::{Channel, Kind, Pieces, Series, Source};
pub use source_file::{FilePieces, SourceFile};

/// Most bytes that one block, column or variable may unpack to: 1 GiB.
pub const MOST_BYTES: u64 = 1 << 30;
