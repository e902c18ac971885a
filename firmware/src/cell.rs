//! A place for what one interrupt owns.

use core::cell::UnsafeCell;

/// Filled once before its interrupt is enabled, used by that interrupt alone.
pub struct InterruptCell<T>(UnsafeCell<Option<T>>);

// SAFETY: the contract of `fill` and `get` leaves one user at a time; `Send` because the content moves from
// the main program to an interrupt.
#[allow(unsafe_code, reason = "what one interrupt owns lives in a static")]
unsafe impl<T: Send> Sync for InterruptCell<T> {}

impl<T> InterruptCell<T> {
    /// Nothing in it.
    pub const fn new() -> Self {
        Self(UnsafeCell::new(None))
    }

    /// Puts something in.
    ///
    /// # Safety
    /// The interrupt that uses [`InterruptCell::get`] is not enabled yet.
    #[allow(unsafe_code, reason = "what one interrupt owns lives in a static")]
    pub unsafe fn fill(&self, value: T) {
        // SAFETY: nobody else looks yet, by the contract.
        unsafe { *self.0.get() = Some(value) };
    }

    /// What is in it.
    ///
    /// # Safety
    /// Called from one interrupt only, and not while an earlier answer is still in use.
    #[allow(
        unsafe_code,
        clippy::mut_from_ref,
        reason = "what one interrupt owns lives in a static"
    )]
    pub unsafe fn get(&self) -> Option<&mut T> {
        // SAFETY: the only user, by the contract.
        unsafe { (*self.0.get()).as_mut() }
    }
}
