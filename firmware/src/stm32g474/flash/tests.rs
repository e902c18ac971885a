//! The driver on the last two pages as RM0440 describes them.

use super::*;
use crate::stm32::flash::model::{
    Chip, Model, cuts_of_a_save, cuts_of_an_erase, locks_and_forgets_old_errors,
    refuses_what_is_not_whole, survives_write_protection,
};
use std::vec::Vec;

extern crate std;

impl Model for Pages {
    const CODED: bool = true;

    fn erased(control: u32) -> usize {
        assert_eq!(control & BANK_2, BANK_2, "bank 1 is the program's");
        let page = control >> 3 & 0x7F;
        assert!((126..128).contains(&page), "page {page} is erased");
        page as usize - 126
    }

    fn is_own(address: u32) -> bool {
        address == ECCR
    }

    fn torn_word_read(mut chip: &mut Chip<Self>, at: usize) {
        // Of bank 2, by its place there; then the interrupt, which goes on.
        chip.own = TWO_BITS | ECC_BANK_2 | ((Self::START & 0x3_FFFF) + at as u32);
        chip.interrupts += 1;
        assert!(forgives(&mut chip));
        assert_eq!(chip.own & TWO_BITS, 0, "told of once");
    }
}

#[test]
fn a_cut_in_every_double_word_of_a_save_torn_from_either_end_leaves_the_old_or_the_new() {
    let cuts: usize = [0, 1, 7, 8, 15].map(cuts_of_a_save::<Pages>).iter().sum();
    assert!(cuts >= 5 * 32 * 16, "{cuts}");
}

#[test]
fn a_cut_at_every_byte_of_an_erase_from_either_end_leaves_the_newest() {
    let places: Vec<_> = (0..Pages::SECTOR_BYTES as usize).collect();
    cuts_of_an_erase::<Pages>(&places);
}

#[test]
fn it_is_locked_after_everything_and_old_errors_block_nothing() {
    locks_and_forgets_old_errors::<Pages>();
}

#[test]
fn a_protected_page_is_an_error_and_nothing_changes() {
    survives_write_protection::<Pages>();
}

#[test]
fn only_an_error_of_two_bits_among_the_parameters_is_forgiven() {
    let place = Pages::START & 0x3_FFFF;
    for (told, expected) in [
        (TWO_BITS | ECC_BANK_2 | place, true),
        (TWO_BITS | ECC_BANK_2 | (place + 4088), true),
        // The program's bank, below the parameters, no error at all: the crystal's interrupt.
        (TWO_BITS | place, false),
        (TWO_BITS | ECC_BANK_2 | (place - 8), false),
        (0, false),
    ] {
        let mut chip = Chip::<Pages>::blank();
        chip.own = told;
        assert_eq!(forgives(&mut &mut chip), expected, "{told:08x}");
    }
}

#[test]
fn what_is_not_whole_double_words_or_pages_of_the_two_is_refused_and_touches_nothing() {
    refuses_what_is_not_whole::<Pages>();
}
