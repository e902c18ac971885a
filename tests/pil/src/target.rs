//! What can be sampled: the image in QEMU, or the controller natively.

use anyhow::Result;
use muslip_control::board::RawSample;
use muslip_control::brake::BrakeOutput;
use muslip_control::emulation::Delays;
use muslip_control::rates::Rates;
use muslip_record::SAMPLE_RATE_HZ;

/// Rates of the board that the image is for.
pub const RATES: Rates = Rates::new(SAMPLE_RATE_HZ, 84_000_000);

/// One sample's input beside the sensors.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    /// What the sensors read.
    pub raw: RawSample,
    /// Bytes that arrive on the link before the sample's work.
    pub link: &'a [u8],
    /// Bytes that the link's wire takes during the sample.
    pub room: u16,
    /// Instructions to waste.
    pub burn: u32,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Output {
    /// What the valves were told.
    pub brake: BrakeOutput,
    /// Bytes sent on the link.
    pub link: Vec<u8>,
    /// Instructions of sampling interrupt, control step, and step with the link's work; 0 natively.
    pub instructions: [u32; 3],
    /// What can hold an interrupt off, so far; 0 natively.
    pub delays: Delays,
    /// Deepest stack so far in bytes; 0 natively.
    pub stack_bytes: u32,
}

/// Something that takes samples.
pub trait Target {
    /// Takes a sample and does its work.
    ///
    /// # Errors
    /// The target is gone or does not answer.
    fn sample(&mut self, input: &Input<'_>) -> Result<Output>;
}
