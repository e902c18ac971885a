//! The rig controller above its registers.
//!
//! ```text
//! interrupt   Sensors::read -> RawSample -> queue                                  board
//! main loop   Controller::control    counts and codes to SI units                  conversion, encoder
//!                                    interlocks, before anything else              interlock
//!                                    state machine, brake demand                   sequence
//!                                    slip, friction, compensation, estimator       estimation
//!             Actuators::actuate     valve and dump valve                          board, brake
//!             Controller::communicate  commands in, telemetry out                  controller, link
//! ```
//!
//! No register and no clock is touched here: a sample goes in, the brake's outputs come out, and the same arithmetic runs on
//! the chip, in the emulator and natively beside it. `no_std`, no heap, no panic but for [`rates::Rates::new`] outside its
//! ranges: a `const` makes that an error of the build. Drivers are generic over
//! `embedded-hal` 1.0 ([`ads131m02`]) and `embedded-storage` ([`store`]), the link over `embedded-io` ([`link`]); a board says
//! how often it samples and how finely it stamps edges ([`rates`]).
//!
//! ```text
//! let mut controller = Controller::new(&parameters, identity)?;    Err(BadParameters): the number of the field
//! let output = controller.control(&raw);                           each sample, no input or output
//! actuators.actuate(output);
//! controller.communicate(&mut port, &mut actuators);
//! ```
//!
//! Which parameters are refused: [`validate`], [`ceiling`]; emergency stop: [`stop`]; line pressure against demand:
//! [`pressure`]; the slip controller: [`slip_hold`]; what an emulated rig hands over: [`emulation`].
//!
//! No safety category, performance level or integrity level is claimed: one processor computes, watches and acts, and what
//! protects people is the safety circuit outside it (docs/safety.md). Nothing here has run on silicon: an STM32F405 in QEMU
//! only, of the STM32G474 its tables and flash driver on mocks (docs/rig.md).
#![no_std]
#![forbid(unsafe_code)]
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

pub mod ads131m02;
pub mod board;
pub mod brake;
pub mod ceiling;
pub mod compensation;
pub mod controller;
pub mod conversion;
pub mod emulation;
pub mod encoder;
pub mod estimation;
mod fault_set;
pub mod interlock;
pub mod link;
mod number;
pub mod pressure;
pub mod rates;
pub mod sequence;
pub mod slip_hold;
pub mod stop;
pub mod store;
pub mod validate;
