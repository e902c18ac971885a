//! A progress bar on standard error, for work that takes over a second.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

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
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:32} {percent:>3} %  {eta} left")
        {
            bar.set_style(style);
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
