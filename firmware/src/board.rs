//! Which board this is, and its start-up.

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{NVIC, SCB};
use muslip_control::board::{Actuators, Board, NotStored, RawSample, Sensors};
use muslip_control::brake::BrakeOutput;
use muslip_control::controller::{Controller, Identity};
use muslip_control::emulation::FromFirmware;
use muslip_control::store::Loaded;
use muslip_record::{Origin, Parameters, SAMPLE_RATE_HZ};
use stm32f4::stm32f405::{Interrupt, Peripherals, USART1};

use crate::counter::{Most, cycles, is_emulated};
use crate::settings::{CORE_HZ, HSI_HZ};
use crate::uart::LinkEnd;
use crate::{chip, emulator, fault, uart};

/// Priorities of the interrupts, in the upper four bits of their registers: 0 goes first.
/// 0 is the memory fault's: an overflow of the stack must be one in every interrupt.
const LINK_PRIORITY: u8 = 1;
const SAMPLING_PRIORITY: u8 = 2;
const RIG_PRIORITY: u8 = 3;

/// Does something with sampling held off, and the link not.
pub fn without_sampling<T>(work: impl FnOnce() -> T) -> T {
    let start = cycles();
    #[allow(unsafe_code, reason = "a priority is masked and let go")]
    // SAFETY: nothing relies on sampling coming within the few instructions of `work`.
    unsafe {
        cortex_m::register::basepri::write(SAMPLING_PRIORITY << 4);
    }
    // The mask holds from here on, for the core and for the compiler (ARMv7-M, B5.2.3).
    cortex_m::asm::isb();
    compiler_fence(Ordering::SeqCst);
    let result = work();
    compiler_fence(Ordering::SeqCst);
    HELD_OFF.take(cycles().wrapping_sub(start));
    #[allow(unsafe_code, reason = "a priority is masked and let go")]
    // SAFETY: 0 masks nothing.
    unsafe {
        cortex_m::register::basepri::write(0);
    }
    result
}

/// Most cycles for which sampling was held off by [`without_sampling`].
static HELD_OFF: Most = Most::new();

/// Most cycles for which sampling was held off to set the valves.
pub fn sampling_held_off() -> u32 {
    HELD_OFF.get()
}

/// The board, whichever it is.
pub struct AnyBoard {
    sensors: AnySensors,
    actuators: AnyActuators,
}

/// Its sensors.
pub enum AnySensors {
    /// Those of the rig.
    Chip(chip::ChipSensors),
    /// Those of the simulator.
    Emulated(emulator::EmulatedSensors),
}

/// Its valves.
pub enum AnyActuators {
    /// Those of the rig.
    Chip(chip::ChipActuators),
    /// Those of the simulator.
    Emulated(emulator::EmulatedActuators),
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

/// What start-up leaves to the main loop.
pub struct Started {
    /// The board.
    pub board: AnyBoard,
    /// The controller; none only if start-up ran twice.
    pub controller: Option<&'static mut Controller>,
    /// The host link; none only if start-up ran twice.
    pub link: Option<LinkEnd>,
    /// The log's UART.
    pub log: USART1,
}

/// Dumps the brake, then finds out where it runs and sets that up.
#[allow(
    unsafe_code,
    reason = "start-up takes the peripherals and sets priorities"
)]
pub fn start() -> Started {
    fault::guard_stack();
    let (end, brake_energy_j) = (fault::last_end(), fault::last_brake_energy_j());
    // SAFETY: called once, from `main`, before any interrupt is enabled.
    let peripherals = unsafe { Peripherals::steal() };
    // Set on silicon whenever the core runs from reset; never in QEMU, which does not model RCC.
    let emulated = peripherals.RCC.cr().read().bits() & 1 << 1 == 0;
    let (board, identity, parameters) = if emulated {
        let (sensors, actuators) = emulator::start(&peripherals.USART3, &peripherals.TIM2);
        let board = AnyBoard {
            sensors: AnySensors::Emulated(sensors),
            actuators: AnyActuators::Emulated(actuators),
        };
        let identity = Identity {
            core_clock_hz: CORE_HZ,
            emulated,
            watchdog_reset: end.is_some(),
            reset_flags: 0,
            end,
            slow_clock: false,
            set_up: true,
            parameters: Origin::BuiltIn,
            brake_energy_j,
        };
        (board, identity, Parameters::default())
    } else {
        let up = chip::start(&peripherals);
        let board = AnyBoard {
            sensors: AnySensors::Chip(up.sensors),
            actuators: AnyActuators::Chip(up.actuators),
        };
        let identity = Identity {
            core_clock_hz: if up.full_clock { CORE_HZ } else { HSI_HZ },
            emulated,
            watchdog_reset: up.watchdog_reset || end.is_some(),
            reset_flags: up.reset_flags,
            end,
            slow_clock: !up.full_clock,
            set_up: up.set_up,
            parameters: match up.loaded {
                Some(Loaded { newest: true, .. }) => Origin::Stored,
                Some(_) => Origin::Previous,
                None => Origin::BuiltIn,
            },
            brake_energy_j,
        };
        let parameters = up
            .loaded
            .map_or_else(Parameters::default, |loaded| loaded.parameters);
        (board, identity, parameters)
    };
    let link = uart::start(
        &peripherals.RCC,
        &peripherals.USART1,
        peripherals.USART2,
        !identity.slow_clock,
    );
    defmt::info!(
        "muslip: emulated {}, core {} Hz, watchdog reset {}, parameters {}",
        identity.emulated,
        identity.core_clock_hz,
        identity.watchdog_reset,
        identity.parameters
    );
    // Stored parameters were checked when they were loaded, the default ones by a test.
    let controller = Controller::new(&parameters, identity)
        .ok()
        .and_then(|controller| cortex_m::singleton!(: Controller = controller));
    Started {
        board,
        controller,
        link,
        log: peripherals.USART1,
    }
}

/// Lets samples come: by the timer on the chip, by the simulator's frames in the emulator.
#[allow(
    unsafe_code,
    reason = "start-up takes the peripherals and sets priorities"
)]
pub fn start_sampling() {
    // SAFETY: called once; nobody else has the core's peripherals.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    // SAFETY: the host link goes above sampling, which takes longer than its next byte; nothing relies on
    // another order. docs/design/0013-silicon.md.
    unsafe {
        core.NVIC
            .set_priority(Interrupt::USART2, LINK_PRIORITY << 4);
        core.SCB
            .set_priority(SystemHandler::SysTick, SAMPLING_PRIORITY << 4);
        core.NVIC.set_priority(Interrupt::USART3, RIG_PRIORITY << 4);
    }
    if is_emulated() {
        let sampling_instructions = chip::sampling_instructions();
        let registers_hold = chip::registers_hold();
        emulator::say(&FromFirmware::Ready {
            sampling_instructions,
            registers_hold,
            priorities: [
                NVIC::get_priority(Interrupt::USART2) >> 4,
                SCB::get_priority(SystemHandler::SysTick) >> 4,
            ],
        });
        return;
    }
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let clock_hz = if chip::runs_at_full_clock() {
        CORE_HZ
    } else {
        HSI_HZ
    };
    core.SYST
        .set_clock_source(cortex_m::peripheral::syst::SystClkSource::Core);
    core.SYST.set_reload(clock_hz / SAMPLE_RATE_HZ - 1);
    core.SYST.clear_current();
    core.SYST.enable_interrupt();
    core.SYST.enable_counter();
    chip::start_watchdog();
}
