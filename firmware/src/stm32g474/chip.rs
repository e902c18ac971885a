//! What of the rig is this chip's own: its converters, its start-up, and what the main loop needs of it.

use cortex_m::peripheral::NVIC;
use muslip_control::controller::Identity;
use muslip_control::rates::Rates;
use muslip_record::Parameters;
use stm32g4::stm32g474::{Interrupt, Peripherals};

use super::flash::{Pages, forgives};
use super::settings::{CORE_HZ, CYCLES_PER_SAMPLE, HSI_HZ, RATES};
use super::{clock, table, uart};
use crate::bits::low_u16;
use crate::board::{Started, origin, set_priorities, start_timer};
use crate::chip::Chip;
use crate::fault;
use crate::registers::{Registers, set_up};
use crate::stm32::bus::Bus;
use crate::stm32::rig::{self, Rig, Tables};
use crate::stm32::wait_for;
use crate::stm32::watchdog::Watchdog;

/// Brake first, then clocks, pins and peripherals.
#[allow(unsafe_code, reason = "start-up takes the peripherals")]
pub fn start() -> Started {
    fault::guard_stack();
    let (end, brake_energy_j) = (fault::last_end(), fault::last_brake_energy_j());
    // SAFETY: called once, from `main`, before any interrupt is enabled.
    let p = unsafe { Peripherals::steal() };
    rig::dump_line_low::<Stm32g474>();
    set_up(&table::POWER, &mut Bus);
    let full_clock = clock::start(&p.RCC, &p.PWR, &p.FLASH);
    // RCC_CSR (7.4.30): IWDGRSTF bit 29; RMVF bit 23 clears the flags.
    let [.., reset_flags] = p.RCC.csr().read().bits().to_le_bytes();
    // SAFETY: one bit changes, to a value it may have.
    p.RCC
        .csr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 1 << 23) });
    let (board, loaded) = rig::start();
    let link = uart::start(full_clock);
    let identity = Identity {
        rates: RATES,
        core_clock_hz: if full_clock { CORE_HZ } else { HSI_HZ },
        emulated: false,
        watchdog_reset: reset_flags & 1 << 5 != 0 || end.is_some(),
        reset_flags,
        end,
        slow_clock: !full_clock,
        set_up: rig::registers_hold::<Stm32g474>(),
        parameters: origin(loaded.as_ref()),
        brake_energy_j,
    };
    let parameters = loaded.map_or_else(Parameters::default, |loaded| loaded.parameters);
    Started::new(board, &parameters, identity, link)
}

/// Registers of a converter (21.7).
const ADC_ISR: u32 = 0x00;
const ADC_CR: u32 = 0x08;
const ADC_DR: u32 = 0x40;
const READY: u32 = 1;
const EOC: u32 = 1 << 2;
/// Of CR: on, start, regulator, calibrate.
const ADEN: u32 = 1;
const ADSTART: u32 = 1 << 2;
const ADVREGEN: u32 = 1 << 28;
const ADCAL: u32 = 1 << 31;

/// Of the supply, of the pressure.
const CONVERTERS: [u32; 2] = [table::ADC1, table::ADC2];

impl rig::Chip for Stm32g474 {
    const TABLES: Tables = table::TABLES;
    const RATES: Rates = RATES;
    type Flash = Pages;

    /// Calibrated first (21.4.8, 21.4.9).
    fn start_converters() {
        set_up(&table::CONVERTERS, &mut Bus);
        // t_ADCVREG_STUP is 20 us (DS12288, table 66).
        cortex_m::asm::delay(CORE_HZ / 40_000);
        for adc in CONVERTERS {
            Bus.write(adc + ADC_CR, ADVREGEN | ADCAL);
            wait_for(100_000, || Bus.read(adc + ADC_CR) & ADCAL == 0);
            // Four of its clocks after the calibration, and more.
            cortex_m::asm::delay(100);
            Bus.write(adc + ADC_CR, ADVREGEN | ADEN);
            wait_for(100_000, || Bus.read(adc + ADC_ISR) & READY != 0);
            convert(adc);
            wait_for(100_000, || Bus.read(adc + ADC_ISR) & EOC != 0);
        }
    }

    fn converted() -> [u16; 2] {
        CONVERTERS.map(|adc| {
            let is_there = Bus.read(adc + ADC_ISR) & EOC != 0;
            // Reading it clears the flag.
            let code = low_u16(Bus.read(adc + ADC_DR));
            convert(adc);
            if is_there { code } else { 0 }
        })
    }
}

/// Starts a conversion; what is written as 0 stays as it is, but for the regulator.
fn convert(adc: u32) {
    Bus.write(adc + ADC_CR, ADVREGEN | ADSTART);
}

/// This chip.
pub struct Stm32g474;

impl Chip for Stm32g474 {
    type Board = Rig<Self>;
    type Uart = uart::Uart;

    const CYCLES_PER_SAMPLE: u32 = CYCLES_PER_SAMPLE;

    fn start_sampling() {
        set_priorities(Interrupt::USART2);
        let clock_hz = if clock::runs_at_full_clock() {
            CORE_HZ
        } else {
            HSI_HZ
        };
        start_timer(clock_hz, RATES.sample_hz());
        Watchdog::new(Bus).start();
    }

    fn dump() {
        rig::dump::<Self>();
    }

    fn kick() {
        NVIC::pend(Interrupt::USART2);
    }

    fn log(byte: impl FnOnce() -> Option<u8>) -> bool {
        uart::log(byte)
    }

    fn goes_on_after_nmi() -> bool {
        forgives(&mut Bus)
    }
}
