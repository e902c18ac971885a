//! The board, whichever it is: the rig's or the emulator's.

use muslip_control::board::{Actuators, Board, NotStored, RawSample, Sensors};
use muslip_control::brake::BrakeOutput;
use muslip_record::Parameters;

use super::chip::Stm32f405;
use super::emulator::{EmulatedActuators, EmulatedSensors};
use crate::stm32::rig::{RigActuators, RigSensors};

/// The board, whichever it is.
pub struct AnyBoard {
    /// Its sensors.
    pub sensors: AnySensors,
    /// Its valves.
    pub actuators: AnyActuators,
}

/// Its sensors.
pub enum AnySensors {
    /// Those of the rig.
    Chip(RigSensors<Stm32f405>),
    /// Those of the simulator.
    Emulated(EmulatedSensors),
}

/// Its valves.
pub enum AnyActuators {
    /// Those of the rig.
    Chip(RigActuators<Stm32f405>),
    /// Those of the simulator.
    Emulated(EmulatedActuators),
}

impl Board for AnyBoard {
    type Sensors = AnySensors;
    type Actuators = AnyActuators;

    fn split(self) -> (AnySensors, AnyActuators) {
        (self.sensors, self.actuators)
    }
}

impl Sensors for AnySensors {
    fn read(&mut self) -> RawSample {
        match self {
            Self::Chip(sensors) => sensors.read(),
            Self::Emulated(sensors) => sensors.read(),
        }
    }

    fn dump(&mut self) {
        match self {
            Self::Chip(sensors) => sensors.dump(),
            Self::Emulated(sensors) => sensors.dump(),
        }
    }
}

impl Actuators for AnyActuators {
    fn actuate(&mut self, output: BrakeOutput) {
        match self {
            Self::Chip(actuators) => actuators.actuate(output),
            Self::Emulated(actuators) => actuators.actuate(output),
        }
    }

    fn feed_watchdog(&mut self) {
        match self {
            Self::Chip(actuators) => actuators.feed_watchdog(),
            Self::Emulated(actuators) => actuators.feed_watchdog(),
        }
    }

    fn store(&mut self, parameters: &Parameters) -> Result<(), NotStored> {
        match self {
            Self::Chip(actuators) => actuators.store(parameters),
            Self::Emulated(actuators) => actuators.store(parameters),
        }
    }
}
