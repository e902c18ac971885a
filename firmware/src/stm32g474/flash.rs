//! The last two pages of bank 2, programmed by double words with their ECC (RM0440, 3.3, 3.7). The program runs on from
//! bank 1 meanwhile.
//!
//! A double word that was torn may read as anything, with an error of two bits that the chip tells by its interrupt that
//! cannot be masked ([`forgives`]); the store's checksum finds it. A double word is programmed once only: the store
//! writes where nothing was ever written.

use crate::registers::Registers;
use crate::stm32::flash::Interface;

const ERASE_PAGE: u32 = 1 << 1;
const BANK_2: u32 = 1 << 11;
/// Number of the first page within its bank.
const FIRST_PAGE: u32 = 126;

const ECCR: u32 = 0x4002_2018;
/// An error of two bits was read (ECCD), of bank 2 (BK_ECC), at this double word of it (ADDR_ECC).
const TWO_BITS: u32 = 1 << 31;
const ECC_BANK_2: u32 = 1 << 21;
const ECC_ADDRESS: u32 = (1 << 19) - 1;

/// The two pages.
pub struct Pages;

impl Interface for Pages {
    const START: u32 = 0x0807_F000;
    const SECTOR_BYTES: u32 = 2048;
    const WORD: usize = 8;
    const ACR: u32 = 0x4002_2000;
    const KEYR: u32 = 0x4002_2008;
    const SR: u32 = 0x4002_2010;
    const CR: u32 = 0x4002_2014;
    /// Operation, programming, protection, alignment, size, sequence, miss and fast errors; read and option errors.
    const ERRORS: u32 = 0b11_1111_1010 | 0b11 << 14;
    /// An erase takes some millions: 22 ms at most (DS12288, table 53).
    const LIMIT: u32 = 10_000_000;
    const PROGRAM: u32 = 1;

    fn erase(page: u32) -> u32 {
        ERASE_PAGE | BANK_2 | (FIRST_PAGE + page) << 3
    }
}

/// Whether the interrupt that cannot be masked came of an error of two bits where parameters are, which is then
/// forgotten: a double word torn by a power cut, and no reason to end the program.
pub fn forgives(bus: &mut impl Registers) -> bool {
    let told = bus.read(ECCR);
    // ADDR_ECC counts bytes of a bank of 256 KiB; the last 4 KiB are the parameters.
    let place = told & ECC_ADDRESS;
    let ours = told & ECC_BANK_2 != 0 && place >= (Pages::START & 0x3_FFFF);
    if told & TWO_BITS == 0 || !ours {
        return false;
    }
    bus.write(ECCR, TWO_BITS);
    true
}

#[cfg(test)]
mod tests;
