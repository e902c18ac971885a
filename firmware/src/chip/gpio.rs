//! Pins: docs/rig.md has the same table with its wires.

use stm32f4::stm32f405::{GPIOB, GPIOC};

use super::bus::Bus;
use crate::dump::DUMP_LINE;
use crate::registers::{self, set_up};

/// The dump valve's pin is an output and low: before anything else, with the ports' clock and nothing more.
pub fn dump_line_low(b: &GPIOB) {
    set_up(&registers::PORTS, &mut Bus);
    b.bsrr().write(|w| unsafe { w.bits(1 << (DUMP_LINE + 16)) });
    set_up(&registers::DUMP_PIN, &mut Bus);
}

/// The dump valve's pin is TIM1's, which has it low.
pub fn dump_line_to_timer() {
    set_up(&registers::DUMP_PIN_ON_TIMER, &mut Bus);
}

/// All other pins.
pub fn start(b: &GPIOB, c: &GPIOC) {
    // The bridge converter's select and reset are high before they are outputs.
    b.bsrr().write(|w| unsafe { w.bits(1 << 12) });
    c.bsrr().write(|w| unsafe { w.bits(1 << 5) });
    set_up(registers::PINS.as_flattened(), &mut Bus);
}
