//! A file as channels.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{FormatError, Problem};
use crate::file_bytes::FileBytes;
use crate::format::Format;
use crate::guard::guarded;

/// What the readings of a channel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Numbers.
    Numeric,
    /// Text, which no role can be.
    Text,
    /// Several numbers at a time, which no role can be.
    Array,
    /// Two values.
    Bool,
    /// Numbers with names.
    Enum,
}

impl Kind {
    /// The word for it in `muslip channels --json`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Numeric => "numeric",
            Self::Text => "text",
            Self::Array => "array",
            Self::Bool => "bool",
            Self::Enum => "enum",
        }
    }

    /// Whether its readings are single numbers.
    #[must_use]
    pub fn is_number(self) -> bool {
        matches!(self, Self::Numeric | Self::Bool | Self::Enum)
    }
}

/// A channel as its file announces it.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Group, folder or structure that it is in; empty where the format has none.
    pub group: String,
    /// Name, without a unit.
    pub name: String,
    /// Unit as the file spells it; empty where it has none.
    pub unit: String,
    /// Readings that the file announces.
    pub samples: u64,
    /// What the file says about it.
    pub comment: String,
    /// What its readings are.
    pub kind: Kind,
    /// Whether it is the time of its group, in s.
    pub is_time: bool,
}

impl Channel {
    /// The channel in a message: `nWheelFL [1/min] (group 2)`.
    #[must_use]
    pub fn shown(&self) -> String {
        let unit = if self.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", self.unit)
        };
        let group = if self.group.is_empty() {
            String::new()
        } else {
            format!(" (group {})", self.group)
        };
        crate::error::one_line(&format!("{}{unit}{group}", self.name))
    }
}

/// Readings of a channel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Times in s since the start of the file's measurement, where the format says them. As many as `values`.
    pub time_s: Option<Arc<Vec<f64>>>,
    /// The readings in the file's unit. A missing one is `NaN`.
    pub values: Vec<f64>,
    /// Which of them the file calls invalid; `None` where it calls none.
    pub invalid: Option<Vec<bool>>,
}

impl Series {
    /// Readings that the file calls invalid.
    #[must_use]
    pub fn invalid_count(&self) -> u64 {
        let flags = self.invalid.iter().flatten();
        flags.filter(|&&invalid| invalid).count() as u64
    }
}

/// A source of channels: what each format is to everything above it.
pub trait Source: Send {
    /// What start the file gives, in RFC 3339.
    fn start_time(&self) -> Option<String>;

    /// The channels, in the order of the file.
    fn channels(&self) -> &[Channel];

    /// Reads channels by their place in [`Source::channels`], in the order asked for.
    ///
    /// # Errors
    /// [`Problem`] where a channel is no number, a block of it is damaged, or a filter of it is not supported.
    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem>;

    /// What of the file was found damaged or left out so far, one line each.
    fn faults(&self) -> Vec<String>;
}

/// An open file: its format and its channels.
pub struct SourceFile {
    path: PathBuf,
    format: Format,
    source: Box<dyn Source>,
}

impl std::fmt::Debug for SourceFile {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("SourceFile")
            .field("path", &self.path)
            .field("format", &self.format)
            .finish_non_exhaustive()
    }
}

impl SourceFile {
    /// Opens a file of any format that this build has.
    ///
    /// # Errors
    /// [`FormatError`]: no such file, a format that is unknown, not supported or not in this build, or nothing in it that can be used.
    pub fn open(path: &Path) -> Result<Self, FormatError> {
        let file = File::open(path).map_err(|error| Problem::from(error).in_file(path))?;
        Self::of_file(path, file)
    }

    /// As [`SourceFile::open`], of a file that is open already; `path` is only named in errors.
    ///
    /// # Errors
    /// As [`SourceFile::open`].
    pub fn of_file(path: &Path, file: File) -> Result<Self, FormatError> {
        let open = || {
            if file.metadata()?.is_dir() {
                return Err(Problem::whole("cannot be read: is a directory"));
            }
            let bytes = FileBytes::new(file)?;
            if bytes.length() == 0 {
                return Err(Problem::whole("the file is empty"));
            }
            let format = Format::of(&bytes)?;
            Ok((format, source(format, bytes)?))
        };
        let (format, source) = guarded(open).map_err(|problem| problem.in_file(path))?;
        Ok(Self {
            path: path.to_owned(),
            format,
            source,
        })
    }

    /// The format that a file is in, by its bytes.
    ///
    /// # Errors
    /// [`FormatError`] as for [`SourceFile::open`].
    pub fn format_of(path: &Path, file: File) -> Result<Format, FormatError> {
        let format = FileBytes::new(file).and_then(|bytes| Format::of(&bytes));
        format.map_err(|problem| problem.in_file(path))
    }

    /// The file as the user named it.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's format.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    /// Start of the measurement in RFC 3339, where the file gives it.
    #[must_use]
    pub fn start_time(&self) -> Option<String> {
        self.source.start_time()
    }

    /// The channels, in the order of the file.
    #[must_use]
    pub fn channels(&self) -> &[Channel] {
        self.source.channels()
    }

    /// Reads channels by their place in [`SourceFile::channels`], in the order asked for.
    ///
    /// # Errors
    /// [`FormatError`] where a channel is no number, a block of it is damaged, or a filter of it is not supported.
    pub fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, FormatError> {
        let source = &mut self.source;
        guarded(|| source.read(wanted)).map_err(|problem| problem.in_file(&self.path))
    }

    /// What of the file was found damaged or left out so far, one line each.
    #[must_use]
    pub fn faults(&self) -> Vec<String> {
        self.source.faults()
    }
}

#[cfg_attr(
    not(any(
        feature = "csv",
        feature = "mdf",
        feature = "tdms",
        feature = "mat",
        feature = "hdf5",
        feature = "parquet",
        feature = "arrow"
    )),
    expect(
        unused_variables,
        clippy::needless_pass_by_value,
        reason = "a build without formats"
    )
)]
fn source(format: Format, bytes: FileBytes) -> Result<Box<dyn Source>, Problem> {
    match format {
        #[cfg(feature = "csv")]
        Format::Csv => Ok(Box::new(crate::csv_text::CsvSource::open(bytes)?)),
        #[cfg(feature = "mdf")]
        Format::Mdf3 | Format::Mdf4 => Ok(Box::new(crate::mdf::MdfSource::open(bytes)?)),
        #[cfg(feature = "tdms")]
        Format::Tdms => Ok(Box::new(crate::tdms::TdmsSource::open(bytes)?)),
        #[cfg(feature = "mat")]
        Format::Mat => Ok(Box::new(crate::mat::MatSource::open(bytes)?)),
        #[cfg(feature = "hdf5")]
        Format::Mat73 | Format::Hdf5 => {
            Ok(Box::new(crate::hdf5::Hdf5Source::open(&bytes, format)?))
        }
        #[cfg(feature = "parquet")]
        Format::Parquet => Ok(Box::new(crate::parquet::ParquetSource::open(&bytes)?)),
        #[cfg(feature = "arrow")]
        Format::Arrow => Ok(Box::new(crate::arrow::ArrowSource::open(bytes)?)),
        #[allow(unreachable_patterns, reason = "not in a build with every format")]
        other => Err(Problem::whole(format!(
            "{}: this build has no reader for it",
            other.word()
        ))),
    }
}
