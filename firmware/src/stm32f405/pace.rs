//! The emulator at true pace: time passes by the bytes of the link's wire, and stands still where the simulator is asked.
//!
//! Sampling is `PendSV`'s meanwhile, on the same priority as ever, and takes as long as its buses do. Each time that a sample is
//! due the timer stands still while the simulator is told of the last and says the next: nothing of the program runs then,
//! so none of its time passes.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;
use muslip_control::emulation::FromFirmware;
use stm32f4::stm32f405::{USART2, USART3};

use super::settings::CYCLES_PER_SAMPLE;
use super::wire::{self, CYCLES_PER_BYTE};
use super::{emulator, uart};
use crate::bits::low_u8;
use crate::counter::cycles;
use crate::totals::{LATE, RAISED, WORKED};
use crate::{link, run};

/// Cycles since a sample was due.
static SINCE_SAMPLE: AtomicU32 = AtomicU32::new(0);

/// A byte's time has passed; false where the timer is not the wire's.
pub fn tick() -> bool {
    if !wire::is_on() {
        return false;
    }
    wire::move_bytes();
    let since = SINCE_SAMPLE.load(Ordering::Relaxed) + CYCLES_PER_BYTE;
    if since < CYCLES_PER_SAMPLE {
        SINCE_SAMPLE.store(since, Ordering::Relaxed);
        return true;
    }
    SINCE_SAMPLE.store(since - CYCLES_PER_SAMPLE, Ordering::Relaxed);
    #[allow(unsafe_code, reason = "raw register values")]
    // SAFETY: ENABLE of the timer whose handler this is; its count stays.
    let timer = unsafe { &(*SYST::PTR).csr };
    #[allow(unsafe_code, reason = "raw register values")]
    // SAFETY: as above.
    unsafe {
        timer.modify(|csr| csr & !1);
    }
    let stopped = cycles();
    tell_and_hear();
    // None of it passed for a byte that came with this tick.
    wire::stood_still(cycles().wrapping_sub(stopped));
    #[allow(unsafe_code, reason = "raw register values")]
    // SAFETY: as above.
    unsafe {
        timer.modify(|csr| csr | 1);
    }
    SCB::set_pendsv();
    true
}

/// Tells the simulator of the sample before, and takes the next with the bytes that the wire brings during it.
#[allow(unsafe_code, reason = "raw register values")]
fn tell_and_hear() {
    let [raised, worked, late] =
        [&RAISED, &WORKED, &LATE].map(|total| total.load(Ordering::Relaxed));
    emulator::say(&FromFirmware::Paced {
        raised,
        worked,
        late,
        output: emulator::output(),
        link_sent: link::totals().1,
        waited: wire::waited(),
        ready: wire::ready(),
        lost: link::overrun_bytes(),
    });
    // SAFETY: both are read here only, now that USART3's interrupt is masked.
    let (uart, rig) = unsafe { (&*USART2::ptr(), &*USART3::ptr()) };
    let mut wanted = emulator::heard_sample(|| {
        while rig.sr().read().bits() & uart::RXNE == 0 {}
        low_u8(rig.dr().read().bits())
    });
    while wanted > 0 {
        if uart.sr().read().bits() & uart::RXNE != 0 {
            wire::bring(low_u8(uart.dr().read().bits()));
            wanted -= 1;
        }
    }
}

/// Samples while the timer is the wire's.
#[exception]
fn PendSV() {
    run::sample();
}
