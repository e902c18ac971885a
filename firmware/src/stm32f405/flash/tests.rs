//! The driver on a flash interface as RM0090 describes it, whose power fails in the middle of anything.

use super::*;
use muslip_control::store::{Loaded, SLOT_BYTES, Store, StoreError};
use muslip_record::Parameters;
use std::vec;
use std::vec::Vec;

extern crate std;

const SECTOR: usize = SECTOR_BYTES as usize;
const PROGRAMMING_SEQUENCE: u32 = 1 << 7;
const WRITE_PROTECTED: u32 = 1 << 4;

/// What is left undone when the power fails in the middle of a word or of an erase: all but so many bytes, of those at
/// its lower end or at its upper one.
#[derive(Clone, Copy, Debug)]
struct Tear {
    done: usize,
    from_above: bool,
}

impl Tear {
    fn done_of(self, bytes: &mut [u8]) -> &mut [u8] {
        let done = self.done.min(bytes.len());
        let left = bytes.len() - done;
        if self.from_above {
            &mut bytes[left..]
        } else {
            &mut bytes[..done]
        }
    }
}

#[derive(Clone)]
struct Chip {
    cells: Vec<u8>,
    control: u32,
    status: u32,
    cache: u32,
    keys: usize,
    locked: bool,
    busy: u32,
    cache_resets: u32,
    /// Words and sectors done, and at which of them the power fails.
    effects: u32,
    cut: Option<(u32, Tear)>,
    dead: bool,
    protected: bool,
}

impl Chip {
    fn blank() -> Self {
        Self::with(vec![0xFF; 2 * SECTOR])
    }

    /// As it comes out of a reset.
    fn with(cells: Vec<u8>) -> Self {
        Self {
            cells,
            control: LOCK,
            status: 0,
            cache: DATA_CACHE,
            keys: 0,
            locked: true,
            busy: 0,
            cache_resets: 0,
            effects: 0,
            cut: None,
            dead: false,
            protected: false,
        }
    }

    /// Does something to some cells, or part of it and nothing ever after.
    fn affect(&mut self, at: usize, length: usize, work: impl Fn(&mut [u8], usize)) {
        self.effects += 1;
        self.busy = 3;
        let cells = &mut self.cells[at..at + length];
        match self.cut {
            Some((effect, tear)) if effect == self.effects => {
                let from = if tear.from_above {
                    length - tear.done.min(length)
                } else {
                    0
                };
                work(tear.done_of(cells), from);
                self.dead = true;
            }
            _ => work(cells, 0),
        }
    }

    fn program(&mut self, address: u32, value: u32) {
        let ready = !self.locked && self.control == PROGRAM | WORDS && self.busy == 0;
        if !ready || !address.is_multiple_of(4) {
            self.status |= PROGRAMMING_SEQUENCE;
        } else if self.protected {
            self.status |= WRITE_PROTECTED;
        } else {
            let at = (address - START) as usize;
            let bytes = value.to_le_bytes();
            self.affect(at, 4, |cells, from| {
                for (cell, byte) in cells.iter_mut().zip(&bytes[from..]) {
                    *cell &= byte;
                }
            });
        }
    }

    fn erase(&mut self) {
        let sector = self.control >> 3 & 0xF;
        assert!((10..=11).contains(&sector), "sector {sector} is erased");
        let at = (sector as usize - 10) * SECTOR;
        self.affect(at, SECTOR, |cells, _| cells.fill(0xFF));
    }
}

impl Registers for &mut Chip {
    fn read(&mut self, address: u32) -> u32 {
        match address {
            SR if self.dead => ERRORS,
            SR if self.busy > 0 => {
                self.busy -= 1;
                self.status | BUSY
            }
            SR => self.status,
            ACR => self.cache,
            _ => {
                let at = (address - START) as usize;
                let word: [u8; 4] = self.cells[at..at + 4].try_into().unwrap();
                u32::from_le_bytes(word)
            }
        }
    }

    fn write(&mut self, address: u32, value: u32) {
        if self.dead {
            return;
        }
        match address {
            KEYR => {
                self.keys = if KEYS.get(self.keys) == Some(&value) {
                    self.keys + 1
                } else {
                    0
                };
                self.locked &= self.keys < 2;
            }
            SR => self.status &= !value,
            CR if self.locked => self.status |= PROGRAMMING_SEQUENCE,
            CR => {
                self.control = value;
                if value & LOCK != 0 {
                    (self.locked, self.keys) = (true, 0);
                } else if value & (ERASE_SECTOR | START_ERASE) == ERASE_SECTOR | START_ERASE {
                    self.erase();
                }
            }
            ACR => {
                // It may be reset only while it is off (3.9.1).
                let resets = value & RESET_DATA_CACHE != 0;
                assert!(!resets || value & DATA_CACHE == 0);
                self.cache_resets += u32::from(resets);
                self.cache = value;
            }
            _ => self.program(address, value),
        }
    }
}

fn numbered(number: u16) -> Parameters {
    let mut parameters = Parameters::default();
    parameters.wheel_encoder.pulses_per_revolution = number;
    parameters.drag.zero_code = i32::from(number) * 1000;
    parameters
}

fn save(chip: &mut Chip, number: u16) -> Result<(), StoreError<FlashFailed>> {
    Store::new(ParameterFlash::new(chip)).save(&numbered(number))
}

fn load(chip: &mut Chip) -> Option<Loaded> {
    Store::new(ParameterFlash::new(chip)).load().unwrap()
}

/// A chip with saves from 1 to this number.
fn saved(numbers: u16) -> Chip {
    let mut chip = Chip::blank();
    for number in 1..=numbers {
        save(&mut chip, number).unwrap();
    }
    chip
}

/// The power fails at this point of a save; then whole parameters are there, the old or the new, and a save works.
fn cut(before: &Chip, number: u16, at: (u32, Tear), again: bool) {
    let mut chip = before.clone();
    chip.effects = 0;
    chip.cut = Some(at);
    assert!(save(&mut chip, number).is_err(), "{at:?}");
    let mut chip = Chip::with(chip.cells);
    let found = load(&mut chip).map(|loaded| loaded.parameters);
    let old = (number > 1).then(|| numbered(number - 1));
    assert!(
        found == old || found == Some(numbered(number)),
        "save {number}, {at:?}: {found:?}"
    );
    if again {
        save(&mut chip, number).unwrap();
        assert_eq!(load(&mut chip).unwrap().parameters, numbered(number));
    }
}

#[test]
fn a_cut_at_every_byte_of_a_save_torn_from_either_end_leaves_the_old_or_the_new() {
    let mut cuts = 0;
    for saves in [0, 1, 7] {
        let before = saved(saves);
        let mut whole = before.clone();
        whole.effects = 0;
        save(&mut whole, saves + 1).unwrap();
        assert_eq!(whole.effects as usize, SLOT_BYTES / 4);
        for effect in 1..=whole.effects {
            for from_above in [false, true] {
                for done in 0..4 {
                    let tear = Tear { done, from_above };
                    cut(&before, saves + 1, (effect, tear), done == 1);
                    cuts += 1;
                }
            }
        }
    }
    assert_eq!(cuts, 3 * 64 * 8);
}

#[test]
fn a_cut_in_the_erase_of_a_full_sector_from_either_end_leaves_the_newest() {
    let slots = SECTOR / SLOT_BYTES;
    // Both sectors full, so that what is erased holds old slots.
    let before = saved(2 * slots as u16);
    let next = 2 * slots as u16 + 1;
    // Every byte of the first and the last slot, and every slot's edges.
    let ends = (0..SLOT_BYTES).chain(SECTOR - SLOT_BYTES..SECTOR);
    let edges = (1..slots).flat_map(|slot| [slot * SLOT_BYTES - 1, slot * SLOT_BYTES]);
    let places: Vec<_> = ends.chain(edges.step_by(4)).collect();
    assert_eq!(places.len(), 768);
    for (index, done) in places.into_iter().enumerate() {
        for from_above in [false, true] {
            let tear = Tear { done, from_above };
            cut(&before, next, (1, tear), index % 64 == 0);
        }
    }
    // And in the first words after it.
    for effect in [2, 3, 65] {
        for done in 0..4 {
            let tear = Tear {
                done,
                from_above: false,
            };
            cut(&before, next, (effect, tear), true);
        }
    }
    let mut whole = before;
    save(&mut whole, next).unwrap();
    assert_eq!(load(&mut whole).unwrap().parameters, numbered(next));
}

#[test]
fn it_is_locked_and_the_cache_is_reset_after_everything_and_old_errors_block_nothing() {
    let mut chip = saved(1);
    assert!(chip.locked && chip.cache == DATA_CACHE);
    // Body and last word, each with a reset of its own.
    assert_eq!(chip.cache_resets, 2);
    chip.status = ERRORS;
    save(&mut chip, 2).unwrap();
    assert_eq!(chip.status & ERRORS, 0);
    // A protected sector is an error, and nothing changes.
    chip.protected = true;
    let cells = chip.cells.clone();
    assert!(save(&mut chip, 3).is_err());
    assert!(chip.locked && chip.cells == cells);
    chip.protected = false;
    save(&mut chip, 3).unwrap();
    assert_eq!(load(&mut chip).unwrap().parameters, numbered(3));
}

#[test]
fn what_is_not_whole_words_or_sectors_of_the_two_is_refused_and_touches_nothing() {
    let mut chip = saved(1);
    let before = chip.cells.clone();
    let mut flash = ParameterFlash::new(&mut chip);
    let sector = SECTOR_BYTES;
    for (from, to) in [
        (0, 2 * sector),
        (4, sector + 4),
        (2 * sector, 3 * sector),
        (sector, sector),
    ] {
        assert_eq!(flash.erase(from, to), Err(FlashFailed), "{from} {to}");
    }
    for (offset, length) in [(1, 4), (0, 3), (2 * sector, 4), (2 * sector - 4, 8)] {
        let mut bytes = vec![0; length];
        assert_eq!(flash.write(offset, &bytes), Err(FlashFailed));
        assert_eq!(flash.read(offset, &mut bytes), Err(FlashFailed));
    }
    assert_eq!(chip.cells, before);
}
