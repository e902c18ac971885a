//! The independent watchdog (21.4): on its own oscillator, also while a debugger has stopped the core.

use crate::registers::Registers;
use crate::stm32::wait_for;

const IWDG: u32 = 0x4000_3000;
const KR: u32 = IWDG;
const PR: u32 = IWDG + 0x04;
const RLR: u32 = IWDG + 0x08;
const SR: u32 = IWDG + 0x0C;

const KEY_START: u32 = 0xCCCC;
const KEY_FEED: u32 = 0xAAAA;
const KEY_ACCESS: u32 = 0x5555;

/// Prescaler bits and counts while samples come: at LSI's 17 to 47 kHz a prescaler of 4 and 60 counts are 5 to 14 ms.
const SAMPLING: [u32; 2] = [0, 60];
/// While flash is erased: prescaler 64 and 4095 counts are 5.6 s at least, longer than any erase.
const ERASING: [u32; 2] = [4, 4095];

/// The watchdog.
pub struct Watchdog<B>(B);

impl<B: Registers> Watchdog<B> {
    /// The watchdog, started or not.
    pub fn new(bus: B) -> Self {
        Self(bus)
    }

    /// Starts it, for good: nothing sets it to stop with the core (the debug unit's freeze bits are left at 0), so that
    /// valves do not stay energised by a program that stands.
    pub fn start(&mut self) {
        self.0.write(KR, KEY_START);
        self.set(SAMPLING);
    }

    /// Puts its time off.
    pub fn feed(&mut self) {
        self.0.write(KR, KEY_FEED);
    }

    /// Does something that takes as long as an erase.
    pub fn while_erasing<T>(&mut self, work: impl FnOnce() -> T) -> T {
        self.set(ERASING);
        let result = work();
        self.set(SAMPLING);
        result
    }

    fn set(&mut self, [prescaler, reload]: [u32; 2]) {
        self.0.write(KR, KEY_ACCESS);
        self.0.write(PR, prescaler);
        self.0.write(RLR, reload);
        // Up to five LSI cycles each: 300 us.
        wait_for(200_000, || self.0.read(SR) == 0);
        self.feed();
    }
}
