//! The chip's bus for set-up by addresses.

use core::ptr;

use crate::registers::Registers;

/// All registers, by their addresses.
pub struct Bus;

impl Registers for Bus {
    fn read(&mut self, address: u32) -> u32 {
        // SAFETY: addresses are those of the table, which are registers that may be read.
        unsafe { ptr::read_volatile(address as *const u32) }
    }

    fn write(&mut self, address: u32, value: u32) {
        // SAFETY: as above; start-up, which alone writes, runs before any interrupt.
        unsafe { ptr::write_volatile(address as *mut u32, value) };
    }
}
