//! Dumping the brake behind the main loop's back.

use core::sync::atomic::{AtomicBool, Ordering};

use crate::chip::{Chip, This};

/// Set by whoever dumps the brake behind the main loop's back, until the main loop dumps it itself.
static DUMPED: AtomicBool = AtomicBool::new(false);

/// Dumps the brake; before start-up as well.
pub fn dump() {
    DUMPED.store(true, Ordering::Relaxed);
    This::dump();
}

/// Whether the brake was dumped by [`dump`] and the main loop has not caught up; it catches up by dumping.
pub fn dumped(main_loop_dumps: bool) -> bool {
    if main_loop_dumps {
        DUMPED.store(false, Ordering::Relaxed);
    }
    DUMPED.load(Ordering::Relaxed)
}
