//! A progress bar on standard error, for work that takes over a second.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::terminal::shows_progress;

/// How long work goes on before a bar appears.
const PATIENCE: Duration = Duration::from_secs(1);

/// A bar that shows itself when it is worth while, and only on a terminal.
pub(super) struct Progress {
    bar: ProgressBar,
    started: Instant,
    shown: bool,
    possible: bool,
}

impl Progress {
    /// A bar for `total` units of work under a name.
    pub(super) fn new(name: &'static str, total: u64) -> Self {
        Self::with_rate(name, total, "{percent_per_sec}")
    }

    /// A bar for as many bytes.
    pub(super) fn bytes(name: &'static str, total: u64) -> Self {
        Self::with_rate(name, total, "{binary_bytes_per_sec}")
    }

    fn with_rate(name: &'static str, total: u64, rate: &str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        // The bar gives way on a narrow terminal, the figures do not.
        let template = format!("{{msg}} {{wide_bar}} {{percent:>3}} % {rate}, {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            let percent_a_second = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                let rate = 100.0 * state.per_sec() / total.max(1) as f64;
                // A rate that cannot be written is only not seen.
                let _ = write!(out, "{rate:.1} %/s");
            };
            bar.set_style(style.with_key("percent_per_sec", percent_a_second));
        }
        bar.set_message(name);
        Self {
            bar,
            started: Instant::now(),
            shown: false,
            possible: shows_progress(),
        }
    }

    /// Tells how much is done.
    pub(super) fn done(&mut self, units: u64) {
        if !self.possible {
            return;
        }
        if !self.shown && self.started.elapsed() > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.shown = true;
        }
        if self.shown {
            self.bar.set_position(units);
        }
    }

    /// Tells what is being done.
    pub(super) fn says(&mut self, what: &str) {
        if self.possible && self.bar.message() != what {
            self.bar.set_message(what.to_owned());
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
