//! A power cut at any write or erase leaves the old parameters or the new ones, never a mix.
#![allow(clippy::unwrap_used, reason = "a failed step fails the test")]

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use muslip_control::store::{Loaded, SLOT_BYTES, Store};
use muslip_record::Parameters;

/// Sectors of eight slots, so that a test goes round often.
const SECTOR: usize = 8 * SLOT_BYTES;

/// Flash that loses power after a number of words or erase steps, and does what real flash does: bits go
/// from 1 to 0 by word, and from 0 to 1 by sector.
#[derive(Clone)]
struct Flash<const WORD: usize = 4> {
    bytes: Vec<u8>,
    /// Operations until the power is cut.
    left: usize,
    /// How a torn word or sector looks.
    torn: Torn,
    operations: usize,
}

#[derive(Clone, Copy, Debug)]
enum Torn {
    /// The word as it was; the sector half erased.
    Untouched,
    /// Half of the bits done; the sector all erased but for its end.
    Half,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct PowerCut;

impl NorFlashError for PowerCut {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const WORD: usize> Flash<WORD> {
    fn blank() -> Self {
        Self {
            bytes: vec![0xFF; 2 * SECTOR],
            left: usize::MAX,
            torn: Torn::Half,
            operations: 0,
        }
    }

    fn cut(&mut self) -> bool {
        self.operations += 1;
        self.left = self.left.saturating_sub(1);
        self.left == 0
    }
}

impl<const WORD: usize> ErrorType for Flash<WORD> {
    type Error = PowerCut;
}

impl<const WORD: usize> ReadNorFlash for Flash<WORD> {
    const READ_SIZE: usize = 1;
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        if self.left == 0 {
            return Err(PowerCut);
        }
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }
    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WORD: usize> NorFlash for Flash<WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        if self.left == 0 {
            return Err(PowerCut);
        }
        let (from, mut to) = (from as usize, to as usize);
        assert!(from % SECTOR == 0 && to == from + SECTOR);
        let cut = self.cut();
        if cut {
            to = match self.torn {
                Torn::Untouched => from + SECTOR / 2,
                Torn::Half => to - 3,
            };
        }
        self.bytes[from..to].fill(0xFF);
        if cut { Err(PowerCut) } else { Ok(()) }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        assert!((offset as usize).is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
        for (index, word) in bytes.chunks(WORD).enumerate() {
            if self.left == 0 {
                return Err(PowerCut);
            }
            let cut = self.cut();
            for (place, &byte) in self.bytes[offset as usize + WORD * index..]
                .iter_mut()
                .zip(word)
            {
                let written = match (cut, self.torn) {
                    (false, _) => byte,
                    (true, Torn::Untouched) => 0xFF,
                    (true, Torn::Half) => byte | 0x5A,
                };
                *place &= written;
            }
            if cut {
                return Err(PowerCut);
            }
        }
        Ok(())
    }
}

fn numbered(number: u16) -> Parameters {
    let mut parameters = Parameters::default();
    parameters.wheel_encoder.pulses_per_revolution = number;
    parameters.drag.zero_code = i32::from(number) * 1000;
    parameters
}

fn newest(number: u16) -> Loaded {
    Loaded {
        parameters: numbered(number),
        newest: true,
    }
}

fn loaded<const WORD: usize>(flash: &Flash<WORD>) -> Option<Parameters> {
    everything_loaded(flash).map(|loaded| loaded.parameters)
}

fn everything_loaded<const WORD: usize>(flash: &Flash<WORD>) -> Option<Loaded> {
    let flash = Flash {
        left: usize::MAX,
        ..flash.clone()
    };
    Store::new(flash).load().unwrap()
}

#[test]
fn a_blank_flash_holds_nothing_and_the_last_save_counts() {
    let mut flash = Flash::<4>::blank();
    assert_eq!(loaded(&flash), None);
    for number in 1..50 {
        let mut store = Store::new(flash);
        store.save(&numbered(number)).unwrap();
        assert_eq!(store.load(), Ok(Some(newest(number))));
        flash = store.into_inner();
    }
}

#[test]
fn a_cut_at_every_operation_of_every_save_leaves_the_old_or_the_new_whole() {
    let cuts = cuts_in_words_of::<4>();
    println!("{cuts} cuts");
    assert!(cuts > 3000);
    // Words of other chips: STM32G4 8, STM32U5 16, STM32H7 32 bytes.
    cuts_in_words_of::<8>();
    cuts_in_words_of::<16>();
    cuts_in_words_of::<32>();
}

fn cuts_in_words_of<const WORD: usize>() -> u32 {
    let mut cuts = 0;
    for torn in [Torn::Untouched, Torn::Half] {
        let mut flash = Flash::<WORD> {
            torn,
            ..Flash::blank()
        };
        // Far enough to fill both sectors and erase each of them.
        for number in 1..30_u16 {
            let old = loaded(&flash);
            let new = Some(numbered(number));
            let mut whole = Store::new(Flash {
                operations: 0,
                ..flash.clone()
            });
            whole.save(&numbered(number)).unwrap();
            let whole = whole.into_inner();
            for left in 1..=whole.operations {
                let mut store = Store::new(Flash {
                    left,
                    ..flash.clone()
                });
                assert!(store.save(&numbered(number)).is_err());
                let mut cut = store.into_inner();
                let found = loaded(&cut);
                assert!(
                    found == old || found == new,
                    "{torn:?} save {number} cut {left}"
                );
                cuts += 1;
                // And saving works again after it, cut once more in the same place or not.
                cut.left = usize::MAX;
                let mut again = Store::new(cut);
                again.save(&numbered(number)).unwrap();
                assert_eq!(again.load(), Ok(Some(newest(number))));
            }
            flash = whole;
        }
    }
    cuts
}

#[test]
fn cuts_one_after_the_other_do_not_add_up() {
    let mut flash = Flash::<4>::blank();
    let mut store = Store::new(flash);
    store.save(&numbered(1)).unwrap();
    flash = store.into_inner();
    for round in 0..200 {
        let mut store = Store::new(Flash {
            left: 1 + round % 70,
            ..flash
        });
        let saved = store.save(&numbered(2));
        flash = Flash {
            left: usize::MAX,
            ..store.into_inner()
        };
        let found = loaded(&flash);
        assert!(
            found == Some(numbered(1)) || found == Some(numbered(2)),
            "{round} {saved:?}"
        );
    }
}

/// A flash with saves of 1 to this number, each a slot after the other.
fn saved(numbers: u16) -> Flash {
    let mut store = Store::new(Flash::blank());
    for number in 1..=numbers {
        store.save(&numbered(number)).unwrap();
    }
    store.into_inner()
}

/// Changes a slot's bytes and makes its checksum right again.
fn forge(flash: &mut Flash, slot: usize, change: impl FnOnce(&mut [u8])) {
    let slot = &mut flash.bytes[slot * SLOT_BYTES..][..SLOT_BYTES];
    let (body, checksum) = slot.split_at_mut(SLOT_BYTES - 4);
    change(body);
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    checksum.copy_from_slice(&crc.checksum(body).to_le_bytes());
}

fn before_the_newest(number: u16) -> Option<Loaded> {
    Some(Loaded {
        newest: false,
        ..newest(number)
    })
}

#[test]
fn a_newest_slot_that_has_rotted_falls_back_to_the_one_before_and_says_so() {
    for bit in 0..SLOT_BYTES * 8 {
        let mut flash = saved(3);
        assert_eq!(everything_loaded(&flash), Some(newest(3)));
        flash.bytes[2 * SLOT_BYTES + bit / 8] ^= 1 << (bit % 8);
        assert_eq!(everything_loaded(&flash), before_the_newest(2), "bit {bit}");
        // Set again, all is well.
        let mut store = Store::new(flash);
        store.save(&numbered(4)).unwrap();
        assert_eq!(store.load(), Ok(Some(newest(4))), "bit {bit}");
    }
}

#[test]
fn a_slot_begun_in_the_other_sector_is_noticed_as_well() {
    // Eight slots fill the first sector; the ninth goes into the other.
    let mut flash = saved(9);
    flash.bytes[SECTOR + 40] ^= 1;
    assert_eq!(everything_loaded(&flash), before_the_newest(8));
}

#[test]
fn a_slot_begun_after_the_newest_is_noticed_in_either_sector_however_far_behind() {
    for (saves, torn) in [(3, 3), (3, 7), (9, 9), (9, 15)] {
        let mut flash = saved(saves);
        flash.bytes[torn * SLOT_BYTES + 40] = 0;
        assert_eq!(
            everything_loaded(&flash),
            before_the_newest(saves),
            "{saves} {torn}"
        );
    }
}

#[test]
fn an_erase_that_was_cut_is_noticed_whatever_it_left() {
    // The first sector full for the second time, the other with eight saves of before.
    let full = saved(24);
    assert_eq!(everything_loaded(&full), Some(newest(24)));
    let cut = |change: fn(&mut [u8])| {
        let mut flash = full.clone();
        change(&mut flash.bytes[SECTOR..]);
        everything_loaded(&flash)
    };
    // Everything half erased.
    assert_eq!(cut(|sector| sector.fill(0x5A)), before_the_newest(24));
    // Its end erased, a slot half erased, its beginning whole.
    let end = |sector: &mut [u8]| {
        sector[3 * SLOT_BYTES..4 * SLOT_BYTES].fill(0x5A);
        sector[4 * SLOT_BYTES..].fill(0xFF);
    };
    assert_eq!(cut(end), before_the_newest(24));
    // Full of whole slots and one that was torn when the sector was in use: no news.
    assert_eq!(cut(|sector| sector[40 + SLOT_BYTES] ^= 1), Some(newest(24)));
}

/// A flash of which one slot reads as blank and refuses every word.
struct Refusing {
    flash: Flash,
    slot: usize,
}

impl ErrorType for Refusing {
    type Error = PowerCut;
}

impl ReadNorFlash for Refusing {
    const READ_SIZE: usize = 1;
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerCut> {
        self.flash.read(offset, bytes)
    }
    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for Refusing {
    const WRITE_SIZE: usize = Flash::<4>::WRITE_SIZE;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerCut> {
        self.flash.erase(from, to)
    }
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerCut> {
        if offset as usize / SLOT_BYTES == self.slot {
            return Err(PowerCut);
        }
        self.flash.write(offset, bytes)
    }
}

#[test]
fn a_slot_that_refuses_is_passed_over_and_no_other_is_lost() {
    for saves in 0..16 {
        let slot = usize::from(saves);
        let mut store = Store::new(Refusing {
            flash: saved(saves),
            slot,
        });
        assert_eq!(store.save(&numbered(99)), Ok(()), "{saves}");
        assert_eq!(store.load(), Ok(Some(newest(99))), "{saves}");
        let (before, after) = (saved(saves), store.into_inner().flash);
        // The one that refuses is followed by its neighbour, or, last of its sector, by the first of the other.
        let taken = if slot % 8 == 7 {
            8 - slot / 8 * 8
        } else {
            slot + 1
        };
        let kept = (0..16).filter(|&place| place != taken && (slot != 15 || place >= 8));
        for place in kept {
            let bytes = place * SLOT_BYTES..(place + 1) * SLOT_BYTES;
            assert_eq!(
                before.bytes[bytes.clone()],
                after.bytes[bytes],
                "{saves} {place}"
            );
        }
        assert_ne!(after.bytes[taken * SLOT_BYTES..][..4], [0xFF; 4], "{saves}");
    }
}

#[test]
fn a_slot_that_was_torn_long_ago_in_the_other_sector_is_no_news() {
    // Torn and saved again, in a sector that is then filled and left.
    let mut flash = saved(2);
    flash.bytes[SLOT_BYTES + 40] ^= 1;
    let mut store = Store::new(flash);
    let mut seen = 0;
    for number in 3..40 {
        store.save(&numbered(number)).unwrap();
        assert_eq!(store.load(), Ok(Some(newest(number))), "{number}");
        seen += 1;
    }
    assert_eq!(seen, 37);
}

#[test]
fn a_slot_of_another_schema_or_length_is_not_read_as_this() {
    for change in [
        |body: &mut [u8]| body[8] ^= 1,
        // One byte more than the parameters take, and one less.
        |body: &mut [u8]| body[12] += 1,
        |body: &mut [u8]| body[12] -= 1,
        // Beyond the slot.
        |body: &mut [u8]| body[14] = 1,
    ] {
        let mut flash = saved(2);
        forge(&mut flash, 1, change);
        assert_eq!(everything_loaded(&flash), before_the_newest(1));
    }
}

#[test]
fn whole_slots_with_parameters_outside_their_ranges_are_not_taken() {
    let mut store = Store::new(saved(2));
    let mut bad = numbered(3);
    bad.wheel.effective_radius_m = -1.0;
    store.save(&bad).unwrap();
    assert_eq!(store.load(), Ok(before_the_newest(2)));
}

/// What a slot can hold, for an enumeration of all there is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Slot {
    Blank,
    Torn,
    Whole(u8),
    /// Of another schema: a firmware of before, or of after.
    Foreign(u8),
}

/// A slot's bytes; its parameters are numbered as its sequence.
fn bytes_of(slot: Slot) -> Vec<u8> {
    let (sequence, foreign) = match slot {
        Slot::Blank => return vec![0xFF; SLOT_BYTES],
        Slot::Torn => return vec![0x5A; SLOT_BYTES],
        Slot::Whole(sequence) => (sequence, false),
        Slot::Foreign(sequence) => (sequence, true),
    };
    let mut store = Store::new(Flash::<4>::blank());
    store.save(&numbered(u16::from(sequence))).unwrap();
    let mut flash = store.into_inner();
    forge(&mut flash, 0, |body| {
        body[4..8].copy_from_slice(&u32::from(sequence).to_le_bytes());
        body[8] ^= u8::from(foreign);
    });
    flash.bytes[..SLOT_BYTES].to_vec()
}

/// Two sectors whose first six slots are spent on another schema; the last two of each hold these.
fn flash_of(sectors: [[usize; 2]; 2], slots: &[(Slot, Vec<u8>)]) -> Flash {
    let mut flash = Flash::blank();
    let spent = bytes_of(Slot::Foreign(0));
    for (sector, ends) in flash.bytes.chunks_mut(SECTOR).zip(sectors) {
        for place in sector[..SECTOR - 2 * SLOT_BYTES].chunks_mut(SLOT_BYTES) {
            place.copy_from_slice(&spent);
        }
        for (place, slot) in sector[SECTOR - 2 * SLOT_BYTES..]
            .chunks_mut(SLOT_BYTES)
            .zip(ends)
        {
            place.copy_from_slice(&slots[slot].1);
        }
    }
    flash
}

#[test]
fn whatever_four_slots_hold_the_newest_whole_one_is_loaded_and_a_save_is_found_again() {
    let mut slots = vec![Slot::Blank, Slot::Torn];
    slots.extend((1..=4).flat_map(|n| [Slot::Whole(n), Slot::Foreign(n)]));
    let slots: Vec<_> = slots
        .into_iter()
        .map(|slot| (slot, bytes_of(slot)))
        .collect();
    let mut states = 0;
    for state in 0..slots.len().pow(4) {
        let at = |place: u32| state / slots.len().pow(place) % slots.len();
        let ends = [[at(0), at(1)], [at(2), at(3)]];
        let held = ends.as_flattened().iter().map(|&slot| slots[slot].0);
        let sequences: Vec<u8> = held
            .clone()
            .filter_map(|slot| match slot {
                Slot::Whole(n) | Slot::Foreign(n) => Some(n),
                _ => None,
            })
            .collect();
        // No two slots ever have the same sequence.
        if (1..=4).any(|n| sequences.iter().filter(|&&other| other == n).count() > 1) {
            continue;
        }
        states += 1;
        let best = held
            .filter_map(|slot| match slot {
                Slot::Whole(n) => Some(u16::from(n)),
                _ => None,
            })
            .max();
        let flash = flash_of(ends, &slots);
        let found = everything_loaded(&flash);
        assert_eq!(
            found.map(|loaded| loaded.parameters),
            best.map(numbered),
            "{ends:?}"
        );
        let newer = sequences
            .iter()
            .any(|&n| best.is_some_and(|best| u16::from(n) > best));
        assert!(
            !newer || found.is_some_and(|loaded| !loaded.newest),
            "{ends:?}"
        );
        let mut store = Store::new(flash);
        store.save(&numbered(9)).unwrap();
        let found = store.load().unwrap().unwrap();
        assert_eq!(found.parameters, numbered(9), "{ends:?}");
        // A sector that was torn and is not full was torn in its erase, or is the one in use.
        let is = |ends: [usize; 2], slot| ends.iter().any(|&end| slots[end].0 == slot);
        let torn = ends
            .iter()
            .any(|&ends| is(ends, Slot::Torn) && is(ends, Slot::Blank));
        assert!(found.newest || torn, "{ends:?}");
    }
    // Σ C(4,k) 4!/(4-k)! 2^k 2^(4-k): k slots with sequences, of two kinds, the others blank or torn.
    assert_eq!(states, 3_344);
}
