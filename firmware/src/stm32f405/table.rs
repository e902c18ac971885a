//! The chip's set-up registers. Sections are RM0090's.

use crate::registers::{ALL_16, Mode, Port, Setting, enable, pin, ports, set};
#[cfg(target_os = "none")]
use crate::stm32::rig::Tables;
use crate::stm32::{encoders, outputs};

use super::settings::{
    ADC_DIVIDER_BITS, CORE_HZ, PLL, VALVE_PWM_HZ, VALVE_PWM_PERIOD, VALVE_PWM_PRESCALER,
};

const RCC: u32 = 0x4002_3800;
const FLASH: u32 = 0x4002_3C00;
/// TIM1, on which the valves are.
pub const TIM1: u32 = 0x4001_0000;
/// SPI2, on which the bridge's converter is.
pub const SPI2: u32 = 0x4000_3800;
/// The converters of the valves' supply and of the pressure.
pub const ADC1: u32 = 0x4001_2000;
/// The second.
pub const ADC2: u32 = 0x4001_2100;
const ADC_COMMON: u32 = 0x4001_2300;

/// The ports.
pub const PORTS: [Port; 3] = ports(0x4002_0000);
const GPIOA: Port = PORTS[0];
const GPIOB: Port = PORTS[1];
const GPIOC: Port = PORTS[2];

/// Clocks of the ports; then the dump valve's pin, whose level was made low before: an output until TIM1 can have it.
pub const PORT_CLOCKS: [Setting; 1] = [enable("RCC_AHB1ENR", RCC + 0x30, 0b111)];

/// The dump valve's pin.
pub const DUMP_PIN: [Setting; 4] = pin(GPIOB, 0, Mode::Output);

/// All other pins; docs/rig.md has the same table with its wires.
pub const PINS: [[Setting; 4]; 21] = [
    // Wheel encoder: A to TIM3_CH1 and TIM5_CH1, B to TIM3_CH2.
    pin(GPIOC, 6, Mode::AlternatePulledUp(2)),
    pin(GPIOC, 7, Mode::AlternatePulledUp(2)),
    pin(GPIOA, 0, Mode::AlternatePulledUp(2)),
    // Vehicle encoder: A to TIM4_CH1 and TIM2_CH1, B to TIM4_CH2.
    pin(GPIOB, 6, Mode::AlternatePulledUp(2)),
    pin(GPIOB, 7, Mode::AlternatePulledUp(2)),
    pin(GPIOA, 15, Mode::AlternatePulledUp(1)),
    // Host link and log.
    pin(GPIOA, 2, Mode::Alternate(7)),
    pin(GPIOA, 3, Mode::AlternatePulledUp(7)),
    pin(GPIOA, 9, Mode::Alternate(7)),
    // Bridge converter: select, reset, clock, data in and out.
    pin(GPIOB, 12, Mode::Output),
    pin(GPIOC, 5, Mode::Output),
    pin(GPIOB, 13, Mode::Alternate(5)),
    pin(GPIOB, 14, Mode::Alternate(5)),
    pin(GPIOB, 15, Mode::Alternate(5)),
    // Valve, emergency stop, supply.
    pin(GPIOA, 8, Mode::Alternate(1)),
    pin(GPIOB, 1, Mode::InputPulledDown),
    // The emergency stop's other channel, and the first once more as TIM1's break; the button that confirms.
    pin(GPIOC, 4, Mode::InputPulledDown),
    pin(GPIOA, 6, Mode::AlternatePulledDown(1)),
    pin(GPIOB, 10, Mode::InputPulledDown),
    pin(GPIOC, 0, Mode::Analog),
    // Pressure.
    pin(GPIOC, 1, Mode::Analog),
];

/// The dump valve's pin as TIM1's channel 2N, once that is set up: what breaks TIM1 takes this pin low as well.
pub const DUMP_PIN_ON_TIMER: [Setting; 4] = pin(GPIOB, 0, Mode::Alternate(1));

/// TIM1's clock, and its outputs.
pub const VALVES_CLOCK: [Setting; 1] = [enable("RCC_APB2ENR", RCC + 0x44, 1)];
/// Both valves.
pub const VALVES: [Setting; 11] = outputs::valves(TIM1, VALVE_PWM_PRESCALER, VALVE_PWM_PERIOD);

/// Clocks of the encoders' timers.
pub const ENCODERS_CLOCK: [Setting; 1] = [enable("RCC_APB1ENR", RCC + 0x40, 0b1111)];

/// SPI2 in mode 1 at 10.5 MHz (28.5.1): CPHA, master, APB1 by 4, on, software select.
pub const BRIDGE: [Setting; 2] = [
    enable("RCC_APB1ENR", RCC + 0x40, 1 << 14),
    set(
        "SPI2_CR1",
        SPI2,
        ALL_16,
        1 | 1 << 2 | 0b001 << 3 | 1 << 6 | 1 << 8 | 1 << 9,
    ),
];

/// ADC1 on channel 10, PC0, and ADC2 on channel 11, PC1 (13.13: CCR, SMPR1, SQR3, CR2).
pub const CONVERTERS: [Setting; 8] = [
    enable("RCC_APB2ENR", RCC + 0x44, 0b11 << 8),
    set(
        "ADC_CCR",
        ADC_COMMON + 0x04,
        0b11 << 16,
        ADC_DIVIDER_BITS << 16,
    ),
    set("ADC1_SMPR1", ADC1 + 0x0C, 0b111, 0b111),
    set("ADC1_SQR3", ADC1 + 0x34, 0x1F, 10),
    set("ADC1_CR2", ADC1 + 0x08, 1, 1),
    set("ADC2_SMPR1", ADC2 + 0x0C, 0b111 << 3, 0b111 << 3),
    set("ADC2_SQR3", ADC2 + 0x34, 0x1F, 11),
    set("ADC2_CR2", ADC2 + 0x08, 1, 1),
];

/// What nothing here writes, because it takes waits or a programmer, and what must hold all the same.
pub const CLOCK: [Setting; 5] = {
    let [m, n, p, q] = PLL;
    [
        // Crystal, clock security and PLL on (7.3.1).
        set(
            "RCC_CR",
            RCC,
            1 << 16 | 1 << 19 | 1 << 24,
            1 << 16 | 1 << 19 | 1 << 24,
        ),
        set(
            "RCC_PLLCFGR",
            RCC + 0x04,
            0x0F43_7FFF,
            m | n << 6 | (p / 2 - 1) << 16 | 1 << 22 | q << 24,
        ),
        // PLL in use, AHB undivided, APB1 by 4, APB2 by 2 (7.3.3).
        set(
            "RCC_CFGR",
            RCC + 0x08,
            0b1100 | 0xF << 4 | 0b111 << 10 | 0b111 << 13,
            0b1000 | 0b101 << 10 | 0b100 << 13,
        ),
        // Five wait states, prefetch, both caches (3.9.1).
        set("FLASH_ACR", FLASH, 0x70F, 0x705),
        // Brown-out level 3: reset below 2.7 V (3.9.7; BOR_LEV = 00). In the option bytes: docs/rig.md.
        set("FLASH_OPTCR", FLASH + 0x14, 0b1100, 0),
    ]
};

/// All that is held against the chip after start-up, in its order.
pub const CHECKED: [&[Setting]; 11] = [
    &CLOCK,
    &PORT_CLOCKS,
    PINS.as_flattened(),
    &VALVES_CLOCK,
    &VALVES,
    &DUMP_PIN_ON_TIMER,
    &ENCODERS_CLOCK,
    &encoders::ENCODERS,
    &encoders::COUNTERS_ON,
    &BRIDGE,
    &CONVERTERS,
];

/// All of them.
#[cfg(target_os = "none")]
pub const TABLES: Tables = Tables {
    ports: PORTS,
    port_clocks: &PORT_CLOCKS,
    dump_pin: [&DUMP_PIN, &DUMP_PIN_ON_TIMER],
    pins: PINS.as_flattened(),
    tim1: TIM1,
    valves_clock: &VALVES_CLOCK,
    valves: &VALVES,
    valve_period: VALVE_PWM_PERIOD,
    encoders_clock: &ENCODERS_CLOCK,
    spi: SPI2,
    spi_packs: false,
    bridge: &BRIDGE,
    checked: &CHECKED,
};

const _: () = assert!(CORE_HZ / VALVE_PWM_PRESCALER / VALVE_PWM_HZ == VALVE_PWM_PERIOD);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::testing::{Board, each_pin_once};

    const BOARD: Board<'_> = Board {
        written: &[
            &PORT_CLOCKS,
            &DUMP_PIN,
            PINS.as_flattened(),
            &CONVERTERS,
            &VALVES_CLOCK,
            &VALVES,
            &DUMP_PIN_ON_TIMER,
            &ENCODERS_CLOCK,
            &encoders::ENCODERS,
            &encoders::COUNTERS_ON,
            &BRIDGE,
        ],
        held: &CLOCK,
        checked: &CHECKED,
    };

    #[test]
    fn the_write_after_an_enable_is_not_lost() {
        BOARD.loses_no_write();
    }

    #[test]
    fn a_register_that_lost_its_write_is_found_by_its_name() {
        for (enable, lost) in [
            ((RCC + 0x44, 0b11 << 8), "ADC_CCR"),
            ((RCC + 0x40, 0b1111), "TIM3_CCMR1"),
            ((RCC + 0x40, 1 << 14), "SPI2_CR1"),
        ] {
            assert_eq!(BOARD.lost_after(enable), Some(lost));
        }
    }

    #[test]
    fn every_bit_that_is_set_up_is_checked() {
        let bits = BOARD.every_bit_is_checked();
        assert!(bits > 500, "{bits}");
    }

    #[test]
    fn no_pin_is_set_up_twice() {
        each_pin_once(&PINS);
        // PB0 has its own two.
        assert!(!PINS.contains(&DUMP_PIN));
    }
}
