//! `defmt` on USART1: frames into a ring, the ring to the UART when the main loop idles.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};

use critical_section::RestoreState;

use crate::log_ring::LogRing;

/// Bytes that may wait.
const RING_BYTES: usize = 1024;

#[defmt::global_logger]
struct Logger;

struct State {
    ring: LogRing<RING_BYTES>,
    encoder: defmt::Encoder,
    restore: RestoreState,
}

struct Shared(UnsafeCell<State>);

#[allow(
    unsafe_code,
    reason = "defmt's logger is shared by every context, in critical sections"
)]
// SAFETY: every access is inside a critical section on a single core.
unsafe impl Sync for Shared {}

static SHARED: Shared = Shared(UnsafeCell::new(State {
    ring: LogRing::new(),
    encoder: defmt::Encoder::new(),
    restore: RestoreState::invalid(),
}));
static TAKEN: AtomicBool = AtomicBool::new(false);

#[allow(
    unsafe_code,
    reason = "defmt's logger is shared by every context, in critical sections"
)]
// SAFETY: acquire opens a critical section that release closes; between them nothing else runs.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: released in `release`, with the same state.
        let restore = unsafe { critical_section::acquire() };
        if TAKEN.swap(true, Ordering::Relaxed) {
            // A format that logs: its frame is lost in the outer one's, which the decoder will tell.
            return;
        }
        // SAFETY: inside the critical section.
        let state = unsafe { &mut *SHARED.0.get() };
        state.restore = restore;
        let ring = &mut state.ring;
        state
            .encoder
            .start_frame(|bytes| bytes.iter().for_each(|&byte| ring.push(byte)));
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: inside the critical section opened by `acquire`.
        let state = unsafe { &mut *SHARED.0.get() };
        let ring = &mut state.ring;
        state
            .encoder
            .end_frame(|bytes| bytes.iter().for_each(|&byte| ring.push(byte)));
        TAKEN.store(false, Ordering::Relaxed);
        // SAFETY: the state that `acquire` stored.
        unsafe { critical_section::release(state.restore) };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: inside the critical section opened by `acquire`.
        let state = unsafe { &mut *SHARED.0.get() };
        let ring = &mut state.ring;
        state.encoder.write(bytes, |bytes| {
            bytes.iter().for_each(|&byte| ring.push(byte))
        });
    }
}

/// Takes the oldest byte of the log.
pub fn pop() -> Option<u8> {
    with_ring(LogRing::pop)
}

/// Whether the log has nothing to send.
pub fn is_empty() -> bool {
    with_ring(|ring| ring.is_empty())
}

fn with_ring<T>(work: impl FnOnce(&mut LogRing<RING_BYTES>) -> T) -> T {
    critical_section::with(|_| {
        #[allow(
            unsafe_code,
            reason = "defmt's logger is shared by every context, in critical sections"
        )]
        // SAFETY: inside a critical section.
        let state = unsafe { &mut *SHARED.0.get() };
        work(&mut state.ring)
    })
}
