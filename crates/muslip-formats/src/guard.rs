//! Panics of libraries, turned into problems of the file.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use crate::error::Problem;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Lets a panic inside a reader pass without a word on standard error, for programs that promise one line there. The reader tells of it as
/// damage of the file either way.
pub fn quiet_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !GUARDED.with(Cell::get) {
                before(panic);
            }
        }));
    });
}

/// Runs a reader; a panic of a library that it uses is a damaged file.
pub(crate) fn guarded<T>(work: impl FnOnce() -> Result<T, Problem>) -> Result<T, Problem> {
    let before = GUARDED.with(|guarded| guarded.replace(true));
    // What the closure leaves half done is dropped or refused by the caller, who gets an error.
    let outcome = catch_unwind(AssertUnwindSafe(work));
    GUARDED.with(|guarded| guarded.set(before));
    outcome.unwrap_or_else(|panic| {
        let what = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given");
        Err(Problem::whole(format!(
            "damaged: its reader gave up ({what})"
        )))
    })
}
