//! Time passed: core cycles on the chip, instructions in the emulator.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use stm32f4::stm32f405::TIM2;

/// True once the emulated board is in use.
static EMULATED: AtomicBool = AtomicBool::new(false);

/// Lets TIM2 count instructions, which it does with `-icount shift=0`.
#[allow(unsafe_code, reason = "raw register values")]
pub fn start_emulated(counter: &TIM2) {
    // SAFETY: no prescaler (RM0090, 18.4.11).
    counter.psc().write(|w| unsafe { w.bits(0) });
    // SAFETY: all 32 bits (18.4.12).
    counter.arr().write(|w| unsafe { w.bits(u32::MAX) });
    // SAFETY: CEN, counting up (18.4.1).
    counter.cr1().write(|w| unsafe { w.bits(1) });
    EMULATED.store(true, Ordering::Relaxed);
}

/// Whether this is the emulator.
#[inline]
pub fn is_emulated() -> bool {
    EMULATED.load(Ordering::Relaxed)
}

/// Core cycles, or instructions in the emulator; wraps.
#[inline]
pub fn cycles() -> u32 {
    if is_emulated() {
        #[allow(unsafe_code, reason = "reads a register")]
        // SAFETY: reading a counter has no effect.
        unsafe {
            (*TIM2::ptr()).cnt().read().bits()
        }
    } else {
        cortex_m::peripheral::DWT::cycle_count()
    }
}

/// The most of something so far; one context writes, all read.
pub struct Most(AtomicU32);

impl Most {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Takes the next.
    #[inline]
    pub fn take(&self, amount: u32) {
        if amount > self.0.load(Ordering::Relaxed) {
            self.0.store(amount, Ordering::Relaxed);
        }
    }

    /// The most so far.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}
