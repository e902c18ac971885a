//! What runs when nothing else can: the brake is dumped before anything is said.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};
use muslip_control::emulation::FromFirmware;

use crate::{chip, emulator};

/// Set by whoever dumps the brake behind the main loop's back, until the main loop dumps it itself.
static DUMPED: AtomicBool = AtomicBool::new(false);

/// Dumps the brake from any context, by the shortest way there is on either board.
pub fn dump() {
    DUMPED.store(true, Ordering::Relaxed);
    chip::dump();
    emulator::dump();
}

/// Whether the brake was dumped by [`dump`] and the main loop has not caught up; it catches up by dumping.
pub fn dumped(main_loop_dumps: bool) -> bool {
    if main_loop_dumps {
        DUMPED.store(false, Ordering::Relaxed);
    }
    DUMPED.load(Ordering::Relaxed)
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    dump();
    end(true)
}

// SAFETY: never returns to what faulted.
#[allow(unsafe_code, reason = "a fault handler is unsafe by its type")]
#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    dump();
    end(false)
}

/// Nothing more happens: the watchdog resets the chip, which starts up faulted.
fn end(panic: bool) -> ! {
    cortex_m::interrupt::disable();
    let output = emulator::output();
    emulator::say(&FromFirmware::Dumped { panic, output });
    loop {
        cortex_m::asm::nop();
    }
}
