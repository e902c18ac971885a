//! 168 MHz from an 8 MHz crystal, every wait bounded.

use stm32f4::stm32f405::{FLASH, RCC};

use super::settings::PLL;
use crate::stm32::wait_for;

/// Start-up of the crystal takes 2 ms, the PLL 0.3 ms: this many reads at 16 MHz are some 100 ms.
const LIMIT: u32 = 200_000;

/// Whether the PLL is the core's clock (RCC_CFGR, 7.3.3: SWS).
pub fn runs_at_full_clock() -> bool {
    // SAFETY: reading has no effect.
    unsafe { (*RCC::ptr()).cfgr().read().bits() >> 2 & 0b11 == 0b10 }
}

/// Crystal, PLL, flash latency, bus dividers, switch (7.3.1 to 7.3.3, 3.9.1); where a wait runs out the core stays
/// on its 16 MHz oscillator and the answer is false.
pub fn start(rcc: &RCC, flash: &FLASH) -> bool {
    let set = |bit: u32| {
        rcc.cr()
            .modify(|r, w| unsafe { w.bits(r.bits() | 1 << bit) })
    };
    let is_set = |bit: u32| rcc.cr().read().bits() & 1 << bit != 0;
    set(16);
    if !wait_for(LIMIT, || is_set(17)) {
        return false;
    }
    let [m, n, p, q] = PLL;
    rcc.pllcfgr().write(|w| unsafe {
        // Bit 22: from the crystal. Bit 29 is reserved and 1 out of reset.
        w.bits(m | n << 6 | (p / 2 - 1) << 16 | 1 << 22 | q << 24 | 1 << 29)
    });
    // Clock security: a crystal that stops raises the NMI, which dumps the brake (7.2.7).
    set(19);
    set(24);
    if !wait_for(LIMIT, || is_set(25)) {
        return false;
    }
    // Five wait states above 150 MHz at 3.3 V; prefetch and both caches on.
    let acr = 5 | 1 << 8 | 1 << 9 | 1 << 10;
    flash.acr().write(|w| unsafe { w.bits(acr) });
    if !wait_for(LIMIT, || flash.acr().read().bits() & 0xF == 5) {
        return false;
    }
    // AHB undivided, APB1 by 4, APB2 by 2, then the PLL as clock.
    let dividers = 0b101 << 10 | 0b100 << 13;
    rcc.cfgr().write(|w| unsafe { w.bits(dividers) });
    rcc.cfgr().write(|w| unsafe { w.bits(dividers | 0b10) });
    wait_for(LIMIT, runs_at_full_clock)
}
