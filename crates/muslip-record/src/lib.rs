//! What the controller and its host say to each other: types, frames, and how a stream of bytes is cut
//! into frames.
//!
//! ```text
//! frame = COBS(postcard(Envelope) ‖ CRC-32, little-endian) ‖ 0x00
//! ```
//!
//! COBS (Cheshire and Baker, IEEE/ACM Trans. Networking 7 (1999) 159-172) leaves no zero in a frame, so a
//! zero always ends one and a reader finds its place again after any damage. The checksum is CRC-32 as in
//! IEEE 802.3. An [`Envelope`] numbers what it carries, so that lost and repeated frames are counted.
//!
//! [`SCHEMA_HASH`] is made from the source of the wire types: two ends that differ in any of them see it
//! in [`Hello`] before anything else is believed.
//!
//! ```
//! use muslip_record::{Command, Envelope, FrameReader, FRAME_BYTES, encode};
//!
//! let sent = Envelope { sequence: 7, body: Command::Arm };
//! let mut buffer = [0; FRAME_BYTES];
//! let frame = encode(&sent, &mut buffer)?;
//!
//! let mut reader = FrameReader::new();
//! let mut received = None;
//! for &byte in frame {
//!     if let Some(result) = reader.push::<Envelope<Command>>(byte) {
//!         received = Some(result);
//!     }
//! }
//! assert_eq!(received, Some(Ok(sent)));
//! # Ok::<(), muslip_record::EncodeError>(())
//! ```
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

mod compensation;
mod fault;
mod frame;
mod hash;
mod parameters;
mod wire;

pub use compensation::{
    CompensationParameters, Estimating, Estimator, LoadCompensation, RadiusCompensation,
    RelaxationCompensation, SpeedCompensation, ThermalCompensation,
};
pub use frame::{BODY_BYTES, EncodeError, FRAME_BYTES, FrameError, FrameReader, encode};
pub use hash::{PARAMETERS_HASH, SCHEMA_HASH};
pub use parameters::{
    BrakeParameters, EncoderParameters, EstimatorParameters, ForceParameters, HeatParameters,
    LimitParameters, Parameters, PressureParameters, SlipControlParameters, TyreRange,
    WheelParameters,
};
pub use wire::{
    Answer, Command, End, Envelope, Estimate, Event, Fault, Hello, LinkCounters, Origin,
    PostMortem, Profile, Program, QuarterCar, Refusal, STEPS, Sample, State, Status, Telemetry,
};

/// Version of the protocol: raised when the meaning of a field changes though its type does not.
pub const PROTOCOL_VERSION: u16 = 1;

/// Bits a second on the link's wire.
pub const LINK_BAUD: u32 = 921_600;

/// Bytes a second on the link's wire: a start and a stop bit go with each eight.
pub const LINK_BYTES_PER_SECOND: u32 = LINK_BAUD / 10;

/// Samples a second.
pub const SAMPLE_RATE_HZ: u32 = 1_000;

/// Samples for each estimate that is sent.
pub const SAMPLES_PER_ESTIMATE: u32 = 10;
