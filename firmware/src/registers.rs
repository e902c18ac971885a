//! Set-up registers: a board's tables, which start-up writes and afterwards reads back.
//!
//! A write can be lost: on an STM32F405 the one right after a peripheral's clock is enabled is (erratum ES0182, 2.1.13), and a
//! prescaler that was never written shows nowhere but in a valve that moves wrongly. So every clock enable is read
//! back before anything behind it is touched, and at the end all registers are held against their tables; one that
//! differs is the fault `SetUp`.

/// Access to registers by address: the bus of a chip, or a test's stand-in.
pub trait Registers {
    /// Reads 32 bits.
    fn read(&mut self, address: u32) -> u32;
    /// Writes 32 bits.
    fn write(&mut self, address: u32, value: u32);
}

/// What some bits of a register must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setting {
    /// The register, as in the chip's reference manual.
    pub name: &'static str,
    /// Its address.
    pub address: u32,
    /// The bits that are set up; others stay as they are.
    pub mask: u32,
    /// Their value.
    pub value: u32,
    /// Whether they can be read back.
    pub stays: bool,
    /// A clock enable, which is read back before what it enables is touched.
    pub enables: bool,
}

/// A setting of bits that stay; for a constant.
///
/// # Panics
/// A value outside its mask, which stops the build.
pub const fn set(name: &'static str, address: u32, mask: u32, value: u32) -> Setting {
    assert!(value & !mask == 0);
    Setting {
        name,
        address,
        mask,
        value,
        stays: true,
        enables: false,
    }
}

/// A setting of bits that the chip changes by itself, or that read as something else.
pub const fn set_once(name: &'static str, address: u32, mask: u32, value: u32) -> Setting {
    Setting {
        stays: false,
        ..set(name, address, mask, value)
    }
}

/// Clocks switched on.
pub const fn enable(name: &'static str, address: u32, bits: u32) -> Setting {
    Setting {
        enables: true,
        ..set(name, address, bits, bits)
    }
}

/// All 16 bits of a register that has no more.
pub const ALL_16: u32 = 0xFFFF;

/// A port of pins: its address, and the names of the registers that set up a pin.
#[derive(Clone, Copy)]
pub struct Port {
    address: u32,
    names: [&'static str; 5],
}

/// Ports A, B and C of an STM32, the first at this address.
pub const fn ports(address: u32) -> [Port; 3] {
    const STRIDE: u32 = 0x400;
    [
        Port {
            address,
            names: [
                "GPIOA_PUPDR",
                "GPIOA_OSPEEDR",
                "GPIOA_AFRL",
                "GPIOA_AFRH",
                "GPIOA_MODER",
            ],
        },
        Port {
            address: address + STRIDE,
            names: [
                "GPIOB_PUPDR",
                "GPIOB_OSPEEDR",
                "GPIOB_AFRL",
                "GPIOB_AFRH",
                "GPIOB_MODER",
            ],
        },
        Port {
            address: address + 2 * STRIDE,
            names: [
                "GPIOC_PUPDR",
                "GPIOC_OSPEEDR",
                "GPIOC_AFRL",
                "GPIOC_AFRH",
                "GPIOC_MODER",
            ],
        },
    ]
}

impl Port {
    /// Address of the levels of its pins.
    #[must_use]
    pub const fn levels(self) -> u32 {
        self.address + 0x10
    }

    /// Address at which a bit sets the pin of its number, and 16 bits further up resets it.
    #[must_use]
    pub const fn set_reset(self) -> u32 {
        self.address + 0x18
    }
}

/// What a pin is.
#[derive(Clone, Copy)]
pub enum Mode {
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

/// The four settings of a pin, direction last: the same on all STM32 that have a MODER.
pub const fn pin(port: Port, line: u32, mode: Mode) -> [Setting; 4] {
    let (direction, pull, function) = match mode {
        Mode::InputPulledDown => (0b00, 0b10, 0),
        Mode::Output => (0b01, 0b00, 0),
        Mode::Alternate(function) => (0b10, 0b00, function),
        Mode::AlternatePulledUp(function) => (0b10, 0b01, function),
        Mode::AlternatePulledDown(function) => (0b10, 0b10, function),
        Mode::Analog => (0b11, 0b00, 0),
    };
    let Port {
        address,
        names: [pulls, speeds, low, high, modes],
    } = port;
    let field = 0b11 << (2 * line);
    let functions = if line < 8 {
        set(
            low,
            address + 0x20,
            0xF << (4 * line),
            function << (4 * line),
        )
    } else {
        let at = 4 * (line - 8);
        set(high, address + 0x24, 0xF << at, function << at)
    };
    [
        set(pulls, address + 0x0C, field, pull << (2 * line)),
        set(speeds, address + 0x08, field, 0b01 << (2 * line)),
        functions,
        set(modes, address, field, direction << (2 * line)),
    ]
}

/// Sets up registers in order; a clock enable is read back before the next.
pub fn set_up(settings: &[Setting], bus: &mut impl Registers) {
    for setting in settings {
        let Setting {
            address,
            mask,
            value,
            enables,
            ..
        } = *setting;
        let others = bus.read(address) & !mask;
        bus.write(address, others | value);
        if enables {
            bus.read(address);
        }
    }
}

/// The first register of a board's tables that does not hold what it should, and what it holds.
pub fn first_wrong<'a>(
    tables: &[&'a [Setting]],
    bus: &mut impl Registers,
) -> Option<(&'a Setting, u32)> {
    let stays = |setting: &&Setting| setting.stays;
    for setting in tables.iter().copied().flatten().filter(stays) {
        let read = bus.read(setting.address);
        if read & setting.mask != setting.value {
            return Some((setting, read));
        }
    }
    None
}

/// What the tests of every board's tables share.
#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    extern crate std;
    use std::collections::BTreeMap;
    use std::vec::Vec;

    /// Registers, and what becomes of the write after a clock enable.
    #[derive(Default, Clone)]
    pub struct Chip {
        /// What each holds; 0 before it was written.
        pub registers: BTreeMap<u32, u32>,
        enables: Vec<u32>,
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
            if self.enables.contains(&address) && before != value {
                self.fresh = true;
                self.deaf = self.deaf_after == Some((address, value & !before));
            }
        }
    }

    /// A board's tables.
    pub struct Board<'a> {
        /// What start-up writes, in its order.
        pub written: &'a [&'a [Setting]],
        /// What a chip holds before, because it takes waits.
        pub held: &'a [Setting],
        /// What is held against the chip.
        pub checked: &'a [&'a [Setting]],
    }

    impl Board<'_> {
        fn chip(&self) -> Chip {
            let mut chip = Chip::default();
            for setting in self.held {
                *chip.registers.entry(setting.address).or_default() |= setting.value;
            }
            let all = self.written.iter().copied().flatten();
            chip.enables = all
                .filter(|setting| setting.enables)
                .map(|setting| setting.address)
                .collect();
            chip
        }

        fn start(&self, mut chip: Chip) -> Chip {
            for table in self.written {
                set_up(table, &mut chip);
            }
            chip
        }

        /// A chip that was started up.
        pub fn started(&self) -> Chip {
            self.start(self.chip())
        }

        /// No write is lost on a chip that loses the one right after an enable.
        pub fn loses_no_write(&self) {
            assert_eq!(first_wrong(self.checked, &mut self.started()), None);
            let mut lossy = self.chip();
            let enable = lossy.enables[0];
            lossy.write(enable, u32::MAX);
            lossy.write(4, 3);
            assert_eq!(lossy.read(4), 0, "the stand-in loses nothing");
        }

        /// The register whose write is lost where one is lost all the same, after this enable of these bits.
        pub fn lost_after(&self, enable: (u32, u32)) -> Option<&'static str> {
            let mut chip = self.chip();
            chip.deaf_after = Some(enable);
            let mut started = self.start(chip);
            first_wrong(self.checked, &mut started).map(|(setting, _)| setting.name)
        }

        /// Every bit of every setting that stays is missed where it is another; how many there are.
        pub fn every_bit_is_checked(&self) -> u32 {
            let whole = self.started();
            let mut found = 0;
            for (&address, &value) in &whole.registers {
                for bit in 0..32 {
                    let mut chip = whole.clone();
                    chip.registers.insert(address, value ^ 1 << bit);
                    if let Some((wrong, read)) = first_wrong(self.checked, &mut chip) {
                        assert!(wrong.address == address && wrong.mask & 1 << bit != 0);
                        assert_eq!(read, value ^ 1 << bit);
                        found += 1;
                    }
                }
            }
            let mut masks = BTreeMap::<u32, u32>::new();
            let stays = |setting: &&Setting| setting.stays;
            for setting in self.checked.iter().copied().flatten().filter(stays) {
                *masks.entry(setting.address).or_default() |= setting.mask;
            }
            assert_eq!(found, masks.values().map(|mask| mask.count_ones()).sum());
            found
        }
    }

    /// No pin is set up twice.
    pub fn each_pin_once(pins: &[[Setting; 4]]) {
        let mut modes: Vec<_> = pins
            .iter()
            .map(|[.., mode]| (mode.address, mode.mask))
            .collect();
        modes.sort_unstable();
        modes.dedup();
        assert_eq!(modes.len(), pins.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pin_takes_its_own_fields_and_no_others() {
        let [port, _, _] = ports(0x4002_0000);
        let [pull, speed, function, mode] = pin(port, 15, Mode::AlternatePulledUp(1));
        assert_eq!((pull.address, pull.mask), (0x4002_000C, 0xC000_0000));
        assert_eq!((pull.value, speed.value), (0x4000_0000, 0x4000_0000));
        assert_eq!(
            (function.address, function.mask, function.value),
            (0x4002_0024, 0xF000_0000, 0x1000_0000)
        );
        assert_eq!((mode.address, mode.value), (0x4002_0000, 0x8000_0000));
    }
}
