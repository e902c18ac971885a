//! The chip's bus, by addresses.

use core::ptr;

use crate::registers::Registers;

/// All registers, by their addresses.
#[derive(Clone, Copy)]
pub struct Bus;

#[allow(
    unsafe_code,
    reason = "registers are read and written by their addresses"
)]
impl Registers for Bus {
    fn read(&mut self, address: u32) -> u32 {
        // SAFETY: addresses are those of tables and drivers, all registers or flash that may be read.
        unsafe { ptr::read_volatile(address as *const u32) }
    }

    fn write(&mut self, address: u32, value: u32) {
        // SAFETY: as above; each register is written by one context, or whole.
        unsafe { ptr::write_volatile(address as *mut u32, value) };
    }
}
