//! `defmt` on USART1: frames into a ring, the ring to the UART when the main loop idles.
//!
//! The log is the thread's alone: what an interrupt would log is left out. So a frame masks no interrupt while it
//! is made, which takes longer than the host link may wait for its next byte.

use core::cell::UnsafeCell;

use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::VectActive;

use crate::log_ring::LogRing;

/// Bytes that may wait.
const RING_BYTES: usize = 1024;

#[defmt::global_logger]
struct Logger;

struct State {
    ring: LogRing<RING_BYTES>,
    encoder: defmt::Encoder,
    /// A frame is being made: one inside it, by a format that logs, is lost in it, which the decoder will tell.
    depth: u8,
}

struct Shared(UnsafeCell<State>);

#[allow(unsafe_code, reason = "defmt's logger is a static")]
// SAFETY: every access is the thread's, by `with_state`.
unsafe impl Sync for Shared {}

static SHARED: Shared = Shared(UnsafeCell::new(State {
    ring: LogRing::new(),
    encoder: defmt::Encoder::new(),
    depth: 0,
}));

/// Does something with the log where the thread asks for it; none in an interrupt.
fn with_state<T>(work: impl FnOnce(&mut State) -> T) -> Option<T> {
    if SCB::vect_active() != VectActive::ThreadMode {
        return None;
    }
    #[allow(unsafe_code, reason = "defmt's logger is a static")]
    // SAFETY: there is one thread, and no `work` calls this again.
    let state = unsafe { &mut *SHARED.0.get() };
    Some(work(state))
}

#[allow(unsafe_code, reason = "defmt's trait is unsafe")]
// SAFETY: only the thread writes, one frame after the other.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        with_state(
            |State {
                 ring,
                 encoder,
                 depth,
             }| {
                *depth = depth.saturating_add(1);
                if *depth == 1 {
                    encoder.start_frame(|bytes| bytes.iter().for_each(|&byte| ring.push(byte)));
                }
            },
        );
    }

    unsafe fn flush() {}

    unsafe fn release() {
        with_state(
            |State {
                 ring,
                 encoder,
                 depth,
             }| {
                *depth = depth.saturating_sub(1);
                if *depth == 0 {
                    encoder.end_frame(|bytes| bytes.iter().for_each(|&byte| ring.push(byte)));
                }
            },
        );
    }

    unsafe fn write(bytes: &[u8]) {
        with_state(|State { ring, encoder, .. }| {
            encoder.write(bytes, |bytes| {
                bytes.iter().for_each(|&byte| ring.push(byte))
            });
        });
    }
}

/// Takes the oldest byte of the log.
pub fn pop() -> Option<u8> {
    with_state(|state| state.ring.pop()).flatten()
}

/// Whether the log has nothing to send.
pub fn is_empty() -> bool {
    with_state(|state| state.ring.is_empty()).unwrap_or(true)
}
