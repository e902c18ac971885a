//! 170 MHz from an 8 MHz crystal, every wait bounded (RM0440, 6.1.5 and 7.2).

use stm32g4::stm32g474::{FLASH, PWR, RCC};

use super::settings::{FLASH_WAIT_STATES, PLL};
use crate::stm32::wait_for;

/// Start-up of the crystal takes 2 ms, the PLL 0.3 ms: this many reads at 16 MHz are some 100 ms.
const LIMIT: u32 = 200_000;
const PLL_IN_USE: u32 = 0b11;

/// Whether the PLL is the core's clock (RCC_CFGR: SWS).
#[allow(unsafe_code, reason = "reads a register")]
pub fn runs_at_full_clock() -> bool {
    // SAFETY: reading has no effect.
    unsafe { (*RCC::ptr()).cfgr().read().bits() >> 2 & 0b11 == PLL_IN_USE }
}

/// Crystal, voltage boost, PLL, flash latency, switch; where a wait runs out the core stays on its 16 MHz oscillator and
/// the answer is false. The power control's clock runs.
#[allow(
    unsafe_code,
    clippy::undocumented_unsafe_blocks,
    reason = "raw register values, each from the section of RM0440 named beside it"
)]
pub fn start(rcc: &RCC, power: &PWR, flash: &FLASH) -> bool {
    let set = |bit: u32| {
        rcc.cr()
            .modify(|r, w| unsafe { w.bits(r.bits() | 1 << bit) })
    };
    let is_set = |bit: u32| rcc.cr().read().bits() & 1 << bit != 0;
    set(16);
    if !wait_for(LIMIT, || is_set(17)) {
        return false;
    }
    // Boost for above 150 MHz: R1MODE, bit 8, is 0 (6.4.5).
    power
        .cr5()
        .modify(|r, w| unsafe { w.bits(r.bits() & !(1 << 8)) });
    let [m, n, r] = PLL;
    // R enabled; R = 2 is 00 (7.4.4).
    const { assert!(PLL[2] == 2) };
    rcc.pllcfgr()
        .write(|w| unsafe { w.bits(0b11 | (m - 1) << 4 | n << 8 | 1 << 24 | (r / 2 - 1) << 25) });
    // Clock security: a crystal that stops raises the NMI, which dumps the brake (7.2.8).
    set(19);
    set(24);
    if !wait_for(LIMIT, || is_set(25)) {
        return false;
    }
    // Prefetch and both caches on (3.7.1).
    let acr = FLASH_WAIT_STATES | 1 << 8 | 1 << 9 | 1 << 10;
    flash.acr().write(|w| unsafe { w.bits(acr) });
    if !wait_for(LIMIT, || {
        flash.acr().read().bits() & 0xF == FLASH_WAIT_STATES
    }) {
        return false;
    }
    // Above 80 MHz by way of half of it, for a microsecond at least (7.2.7).
    let half = 0b1000 << 4;
    rcc.cfgr().write(|w| unsafe { w.bits(half) });
    rcc.cfgr().write(|w| unsafe { w.bits(half | PLL_IN_USE) });
    if !wait_for(LIMIT, runs_at_full_clock) {
        return false;
    }
    cortex_m::asm::delay(200);
    rcc.cfgr().write(|w| unsafe { w.bits(PLL_IN_USE) });
    wait_for(LIMIT, runs_at_full_clock)
}
