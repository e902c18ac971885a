//! The controller natively: what the image must equal.

use anyhow::{Result, anyhow};
use muslip_control::board::{Actuators, NotStored};
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::{Controller, Identity};
use muslip_control::emulation::Delays;
use muslip_record::{Origin, Parameters};
use test_support::MemoryPort;

use crate::target::{Input, Output, RATES, Target};

/// Bytes that the image's transmit queue holds.
const QUEUE_BYTES: usize = 2047;

/// Instructions from one sample to the next at 168 MHz.
const CYCLES_PER_SAMPLE: u32 = 168_000;

/// The controller on a board of memory.
pub struct Native {
    controller: Controller,
    /// The link's bytes, as the image's interrupt keeps them.
    port: MemoryPort,
}

/// As in the emulator: nothing can be stored.
struct NoStore;

impl Actuators for NoStore {
    fn actuate(&mut self, _: BrakeOutput) {}
    fn feed_watchdog(&mut self) {}
    fn store(&mut self, _: &Parameters) -> Result<(), NotStored> {
        Err(NotStored)
    }
}

impl Native {
    /// A controller as the image starts in the emulator.
    ///
    /// # Errors
    /// The default parameters are refused.
    pub fn new() -> Result<Self> {
        let identity = Identity {
            rates: RATES,
            core_clock_hz: 168_000_000,
            emulated: true,
            watchdog_reset: false,
            reset_flags: 0,
            end: None,
            slow_clock: false,
            set_up: true,
            parameters: Origin::BuiltIn,
            brake_energy_j: 0,
        };
        let controller = Controller::new(&Parameters::default(), identity)
            .map_err(|error| anyhow!("default parameters: {error:?}"))?;
        Ok(Self {
            controller,
            port: MemoryPort::new(QUEUE_BYTES),
        })
    }
}

impl Target for Native {
    fn sample(&mut self, input: &Input<'_>) -> Result<Output> {
        let brake = self.controller.control(&input.raw);
        self.port.incoming.extend(input.link);
        self.controller.communicate(&mut self.port, &mut NoStore);
        // What the image finds out by counting.
        if input.burn > CYCLES_PER_SAMPLE {
            self.controller.overran();
        }
        let sent = usize::from(input.room).min(self.port.outgoing.len());
        Ok(Output {
            brake,
            link: self.port.outgoing.drain(..sent).collect(),
            instructions: [0; 3],
            delays: Delays::default(),
            stack_bytes: 0,
        })
    }
}
