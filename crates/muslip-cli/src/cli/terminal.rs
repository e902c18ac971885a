//! Standard output and standard error, for people and for pipes.

use std::io::{self, IsTerminal, Write};

use clap::builder::styling::{AnsiColor, Style};
use muslip::filter::PeakEstimate;
use muslip_report::text::{WIDEST_RUNNING_TEXT, columns, wrapped};

use super::failure::Failure;

/// Standard output. Colours and bold only where it is a terminal and `NO_COLOR` does not forbid them.
pub(super) struct Terminal {
    out: anstream::AutoStream<io::Stdout>,
    /// Columns of the terminal, or as many as `COLUMNS` says; `None` in a pipe or a file otherwise.
    columns: Option<usize>,
}

impl Terminal {
    pub(super) fn new() -> Self {
        Self {
            out: anstream::AutoStream::auto(io::stdout()),
            columns: columns(),
        }
    }

    /// The widest line, where at most `widest` is wanted.
    pub(super) fn width(&self, widest: usize) -> usize {
        self.columns.map_or(widest, |columns| columns.min(widest))
    }

    /// Prints a line as it is.
    pub(super) fn line(&mut self, text: &str) -> Result<(), Failure> {
        writeln!(self.out, "{text}").map_err(Failure::Terminal)
    }

    /// Prints the answer: in bold.
    pub(super) fn headline(&mut self, text: &str) -> Result<(), Failure> {
        self.styled(text, Style::new().bold())
    }

    /// Prints a verdict: in bold, and in the colour of what it means.
    pub(super) fn verdict(&mut self, text: &str, good: bool) -> Result<(), Failure> {
        let color = if good {
            AnsiColor::Green
        } else {
            AnsiColor::Yellow
        };
        self.styled(text, Style::new().bold().fg_color(Some(color.into())))
    }

    /// Prints text in a style: in a pipe a line.
    fn styled(&mut self, text: &str, style: Style) -> Result<(), Failure> {
        for line in wrapped(text, self.columns.unwrap_or(usize::MAX)) {
            writeln!(self.out, "{style}{line}{style:#}").map_err(Failure::Terminal)?;
        }
        Ok(())
    }

    /// Prints running text, wrapped.
    pub(super) fn paragraph(&mut self, text: &str) -> Result<(), Failure> {
        for line in wrapped(text, self.width(WIDEST_RUNNING_TEXT)) {
            self.line(&line)?;
        }
        Ok(())
    }

    /// Prints names and values in two columns.
    pub(super) fn table(&mut self, rows: &[(&str, String)]) -> Result<(), Failure> {
        let widest = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        // In a pipe a row is a line.
        let room = self
            .columns
            .map(|columns| columns.saturating_sub(widest + 4));
        for (name, value) in rows {
            let lines = match room {
                Some(room) if value.chars().count() > room => wrapped(value, room),
                _ => vec![value.clone()],
            };
            let names = std::iter::once(*name).chain(std::iter::repeat(""));
            for (name, line) in names.zip(lines) {
                self.line(&format!("  {name:widest$}  {line}"))?;
            }
        }
        Ok(())
    }

    /// Prints peak friction and critical slip, then other names and values, in two columns.
    pub(super) fn peak_table(
        &mut self,
        peak: &PeakEstimate<f64>,
        others: Vec<(&str, String)>,
    ) -> Result<(), Failure> {
        let with_std = |value: f64, std: f64| format!("{value:.5}  1-sigma {std:.5}");
        let mut rows = vec![
            (
                "peak friction",
                with_std(peak.peak_friction, peak.peak_friction_std),
            ),
            (
                "critical slip",
                with_std(peak.critical_slip, peak.critical_slip_std),
            ),
            ("correlation", format!("{:.3}", peak.correlation)),
        ];
        rows.extend(others);
        self.table(&rows)
    }

    /// Prints JSON and nothing else.
    pub(super) fn json(&mut self, value: &serde_json::Value) -> Result<(), Failure> {
        self.line(&format!("{value:#}"))
    }

    /// Prints bytes as they are.
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let mut out = io::stdout();
        out.write_all(bytes)
            .and_then(|()| out.flush())
            .map_err(Failure::Terminal)
    }
}

/// One line on standard error; a closed standard error changes no exit status.
pub(super) fn complain(line: &str) {
    let _ = writeln!(anstream::stderr(), "{line}");
}

/// True where a progress bar would be seen and not be in the way.
pub(super) fn shows_progress() -> bool {
    io::stderr().is_terminal()
}
