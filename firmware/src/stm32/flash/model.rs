//! The driver on a flash as reference manuals describe it, whose power fails in the middle of anything: what each chip's
//! own tests are made of.

extern crate std;

use std::collections::BTreeSet;
use std::ops::Range;
use std::vec;
use std::vec::Vec;

use super::*;
use muslip_control::store::{Loaded, SLOT_BYTES, Store, StoreError};
use muslip_record::Parameters;

/// What a chip's flash does, beyond its interface.
pub trait Model: Interface + Sized {
    /// Of its status: programmed or erased out of turn.
    const SEQUENCE: u32 = 1 << 7;
    /// Of its status: a word programmed twice.
    const TWICE: u32 = 1 << 3;
    /// Of its control register: erase a sector.
    const ERASE: u32 = 1 << 1;
    /// Whether a word carries a code that tells a torn one, so that it is programmed once only.
    const CODED: bool;

    /// Which of the two sectors its control register erases; none other may be.
    fn erased(control: u32) -> usize;

    /// Whether an address is of a register of its own.
    fn is_own(_address: u32) -> bool {
        false
    }

    /// A word is read whose code does not hold.
    fn torn_word_read(_chip: &mut Chip<Self>, _at: usize) {}
}

/// Of the status.
const WRITE_PROTECTED: u32 = 1 << 4;

/// At which word or sector the power fails, with so many bytes of it done from its lower or its upper end.
pub type Cut = (u32, usize, bool);

/// A chip's cells and registers.
pub struct Chip<M> {
    /// The two sectors.
    pub cells: Vec<u8>,
    /// Words that are torn.
    pub torn: BTreeSet<usize>,
    /// A register of its own.
    pub own: u32,
    /// Interrupts that cannot be masked, of which none may end the program.
    pub interrupts: u32,
    control: u32,
    /// Its status.
    pub status: u32,
    cache: u32,
    cache_resets: u32,
    keys: usize,
    locked: bool,
    busy: u32,
    /// The part of a word that waits for its last four bytes.
    begun: Option<(usize, Vec<u8>)>,
    /// Words and sectors done.
    effects: u32,
    cut: Option<Cut>,
    dead: bool,
    protected: bool,
    chip: PhantomData<M>,
}

impl<M: Model> Chip<M> {
    const SECTOR: usize = M::SECTOR_BYTES as usize;

    /// Never written.
    pub fn blank() -> Self {
        Self::with(vec![0xFF; 2 * Self::SECTOR], BTreeSet::new())
    }

    /// As it comes out of a reset.
    fn with(cells: Vec<u8>, torn: BTreeSet<usize>) -> Self {
        Self {
            cells,
            torn,
            own: 0,
            interrupts: 0,
            control: LOCK,
            status: 0,
            cache: DATA_CACHE,
            cache_resets: 0,
            keys: 0,
            locked: true,
            busy: 0,
            begun: None,
            effects: 0,
            cut: None,
            dead: false,
            protected: false,
            chip: PhantomData,
        }
    }

    /// The same before another save.
    fn again(&self) -> Self {
        Self::with(self.cells.clone(), self.torn.clone())
    }

    /// The part of an effect that is done before the power fails: all of it, mostly.
    fn done(&mut self, length: usize) -> Range<usize> {
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
        let (from, mut word) = self.begun.take().unwrap_or((at, Vec::new()));
        let ready = !self.locked && self.control == M::PROGRAM && self.busy == 0;
        if !ready || !from.is_multiple_of(M::WORD) || at != from + word.len() {
            self.status |= M::SEQUENCE;
            return;
        }
        word.extend(value.to_le_bytes());
        if word.len() < M::WORD {
            self.begun = Some((from, word));
            return;
        }
        if self.protected {
            self.status |= WRITE_PROTECTED;
            return;
        }
        let blank = self.cells[from..][..M::WORD].iter().all(|&b| b == 0xFF);
        if M::CODED && (!blank || self.torn.contains(&from)) {
            self.status |= M::TWICE;
            return;
        }
        let done = self.done(M::WORD);
        // One that reads as blank may be torn as well, and refuses to be programmed.
        if M::CODED && done.len() < M::WORD {
            self.torn.insert(from);
        }
        for at in done {
            self.cells[from + at] &= word[at];
        }
    }

    fn erase(&mut self) {
        let from = M::erased(self.control) * Self::SECTOR;
        for at in self.done(Self::SECTOR) {
            self.cells[from + at] = 0xFF;
            self.torn.remove(&((from + at) / M::WORD * M::WORD));
        }
    }

    fn control(&mut self, value: u32) {
        self.control = value;
        let erase = M::ERASE | START_ERASE;
        if value & LOCK != 0 {
            (self.locked, self.keys, self.begun) = (true, 0, None);
        } else if value & erase == erase {
            self.erase();
        }
    }
}

impl<M: Model> Registers for &mut Chip<M> {
    fn read(&mut self, address: u32) -> u32 {
        if address == M::SR {
            if self.dead {
                return M::ERRORS;
            }
            let busy = if self.busy > 0 { BUSY } else { 0 };
            self.busy = self.busy.saturating_sub(1);
            return self.status | busy;
        }
        if address == M::ACR {
            return self.cache;
        }
        if M::is_own(address) {
            return self.own;
        }
        let at = (address - M::START) as usize;
        if self.torn.contains(&(at / M::WORD * M::WORD)) {
            M::torn_word_read(self, at);
        }
        let word: [u8; 4] = self.cells[at..at + 4].try_into().unwrap();
        u32::from_le_bytes(word)
    }

    fn write(&mut self, address: u32, value: u32) {
        if self.dead {
            return;
        }
        if address == M::KEYR {
            self.keys = if KEYS.get(self.keys) == Some(&value) {
                self.keys + 1
            } else {
                0
            };
            self.locked &= self.keys < 2;
        } else if address == M::SR {
            self.status &= !value;
        } else if address == M::CR {
            if self.locked {
                self.status |= M::SEQUENCE;
            } else {
                self.control(value);
            }
        } else if address == M::ACR {
            // It may be reset only while it is off (RM0090, 3.9.1).
            let resets = value & RESET_DATA_CACHE != 0;
            assert!(!resets || value & DATA_CACHE == 0);
            self.cache_resets += u32::from(resets);
            self.cache = value & !RESET_DATA_CACHE;
        } else if M::is_own(address) {
            self.own &= !value;
        } else {
            self.program((address - M::START) as usize, value);
        }
    }
}

fn numbered(number: u16) -> Parameters {
    let mut parameters = Parameters::default();
    parameters.wheel_encoder.pulses_per_revolution = number;
    parameters.drag.zero_code = i32::from(number) * 1000;
    parameters
}

fn save<M: Model>(chip: &mut Chip<M>, number: u16) -> Result<(), StoreError<FlashFailed>> {
    Store::new(ParameterFlash::<M, _>::new(chip)).save(&numbered(number))
}

fn load<M: Model>(chip: &mut Chip<M>) -> Option<Loaded> {
    Store::new(ParameterFlash::<M, _>::new(chip))
        .load()
        .unwrap()
}

/// A chip with saves from 1 to this number.
pub fn saved<M: Model>(numbers: u16) -> Chip<M> {
    let mut chip = Chip::blank();
    for number in 1..=numbers {
        save(&mut chip, number).unwrap();
    }
    chip
}

/// The power fails at this point of a save; then whole parameters are there, the old or the new, and a save works.
fn cut<M: Model>(before: &Chip<M>, number: u16, at: Cut, again: bool) {
    let mut chip = before.again();
    chip.cut = Some(at);
    assert!(save(&mut chip, number).is_err(), "{at:?}");
    let mut chip = chip.again();
    let found = load(&mut chip).map(|loaded| loaded.parameters);
    let old = (number > 1).then(|| numbered(number - 1));
    assert!(
        found == old || found == Some(numbered(number)),
        "save {number}, {at:?}: {found:?}"
    );
    // Every torn word was told of, and none ended the program.
    assert_eq!(chip.interrupts > 0, !chip.torn.is_empty(), "{at:?}");
    if again {
        save(&mut chip, number).unwrap();
        assert_eq!(load(&mut chip).unwrap().parameters, numbered(number));
    }
}

/// A cut at every byte of the save after so many, torn from either end, leaves the old or the new; the number of cuts.
pub fn cuts_of_a_save<M: Model>(saves: u16) -> usize {
    let before = saved::<M>(saves);
    let mut whole = before.again();
    save(&mut whole, saves + 1).unwrap();
    // An erase first where the sector is full and the other one was used.
    let words = (SLOT_BYTES / M::WORD) as u32;
    assert!((words..=words + 1).contains(&whole.effects));
    let mut cuts = 0;
    for effect in 1..=whole.effects {
        for from_above in [false, true] {
            for done in 0..M::WORD {
                cut(
                    &before,
                    saves + 1,
                    (effect, done, from_above),
                    done % 4 <= 1,
                );
                cuts += 1;
            }
        }
    }
    cuts
}

/// A cut in the erase of a full sector after so many of its bytes, from either end, leaves the newest.
pub fn cuts_of_an_erase<M: Model>(done: &[usize]) {
    let full = (2 * M::SECTOR_BYTES as usize / SLOT_BYTES) as u16;
    // Both sectors full, so that what is erased holds old slots.
    let before = saved::<M>(full);
    for (index, &done) in done.iter().enumerate() {
        for from_above in [false, true] {
            cut(&before, full + 1, (1, done, from_above), index % 16 == 0);
        }
    }
    // And in the first words after it, and the last.
    let words = (SLOT_BYTES / M::WORD) as u32;
    for effect in [2, 3, 1 + words] {
        for done in 0..M::WORD {
            cut(&before, full + 1, (effect, done, false), true);
        }
    }
    let mut whole = before;
    save(&mut whole, full + 1).unwrap();
    assert_eq!(load(&mut whole).unwrap().parameters, numbered(full + 1));
}

/// It is locked and the cache is reset after everything, and old errors block nothing.
pub fn locks_and_forgets_old_errors<M: Model>() {
    let mut chip = saved::<M>(1);
    assert!(chip.locked && chip.cache == DATA_CACHE);
    // Body and last word, each with a reset of its own.
    assert_eq!(chip.cache_resets, 2);
    chip.status = M::ERRORS;
    save(&mut chip, 2).unwrap();
    assert_eq!(chip.status & M::ERRORS, 0);
    assert!(chip.locked);
}

/// What is not whole words or sectors of the two is refused and touches nothing.
pub fn refuses_what_is_not_whole<M: Model>() {
    let mut chip = saved::<M>(1);
    let before = chip.cells.clone();
    let mut flash = ParameterFlash::<M, _>::new(&mut chip);
    let (sector, word) = (M::SECTOR_BYTES, M::WORD);
    for (from, to) in [
        (0, 2 * sector),
        (8, sector + 8),
        (2 * sector, 3 * sector),
        (sector, sector),
    ] {
        assert_eq!(flash.erase(from, to), Err(FlashFailed), "{from} {to}");
    }
    let half = word as u32 / 2;
    for (offset, length) in [
        (1, word),
        (half, word),
        (0, word - 1),
        (2 * sector, word),
        (2 * sector - word as u32, 2 * word),
    ] {
        assert_eq!(flash.write(offset, &vec![0; length]), Err(FlashFailed));
    }
    for (offset, length) in [(1, 4), (0, 3), (2 * sector, 4), (2 * sector - 4, 8)] {
        assert_eq!(flash.read(offset, &mut vec![0; length]), Err(FlashFailed));
    }
    assert_eq!(chip.cells, before);
}

/// A save that the chip refuses is an error and changes nothing, and the next one works.
pub fn survives_write_protection<M: Model>() {
    let mut chip = saved::<M>(2);
    chip.protected = true;
    let cells = chip.cells.clone();
    assert!(save(&mut chip, 3).is_err());
    assert!(chip.locked && chip.cells == cells);
    chip.protected = false;
    save(&mut chip, 3).unwrap();
    assert_eq!(load(&mut chip).unwrap().parameters, numbered(3));
}
