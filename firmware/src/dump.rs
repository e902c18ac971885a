//! Dumping the brake, from any context and on either board, by the shortest way there is.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use stm32f4::stm32f405::{GPIOB, TIM1};

use crate::registers::BREAK;

/// Line of GPIOB that holds pressure while it is high.
pub const DUMP_LINE: u32 = 0;

/// Set by whoever dumps the brake behind the main loop's back, until the main loop dumps it itself.
static DUMPED: AtomicBool = AtomicBool::new(false);
/// The emulated pins: duty in the lower half, dump valve above.
pub static EMULATED_PINS: AtomicU32 = AtomicU32::new(0);

/// Dumps the brake; before start-up as well.
pub fn dump() {
    DUMPED.store(true, Ordering::Relaxed);
    #[allow(unsafe_code, reason = "raw register values")]
    // SAFETY: BSRR, BDTR and the compare registers are written whole; no other context's read-modify-write can undo it.
    // Without MOE both valves are off at once, not from the PWM's next period on; BSRR is for before TIM1 has the pin.
    unsafe {
        (*GPIOB::ptr())
            .bsrr()
            .write(|w| w.bits(1 << (DUMP_LINE + 16)));
        (*TIM1::ptr()).bdtr().write(|w| w.bits(BREAK));
        (*TIM1::ptr()).ccr2().write(|w| w.bits(0));
        (*TIM1::ptr()).ccr1().write(|w| w.bits(0));
    }
    EMULATED_PINS.store(0, Ordering::Relaxed);
}

/// Whether the brake was dumped by [`dump`] and the main loop has not caught up; it catches up by dumping.
pub fn dumped(main_loop_dumps: bool) -> bool {
    if main_loop_dumps {
        DUMPED.store(false, Ordering::Relaxed);
    }
    DUMPED.load(Ordering::Relaxed)
}
