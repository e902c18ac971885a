//! Both valves on TIM1, whose break takes them off: the proportional one on channel 1, the dump valve on channel 2N.

use core::convert::Infallible;

use embedded_hal::digital::{self, OutputPin};
use embedded_hal::pwm::{self, SetDutyCycle};

use crate::bits::low_u16;
use crate::registers::{ALL_16, Registers, Setting, set, set_once};

const CR1: u32 = 0x00;
const EGR: u32 = 0x14;
const CCR1: u32 = 0x34;
const CCR2: u32 = 0x38;
const BDTR: u32 = 0x44;

/// MOE, of BDTR: outputs are driven; a break clears it without any program (17.3.12).
const OUTPUTS_ON: u32 = 1 << 15;
/// The rest of BDTR (17.4.18): BKE, break at a low level; OSSI, outputs low and not floating meanwhile; no AOE, they
/// stay off until the program drives them again; LOCK level 1, so that no later write undoes this.
const BREAK: u32 = 1 << 12 | 1 << 10 | 0b01 << 8;

/// TIM1 (17.4), whose clock runs, with a PWM of so many steps: the proportional valve on channel 1, PWM mode 1 at no duty;
/// the dump valve on channel 2's complementary output alone, the same mode at a duty of none or all, so that one write of
/// one register is either.
///
/// # Panics
/// A period longer than the counter, which stops the build of a constant.
pub const fn valves(tim1: u32, prescaler: u32, period: u32) -> [Setting; 11] {
    assert!(period <= ALL_16);
    [
        // OIS: the level of each output while a break keeps it off is low.
        set("TIM1_CR2", tim1 + 0x04, ALL_16, 0),
        set("TIM1_PSC", tim1 + 0x28, ALL_16, prescaler - 1),
        set("TIM1_ARR", tim1 + 0x2C, ALL_16, period - 1),
        // The duty; and pressure held or not, at once: without preload.
        set_once("TIM1_CCR1", tim1 + CCR1, ALL_16, 0),
        set_once("TIM1_CCR2", tim1 + CCR2, ALL_16, 0),
        // OC1M = OC2M = 110; OC1PE: the duty changes at the end of a period.
        set(
            "TIM1_CCMR1",
            tim1 + 0x18,
            ALL_16,
            0b110 << 4 | 1 << 3 | 0b110 << 12,
        ),
        // CC1E, CC2NE: by itself an output N is not inverted (17.3.11).
        set("TIM1_CCER", tim1 + 0x20, ALL_16, 1 | 1 << 6),
        set("TIM1_BDTR", tim1 + BDTR, ALL_16 & !OUTPUTS_ON, BREAK),
        // While the emergency stop is open the chip keeps it off.
        set_once("TIM1_BDTR", tim1 + BDTR, OUTPUTS_ON, OUTPUTS_ON),
        set_once("TIM1_EGR", tim1 + EGR, ALL_16, 1),
        // ARPE, CEN.
        set("TIM1_CR1", tim1 + CR1, ALL_16, 1 << 7 | 1),
    ]
}

/// Takes both outputs off, from any context and before start-up as well: registers are written whole, so that no other
/// context's read-modify-write can undo it. Without MOE both are off at once, not from the PWM's next period on.
pub fn off(tim1: u32, bus: &mut impl Registers) {
    bus.write(tim1 + BDTR, BREAK);
    bus.write(tim1 + CCR2, 0);
    bus.write(tim1 + CCR1, 0);
}

/// The proportional valve's PWM.
pub struct ValvePwm<B> {
    bus: B,
    tim1: u32,
    period: u16,
}

/// The dump valve's pin.
pub struct DumpPin<B> {
    bus: B,
    tim1: u32,
    /// Compare value that holds pressure: beyond the counter's end, and so never low.
    holds: u16,
}

/// Both, on a TIM1 that was set up with [`valves`].
pub fn outputs<B: Registers + Copy>(bus: B, tim1: u32, period: u32) -> (ValvePwm<B>, DumpPin<B>) {
    let period = low_u16(period);
    (
        ValvePwm { bus, tim1, period },
        DumpPin {
            bus,
            tim1,
            holds: period,
        },
    )
}

impl<B> pwm::ErrorType for ValvePwm<B> {
    type Error = Infallible;
}

impl<B: Registers> SetDutyCycle for ValvePwm<B> {
    fn max_duty_cycle(&self) -> u16 {
        self.period
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.bus.write(self.tim1 + CCR1, u32::from(duty));
        if duty == 0 {
            // The duty of 0 is taken at once (UG), then outputs are driven again that a break has switched off: not
            // before, and not while there is still a duty.
            self.bus.write(self.tim1 + EGR, 1);
            self.bus.write(self.tim1 + BDTR, BREAK | OUTPUTS_ON);
        }
        Ok(())
    }
}

impl<B> digital::ErrorType for DumpPin<B> {
    type Error = Infallible;
}

impl<B: Registers> OutputPin for DumpPin<B> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.bus.write(self.tim1 + CCR2, 0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.bus.write(self.tim1 + CCR2, u32::from(self.holds));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::set_up;
    use crate::registers::testing::Chip;
    use crate::valves::Valves;
    use core::cell::RefCell;
    use muslip_control::brake::BrakeOutput;

    const TIM1: u32 = 0x4001_0000;
    const PERIOD: u32 = 21_000;

    #[derive(Clone, Copy)]
    struct Shared<'a>(&'a RefCell<Chip>);

    impl Registers for Shared<'_> {
        fn read(&mut self, address: u32) -> u32 {
            self.0.borrow_mut().read(address)
        }

        fn write(&mut self, address: u32, value: u32) {
            self.0.borrow_mut().write(address, value);
        }
    }

    /// Levels of channel 1 and channel 2N by what the registers hold (17.3.11, 17.3.12, table 97), at a count, while the
    /// break's line is low or not; an error where one floats.
    fn levels(
        bus: &mut impl Registers,
        count: u32,
        broken: bool,
    ) -> Result<[bool; 2], &'static str> {
        let mut read = |offset| bus.read(TIM1 + offset);
        let (cr2, modes, ccer, bdtr) = (read(0x04), read(0x18), read(0x20), read(BDTR));
        let [compare_1, compare_2] = [read(CCR1), read(CCR2)];
        let breaks = bdtr & 1 << 12 != 0 && broken;
        let driven = bdtr & OUTPUTS_ON != 0 && !breaks;
        let reference = |mode: u32, compare: u32| match mode & 0b111 {
            0b110 => count < compare,
            0b100 => false,
            0b101 => true,
            _ => panic!("mode {mode:b}"),
        };
        // The bits of its enable, its polarity, its idle level.
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
            output(0, 1, 8, reference(modes >> 4, compare_1))?,
            output(6, 7, 11, reference(modes >> 12, compare_2))?,
        ])
    }

    #[test]
    fn an_open_emergency_stop_takes_both_valves_off_whatever_the_program_says() {
        let chip = RefCell::new(Chip::default());
        let mut bus = Shared(&chip);
        set_up(&valves(TIM1, 4, PERIOD), &mut bus);
        let (proportional, dump) = outputs(bus, TIM1, PERIOD);
        let mut valves = Valves::new(proportional, dump);
        let counts = [0, 1, PERIOD / 2, PERIOD - 1];
        for valve_duty in [0, 20_000, u16::MAX] {
            for hold_pressure in [false, true] {
                valves.set(BrakeOutput {
                    valve_duty,
                    hold_pressure,
                });
                let steps = if hold_pressure {
                    u32::from(valve_duty) * PERIOD / 65_535
                } else {
                    0
                };
                for count in counts {
                    let driven = [count < steps, hold_pressure];
                    assert_eq!(levels(&mut bus, count, false), Ok(driven));
                    assert_eq!(levels(&mut bus, count, true), Ok([false; 2]));
                }
            }
        }
        // So does a dump by any handler, with the line closed; and they stay off until the program dumps as well.
        off(TIM1, &mut bus);
        for hold_pressure in [true, false, true] {
            for count in counts {
                let expected = levels(&mut bus, count, false);
                assert!(
                    expected == Ok([false; 2])
                        || chip.borrow().registers[&(TIM1 + BDTR)] & OUTPUTS_ON != 0
                );
            }
            valves.set(BrakeOutput {
                valve_duty: 30_000,
                hold_pressure,
            });
        }
        assert_eq!(levels(&mut bus, 0, false), Ok([true; 2]));
    }
}
