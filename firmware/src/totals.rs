//! Samples counted.

use core::sync::atomic::{AtomicU32, Ordering};

/// Samples raised.
pub static RAISED: AtomicU32 = AtomicU32::new(0);
/// Samples raised while the one before was not done.
pub static LATE: AtomicU32 = AtomicU32::new(0);
/// Samples worked on.
pub static WORKED: AtomicU32 = AtomicU32::new(0);

/// Adds one to a counter that only one context writes.
pub fn count(counter: &AtomicU32) {
    add(counter, 1);
}

/// Adds to a counter that only one context writes.
pub fn add(counter: &AtomicU32, amount: u32) {
    let sum = counter.load(Ordering::Relaxed).wrapping_add(amount);
    counter.store(sum, Ordering::Relaxed);
}

#[cfg(feature = "stm32f405")]
/// Forgets the totals, for a run to be counted by itself.
pub fn reset() {
    for total in [&RAISED, &LATE, &WORKED] {
        total.store(0, Ordering::Relaxed);
    }
}
