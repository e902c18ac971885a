//! A file as channels, whatever its format.

use std::fs::File;
use std::path::{Path, PathBuf};

use crate::error::{FormatError, Problem};
use crate::file_bytes::FileBytes;
use crate::format::Format;
use crate::guard::guarded;
use crate::made::Made;
use crate::source::{Channel, Pieces, Series, Source};

/// An open file: its format and its channels.
pub struct SourceFile {
    path: PathBuf,
    format: Format,
    source: Box<dyn Source>,
    made: Made,
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
            let source = source(format, bytes)?;
            let made = source.made();
            Ok((format, source, made))
        };
        let (format, source, made) = guarded(open).map_err(|problem| problem.in_file(path))?;
        Ok(Self {
            path: path.to_owned(),
            format,
            source,
            made,
        })
    }

    /// A source that is open already.
    #[cfg(test)]
    pub(crate) fn of_source(path: PathBuf, format: Format, source: Box<dyn Source>) -> Self {
        Self {
            path,
            format,
            made: source.made(),
            source,
        }
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

    /// What the file says of a conversion that it came from.
    #[must_use]
    pub fn made(&self) -> &Made {
        &self.made
    }

    /// Reads channels by their place in [`SourceFile::channels`], in the order asked for.
    ///
    /// # Errors
    /// [`FormatError`] where a channel is no number, a block of it is damaged, or a filter of it is not supported.
    pub fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, FormatError> {
        let source = &mut self.source;
        guarded(|| source.read(wanted)).map_err(|problem| problem.in_file(&self.path))
    }

    /// Reads channels of one length some readings at a time; `None` where these have to be read whole.
    ///
    /// # Errors
    /// As [`SourceFile::read`].
    pub fn pieces(&self, wanted: &[usize]) -> Result<Option<FilePieces<'_>>, FormatError> {
        let pieces = guarded(|| self.source.pieces(wanted));
        let pieces = pieces.map_err(|problem| problem.in_file(&self.path))?;
        Ok(pieces.map(|pieces| FilePieces {
            pieces,
            path: &self.path,
        }))
    }

    /// What of the file was found damaged or left out so far, one line each.
    #[must_use]
    pub fn faults(&self) -> Vec<String> {
        self.source.faults()
    }
}

/// Readings of several channels of a file, some at a time.
pub struct FilePieces<'a> {
    pieces: Pieces<'a>,
    path: &'a Path,
}

impl std::fmt::Debug for FilePieces<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("FilePieces").finish_non_exhaustive()
    }
}

impl Iterator for FilePieces<'_> {
    type Item = Result<Vec<Series>, FormatError>;

    fn next(&mut self) -> Option<Self::Item> {
        let piece = guarded(|| self.pieces.next().transpose());
        let piece = piece.map_err(|problem| problem.in_file(self.path));
        piece.transpose()
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
