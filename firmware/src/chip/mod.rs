//! The chip's board: STM32F405 at 168 MHz with the rig's sensors and valves.
//!
//! None of this runs in QEMU, where RCC, GPIO, TIM1, flash programming and the watchdog are not modelled; it is
//! reviewed against RM0090 (sections are named at each place) and has never run on silicon.

#![allow(
    unsafe_code,
    clippy::undocumented_unsafe_blocks,
    clippy::cast_possible_truncation,
    reason = "raw register values, each from the section of RM0090 named beside it"
)]

mod bridge;
mod bus;
mod clock;
mod encoders;
mod gpio;
mod outputs;

use core::ops::Deref;

use muslip_control::board::{Actuators, NotStored, RawSample, Sensors};
use muslip_control::brake::BrakeOutput;
use muslip_control::store::{Loaded, Store};
use muslip_record::Parameters;
use stm32f4::stm32f405::{ADC1, ADC2, GPIOB, GPIOC, IWDG, Peripherals, adc1};

use crate::counter::cycles;
use crate::dump::DUMP_LINE;
use crate::flash::ParameterFlash;
use crate::registers::{self, set_up};
use crate::settings::{CORE_HZ, pin_mv, supply_mv, wait_for};
use crate::valves::Valves;
use bridge::Bridge;
use bus::Bus;
use encoders::Encoders;
use outputs::{DumpPin, ValvePwm};

pub use clock::runs_at_full_clock;

/// Lines that are high while the emergency stop's channels are closed: of GPIOB, and of GPIOC.
const EMERGENCY_STOP_LINES: [u32; 2] = [1, 4];
/// Line of GPIOB that is high while the button at the rig is pressed.
const CONFIRM_LINE: u32 = 10;

/// End of conversion, of the ADC's status (13.13.1).
const EOC: u32 = 1 << 1;

/// The rig's sensors.
pub struct ChipSensors {
    encoders: Encoders,
    bridge: Bridge,
    supply: ADC1,
    pressure: ADC2,
    port_b: GPIOB,
    port_c: GPIOC,
}

/// The rig's valves, watchdog and flash.
pub struct ChipActuators {
    valves: Valves<ValvePwm, DumpPin>,
    store: Store<ParameterFlash<Bus>>,
    watchdog: IWDG,
}

/// What start-up found.
pub struct Up {
    /// The rig's sensors.
    pub sensors: ChipSensors,
    /// The rig's valves.
    pub actuators: ChipActuators,
    /// Parameters from flash.
    pub loaded: Option<Loaded>,
    /// Whether every register that was set up holds what it should.
    pub set_up: bool,
    /// Whether the PLL runs.
    pub full_clock: bool,
    /// What caused the reset: the upper byte of RCC_CSR (7.3.21).
    pub reset_flags: u8,
    /// Whether the watchdog caused the reset.
    pub watchdog_reset: bool,
}

/// Brake first, then clocks, pins and peripherals.
pub fn start(_: &Peripherals) -> Up {
    // SAFETY: called once before interrupts; each part takes the peripherals that are its own.
    let p = unsafe { Peripherals::steal() };
    gpio::dump_line_low(&p.GPIOB);
    let full_clock = clock::start(&p.RCC, &p.FLASH);
    // RCC_CSR (7.3.21): IWDGRSTF bit 29; RMVF bit 24 clears the flags.
    let [.., reset_flags] = p.RCC.csr().read().bits().to_le_bytes();
    let watchdog_reset = reset_flags & 1 << 5 != 0;
    p.RCC
        .csr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 1 << 24) });
    gpio::start(&p.GPIOB, &p.GPIOC);
    start_converters(&p.ADC1, &p.ADC2);
    let (proportional, dump) = outputs::start(p.TIM1);
    let valves = Valves::new(proportional, dump);
    let mut store = Store::new(ParameterFlash::new(Bus));
    let loaded = store.load().ok().flatten();
    let sensors = ChipSensors {
        encoders: Encoders::start(p.TIM3, p.TIM4, p.TIM5, p.TIM2),
        bridge: Bridge::start(p.SPI2),
        supply: p.ADC1,
        pressure: p.ADC2,
        port_b: p.GPIOB,
        port_c: p.GPIOC,
    };
    Up {
        sensors,
        set_up: check_registers(),
        actuators: ChipActuators {
            valves,
            store,
            watchdog: p.IWDG,
        },
        loaded,
        full_clock,
        reset_flags,
        watchdog_reset,
    }
}

/// Whether every register that was set up holds what it should.
pub fn registers_hold() -> bool {
    registers::first_wrong(&mut Bus).is_none()
}

/// The same; the first register that does not is logged.
fn check_registers() -> bool {
    let wrong = registers::first_wrong(&mut Bus);
    if let Some((setting, read)) = wrong {
        defmt::error!(
            "register {=str} holds {=u32:08x}, not {=u32:08x} in {=u32:08x}",
            setting.name,
            read,
            setting.value,
            setting.mask
        );
    }
    wrong.is_none()
}

/// Both converters, and their first conversions, so that the first sample finds one of each.
fn start_converters(supply: &ADC1, pressure: &ADC2) {
    set_up(&registers::CONVERTERS, &mut Bus);
    // t_STAB is 3 us (data sheet, table 67).
    cortex_m::asm::delay(CORE_HZ / 100_000);
    for adc in [supply.deref(), pressure.deref()] {
        convert(adc);
        wait_for(100_000, || adc.sr().read().bits() & EOC != 0);
    }
}

/// Starts a conversion (13.13.3: SWSTART).
fn convert(adc: &adc1::RegisterBlock) {
    adc.cr2().write(|w| unsafe { w.bits(1 | 1 << 30) });
}

/// The result of the conversion started a sample ago, and the next one started; 0 without one, at which what it measures
/// counts as lost. Reading it clears the flag.
fn converted(adc: &adc1::RegisterBlock) -> u16 {
    let is_there = adc.sr().read().bits() & EOC != 0;
    let code = adc.dr().read().bits() as u16;
    convert(adc);
    if is_there { code } else { 0 }
}

/// Instructions of one look at the sensors, counted in the emulator, where every bus is ready at once: for docs/rig.md,
/// which adds all waits. There the bridge's first frame, of no converter, is refused: its second is counted as another.
pub fn sampling_instructions() -> u32 {
    // SAFETY: only called in the emulator, before sampling, where none of these is in use.
    let p = unsafe { Peripherals::steal() };
    let mut sensors = ChipSensors {
        encoders: Encoders::untouched(p.TIM3, p.TIM4, p.TIM5, p.TIM2),
        bridge: Bridge::untouched(p.SPI2),
        supply: p.ADC1,
        pressure: p.ADC2,
        port_b: p.GPIOB,
        port_c: p.GPIOC,
    };
    let start = cycles();
    core::hint::black_box(sensors.read());
    core::hint::black_box(sensors.bridge.read());
    cycles().wrapping_sub(start)
}

impl Sensors for ChipSensors {
    fn read(&mut self) -> RawSample {
        let [wheel, vehicle] = self.encoders.read();
        let (supply, pressure) = (converted(&self.supply), converted(&self.pressure));
        let (port_b, port_c) = (
            self.port_b.idr().read().bits(),
            self.port_c.idr().read().bits(),
        );
        let [line_b, line_c] = EMERGENCY_STOP_LINES;
        RawSample {
            wheel,
            vehicle,
            bridge: self.bridge.read(),
            supply_mv: supply_mv(supply),
            pressure_mv: pin_mv(pressure),
            emergency_stop: [port_b & 1 << line_b == 0, port_c & 1 << line_c == 0],
            holds: port_b & 1 << DUMP_LINE != 0,
            confirm: port_b & 1 << CONFIRM_LINE != 0,
            late: false,
        }
    }

    fn dump(&mut self) {
        crate::dump::dump();
    }
}

/// IWDG keys and settings (21.4): at LSI's 17 to 47 kHz the prescaler 4 and 60 counts are 5 to 14 ms.
const KEY_START: u32 = 0xCCCC;
const KEY_FEED: u32 = 0xAAAA;
const KEY_ACCESS: u32 = 0x5555;
const RELOAD_SAMPLING: u32 = 60;
/// Prescaler 64 and 4095 counts: 5.6 s at least, longer than any erase.
const RELOAD_ERASING: u32 = 4095;

/// Starts the watchdog, for good.
pub fn start_watchdog() {
    // SAFETY: IWDG is used here before the main loop does.
    let watchdog = unsafe { IWDG::steal() };
    // It runs on while a debugger has stopped the core (DBGMCU_APB1_FZ is left at 0): valves must not stay
    // energised by a program that stands.
    watchdog.kr().write(|w| unsafe { w.bits(KEY_START as _) });
    set_watchdog(&watchdog, 0, RELOAD_SAMPLING);
}

fn set_watchdog(watchdog: &IWDG, prescaler: u32, reload: u32) {
    watchdog.kr().write(|w| unsafe { w.bits(KEY_ACCESS as _) });
    watchdog.pr().write(|w| unsafe { w.bits(prescaler as _) });
    watchdog.rlr().write(|w| unsafe { w.bits(reload as _) });
    // Up to five LSI cycles each: 300 us.
    wait_for(200_000, || watchdog.sr().read().bits() == 0);
    watchdog.kr().write(|w| unsafe { w.bits(KEY_FEED as _) });
}

impl Actuators for ChipActuators {
    fn actuate(&mut self, output: BrakeOutput) {
        self.valves.set(output);
    }

    fn feed_watchdog(&mut self) {
        self.watchdog
            .kr()
            .write(|w| unsafe { w.bits(KEY_FEED as _) });
    }

    fn store(&mut self, parameters: &Parameters) -> Result<(), NotStored> {
        // An erase stalls the core for up to 2 s (data sheet, table 40).
        set_watchdog(&self.watchdog, 4, RELOAD_ERASING);
        let stored = self.store.save(parameters);
        set_watchdog(&self.watchdog, 0, RELOAD_SAMPLING);
        stored.map_err(|_| NotStored)
    }
}
