//! The rig controller's board: what lies between `muslip-control` and the registers of an STM32F405.
//!
//! On a host this is a small library of what can be tested there: [`flash`], [`heat`], [`valves`], [`log_ring`], [`post_mortem`], [`registers`], [`settings`]. For the
//! chip it adds the two boards, the interrupts and the main loop. One image serves both boards; which it runs
//! on is decided at start-up by one bit (see docs/design/0005-controller.md).
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

mod bits;
pub mod flash;
pub mod heat;
pub mod log_ring;
pub mod post_mortem;
pub mod registers;
pub mod settings;
pub mod valves;

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
mod cell;
#[cfg(target_os = "none")]
mod chip;
#[cfg(target_os = "none")]
mod counter;
#[cfg(target_os = "none")]
mod dump;
#[cfg(target_os = "none")]
mod emulator;
#[cfg(target_os = "none")]
mod fault;
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
#[cfg(target_os = "none")]
mod uart;
