//! The chip's set-up registers. Sections are RM0440's; alternate functions are those of DS12288, tables 13 and 14.

use crate::registers::{ALL_16, Mode, Port, Setting, enable, pin, ports, set};
#[cfg(target_os = "none")]
use crate::stm32::rig::Tables;
use crate::stm32::{encoders, outputs};

use super::settings::{
    ADC_DIVIDER, CORE_HZ, FLASH_WAIT_STATES, PLL, VALVE_PWM_HZ, VALVE_PWM_PERIOD,
    VALVE_PWM_PRESCALER,
};

const RCC: u32 = 0x4002_1000;
const PWR: u32 = 0x4000_7000;
const FLASH: u32 = 0x4002_2000;
/// TIM1, on which the valves are.
pub const TIM1: u32 = 0x4001_2C00;
/// SPI2, on which the bridge's converter is.
pub const SPI2: u32 = 0x4000_3800;
/// The converters of the valves' supply and of the pressure.
pub const ADC1: u32 = 0x5000_0000;
/// The second.
pub const ADC2: u32 = 0x5000_0100;
const ADC_COMMON: u32 = 0x5000_0300;

/// The ports.
pub const PORTS: [Port; 3] = ports(0x4800_0000);
const GPIOA: Port = PORTS[0];
const GPIOB: Port = PORTS[1];
const GPIOC: Port = PORTS[2];

/// Clocks of the ports; then the dump valve's pin, whose level was made low before: an output until TIM1 can have it.
pub const PORT_CLOCKS: [Setting; 1] = [enable("RCC_AHB2ENR", RCC + 0x4C, 0b111)];

/// The dump valve's pin.
pub const DUMP_PIN: [Setting; 4] = pin(GPIOB, 0, Mode::Output);

/// The power control's clock, and the pull-downs of a USB-C port without power off, which would lie on PB6 (6.4.3).
pub const POWER: [Setting; 2] = [
    enable("RCC_APB1ENR1", RCC + 0x58, 1 << 28),
    set("PWR_CR3", PWR + 0x08, 1 << 14, 1 << 14),
];

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
    // Valve; emergency stop, its first channel once more as TIM1's break; the button that confirms.
    pin(GPIOA, 8, Mode::Alternate(6)),
    pin(GPIOB, 1, Mode::InputPulledDown),
    pin(GPIOC, 4, Mode::InputPulledDown),
    pin(GPIOA, 6, Mode::AlternatePulledDown(6)),
    pin(GPIOB, 10, Mode::InputPulledDown),
    // Supply, pressure.
    pin(GPIOC, 0, Mode::Analog),
    pin(GPIOC, 1, Mode::Analog),
];

/// The dump valve's pin as TIM1's channel 2N, once that is set up: what breaks TIM1 takes this pin low as well.
pub const DUMP_PIN_ON_TIMER: [Setting; 4] = pin(GPIOB, 0, Mode::Alternate(6));

/// TIM1's clock; its break comes from the pin alone, as it is (28.6.26: AF1's other sources off, BKINP not inverted).
pub const VALVES_CLOCK: [Setting; 2] = [
    enable("RCC_APB2ENR", RCC + 0x60, 1 << 11),
    set("TIM1_AF1", TIM1 + 0x60, 0x0000_3FFF, 1),
];
/// Both valves.
pub const VALVES: [Setting; 11] = outputs::valves(TIM1, VALVE_PWM_PRESCALER, VALVE_PWM_PERIOD);

/// Clocks of the encoders' timers.
pub const ENCODERS_CLOCK: [Setting; 1] = [enable("RCC_APB1ENR1", RCC + 0x58, 0b1111)];

/// SPI2 in mode 1 at 10.6 MHz (40.9.1, 40.9.2): bytes, told of one by one; CPHA, master, APB1 by 16, on, software select.
pub const BRIDGE: [Setting; 3] = [
    enable("RCC_APB1ENR1", RCC + 0x58, 1 << 14),
    set("SPI2_CR2", SPI2 + 0x04, ALL_16, 0b0111 << 8 | 1 << 12),
    set(
        "SPI2_CR1",
        SPI2,
        ALL_16,
        1 | 1 << 2 | 0b011 << 3 | 1 << 6 | 1 << 8 | 1 << 9,
    ),
];

/// ADC1 on channel 6, PC0, and ADC2 on channel 7, PC1 (21.7: CCR, SMPR1, SQR1), and their regulators on (CR: ADVREGEN, not
/// DEEPPWD); calibration and start take waits.
pub const CONVERTERS: [Setting; 8] = [
    enable("RCC_AHB2ENR", RCC + 0x4C, 1 << 13),
    // CKMODE = 11: AHB by 4.
    set("ADC12_CCR", ADC_COMMON + 0x08, 0b11 << 16, 0b11 << 16),
    set("ADC1_SMPR1", ADC1 + 0x14, 0b111 << 18, 0b111 << 18),
    set("ADC1_SQR1", ADC1 + 0x30, 0x7CF, 6 << 6),
    set("ADC2_SMPR1", ADC2 + 0x14, 0b111 << 21, 0b111 << 21),
    set("ADC2_SQR1", ADC2 + 0x30, 0x7CF, 7 << 6),
    set("ADC1_CR", ADC1 + 0x08, 0b11 << 28, 1 << 28),
    set("ADC2_CR", ADC2 + 0x08, 0b11 << 28, 1 << 28),
];

/// Both UARTs (37.8.1): on, with their buffers of eight bytes, of which one bit of status is each.
pub const UART_CLOCKS: [Setting; 2] = [
    enable("RCC_APB1ENR1", RCC + 0x58, 1 << 17),
    enable("RCC_APB2ENR", RCC + 0x60, 1 << 14),
];

/// What nothing here writes, because it takes waits or a programmer, and what must hold all the same.
pub const CLOCK: [Setting; 7] = {
    let [m, n, _] = PLL;
    [
        // Crystal, clock security and PLL on (7.4.1).
        set(
            "RCC_CR",
            RCC,
            1 << 16 | 1 << 19 | 1 << 24,
            1 << 16 | 1 << 19 | 1 << 24,
        ),
        // From the crystal, R = 2 and on (7.4.4).
        set(
            "RCC_PLLCFGR",
            RCC + 0x0C,
            0x0700_7FF3,
            0b11 | (m - 1) << 4 | n << 8 | 1 << 24,
        ),
        // PLL in use, no bus divided (7.4.3).
        set("RCC_CFGR", RCC + 0x08, 0x3FFC, 0b1100),
        // Range 1, boosted (6.4.1, 6.4.5).
        set("PWR_CR1", PWR, 0b11 << 9, 0b01 << 9),
        set("PWR_CR5", PWR + 0x80, 1 << 8, 0),
        // Wait states, prefetch, both caches (3.7.1).
        set("FLASH_ACR", FLASH, 0x70F, 0x700 | FLASH_WAIT_STATES),
        // Two banks, and reset below 2.8 V (3.7.8: DBANK; BOR_LEV = 100). In the option bytes.
        set(
            "FLASH_OPTR",
            FLASH + 0x20,
            1 << 22 | 0b111 << 8,
            1 << 22 | 0b100 << 8,
        ),
    ]
};

/// All that is held against the chip after start-up, in its order.
pub const CHECKED: [&[Setting]; 13] = [
    &CLOCK,
    &PORT_CLOCKS,
    &POWER,
    PINS.as_flattened(),
    &VALVES_CLOCK,
    &VALVES,
    &DUMP_PIN_ON_TIMER,
    &ENCODERS_CLOCK,
    &encoders::ENCODERS,
    &encoders::COUNTERS_ON,
    &BRIDGE,
    &CONVERTERS,
    &UART_CLOCKS,
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
    spi_packs: true,
    bridge: &BRIDGE,
    checked: &CHECKED,
};

const _: () = assert!(CORE_HZ / VALVE_PWM_PRESCALER / VALVE_PWM_HZ == VALVE_PWM_PERIOD);
const _: () = assert!(ADC_DIVIDER == 4, "CKMODE in CONVERTERS");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::testing::{Board, each_pin_once};

    const BOARD: Board<'_> = Board {
        written: &[
            &PORT_CLOCKS,
            &DUMP_PIN,
            &POWER,
            PINS.as_flattened(),
            &CONVERTERS,
            &VALVES_CLOCK,
            &VALVES,
            &DUMP_PIN_ON_TIMER,
            &ENCODERS_CLOCK,
            &encoders::ENCODERS,
            &encoders::COUNTERS_ON,
            &BRIDGE,
            &UART_CLOCKS,
        ],
        held: &CLOCK,
        checked: &CHECKED,
    };

    #[test]
    fn no_write_is_lost_and_every_bit_is_checked() {
        BOARD.loses_no_write();
        let lost = BOARD.lost_after((RCC + 0x60, 1 << 11));
        assert_eq!(lost, Some("TIM1_AF1"));
        let bits = BOARD.every_bit_is_checked();
        assert!(bits > 500, "{bits}");
    }

    #[test]
    fn no_pin_is_set_up_twice() {
        each_pin_once(&PINS);
        assert!(!PINS.contains(&DUMP_PIN));
    }
}
