//! What a recording says of how it was made: lines beside its rows, which whoever reads it finds again. Without them a channel that was interpolated
//! would be one that was measured as often as there are rows.

use serde::Deserialize;

use crate::map::Method;
use crate::raster::Done;

/// How the lines begin, behind the mark of a comment.
const RESAMPLED: &str = "muslip.resampled = ";
const FAULT: &str = "muslip.fault = ";
/// Key under which the lines stand beside a table of Parquet.
pub const MADE: &str = "muslip.made";
/// Bytes at either end of a text in which its comments are looked for.
pub const COMMENT_BYTES: u64 = 1 << 20;
/// Most lines that are heeded.
const MOST_LINES: usize = 1 << 14;

/// Something of a channel that a diagnosis must know.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Fault {
    /// The column.
    pub column: String,
    /// From when, in s of the recording's time.
    pub start_s: f64,
    /// Until when.
    pub end_s: f64,
    /// What, in words.
    pub what: String,
}

/// A column whose channel was measured at other times than the recording's.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    /// The column.
    pub column: String,
    /// The channel's own sampling interval in s.
    pub interval_s: f64,
    /// What was done to it.
    pub done: Done,
}

/// What a diagnosis must know of how a recording was made.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Made {
    /// What is wrong with it, or was done to it, and when.
    pub faults: Vec<Fault>,
    /// Which columns were measured at other times.
    pub resampled: Vec<Resampled>,
}

/// A line as it is read.
#[derive(Deserialize)]
struct Line {
    muslip: Keys,
}

#[derive(Deserialize)]
struct Keys {
    resampled: Option<Brought>,
    fault: Option<Fault>,
}

#[derive(Deserialize)]
struct Brought {
    column: String,
    interval_s: f64,
    how: String,
    edge_hz: Option<f64>,
}

impl Brought {
    fn resampled(self) -> Option<Resampled> {
        let is_good = |value: &f64| value.is_finite() && *value > 0.0;
        let done = match self.how.as_str() {
            "linear" => Done::Interpolated(Method::Linear),
            "hold" => Done::Interpolated(Method::Hold),
            "low_passed" => Done::Decimated {
                edge_hz: self.edge_hz.filter(is_good)?,
            },
            _ => return None,
        };
        is_good(&self.interval_s).then_some(Resampled {
            column: self.column,
            interval_s: self.interval_s,
            done,
        })
    }
}

impl Made {
    /// The lines of the columns that were measured at other times: each one a line of TOML.
    #[must_use]
    pub fn resampled_lines(&self) -> Vec<String> {
        let of = |one: &Resampled| {
            let how = match one.done {
                Done::Kept => return None,
                Done::Interpolated(method) => format!("{:?}", method.word()),
                Done::Decimated { edge_hz } => format!("\"low_passed\", edge_hz = {edge_hz:?}"),
            };
            Some(format!(
                "{RESAMPLED}{{ column = {}, interval_s = {:?}, how = {how} }}",
                quoted(&one.column),
                one.interval_s
            ))
        };
        self.resampled.iter().filter_map(of).collect()
    }

    /// The lines of the faults.
    #[must_use]
    pub fn fault_lines(&self) -> Vec<String> {
        let of = |one: &Fault| {
            format!(
                "{FAULT}{{ column = {}, start_s = {:?}, end_s = {:?}, what = {} }}",
                quoted(&one.column),
                one.start_s,
                one.end_s,
                quoted(&one.what)
            )
        };
        self.faults.iter().map(of).collect()
    }

    /// What lines say, of which most may be about something else.
    #[must_use]
    pub fn of_lines<'a>(lines: impl Iterator<Item = &'a str>) -> Self {
        let mut made = Self::default();
        let ours = lines.filter(|line| line.starts_with(RESAMPLED) || line.starts_with(FAULT));
        for line in ours.take(MOST_LINES) {
            // Whoever writes such a line by hand may err: what says nothing is a comment.
            let Ok(Line { muslip }) = toml::from_str(line) else {
                continue;
            };
            let resampled = muslip.resampled.and_then(Brought::resampled);
            let fault = muslip.fault;
            made.resampled.extend(resampled);
            made.faults
                .extend(fault.filter(|one| one.start_s.is_finite() && one.end_s.is_finite()));
        }
        made
    }

    /// What the comments above and behind the rows of a text say, of its first and last bytes ([`COMMENT_BYTES`]; the same ones where it is shorter).
    #[must_use]
    pub fn of_text(first: &[u8], last: &[u8], is_whole: bool) -> Self {
        let first = String::from_utf8_lossy(first);
        let comment = |line: &str| {
            line.trim_start_matches('\u{feff}')
                .strip_prefix('#')
                .map(|line| line.trim().to_owned())
        };
        let mut lines: Vec<String> = first.lines().map_while(comment).collect();
        // A text of comments alone has been seen whole.
        if !(is_whole && lines.len() == first.lines().count()) {
            let last = String::from_utf8_lossy(last);
            let mut behind: Vec<String> = last.lines().rev().map_while(comment).collect();
            behind.reverse();
            lines.append(&mut behind);
        }
        Self::of_lines(lines.iter().map(String::as_str))
    }

    /// Adds what an earlier conversion did to a channel that has become a column. Of two that brought it onto other times the coarser one says how
    /// often it was measured.
    pub(crate) fn inherit(&mut self, earlier: &Self, channel: &str, column: &str) {
        for fault in earlier.faults.iter().filter(|one| one.column == channel) {
            self.faults.push(Fault {
                column: column.to_owned(),
                ..fault.clone()
            });
        }
        let Some(before) = earlier.resampled.iter().find(|one| one.column == channel) else {
            return;
        };
        let before = Resampled {
            column: column.to_owned(),
            ..before.clone()
        };
        match self.resampled.iter_mut().find(|one| one.column == column) {
            Some(now) if now.interval_s < before.interval_s => *now = before,
            Some(_) => {}
            None => self.resampled.push(before),
        }
    }
}

/// A text as TOML has it in one line.
fn quoted(text: &str) -> String {
    let text = crate::error::one_line(text);
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made() -> Made {
        let of = |column: &str, interval_s, done| Resampled {
            column: column.to_owned(),
            interval_s,
            done,
        };
        Made {
            faults: vec![Fault {
                column: "a \"b\" \\ c".to_owned(),
                start_s: 0.1 + 0.2,
                end_s: 1e-300,
                what: "gap of 3 s".to_owned(),
            }],
            resampled: vec![
                of("ä", 1.0 / 3.0, Done::Interpolated(Method::Linear)),
                of("b", 1e21, Done::Interpolated(Method::Hold)),
                of("c", 1e-9, Done::Decimated { edge_hz: 0.1 }),
            ],
        }
    }

    #[test]
    fn what_was_made_is_read_back_as_it_was_written_from_either_end_of_a_text() {
        let made = made();
        let comments = |lines: Vec<String>| -> String {
            lines.iter().map(|line| format!("# {line}\n")).collect()
        };
        let (above, behind) = (
            comments(made.resampled_lines()),
            comments(made.fault_lines()),
        );
        let text = format!("\u{feff}# a note\n{above}t,v\n0,1\n{behind}");
        assert_eq!(Made::of_text(text.as_bytes(), text.as_bytes(), true), made);
        let text = format!("{above}{behind}");
        assert_eq!(Made::of_text(text.as_bytes(), text.as_bytes(), true), made);
        // In two pieces, the second of which begins within a line.
        let (first, last) = (
            format!("{above}t,v\n0,"),
            format!("e, start_s = 0\n0,1\n{behind}"),
        );
        assert_eq!(
            Made::of_text(first.as_bytes(), last.as_bytes(), false),
            made
        );
    }

    #[test]
    fn lines_that_say_nothing_are_comments() {
        let lines = [
            "muslip.resampled = { column = \"a\" }",
            "muslip.resampled = { column = \"a\", interval_s = -1.0, how = \"linear\" }",
            "muslip.resampled = { column = \"a\", interval_s = 1.0, how = \"low_passed\" }",
            "muslip.fault = { column = \"a\", start_s = nan, end_s = 0.0, what = \"x\" }",
            "muslip.fault = [",
            "muslip: a note",
        ];
        assert_eq!(Made::of_lines(lines.into_iter()), Made::default());
    }

    #[test]
    fn of_two_conversions_the_coarser_says_how_often_a_channel_was_measured() {
        let before = made();
        let mut now = Made {
            resampled: vec![Resampled {
                column: "wheel".to_owned(),
                interval_s: 0.01,
                done: Done::Interpolated(Method::Hold),
            }],
            ..Made::default()
        };
        now.inherit(&before, "ä", "wheel");
        now.inherit(&before, "c", "load");
        now.inherit(&before, "none", "drag");
        let told: Vec<(&str, f64)> = now
            .resampled
            .iter()
            .map(|one| (one.column.as_str(), one.interval_s))
            .collect();
        assert_eq!(told, [("wheel", 1.0 / 3.0), ("load", 1e-9)]);
    }
}
