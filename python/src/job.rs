//! Work while Python stays free: on a thread of its own, so that Ctrl-C is heard, where it takes long enough for that.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::failure::Failure;

/// How often signals are looked for and progress is told.
const BEAT: Duration = Duration::from_millis(50);

/// What unwinds through work that nobody waits for any more.
struct Cancelled;

/// Where work tells how far it is, and learns that it is to end.
pub(crate) struct Reporter {
    cancelled: AtomicBool,
    told: Mutex<(f64, String)>,
}

impl Reporter {
    fn new() -> Self {
        Self {
            cancelled: AtomicBool::new(false),
            told: Mutex::new((0.0, String::new())),
        }
    }

    /// Tells the share done of which step. Does not come back where the work was cancelled: it unwinds to the border, without the words of a panic.
    pub(crate) fn tell(&self, share: f64, step: &str) {
        if self.cancelled.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Cancelled));
        }
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        told.0 = share.clamp(0.0, 1.0);
        if told.1 != step {
            step.clone_into(&mut told.1);
        }
    }

    fn now(&self) -> (f64, String) {
        self.told
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// Does work while Python goes on; `progress` is called with the share done and the step. A panic of the work is an error.
///
/// An interrupt (Ctrl-C) or an error of `progress` ends the wait at once, and the work at its next report.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&Reporter) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let reporter = Arc::new(Reporter::new());
    let (done, outcome) = channel();
    let at_work = Arc::clone(&reporter);
    let thread = thread::Builder::new().name("muslip".to_owned());
    thread
        .spawn(move || {
            let outcome = guarded(|| work(&at_work));
            // Nobody waits after an interrupt.
            let _ = done.send(outcome);
        })
        .map_err(|error| Failure::Other(format!("no thread can be started: {error}")))?;
    let mut told = (-1.0, String::new());
    let mut tell = |py: Python<'_>| -> PyResult<()> {
        py.check_signals()?;
        let now = reporter.now();
        if let Some(progress) = progress.filter(|_| now != told) {
            progress.call1(py, now.clone())?;
            told = now;
        }
        Ok(())
    };
    // A receiver is not shared between threads, and the wait is one.
    let outcome = Mutex::new(outcome);
    loop {
        let received = py.detach(|| {
            let outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner);
            outcome.recv_timeout(BEAT)
        });
        match received {
            Ok(result) => {
                let result = result?;
                tell(py)?;
                return Ok(result);
            }
            Err(RecvTimeoutError::Timeout) => {
                if let Err(error) = tell(py) {
                    reporter.cancelled.store(true, Ordering::Relaxed);
                    return Err(error);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Failure::Other("the work ended without a result".to_owned()).into());
            }
        }
    }
}

/// As [`run`], on the thread that asks where the work is short and nobody is told of progress: a thread would cost as
/// much again. An interrupt is heard behind it.
pub(crate) fn run_short<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    is_short: bool,
    work: impl FnOnce(&Reporter) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    if progress.is_some() || !is_short {
        return run(py, progress, work);
    }
    let result = py.detach(|| guarded(|| work(&Reporter::new())))?;
    py.check_signals()?;
    Ok(result)
}

/// Runs what must not panic into Python.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    // What the work leaves half done is dropped with it.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(Failure::Panic(words(&*panic))))
}

fn words(panic: &(dyn Any + Send)) -> String {
    panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no reason given")
        .to_owned()
}

/// Panics where the work of a call would. Not in a release: the tests show by it that no panic crosses.
#[cfg(debug_assertions)]
#[pyfunction]
#[expect(clippy::panic, reason = "what it is for")]
pub(crate) fn panics(py: Python<'_>, words: String) -> PyResult<()> {
    run(py, None, move |_| std::panic::panic_any(words))
}
