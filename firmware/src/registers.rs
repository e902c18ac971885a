//! The chip's set-up registers: one table that start-up writes and afterwards reads back.
//!
//! A write can be lost: the one right after a peripheral's clock is enabled is (erratum ES0182, 2.1.13), and a
//! prescaler that was never written shows nowhere but in a valve that moves wrongly. So every clock enable is read
//! back before anything behind it is touched, and at the end all registers are held against this table; one that
//! differs is the fault `SetUp`. Sections are RM0090's.

use crate::settings::{
    ADC_DIVIDER_BITS, CORE_HZ, PLL, VALVE_PWM_HZ, VALVE_PWM_PERIOD, VALVE_PWM_PRESCALER,
};

/// Access to registers by address: the bus of the chip, or a test's stand-in.
pub trait Registers {
    /// Reads 32 bits.
    fn read(&mut self, address: u32) -> u32;
    /// Writes 32 bits.
    fn write(&mut self, address: u32, value: u32);
}

/// What some bits of a register must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    /// The register, as in RM0090.
    pub name: &'static str,
    /// Its address (2.3, and the offsets of each chapter).
    pub address: u32,
    /// The bits that are set up; others stay as they are.
    pub mask: u32,
    /// Their value.
    pub value: u32,
    /// Whether they can be read back.
    pub stays: bool,
}

/// A setting of bits that stay.
const fn set(name: &'static str, address: u32, mask: u32, value: u32) -> Setting {
    assert!(value & !mask == 0);
    Setting {
        name,
        address,
        mask,
        value,
        stays: true,
    }
}

const RCC: u32 = 0x4002_3800;
/// Clock enables, which are read back before what they enable is touched.
const ENABLES: [u32; 3] = [RCC + 0x30, RCC + 0x40, RCC + 0x44];
const FLASH: u32 = 0x4002_3C00;
const GPIOA: u32 = 0x4002_0000;
const GPIOB: u32 = 0x4002_0400;
const GPIOC: u32 = 0x4002_0800;
const TIM1: u32 = 0x4001_0000;
const TIM2: u32 = 0x4000_0000;
const TIM3: u32 = 0x4000_0400;
const TIM4: u32 = 0x4000_0800;
const TIM5: u32 = 0x4000_0C00;
const SPI2: u32 = 0x4000_3800;
const ADC1: u32 = 0x4001_2000;
const ADC2: u32 = 0x4001_2100;
const ADC_COMMON: u32 = 0x4001_2300;

/// All 16 bits of a register that has no more.
const ALL_16: u32 = 0xFFFF;

/// What a pin is.
#[derive(Clone, Copy)]
enum Mode {
    /// Digital input with pull-down.
    InputPulledDown,
    /// Push-pull output at medium speed, at the level it was given before.
    Output,
    /// Alternate function with no pull.
    Alternate(u32),
    /// Alternate function with pull-up, for open-collector sensors.
    AlternatePulledUp(u32),
    /// Alternate function with pull-down, for a line whose loss must read low.
    AlternatePulledDown(u32),
    /// Analogue.
    Analog,
}

/// The four settings of a pin, direction last (8.4.1 to 8.4.10).
const fn pin(port: u32, line: u32, mode: Mode) -> [Setting; 4] {
    let (direction, pull, function) = match mode {
        Mode::InputPulledDown => (0b00, 0b10, 0),
        Mode::Output => (0b01, 0b00, 0),
        Mode::Alternate(function) => (0b10, 0b00, function),
        Mode::AlternatePulledUp(function) => (0b10, 0b01, function),
        Mode::AlternatePulledDown(function) => (0b10, 0b10, function),
        Mode::Analog => (0b11, 0b00, 0),
    };
    let [pulls, speeds, low, high, modes] = match port {
        GPIOA => [
            "GPIOA_PUPDR",
            "GPIOA_OSPEEDR",
            "GPIOA_AFRL",
            "GPIOA_AFRH",
            "GPIOA_MODER",
        ],
        GPIOB => [
            "GPIOB_PUPDR",
            "GPIOB_OSPEEDR",
            "GPIOB_AFRL",
            "GPIOB_AFRH",
            "GPIOB_MODER",
        ],
        _ => [
            "GPIOC_PUPDR",
            "GPIOC_OSPEEDR",
            "GPIOC_AFRL",
            "GPIOC_AFRH",
            "GPIOC_MODER",
        ],
    };
    let field = 0b11 << (2 * line);
    let functions = if line < 8 {
        set(low, port + 0x20, 0xF << (4 * line), function << (4 * line))
    } else {
        let at = 4 * (line - 8);
        set(high, port + 0x24, 0xF << at, function << at)
    };
    [
        set(pulls, port + 0x0C, field, pull << (2 * line)),
        set(speeds, port + 0x08, field, 0b01 << (2 * line)),
        functions,
        set(modes, port, field, direction << (2 * line)),
    ]
}

/// Ports A, B and C; then the dump valve's pin, whose level was made low before: an output until TIM1 can have it.
pub const PORTS: [Setting; 1] = [set("RCC_AHB1ENR", RCC + 0x30, 0b111, 0b111)];

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

/// MOE, of TIM1_BDTR: outputs are driven; a break clears it without any program (17.3.12).
pub const OUTPUTS_ON: u32 = 1 << 15;
/// The rest of TIM1_BDTR (17.4.18): BKE, break at a low level; OSSI, outputs low and not floating meanwhile; no AOE, they
/// stay off until the program drives them again; LOCK level 1, so that no later write undoes this.
pub const BREAK: u32 = 1 << 12 | 1 << 10 | 0b01 << 8;

/// Compare value of the dump valve's channel that holds pressure: beyond the counter's end, and so never low.
pub const HOLDS: u32 = VALVE_PWM_PERIOD;

/// Both valves on TIM1 (17.4): the proportional one on channel 1, PWM mode 1 at no duty; the dump valve on channel 2's
/// complementary output alone, the same mode at a duty of none or all, so that one write of one register is either.
pub const VALVES: [Setting; 12] = [
    set("RCC_APB2ENR", RCC + 0x44, 1, 1),
    // OIS: the level of each output while a break keeps it off is low.
    set("TIM1_CR2", TIM1 + 0x04, ALL_16, 0),
    set("TIM1_PSC", TIM1 + 0x28, ALL_16, VALVE_PWM_PRESCALER - 1),
    set("TIM1_ARR", TIM1 + 0x2C, ALL_16, VALVE_PWM_PERIOD - 1),
    Setting {
        // The duty, which moves.
        stays: false,
        ..set("TIM1_CCR1", TIM1 + 0x34, ALL_16, 0)
    },
    Setting {
        // Pressure held or not, at once: without preload.
        stays: false,
        ..set("TIM1_CCR2", TIM1 + 0x38, ALL_16, 0)
    },
    // OC1M = OC2M = 110; OC1PE: the duty changes at the end of a period.
    set(
        "TIM1_CCMR1",
        TIM1 + 0x18,
        ALL_16,
        0b110 << 4 | 1 << 3 | 0b110 << 12,
    ),
    // CC1E, CC2NE: by itself an output N is not inverted (17.3.11).
    set("TIM1_CCER", TIM1 + 0x20, ALL_16, 1 | 1 << 6),
    set("TIM1_BDTR", TIM1 + 0x44, ALL_16 & !OUTPUTS_ON, BREAK),
    Setting {
        // While the emergency stop is open the chip keeps it off.
        stays: false,
        ..set("TIM1_BDTR", TIM1 + 0x44, OUTPUTS_ON, OUTPUTS_ON)
    },
    Setting {
        stays: false,
        ..set("TIM1_EGR", TIM1 + 0x14, ALL_16, 1)
    },
    // ARPE, CEN.
    set("TIM1_CR1", TIM1, ALL_16, 1 << 7 | 1),
];

/// Input filter of counters and captures alike: eight equal samples at the timer's clock (18.4.7: IC1F).
const FILTER: u32 = 0b0011;
const CAPTURE_1: u32 = 1 | FILTER << 4;
const CAPTURE_1_AND_2: u32 = CAPTURE_1 | 1 << 8 | FILTER << 12;

/// Encoder counters and the timers that stamp, all but the counters' start: their count is preset before.
pub const ENCODERS: [Setting; 17] = [
    set("RCC_APB1ENR", RCC + 0x40, 0b1111, 0b1111),
    // Encoder mode on TI1's edges, direction by TI2's level (18.4.3: SMS = 010).
    set("TIM3_CCMR1", TIM3 + 0x18, ALL_16, CAPTURE_1_AND_2),
    set("TIM3_SMCR", TIM3 + 0x08, ALL_16, 0b010),
    set("TIM3_ARR", TIM3 + 0x2C, ALL_16, ALL_16),
    set("TIM4_CCMR1", TIM4 + 0x18, ALL_16, CAPTURE_1_AND_2),
    set("TIM4_SMCR", TIM4 + 0x08, ALL_16, 0b010),
    set("TIM4_ARR", TIM4 + 0x2C, ALL_16, ALL_16),
    // Free-running over 32 bits, capture of TI1's rising edge (18.4.7, 18.4.9).
    set("TIM5_PSC", TIM5 + 0x28, ALL_16, 0),
    set("TIM5_ARR", TIM5 + 0x2C, u32::MAX, u32::MAX),
    set("TIM5_CCMR1", TIM5 + 0x18, ALL_16, CAPTURE_1),
    set("TIM5_CCER", TIM5 + 0x20, ALL_16, 1),
    set("TIM5_CR1", TIM5, ALL_16, 1),
    set("TIM2_PSC", TIM2 + 0x28, ALL_16, 0),
    set("TIM2_ARR", TIM2 + 0x2C, u32::MAX, u32::MAX),
    set("TIM2_CCMR1", TIM2 + 0x18, ALL_16, CAPTURE_1),
    set("TIM2_CCER", TIM2 + 0x20, ALL_16, 1),
    set("TIM2_CR1", TIM2, ALL_16, 1),
];

/// The counters' start; bit 4 of CR1 is their direction, which moves.
pub const COUNTERS_ON: [Setting; 2] = [
    set("TIM3_CR1", TIM3, ALL_16 & !(1 << 4), 1),
    set("TIM4_CR1", TIM4, ALL_16 & !(1 << 4), 1),
];

/// SPI2 in mode 1 at 10.5 MHz (28.5.1): CPHA, master, APB1 by 4, on, software select.
pub const BRIDGE: [Setting; 2] = [
    set("RCC_APB1ENR", RCC + 0x40, 1 << 14, 1 << 14),
    set(
        "SPI2_CR1",
        SPI2,
        ALL_16,
        1 | 1 << 2 | 0b001 << 3 | 1 << 6 | 1 << 8 | 1 << 9,
    ),
];

/// ADC1 on channel 10, PC0, and ADC2 on channel 11, PC1 (13.13: CCR, SMPR1, SQR3, CR2).
pub const CONVERTERS: [Setting; 8] = [
    set("RCC_APB2ENR", RCC + 0x44, 0b11 << 8, 0b11 << 8),
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

/// Sets up registers in order; a clock enable is read back before the next.
pub fn set_up(settings: &[Setting], bus: &mut impl Registers) {
    for setting in settings {
        let Setting {
            address,
            mask,
            value,
            ..
        } = *setting;
        let others = bus.read(address) & !mask;
        bus.write(address, others | value);
        if ENABLES.contains(&address) {
            bus.read(address);
        }
    }
}

/// The first register that does not hold what it should, in the order of start-up, and what it holds.
pub fn first_wrong(bus: &mut impl Registers) -> Option<(&'static Setting, u32)> {
    const GROUPS: [&[Setting]; 9] = [
        &CLOCK,
        &PORTS,
        PINS.as_flattened(),
        &VALVES,
        &DUMP_PIN_ON_TIMER,
        &ENCODERS,
        &COUNTERS_ON,
        &BRIDGE,
        &CONVERTERS,
    ];
    for setting in GROUPS.into_iter().flatten().filter(|setting| setting.stays) {
        let read = bus.read(setting.address);
        if read & setting.mask != setting.value {
            return Some((setting, read));
        }
    }
    None
}

const _: () = assert!(CORE_HZ / VALVE_PWM_PRESCALER / VALVE_PWM_HZ == VALVE_PWM_PERIOD);
const _: () = assert!(VALVE_PWM_PERIOD <= ALL_16);

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::collections::BTreeMap;

    /// Registers, and what becomes of the write after a clock enable.
    #[derive(Default)]
    struct Chip {
        registers: BTreeMap<u32, u32>,
        /// Just enabled, and not read since.
        fresh: bool,
        /// An enable whose next write is lost whatever is read before.
        deaf_after: Option<(u32, u32)>,
        deaf: bool,
    }

    impl Registers for Chip {
        fn read(&mut self, address: u32) -> u32 {
            self.fresh = false;
            self.registers.get(&address).copied().unwrap_or(0)
        }

        fn write(&mut self, address: u32, value: u32) {
            if core::mem::take(&mut self.fresh) || core::mem::take(&mut self.deaf) {
                return;
            }
            let before = self.registers.insert(address, value).unwrap_or(0);
            if ENABLES.contains(&address) && before != value {
                self.fresh = true;
                self.deaf = self.deaf_after == Some((address, value & !before));
            }
        }
    }

    fn started(mut chip: Chip) -> Chip {
        // The clock is set up apart.
        for setting in CLOCK {
            chip.registers.insert(setting.address, setting.value);
        }
        for group in [
            &PORTS[..],
            &DUMP_PIN,
            PINS.as_flattened(),
            &CONVERTERS,
            &VALVES,
            &DUMP_PIN_ON_TIMER,
            &ENCODERS,
            &COUNTERS_ON,
            &BRIDGE,
        ] {
            set_up(group, &mut chip);
        }
        chip
    }

    #[test]
    fn the_write_after_an_enable_is_not_lost() {
        assert_eq!(first_wrong(&mut started(Chip::default())), None);
        // The chip does lose it where the enable is not read back.
        let mut chip = Chip::default();
        chip.write(RCC + 0x44, 1);
        chip.write(TIM1 + 0x28, 3);
        assert_eq!(chip.read(TIM1 + 0x28), 0);
    }

    #[test]
    fn a_register_that_lost_its_write_is_found_by_its_name() {
        for (enable, lost) in [
            ((RCC + 0x30, 0b111), "GPIOC_PUPDR"),
            // TIM1_CR2 is written first, to what it is.
            ((RCC + 0x44, 0b11 << 8), "ADC_CCR"),
            ((RCC + 0x40, 0b1111), "TIM3_CCMR1"),
            ((RCC + 0x40, 1 << 14), "SPI2_CR1"),
        ] {
            let mut chip = started(Chip {
                deaf_after: Some(enable),
                ..Chip::default()
            });
            let wrong = first_wrong(&mut chip).map(|(setting, _)| setting.name);
            assert_eq!(wrong, Some(lost));
        }
    }

    #[test]
    fn every_bit_that_is_set_up_is_checked() {
        let mut checked = 0;
        let whole = started(Chip::default()).registers;
        for (&address, &value) in &whole {
            for bit in 0..32 {
                let mut registers = whole.clone();
                registers.insert(address, value ^ 1 << bit);
                let mut chip = Chip {
                    registers,
                    ..Chip::default()
                };
                if let Some((wrong, read)) = first_wrong(&mut chip) {
                    assert!(wrong.address == address && wrong.mask & 1 << bit != 0);
                    assert_eq!(read, value ^ 1 << bit);
                    checked += 1;
                }
            }
        }
        let bits = |group: &[Setting]| -> u32 {
            let mut masks = BTreeMap::new();
            for setting in group.iter().filter(|setting| setting.stays) {
                *masks.entry(setting.address).or_insert(0) |= setting.mask;
            }
            masks.values().map(|mask: &u32| mask.count_ones()).sum()
        };
        let expected: u32 = [
            &CLOCK[..],
            &PORTS,
            PINS.as_flattened(),
            &VALVES,
            &DUMP_PIN_ON_TIMER,
            &ENCODERS,
            &COUNTERS_ON,
            &BRIDGE,
            &CONVERTERS,
        ]
        .into_iter()
        .map(bits)
        .sum();
        assert_eq!(checked, expected);
        assert!(checked > 500, "{checked}");
    }

    /// Levels of TIM1's channel 1 and channel 2N by what its registers hold (17.3.11, 17.3.12, table 97), at a count, and
    /// whether the break's line is low; `Err` where one floats.
    fn outputs(chip: &mut Chip, count: u32, broken: bool) -> Result<[bool; 2], &'static str> {
        let mut read = |offset| chip.read(TIM1 + offset);
        let (cr2, ccmr1, ccer, bdtr) = (read(0x04), read(0x18), read(0x20), read(0x44));
        let [ccr1, ccr2] = [read(0x34), read(0x38)];
        let breaks = bdtr & 1 << 12 != 0 && broken;
        let driven = bdtr & 1 << 15 != 0 && !breaks;
        let level = |mode: u32, compare: u32| match mode & 0b111 {
            0b110 => count < compare,
            0b100 => false,
            0b101 => true,
            _ => panic!("mode {mode:b}"),
        };
        // The enable of each, its polarity, its idle level.
        let output = |enable: u32, inverted: u32, idle: u32, reference: bool| {
            if ccer & 1 << enable == 0 {
                Err("an output that is not enabled floats")
            } else if driven {
                Ok(reference != (ccer & 1 << inverted != 0))
            } else if bdtr & 1 << 10 == 0 {
                Err("without OSSI an output floats while it is off")
            } else {
                Ok(cr2 & 1 << idle != 0)
            }
        };
        Ok([
            output(0, 1, 8, level(ccmr1 >> 4, ccr1))?,
            output(6, 7, 11, level(ccmr1 >> 12, ccr2))?,
        ])
    }

    #[test]
    fn an_open_emergency_stop_takes_both_valves_off_whatever_the_program_says() {
        let mut chip = started(Chip::default());
        let counts = [0, 1, VALVE_PWM_PERIOD / 2, VALVE_PWM_PERIOD - 1];
        for (duty, holds) in [(0, 0), (9_000, HOLDS), (VALVE_PWM_PERIOD, HOLDS)] {
            chip.write(TIM1 + 0x34, duty);
            chip.write(TIM1 + 0x38, holds);
            for count in counts {
                let driven = outputs(&mut chip, count, false);
                assert_eq!(driven, Ok([count < duty, holds == HOLDS]));
                assert_eq!(outputs(&mut chip, count, true), Ok([false; 2]));
            }
        }
        // So does a dump by any handler, with the line closed.
        chip.write(TIM1 + 0x44, BREAK);
        for count in counts {
            assert_eq!(outputs(&mut chip, count, false), Ok([false; 2]));
        }
    }

    #[test]
    fn a_pin_takes_its_own_fields_and_no_others() {
        let [pull, speed, function, mode] = pin(GPIOA, 15, Mode::AlternatePulledUp(1));
        assert_eq!((pull.address, pull.mask), (0x4002_000C, 0xC000_0000));
        assert_eq!((pull.value, speed.value), (0x4000_0000, 0x4000_0000));
        assert_eq!(
            (function.address, function.mask, function.value),
            (0x4002_0024, 0xF000_0000, 0x1000_0000)
        );
        assert_eq!((mode.address, mode.value), (0x4002_0000, 0x8000_0000));
        // No pin twice.
        let mut modes: std::vec::Vec<_> = PINS
            .iter()
            .map(|pin| (pin[3].address, pin[3].mask))
            .collect();
        modes.sort_unstable();
        modes.dedup();
        assert_eq!(modes.len(), PINS.len());
    }
}
