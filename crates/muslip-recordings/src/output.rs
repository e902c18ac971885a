//! Files that appear whole or not at all.
//!
//! Everything that the tool writes goes to a temporary name in the same folder and is renamed when
//! complete, so that a program waiting for the file never reads half of it and a run that ends early
//! leaves an older file as it was.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::{NamedTempFile, TempDir};

/// Files and folders under temporary names, of all threads.
static HALF_WRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes what is half written, and lets nothing more be begun: for programs that are about to end without leaving their
/// functions, as at an interrupt.
pub fn remove_half_written() {
    let mut all = HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
    for path in all.drain(..) {
        // What cannot be removed stays under a name that says what it is.
        let _ = if path.is_dir() {
            fs::remove_dir_all(&path)
        } else {
            fs::remove_file(&path)
        };
    }
    // What another thread began now would stay.
    core::mem::forget(all);
}

/// A temporary name, for as long as there is something under it.
#[derive(Debug)]
struct HalfWritten(PathBuf);

impl HalfWritten {
    /// Makes a file or folder under a temporary name and notes that name, with no interrupt in between.
    fn made<T>(
        make: impl FnOnce() -> io::Result<T>,
        path: fn(&T) -> &Path,
    ) -> io::Result<(T, Self)> {
        let mut all = HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
        let made = make()?;
        let path = path(&made).to_owned();
        all.push(path.clone());
        Ok((made, Self(path)))
    }
}

impl Drop for HalfWritten {
    fn drop(&mut self) {
        let mut all = HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|path| *path != self.0);
    }
}

/// An output that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}:1:1: cannot be written: {reason}", crate::input_error::one_line(&path.to_string_lossy()))]
pub struct OutputError {
    /// The file as the user named it.
    pub path: PathBuf,
    /// The system's reason.
    pub reason: String,
    /// What the system answered.
    #[source]
    pub source: io::Error,
}

impl OutputError {
    /// Names the file that a system error concerns.
    pub fn new(path: &Path, source: io::Error) -> Self {
        Self {
            path: path.to_owned(),
            reason: crate::input_error::system_reason(&source),
            source,
        }
    }
}

/// A file under construction; nothing is at its path until [`OutputFile::commit`].
///
/// Dropped without a commit, it leaves no trace. A path that exists and is no regular file
/// (`/dev/null`, a pipe) is written directly: renaming over it would replace the device.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    sink: Sink,
}

#[derive(Debug)]
enum Sink {
    Renamed {
        temporary: BufWriter<NamedTempFile>,
        destination: PathBuf,
        half_written: HalfWritten,
    },
    Direct(BufWriter<File>),
}

impl OutputFile {
    /// Starts an output.
    ///
    /// # Errors
    /// [`OutputError`] if the folder does not exist or may not be written.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let fail = |error| OutputError::new(path, error);
        let sink = match fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => {
                return Err(fail(io::Error::from(io::ErrorKind::IsADirectory)));
            }
            Ok(metadata) if !metadata.is_file() => Sink::Direct(BufWriter::new(
                File::options().write(true).open(path).map_err(fail)?,
            )),
            _ => {
                // Through a link, the file that it points at is replaced, not the link.
                let destination = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
                let folder = match destination.parent() {
                    Some(folder) if !folder.as_os_str().is_empty() => folder,
                    _ => Path::new("."),
                };
                let (temporary, half_written) =
                    HalfWritten::made(|| temporary_in(folder), NamedTempFile::path)
                        .map_err(fail)?;
                Sink::Renamed {
                    half_written,
                    temporary: BufWriter::with_capacity(1 << 16, temporary),
                    destination,
                }
            }
        };
        Ok(Self {
            path: path.to_owned(),
            sink,
        })
    }

    /// Puts the finished file in its place.
    ///
    /// # Errors
    /// [`OutputError`] if the last bytes cannot be written or the name cannot be taken; what was at
    /// the path before is then still there.
    pub fn commit(self) -> Result<(), OutputError> {
        let fail = |error| OutputError::new(&self.path, error);
        match self.sink {
            Sink::Renamed {
                temporary,
                destination,
                half_written,
            } => {
                let temporary = temporary
                    .into_inner()
                    .map_err(|error| fail(error.into_error()))?;
                temporary
                    .persist(destination)
                    .map_err(|error| fail(error.error))?;
                drop(half_written);
            }
            Sink::Direct(mut file) => file.flush().map_err(fail)?,
        }
        Ok(())
    }

    /// Names this file in a system error that came from writing to it.
    pub fn failure(&self, source: io::Error) -> OutputError {
        OutputError::new(&self.path, source)
    }
}

fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".muslip-").suffix(".tmp");
    #[cfg(unix)]
    {
        // The rights that a plain `create` would give, less the user's umask.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.sink {
            Sink::Renamed { temporary, .. } => temporary.write(bytes),
            Sink::Direct(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.sink {
            Sink::Renamed { temporary, .. } => temporary.flush(),
            Sink::Direct(file) => file.flush(),
        }
    }
}

/// Writes a whole file at once, with the same promise as [`OutputFile`].
///
/// # Errors
/// [`OutputError`] if it cannot be created, written or renamed.
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    let mut file = OutputFile::create(path)?;
    file.write_all(contents)
        .map_err(|error| OutputError::new(path, error))?;
    file.commit()
}

/// Makes a folder for outputs, with those above it.
///
/// # Errors
/// [`OutputError`] if the folder cannot be made.
pub fn create_folder(path: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(path).map_err(|error| OutputError::new(path, error))
}

/// Files that take their places together, in a folder that is made for them if it is not there.
///
/// Dropped without a commit, they leave no trace, and neither does a folder that was made.
#[derive(Debug)]
pub struct StagedFolder {
    destination: PathBuf,
    /// Inside the destination, so that files are renamed and never copied.
    stage: Option<TempDir>,
    _half_written: HalfWritten,
    /// Whether the folder was not there before.
    made: bool,
}

impl StagedFolder {
    /// Starts the files of a folder.
    ///
    /// # Errors
    /// [`OutputError`] if the folder cannot be made or written.
    pub fn create(destination: &Path) -> Result<Self, OutputError> {
        let made = !destination.exists();
        create_folder(destination)?;
        let make = || {
            tempfile::Builder::new()
                .prefix(".muslip-")
                .tempdir_in(destination)
        };
        let (stage, half_written) = HalfWritten::made(make, TempDir::path)
            .map_err(|error| OutputError::new(destination, error))?;
        Ok(Self {
            destination: destination.to_owned(),
            _half_written: half_written,
            stage: Some(stage),
            made,
        })
    }

    /// Where a file is written until the commit.
    pub fn path(&self, name: &str) -> PathBuf {
        let stage = self.stage.as_ref().map(TempDir::path);
        stage.unwrap_or(&self.destination).join(name)
    }

    /// Puts the files of these names in their places.
    ///
    /// # Errors
    /// [`OutputError`] naming the first file that cannot take its place.
    pub fn commit<'a>(
        mut self,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), OutputError> {
        for name in names {
            let path = self.destination.join(name);
            fs::rename(self.path(name), &path).map_err(|error| OutputError::new(&path, error))?;
        }
        self.made = false;
        Ok(())
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        drop(self.stage.take());
        if self.made {
            // Only an empty folder goes; one that cannot be removed stays, which is no harm.
            let _ = fs::remove_dir(&self.destination);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_that_is_not_committed_leaves_the_folder_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        fs::write(&path, "old").unwrap();
        let mut file = OutputFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        file.flush().unwrap();
        drop(file);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_committed_output_replaces_the_old_one_and_leaves_no_temporary() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        fs::write(&path, "old").unwrap();
        write_file(&path, b"new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_is_half_written_is_known_until_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let here = || {
            let all = HALF_WRITTEN.lock().unwrap();
            all.iter()
                .filter(|path| path.starts_with(folder.path()))
                .count()
        };
        let file = OutputFile::create(&folder.path().join("run.csv")).unwrap();
        let staged = StagedFolder::create(folder.path()).unwrap();
        assert_eq!(here(), 2);
        file.commit().unwrap();
        drop(staged);
        assert_eq!(here(), 0);
    }

    #[test]
    fn no_interrupt_comes_between_a_temporary_file_and_the_note_of_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let make = || {
            assert!(HALF_WRITTEN.try_lock().is_err(), "the list is free");
            temporary_in(folder.path())
        };
        HalfWritten::made(make, NamedTempFile::path).unwrap();
    }

    #[test]
    fn staged_files_appear_together_or_leave_no_trace() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        for committed in [false, true] {
            let staged = StagedFolder::create(&out).unwrap();
            for name in ["a", "b"] {
                write_file(&staged.path(name), name.as_bytes()).unwrap();
                assert!(!out.join(name).exists());
            }
            if committed {
                staged.commit(["a", "b"]).unwrap();
                assert_eq!(fs::read_to_string(out.join("b")).unwrap(), "b");
                assert_eq!(fs::read_dir(&out).unwrap().count(), 2);
            } else {
                drop(staged);
                assert!(!out.exists());
            }
        }
    }

    #[test]
    fn a_missing_folder_is_named_in_one_line() {
        let error = write_file(Path::new("no/such/folder/run.csv"), b"").unwrap_err();
        assert_eq!(
            error.to_string(),
            "no/such/folder/run.csv:1:1: cannot be written: no such file or directory"
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_and_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        write_file(Path::new("/dev/null"), b"gone").unwrap();
        assert!(
            fs::metadata("/dev/null")
                .unwrap()
                .file_type()
                .is_char_device()
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("target.csv");
        let link = folder.path().join("link.csv");
        fs::write(&target, "old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
    }
}
