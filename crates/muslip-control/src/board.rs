//! What the controller needs of a board, and what it reads there.

use muslip_record::Parameters;
use serde::{Deserialize, Serialize};

use crate::brake::BrakeOutput;

/// A board: the chip with its sensors, or the emulator's stand-in.
pub trait Board {
    /// The half that the sampling interrupt owns.
    type Sensors: Sensors;
    /// The half that the main loop owns.
    type Actuators: Actuators;

    /// Parts it, so that neither half ever waits for the other.
    fn split(self) -> (Self::Sensors, Self::Actuators);
}

/// The half that the sampling interrupt owns.
pub trait Sensors {
    /// Reads every sensor once.
    fn read(&mut self) -> RawSample;

    /// Dumps the brake from the interrupt, when the main loop is late.
    fn dump(&mut self);
}

/// The half that the main loop owns.
pub trait Actuators {
    /// Sets valve and dump valve.
    fn actuate(&mut self, output: BrakeOutput);

    /// Tells the watchdog that a sample's work is done.
    fn feed_watchdog(&mut self);

    /// Stores parameters; may take seconds, and is only called with the brake dumped.
    ///
    /// # Errors
    /// [`NotStored`] where the board has no storage or it failed; what was stored before is still there.
    fn store(&mut self, parameters: &Parameters) -> Result<(), NotStored>;
}

/// Parameters could not be stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotStored;

/// One sample as the sensors give it: counts, captures and codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RawSample {
    /// The braked wheel's encoder.
    pub wheel: EncoderReading,
    /// The drum's or fifth wheel's encoder.
    pub vehicle: EncoderReading,
    /// The force bridges.
    pub bridge: BridgeReading,
    /// Supply of the valves in mV.
    pub supply_mv: u16,
    /// The pressure transmitter's voltage at the controller's pin in mV.
    pub pressure_mv: u16,
    /// True where a channel of the emergency stop is open.
    pub emergency_stop: [bool; 2],
    /// The dump valve's output as it is at the pin: true holds pressure.
    pub holds: bool,
    /// The button at the rig that confirms a fault is pressed.
    pub confirm: bool,
    /// True where the sample before this one was not taken from the queue in time.
    pub late: bool,
}

/// An encoder at the instant of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct EncoderReading {
    /// Edges of channel A, rising and falling, up to the last rising one: two a pulse; wraps.
    pub edges: u16,
    /// Time of that rising edge in ticks of [`Rates::edge_timer_hz`](crate::rates::Rates::edge_timer_hz); wraps.
    pub edge_ticks: u32,
    /// Ticks from that edge to the sample; wraps.
    pub age_ticks: u32,
}

/// The two bridge channels at the instant of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct BridgeReading {
    /// Codes of drag and normal force, 24 bits with sign.
    pub codes: [i32; 2],
    /// Whether they can be believed.
    pub quality: BridgeQuality,
}

/// Whether bridge codes can be believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum BridgeQuality {
    /// New since the last sample, checksum right.
    #[default]
    Fresh,
    /// Checksum right, but no conversion since the last sample.
    Stale,
    /// No answer, a wrong checksum, or the converter has reset itself.
    Bad,
}
