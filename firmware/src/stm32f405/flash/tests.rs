//! The driver on sectors 10 and 11 as RM0090 describes them.

use super::*;
use crate::stm32::flash::model::{
    Model, cuts_of_a_save, cuts_of_an_erase, locks_and_forgets_old_errors,
    refuses_what_is_not_whole, survives_write_protection,
};
use muslip_control::store::SLOT_BYTES;
use std::vec::Vec;

extern crate std;

impl Model for Sectors {
    const CODED: bool = false;

    fn erased(control: u32) -> usize {
        let sector = control >> 3 & 0xF;
        assert!((10..=11).contains(&sector), "sector {sector} is erased");
        sector as usize - 10
    }
}

#[test]
fn a_cut_at_every_byte_of_a_save_torn_from_either_end_leaves_the_old_or_the_new() {
    for saves in [0, 1, 7] {
        assert_eq!(cuts_of_a_save::<Sectors>(saves), 64 * 8);
    }
}

#[test]
fn a_cut_in_the_erase_of_a_full_sector_from_either_end_leaves_the_newest() {
    let sector = Sectors::SECTOR_BYTES as usize;
    let slots = sector / SLOT_BYTES;
    // Every byte of the first and the last slot, and every slot's edges.
    let ends = (0..SLOT_BYTES).chain(sector - SLOT_BYTES..sector);
    let edges = (1..slots).flat_map(|slot| [slot * SLOT_BYTES - 1, slot * SLOT_BYTES]);
    let places: Vec<_> = ends.chain(edges.step_by(4)).collect();
    assert_eq!(places.len(), 768);
    cuts_of_an_erase::<Sectors>(&places);
}

#[test]
fn it_is_locked_and_the_cache_is_reset_after_everything_and_old_errors_block_nothing() {
    locks_and_forgets_old_errors::<Sectors>();
}

#[test]
fn a_protected_sector_is_an_error_and_nothing_changes() {
    survives_write_protection::<Sectors>();
}

#[test]
fn what_is_not_whole_words_or_sectors_of_the_two_is_refused_and_touches_nothing() {
    refuses_what_is_not_whole::<Sectors>();
}
