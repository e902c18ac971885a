//! The driver on a flash interface as RM0440 describes it, whose power fails in the middle of anything.

use super::*;
use muslip_control::store::{Loaded, SLOT_BYTES, Store, StoreError};
use muslip_record::Parameters;

extern crate std;
use std::collections::BTreeSet;
use std::vec;
use std::vec::Vec;

const PAGES: usize = 2 * PAGE_BYTES as usize;
const PROGRAMMING: u32 = 1 << 3;
const SEQUENCE: u32 = 1 << 7;

/// Cells, of which some double words have an error of two bits: they read as they are, and are told of.
#[derive(Clone)]
struct Chip {
    cells: Vec<u8>,
    broken: BTreeSet<usize>,
    control: u32,
    status: u32,
    ecc: u32,
    cache: u32,
    keys: usize,
    locked: bool,
    busy: u32,
    /// The lower half of a double word that waits for its upper one.
    lower: Option<(usize, u32)>,
    /// Double words and pages done, and at which of them the power fails, with so many bytes of it done from its lower or
    /// upper end.
    effects: u32,
    cut: Option<(u32, usize, bool)>,
    dead: bool,
    /// Interrupts that cannot be masked, of which none may end the program.
    interrupts: u32,
}

impl Chip {
    fn blank() -> Self {
        Self::with(vec![0xFF; PAGES], BTreeSet::new())
    }

    /// As it comes out of a reset.
    fn with(cells: Vec<u8>, broken: BTreeSet<usize>) -> Self {
        Self {
            cells,
            broken,
            control: LOCK,
            status: 0,
            ecc: 0,
            cache: DATA_CACHE,
            keys: 0,
            locked: true,
            busy: 0,
            lower: None,
            effects: 0,
            cut: None,
            dead: false,
            interrupts: 0,
        }
    }

    /// The part of an effect that is done before the power fails: all of it, mostly.
    fn done(&mut self, length: usize) -> std::ops::Range<usize> {
        self.effects += 1;
        self.busy = 3;
        match self.cut {
            Some((effect, done, from_above)) if effect == self.effects => {
                self.dead = true;
                let done = done.min(length);
                if from_above {
                    length - done..length
                } else {
                    0..done
                }
            }
            _ => 0..length,
        }
    }

    fn program(&mut self, at: usize, value: u32) {
        if self.locked || self.control != PROGRAM || self.busy > 0 {
            self.status |= SEQUENCE;
            return;
        }
        let Some((lower_at, lower)) = self.lower.take() else {
            if at.is_multiple_of(WORD) {
                self.lower = Some((at, value));
            } else {
                self.status |= SEQUENCE;
            }
            return;
        };
        let mut word = [0; WORD];
        word[..4].copy_from_slice(&lower.to_le_bytes());
        word[4..].copy_from_slice(&value.to_le_bytes());
        let blank = self.cells[lower_at..][..WORD].iter().all(|&b| b == 0xFF);
        if at != lower_at + 4 || !blank || self.broken.contains(&lower_at) {
            // Programmed before, if only in part: its ECC would be of two words.
            self.status |= PROGRAMMING;
            return;
        }
        let done = self.done(WORD);
        if done.len() < WORD && !done.is_empty() {
            self.broken.insert(lower_at);
        }
        self.cells[lower_at..][done.clone()].copy_from_slice(&word[done]);
    }

    fn erase(&mut self) {
        assert_eq!(self.control & BANK_2, BANK_2, "bank 1 is the program's");
        let page = (self.control >> 3 & 0x7F) as usize;
        assert!((126..128).contains(&page), "page {page} is erased");
        let from = (page - 126) * PAGE_BYTES as usize;
        let done = self.done(PAGE_BYTES as usize);
        for at in done {
            self.cells[from + at] = 0xFF;
            self.broken.remove(&((from + at) / WORD * WORD));
        }
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
            ECCR => self.ecc,
            _ => {
                let at = (address - START) as usize;
                if self.broken.contains(&(at / WORD * WORD)) {
                    // Of bank 2, by its place there; then the interrupt, which goes on.
                    self.ecc = TWO_BITS | ECC_BANK_2 | ((START & 0x3_FFFF) + at as u32);
                    self.interrupts += 1;
                    assert!(forgives(self));
                    assert_eq!(self.ecc & TWO_BITS, 0, "told of once");
                }
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
            ECCR => self.ecc &= !(value & TWO_BITS),
            CR if self.locked => self.status |= SEQUENCE,
            CR => {
                self.control = value;
                if value & LOCK != 0 {
                    (self.locked, self.keys, self.lower) = (true, 0, None);
                } else if value & (ERASE_PAGE | START_ERASE) == ERASE_PAGE | START_ERASE {
                    self.erase();
                }
            }
            ACR => {
                let resets = value & RESET_DATA_CACHE != 0;
                assert!(!resets || value & DATA_CACHE == 0);
                self.cache = value & !RESET_DATA_CACHE;
            }
            _ => self.program((address - START) as usize, value),
        }
    }
}

fn numbered(number: u16) -> Parameters {
    let mut parameters = Parameters::default();
    parameters.wheel_encoder.pulses_per_revolution = number;
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

/// The power fails at this point of a save: whole parameters are there, the old or the new, and a save works.
fn cut(before: &Chip, number: u16, at: (u32, usize, bool)) {
    let mut chip = before.clone();
    (chip.effects, chip.cut) = (0, Some(at));
    assert!(save(&mut chip, number).is_err(), "{at:?}");
    let mut chip = Chip::with(chip.cells, chip.broken);
    let found = load(&mut chip).map(|loaded| loaded.parameters);
    let old = (number > 1).then(|| numbered(number - 1));
    assert!(
        found == old || found == Some(numbered(number)),
        "save {number}, {at:?}: {found:?}"
    );
    // Every torn double word was told of, and none ended the program.
    assert_eq!(chip.interrupts > 0, !chip.broken.is_empty(), "{at:?}");
    save(&mut chip, number).unwrap();
    assert_eq!(load(&mut chip).unwrap().parameters, numbered(number));
}

#[test]
fn a_cut_in_every_double_word_of_a_save_torn_from_either_end_leaves_the_old_or_the_new() {
    let mut cuts = 0;
    for saves in [0, 1, 7, 8, 15] {
        let before = saved(saves);
        let mut whole = before.clone();
        whole.effects = 0;
        save(&mut whole, saves + 1).unwrap();
        let words = (SLOT_BYTES / WORD) as u32;
        // An erase first where the page is full and the other one was used.
        assert!((words..=words + 1).contains(&whole.effects));
        for effect in 1..=whole.effects {
            for from_above in [false, true] {
                for done in 0..WORD {
                    cut(&before, saves + 1, (effect, done, from_above));
                    cuts += 1;
                }
            }
        }
    }
    assert!(cuts >= 5 * 32 * 16, "{cuts}");
}

#[test]
fn a_cut_at_every_byte_of_an_erase_from_either_end_leaves_the_newest() {
    let slots = (PAGES / SLOT_BYTES) as u16;
    let before = saved(slots);
    for done in 0..PAGE_BYTES as usize {
        for from_above in [false, true] {
            cut(&before, slots + 1, (1, done, from_above));
        }
    }
}

#[test]
fn it_is_locked_after_everything_and_old_errors_block_nothing() {
    let mut chip = saved(1);
    assert!(chip.locked && chip.cache == DATA_CACHE);
    chip.status = ERRORS;
    save(&mut chip, 2).unwrap();
    assert_eq!(chip.status & ERRORS, 0);
    assert!(chip.locked);
}

#[test]
fn only_an_error_of_two_bits_among_the_parameters_is_forgiven() {
    let place = START & 0x3_FFFF;
    for (told, expected) in [
        (TWO_BITS | ECC_BANK_2 | place, true),
        (TWO_BITS | ECC_BANK_2 | (place + 4088), true),
        // The program's bank, below the parameters, no error at all: the crystal's interrupt.
        (TWO_BITS | place, false),
        (TWO_BITS | ECC_BANK_2 | (place - 8), false),
        (0, false),
    ] {
        let mut chip = Chip::blank();
        chip.ecc = told;
        assert_eq!(forgives(&mut &mut chip), expected, "{told:08x}");
    }
}

#[test]
fn what_is_not_whole_double_words_or_pages_of_the_two_is_refused_and_touches_nothing() {
    let mut chip = saved(1);
    let before = chip.cells.clone();
    let mut flash = ParameterFlash::new(&mut chip);
    for (from, to) in [
        (0, 2 * PAGE_BYTES),
        (8, PAGE_BYTES + 8),
        (2 * PAGE_BYTES, 3 * PAGE_BYTES),
        (PAGE_BYTES, PAGE_BYTES),
    ] {
        assert_eq!(flash.erase(from, to), Err(FlashFailed), "{from} {to}");
    }
    for (offset, length) in [
        (4, 8),
        (0, 4),
        (2 * PAGE_BYTES, 8),
        (2 * PAGE_BYTES - 8, 16),
    ] {
        let bytes = vec![0; length];
        assert_eq!(flash.write(offset, &bytes), Err(FlashFailed));
    }
    assert_eq!(chip.cells, before);
}
