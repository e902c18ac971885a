//! What of the rig is this chip's own: its converters, and its start-up before all else.
//!
//! None of this runs in QEMU, where RCC, GPIO, TIM1, flash programming and the watchdog are not modelled; it is
//! reviewed against RM0090 (sections are named at each place) and has never run on silicon.

use muslip_control::board::Sensors;
use muslip_control::rates::Rates;
use muslip_control::store::Loaded;
use stm32f4::stm32f405::Peripherals;

use super::flash::Sectors;
use super::settings::{CORE_HZ, RATES};
use super::{clock, table};
use crate::bits::low_u16;
use crate::counter::cycles;
use crate::registers::{Registers, set_up};
use crate::stm32::bus::Bus;
use crate::stm32::rig::{self, Rig, RigSensors, Tables};
use crate::stm32::wait_for;

pub use super::clock::runs_at_full_clock;

/// This chip.
pub struct Stm32f405;

/// What start-up found.
pub struct Up {
    /// The board.
    pub rig: Rig<Stm32f405>,
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
pub fn start(p: &Peripherals) -> Up {
    rig::dump_line_low::<Stm32f405>();
    let full_clock = clock::start(&p.RCC, &p.FLASH);
    // RCC_CSR (7.3.21): IWDGRSTF bit 29; RMVF bit 24 clears the flags.
    let [.., reset_flags] = p.RCC.csr().read().bits().to_le_bytes();
    #[allow(unsafe_code, reason = "a raw register value")]
    // SAFETY: one bit changes, to a value it may have.
    p.RCC
        .csr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 1 << 24) });
    let (rig, loaded) = rig::start();
    Up {
        rig,
        loaded,
        set_up: rig::registers_hold::<Stm32f405>(),
        full_clock,
        reset_flags,
        watchdog_reset: reset_flags & 1 << 5 != 0,
    }
}

/// Registers of a converter (13.13), and its end of conversion.
const ADC_SR: u32 = 0x00;
const ADC_CR2: u32 = 0x08;
const ADC_DR: u32 = 0x4C;
const EOC: u32 = 1 << 1;

/// Of the supply, of the pressure.
const CONVERTERS: [u32; 2] = [table::ADC1, table::ADC2];

impl rig::Chip for Stm32f405 {
    const TABLES: Tables = table::TABLES;
    const RATES: Rates = RATES;
    type Flash = Sectors;

    fn start_converters() {
        set_up(&table::CONVERTERS, &mut Bus);
        // t_STAB is 3 us (data sheet, table 67).
        cortex_m::asm::delay(CORE_HZ / 100_000);
        for adc in CONVERTERS {
            convert(adc);
            wait_for(100_000, || Bus.read(adc + ADC_SR) & EOC != 0);
        }
    }

    fn converted() -> [u16; 2] {
        CONVERTERS.map(|adc| {
            let is_there = Bus.read(adc + ADC_SR) & EOC != 0;
            // Reading it clears the flag.
            let code = low_u16(Bus.read(adc + ADC_DR));
            convert(adc);
            if is_there { code } else { 0 }
        })
    }
}

/// Starts a conversion (13.13.3: ADON, SWSTART).
fn convert(adc: u32) {
    Bus.write(adc + ADC_CR2, 1 | 1 << 30);
}

/// Instructions of one look at the sensors, counted in the emulator, where every bus is ready at once: for docs/rig.md,
/// which adds all waits. There the bridge's first frame, of no converter, is refused: its second is counted as another.
pub fn sampling_instructions() -> u32 {
    // Only called in the emulator, before sampling, where none of these is in use.
    let mut sensors = RigSensors::<Stm32f405>::untouched();
    let start = cycles();
    core::hint::black_box(sensors.read());
    core::hint::black_box(sensors.bridge().read());
    cycles().wrapping_sub(start)
}
