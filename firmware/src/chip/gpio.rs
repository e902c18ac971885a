//! Pins (8.4): docs/rig.md has the same table with its wires.

use stm32f4::stm32f405::{GPIOA, GPIOB, GPIOC, RCC};

use crate::dump::DUMP_LINE;

/// What a pin is.
#[derive(Clone, Copy)]
enum Mode {
    /// Digital input without pull: 0; with pull-down.
    InputPulledDown,
    /// Push-pull output at medium speed, at the level it was given before.
    Output,
    /// Alternate function with no pull.
    Alternate(u32),
    /// Alternate function with pull-up, for open-collector sensors.
    AlternatePulledUp(u32),
    /// Analogue.
    Analog,
}

macro_rules! pin {
    ($port:expr, $line:expr, $mode:expr) => {{
        let line: u32 = $line;
        let (mode, pull, function) = match $mode {
            Mode::InputPulledDown => (0b00, 0b10, 0),
            Mode::Output => (0b01, 0b00, 0),
            Mode::Alternate(function) => (0b10, 0b00, function),
            Mode::AlternatePulledUp(function) => (0b10, 0b01, function),
            Mode::Analog => (0b11, 0b00, 0),
        };
        let with = |bits: u32, width: u32, at: u32, value: u32| {
            bits & !(((1 << width) - 1) << at) | value << at
        };
        // SAFETY of raw bits: one field changes, to a value that 8.4.1 to 8.4.10 give.
        $port
            .pupdr()
            .modify(|r, w| unsafe { w.bits(with(r.bits(), 2, 2 * line, pull)) });
        $port
            .ospeedr()
            .modify(|r, w| unsafe { w.bits(with(r.bits(), 2, 2 * line, 0b01)) });
        if line < 8 {
            $port
                .afrl()
                .modify(|r, w| unsafe { w.bits(with(r.bits(), 4, 4 * line, function)) });
        } else {
            $port
                .afrh()
                .modify(|r, w| unsafe { w.bits(with(r.bits(), 4, 4 * (line - 8), function)) });
        }
        $port
            .moder()
            .modify(|r, w| unsafe { w.bits(with(r.bits(), 2, 2 * line, mode)) });
    }};
}

/// The dump valve's pin is an output and low: before anything else, with port B's clock and nothing more.
pub fn dump_line_low(rcc: &RCC, b: &GPIOB) {
    rcc.ahb1enr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 0b111) });
    b.bsrr().write(|w| unsafe { w.bits(1 << (DUMP_LINE + 16)) });
    pin!(b, DUMP_LINE, Mode::Output);
}

/// All other pins.
pub fn start(rcc: &RCC, a: &GPIOA, b: &GPIOB, c: &GPIOC) {
    rcc.ahb1enr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 0b111) });
    // Wheel encoder: A to TIM3_CH1 and TIM5_CH1, B to TIM3_CH2.
    pin!(c, 6, Mode::AlternatePulledUp(2));
    pin!(c, 7, Mode::AlternatePulledUp(2));
    pin!(a, 0, Mode::AlternatePulledUp(2));
    // Vehicle encoder: A to TIM4_CH1 and TIM2_CH1, B to TIM4_CH2.
    pin!(b, 6, Mode::AlternatePulledUp(2));
    pin!(b, 7, Mode::AlternatePulledUp(2));
    pin!(a, 15, Mode::AlternatePulledUp(1));
    // Host link and log.
    pin!(a, 2, Mode::Alternate(7));
    pin!(a, 3, Mode::AlternatePulledUp(7));
    pin!(a, 9, Mode::Alternate(7));
    // Bridge converter: select and reset high, then clock, data in and out.
    b.bsrr().write(|w| unsafe { w.bits(1 << 12) });
    c.bsrr().write(|w| unsafe { w.bits(1 << 5) });
    pin!(b, 12, Mode::Output);
    pin!(c, 5, Mode::Output);
    for line in 13..=15 {
        pin!(b, line, Mode::Alternate(5));
    }
    // Valve, emergency stop, supply.
    pin!(a, 8, Mode::Alternate(1));
    pin!(b, super::EMERGENCY_STOP_LINE, Mode::InputPulledDown);
    pin!(c, 0, Mode::Analog);
}
