//! Which board this is, its start-up, and what the main loop needs of it.

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{NVIC, SCB};
use muslip_control::controller::Identity;
use muslip_control::emulation::{Delays, FromFirmware};
use muslip_record::{Origin, Parameters};
use stm32f4::stm32f405::{Interrupt, Peripherals};

use super::any::{AnyActuators, AnyBoard, AnySensors};
use super::chip::Stm32f405;
use super::settings::{CORE_HZ, CYCLES_PER_SAMPLE, HSI_HZ, RATES};
use super::{chip, emulator, pace, table, uart, wire};
use crate::board::{Started, origin, set_priorities, start_timer};
use crate::chip::{Chip, Took};
use crate::fault;
use crate::registers::first_wrong;
use crate::stm32::bus::Bus;
use crate::stm32::rig;
use crate::stm32::watchdog::Watchdog;

/// The emulator's interrupt goes after all that silicon has.
const RIG_PRIORITY: u8 = 3;

/// Dumps the brake, then finds out where it runs and sets that up.
#[allow(unsafe_code, reason = "start-up takes the peripherals")]
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
            rates: RATES,
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
            sensors: AnySensors::Chip(up.rig.sensors),
            actuators: AnyActuators::Chip(up.rig.actuators),
        };
        let identity = Identity {
            rates: RATES,
            core_clock_hz: if up.full_clock { CORE_HZ } else { HSI_HZ },
            emulated,
            watchdog_reset: up.watchdog_reset || end.is_some(),
            reset_flags: up.reset_flags,
            end,
            slow_clock: !up.full_clock,
            set_up: up.set_up,
            parameters: origin(up.loaded.as_ref()),
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
    Started::new(board, &parameters, identity, link)
}

impl Chip for Stm32f405 {
    type Board = AnyBoard;
    type Uart = uart::Usart2;

    const CYCLES_PER_SAMPLE: u32 = CYCLES_PER_SAMPLE;

    /// By the timer on the chip, by the simulator's frames in the emulator.
    #[allow(unsafe_code, reason = "start-up sets priorities")]
    fn start_sampling() {
        set_priorities(Interrupt::USART2);
        // SAFETY: called once; nobody else has the core's peripherals, and nothing relies on another order.
        unsafe {
            let mut core = cortex_m::Peripherals::steal();
            core.NVIC.set_priority(Interrupt::USART3, RIG_PRIORITY << 4);
        }
        if emulator::is_emulated() {
            emulator::say(&FromFirmware::Ready {
                sampling_instructions: chip::sampling_instructions(),
                registers_hold: first_wrong(&table::CHECKED, &mut Bus).is_none(),
                priorities: [
                    NVIC::get_priority(Interrupt::USART2) >> 4,
                    SCB::get_priority(SystemHandler::SysTick) >> 4,
                ],
            });
            return;
        }
        let clock_hz = if chip::runs_at_full_clock() {
            CORE_HZ
        } else {
            HSI_HZ
        };
        start_timer(clock_hz, RATES.sample_hz());
        Watchdog::new(Bus).start();
    }

    fn dump() {
        rig::dump::<Self>();
        emulator::dump_pins();
    }

    fn kick() {
        NVIC::pend(Interrupt::USART2);
    }

    fn log(byte: impl FnOnce() -> Option<u8>) -> bool {
        uart::log(byte)
    }

    #[inline]
    fn cycles() -> u32 {
        if emulator::is_emulated() {
            emulator::instructions()
        } else {
            cortex_m::peripheral::DWT::cycle_count()
        }
    }

    #[inline]
    fn timer_is_taken() -> bool {
        pace::tick()
    }

    fn sampled() {
        emulator::count_free_sample();
    }

    fn stays_awake() -> bool {
        emulator::runs_freely() || wire::is_on()
    }

    fn begins_work() {
        emulator::await_link();
    }

    fn valves_are_set() {
        emulator::burn();
    }

    fn worked(tick: u32, took: &Took, delays: Delays, stack_bytes: u32, totals: [u32; 3]) {
        emulator::answer(tick, took, delays, stack_bytes, totals);
    }

    fn ended(panic: bool) {
        emulator::say(&FromFirmware::Dumped {
            panic,
            output: emulator::output(),
        });
    }
}
