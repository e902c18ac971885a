//! A file of TOML: its bytes, its text, what is in it, each error at its line and column.

use std::fs;
use std::path::Path;

use serde::de::DeserializeOwned;

use crate::input_error::{InputError, InputProblem, one_line};

/// The bytes of a file.
///
/// # Errors
/// [`InputError`]: the file is missing, a folder, or refused by the system.
pub fn bytes_of(path: &Path) -> Result<Vec<u8>, InputError> {
    fs::read(path).map_err(|error| InputError::unreadable(path, &error))
}

/// The bytes as text, without the byte-order mark that some editors leave.
///
/// # Errors
/// [`InputError`] at the first byte that is not UTF-8.
pub fn text_of<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a str, InputError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    str::from_utf8(bytes).map_err(|error| {
        let valid = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
        error_at(path, &valid, valid.len(), InputProblem::NotUtf8)
    })
}

/// What the text holds, as the type that it is read into.
///
/// # Errors
/// [`InputError`] where the text is not TOML or does not hold such a type.
pub fn parsed<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, InputError> {
    toml::from_str(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        error_at(
            path,
            text,
            at,
            InputProblem::Toml(one_line(error.message())),
        )
    })
}

/// A problem at a byte of a file's text.
#[must_use]
pub fn error_at(path: &Path, text: &str, byte: usize, problem: InputProblem) -> InputError {
    let before = text.get(..byte).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    InputError {
        path: path.to_owned(),
        line: before.matches('\n').count() as u64 + 1,
        column: before[line_start..].chars().count() as u64 + 1,
        problem,
    }
}
