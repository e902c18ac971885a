//! The rig controller's boards: what lies between `muslip-control` and the registers of a chip.
//!
//! A board is one folder, chosen by a feature: its tables of registers, its clocks, UART, converters and flash, and its part
//! of the linker's script.
//!
//! | feature | chip | flash word | edges stamped at |
//! |---|---|---|---|
//! | `stm32f405` (default) | STM32F405RG, 168 MHz, run unchanged in QEMU | 4 bytes | 84 MHz |
//! | `stm32g474` | STM32G474RE, 170 MHz, never run: tables and flash driver on mocks | 8 bytes with ECC | 170 MHz |
//!
//! What boards share stands beside the folders: set-up tables that are written and read back ([`mod@registers`]), interrupts
//! and main loop (`run`, for the target), what survives a reset ([`heat`], [`post_mortem`]), and what is the same in all
//! STM32 ([`stm32`]). On a host this is a small library of what can be tested there.
//!
//! `cargo xtask firmware` builds and checks the images, `cargo xtask flash` writes one, `cargo xtask pil` runs one in QEMU.
//! Nothing has run on silicon, and no safety category is claimed: docs/rig.md, docs/safety.md.
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::indexing_slicing,
        clippy::float_cmp,
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss
    )
)]
#![deny(
    clippy::undocumented_unsafe_blocks,
    clippy::allow_attributes_without_reason
)]

#[cfg(all(feature = "stm32f405", feature = "stm32g474"))]
compile_error!("an image is for one board: --no-default-features --features BOARD");
#[cfg(not(any(feature = "stm32f405", feature = "stm32g474")))]
compile_error!("an image is for a board: --features BOARD");

mod bits;
pub mod heat;
pub mod log_ring;
pub mod post_mortem;
pub mod registers;
pub mod stm32;
#[cfg(any(feature = "stm32f405", test))]
pub mod stm32f405;
#[cfg(any(feature = "stm32g474", test))]
pub mod stm32g474;
pub mod valves;

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
mod cell;
#[cfg(target_os = "none")]
pub mod chip;
#[cfg(target_os = "none")]
mod counter;
#[cfg(target_os = "none")]
mod dump;
#[cfg(target_os = "none")]
mod fault;
#[cfg(target_os = "none")]
mod link;
#[cfg(target_os = "none")]
mod log;
#[cfg(target_os = "none")]
mod queue;
#[cfg(target_os = "none")]
pub mod run;
#[cfg(target_os = "none")]
mod stack;
#[cfg(target_os = "none")]
mod totals;
