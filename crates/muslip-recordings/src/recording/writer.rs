//! Writing a recording.

use std::io::{self, Write};

/// Writes a recording row by row.
#[derive(Debug)]
pub struct RecordingWriter<W: Write> {
    sink: W,
    columns: usize,
    line: String,
    push: fn(&mut String, f64),
}

impl<W: Write> RecordingWriter<W> {
    /// Starts with comment lines (`#` is added) and the header row.
    ///
    /// # Errors
    /// What `sink` answers.
    pub fn new(mut sink: W, comments: &[String], columns: &[&str]) -> io::Result<Self> {
        write_comments(&mut sink, comments)?;
        writeln!(sink, "{}", columns.join(","))?;
        Ok(Self {
            sink,
            columns: columns.len(),
            line: String::new(),
            push: push_nine_digits,
        })
    }

    /// Writes numbers with all their digits from now on: what is computed from them again comes out the same.
    #[must_use]
    pub fn exact(mut self) -> Self {
        self.push = push_exact;
        self
    }

    /// Writes one row, each number with nine significant digits: far below any sensor's noise, and
    /// short. A value that is not finite becomes an empty cell, which is how a missing value is written.
    ///
    /// # Errors
    /// What the sink answers, or [`io::ErrorKind::InvalidInput`] for a row of another length than the
    /// header.
    pub fn row(&mut self, values: &[f64]) -> io::Result<()> {
        if values.len() != self.columns {
            return Err(io::Error::from(io::ErrorKind::InvalidInput));
        }
        self.line.clear();
        for (index, &value) in values.iter().enumerate() {
            if index > 0 {
                self.line.push(',');
            }
            (self.push)(&mut self.line, value);
        }
        self.line.push('\n');
        self.sink.write_all(self.line.as_bytes())
    }

    /// Gives the sink back.
    pub fn into_inner(self) -> W {
        self.sink
    }
}

/// Writes comment lines, wherever in a recording.
///
/// # Errors
/// What the sink answers.
pub fn write_comments(sink: &mut impl Write, comments: &[String]) -> io::Result<()> {
    for comment in comments {
        writeln!(sink, "# {}", crate::input_error::one_line(comment))?;
    }
    Ok(())
}

/// A number in its shortest exact form, without hundreds of zeros where it is large or small; nothing for one that
/// is not finite.
pub fn push_exact(text: &mut String, value: f64) {
    use std::fmt::Write as _;
    if !value.is_finite() {
        return;
    }
    // Writing to a String cannot fail. Adding 0 turns -0 into 0.
    let _ = if value == 0.0 || (1e-5..1e16).contains(&value.abs()) {
        write!(text, "{}", value + 0.0)
    } else {
        write!(text, "{value:e}")
    };
}

fn push_nine_digits(text: &mut String, value: f64) {
    use std::fmt::Write as _;
    if !value.is_finite() {
        return;
    }
    // Rounded through the decimal form, so that the digits printed are those of the rounded number.
    let rounded = format!("{value:.8e}").parse().unwrap_or(value);
    // Writing to a String cannot fail. Adding 0 turns -0 into 0.
    let rounded: f64 = rounded + 0.0;
    let _ = if rounded == 0.0 || (1e-9..1e15).contains(&rounded.abs()) {
        write!(text, "{rounded}")
    } else {
        write!(text, "{rounded:e}")
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_nine_digits_and_missing_ones_left_out() {
        let mut writer =
            RecordingWriter::new(Vec::new(), &["a\nb".into()], &["x", "y", "z"]).unwrap();
        writer.row(&[1.0 / 3.0, f64::NAN, -0.0]).unwrap();
        writer.row(&[12_345_678_901.0, 1e-7, -1e300]).unwrap();
        assert!(writer.row(&[1.0]).is_err());
        let text = String::from_utf8(writer.into_inner()).unwrap();
        assert_eq!(
            text,
            "# a b\nx,y,z\n0.333333333,,0\n12345678900,0.0000001,-1e300\n"
        );
    }
}
