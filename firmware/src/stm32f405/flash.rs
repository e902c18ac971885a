//! Flash sectors 10 and 11, programmed by 32 bits (RM0090, 3.6, 3.9).

use crate::stm32::flash::Interface;

const ERASE_SECTOR: u32 = 1 << 1;
const FIRST_SECTOR: u32 = 10;
/// By 32 bits at once, at 2.7 V and above.
const WORDS: u32 = 0b10 << 8;

/// The two sectors.
pub struct Sectors;

impl Interface for Sectors {
    const START: u32 = 0x080C_0000;
    const SECTOR_BYTES: u32 = 128 * 1024;
    const WORD: usize = 4;
    const ACR: u32 = 0x4002_3C00;
    const KEYR: u32 = 0x4002_3C04;
    const SR: u32 = 0x4002_3C0C;
    const CR: u32 = 0x4002_3C10;
    /// Operation, protection, alignment, parallelism and sequence errors.
    const ERRORS: u32 = 1 << 1 | 1 << 4 | 1 << 5 | 1 << 6 | 1 << 7;
    /// The core stalls on each read while the flash is busy, so that few are ever needed.
    const LIMIT: u32 = 100_000_000;
    const PROGRAM: u32 = 1 | WORDS;

    fn erase(sector: u32) -> u32 {
        ERASE_SECTOR | (FIRST_SECTOR + sector) << 3 | WORDS
    }
}

#[cfg(test)]
mod tests;
