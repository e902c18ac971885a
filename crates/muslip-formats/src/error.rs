//! What is wrong with a file, and where.

use std::path::{Path, PathBuf};

/// Where in a file something is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// The file as a whole.
    File,
    /// A character of a text; both from 1.
    Text {
        /// Line.
        line: u64,
        /// Character in the line.
        column: u64,
    },
    /// A byte, from 0.
    Byte(u64),
    /// A part by its name: a channel, a group, a data set.
    Part(String),
}

/// What is wrong, without the file's name: a reader does not know it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Where.
    pub place: Place,
    /// What, in one line.
    pub reason: String,
}

impl Problem {
    /// A problem of the whole file.
    pub fn whole(reason: impl Into<String>) -> Self {
        Self {
            place: Place::File,
            reason: reason.into(),
        }
    }

    /// A problem at a byte.
    pub fn at_byte(byte: u64, reason: impl Into<String>) -> Self {
        Self {
            place: Place::Byte(byte),
            reason: reason.into(),
        }
    }

    /// A problem of a named part.
    pub fn of(part: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            place: Place::Part(part.into()),
            reason: reason.into(),
        }
    }

    /// The problem in words, with its place where that is no line of a text.
    #[must_use]
    pub fn in_words(&self) -> String {
        let reason = one_line(&self.reason);
        match &self.place {
            Place::File | Place::Text { .. } => reason,
            Place::Byte(byte) => format!("byte {byte}: {reason}"),
            Place::Part(part) => format!("{}: {reason}", one_line(part)),
        }
    }

    /// The problem of a file.
    #[must_use]
    pub fn in_file(self, path: &Path) -> FormatError {
        FormatError {
            path: path.to_owned(),
            problem: self,
        }
    }
}

impl From<std::io::Error> for Problem {
    fn from(error: std::io::Error) -> Self {
        let text = error.to_string();
        let text = text.split(" (os error").next().unwrap_or_default();
        Self::whole(format!("cannot be read: {}", text.to_lowercase()))
    }
}

/// A file that cannot be used: one line, `path:line:column: reason`, at `1:1` where the format has no lines.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}:{}:{}: {}", one_line(&path.to_string_lossy()), self.line().0, self.line().1, problem.in_words())]
pub struct FormatError {
    /// The file as the user named it.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: Problem,
}

impl FormatError {
    /// Line and column, both from 1.
    #[must_use]
    pub fn line(&self) -> (u64, u64) {
        match self.problem.place {
            Place::Text { line, column } => (line, column),
            _ => (1, 1),
        }
    }
}

/// Text without what would break or disguise a line of a terminal.
pub(crate) fn one_line(text: &str) -> String {
    text.split(char::is_control)
        .map(str::trim)
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}
