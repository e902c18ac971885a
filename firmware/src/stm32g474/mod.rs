//! The STM32G474RE (RM0440, DS12288), at 170 MHz, with the wires of docs/rig.md: its pins have the same places and functions
//! there but for their numbers. It has never run on silicon, nor in an emulator, which has no such chip; its tables and its
//! flash driver are tested on mocks.

pub mod flash;
pub mod settings;
pub mod table;

#[cfg(target_os = "none")]
mod chip;
#[cfg(target_os = "none")]
mod clock;
#[cfg(target_os = "none")]
mod uart;

#[cfg(target_os = "none")]
pub use chip::{Stm32g474, start};
