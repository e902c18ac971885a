//! What runs when nothing else can: the brake is dumped before anything is said.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use muslip_control::emulation::FromFirmware;

use crate::dump::dump;
use crate::emulator;

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

/// The crystal has stopped: the core runs on from its internal oscillator, at a tenth of its clock (7.2.7).
// SAFETY: never returns to what it interrupted.
#[allow(unsafe_code, reason = "the handler is unsafe by its type")]
#[exception]
unsafe fn NonMaskableInt() -> ! {
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
