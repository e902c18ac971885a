//! The STM32F405RG (RM0090, DS8626), at 168 MHz; docs/rig.md has its wires. Run unchanged in QEMU, where one bit tells it that
//! it is: see docs/design/0005-controller.md.

pub mod flash;
pub mod settings;
pub mod table;

#[cfg(target_os = "none")]
mod any;
#[cfg(target_os = "none")]
mod chip;
#[cfg(target_os = "none")]
#[allow(
    unsafe_code,
    clippy::undocumented_unsafe_blocks,
    reason = "raw register values, each from the section of RM0090 named beside it"
)]
mod clock;
#[cfg(target_os = "none")]
mod emulator;
#[cfg(target_os = "none")]
mod pace;
#[cfg(target_os = "none")]
mod start;
#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "raw register values")]
mod uart;
#[cfg(target_os = "none")]
mod wire;

#[cfg(target_os = "none")]
pub use chip::Stm32f405;
#[cfg(target_os = "none")]
pub use start::start;
