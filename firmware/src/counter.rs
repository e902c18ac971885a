//! Time passed: core cycles on the chip, instructions in the emulator.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::chip::{Chip, This};

/// Core cycles, or instructions in the emulator; wraps.
#[inline]
pub fn cycles() -> u32 {
    This::cycles()
}

/// Cycles of the interrupts that go before others, each without those that came into it; wrap.
static INTERRUPTED: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];

/// An interrupt whose time is kept: only that interrupt adds to its own.
#[derive(Debug, Clone, Copy)]
pub enum Interrupter {
    /// The host link.
    Link = 0,
    /// Sampling.
    Sampling = 1,
}

fn interrupted() -> u32 {
    let [link, sampling] = &INTERRUPTED;
    link.load(Ordering::Relaxed)
        .wrapping_add(sampling.load(Ordering::Relaxed))
}

/// Time taken by work, with and without what interrupted it.
///
/// A table of delays adds what interrupts cost by itself; measured work that holds some of it would count it twice.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch {
    cycles: u32,
    interrupted: u32,
}

impl Stopwatch {
    /// From now on.
    #[inline]
    pub fn start() -> Self {
        // An interrupt between the two looks would be in one of them only; there is no second one so soon.
        let mut interrupted_before = interrupted();
        for _ in 0..2 {
            let cycles = cycles();
            let interrupted_now = interrupted();
            if interrupted_now == interrupted_before {
                return Self {
                    cycles,
                    interrupted: interrupted_now,
                };
            }
            interrupted_before = interrupted_now;
        }
        Self {
            cycles: cycles(),
            interrupted: interrupted_before,
        }
    }

    /// Cycles since the start, by the clock.
    #[inline]
    pub fn elapsed(&self) -> u32 {
        cycles().wrapping_sub(self.cycles)
    }

    /// Cycles of the work itself.
    #[inline]
    pub fn own(&self) -> u32 {
        let now = Self::start();
        now.cycles
            .wrapping_sub(self.cycles)
            .wrapping_sub(now.interrupted.wrapping_sub(self.interrupted))
    }
}

/// Keeps the cycles of a run of an interrupt, for what it has interrupted.
#[inline]
pub fn keep(interrupter: Interrupter, own: u32) {
    if let Some(total) = INTERRUPTED.get(interrupter as usize) {
        total.store(
            total.load(Ordering::Relaxed).wrapping_add(own),
            Ordering::Relaxed,
        );
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
