//! The last two pages of bank 2, erased by page and programmed by double words with their ECC (RM0440, 3.3, 3.7). The
//! program runs on from bank 1 meanwhile.
//!
//! A double word that was torn may read as anything, with an error of two bits that the chip tells by its interrupt that
//! cannot be masked ([`forgives`]); the store's checksum finds it. A double word is programmed once only: the store
//! writes where nothing was ever written.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::registers::Registers;
use crate::stm32::wait_for;

/// Where the parameters are (board.x beside this).
const START: u32 = 0x0807_F000;
const PAGE_BYTES: u32 = 2048;
/// Number of the first page within its bank.
const FIRST_PAGE: u32 = 126;
/// Bytes of a double word.
const WORD: usize = 8;

/// Registers (3.7).
const ACR: u32 = 0x4002_2000;
const KEYR: u32 = ACR + 0x08;
const SR: u32 = ACR + 0x10;
const CR: u32 = ACR + 0x14;
const ECCR: u32 = ACR + 0x18;

/// Reads of a busy flag, of which an erase takes some millions: 22 ms at most (DS12288, table 53).
const LIMIT: u32 = 10_000_000;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
const BUSY: u32 = 1 << 16;
/// Operation, programming, protection, alignment, size, sequence, miss and fast errors; read and option errors.
const ERRORS: u32 = 0b11_1111_1010 | 0b11 << 14;
const PROGRAM: u32 = 1;
const ERASE_PAGE: u32 = 1 << 1;
const BANK_2: u32 = 1 << 11;
const START_ERASE: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const DATA_CACHE: u32 = 1 << 10;
const RESET_DATA_CACHE: u32 = 1 << 12;
/// An error of two bits was read (ECCD), of bank 2 (BK_ECC), at this double word of it (ADDR_ECC).
const TWO_BITS: u32 = 1 << 31;
const ECC_BANK_2: u32 = 1 << 21;
const ECC_ADDRESS: u32 = (1 << 19) - 1;

/// The two pages.
pub struct ParameterFlash<B>(B);

/// The flash refused or did not finish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlashFailed;

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Whether the interrupt that cannot be masked came of an error of two bits where parameters are, which is then
/// forgotten: a double word torn by a power cut, and no reason to end the program.
pub fn forgives(bus: &mut impl Registers) -> bool {
    let told = bus.read(ECCR);
    // ADDR_ECC counts bytes of a bank of 256 KiB; the last 4 KiB are the parameters.
    let place = told & ECC_ADDRESS;
    let ours = told & ECC_BANK_2 != 0 && place >= (START & 0x3_FFFF);
    if told & TWO_BITS == 0 || !ours {
        return false;
    }
    bus.write(ECCR, TWO_BITS);
    true
}

impl<B: Registers> ParameterFlash<B> {
    /// The two pages, locked. Whoever has the bus must be the only one who programs.
    pub fn new(bus: B) -> Self {
        Self(bus)
    }

    /// Does something unlocked and locks again.
    fn unlocked(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<(), FlashFailed>,
    ) -> Result<(), FlashFailed> {
        // Errors of what was done before are none of this: cleared, they block nothing.
        self.finished()?;
        self.0.write(SR, ERRORS);
        for key in KEYS {
            self.0.write(KEYR, key);
        }
        let result = work(self);
        self.0.write(CR, LOCK);
        // The data cache may hold what was there before (3.3.7): off, reset, on.
        let acr = self.0.read(ACR);
        let off = acr & !DATA_CACHE;
        for bits in [off, off | RESET_DATA_CACHE, off, acr] {
            self.0.write(ACR, bits);
        }
        result
    }

    /// Waits for the flash, and answers its status.
    fn finished(&mut self) -> Result<u32, FlashFailed> {
        let mut status = BUSY;
        wait_for(LIMIT, || {
            status = self.0.read(SR);
            status & BUSY == 0
        });
        if status & BUSY == 0 {
            Ok(status)
        } else {
            Err(FlashFailed)
        }
    }

    /// Waits for the flash to have done well.
    fn idle(&mut self) -> Result<(), FlashFailed> {
        if self.finished()? & ERRORS == 0 {
            Ok(())
        } else {
            Err(FlashFailed)
        }
    }
}

/// Whether bytes are whole words of the two pages.
fn whole(offset: u32, length: usize, word: usize) -> Result<(), FlashFailed> {
    let end = u64::from(offset) + length as u64;
    let aligned = (offset as usize).is_multiple_of(word) && length.is_multiple_of(word);
    if aligned && end <= u64::from(2 * PAGE_BYTES) {
        Ok(())
    } else {
        Err(FlashFailed)
    }
}

impl<B> ErrorType for ParameterFlash<B> {
    type Error = FlashFailed;
}

impl<B: Registers> ReadNorFlash for ParameterFlash<B> {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        whole(offset, bytes.len(), 4)?;
        let (words, _) = bytes.as_chunks_mut::<4>();
        for (word, from) in words.iter_mut().zip((START + offset..).step_by(4)) {
            *word = self.0.read(from).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * PAGE_BYTES as usize
    }
}

impl<B: Registers> NorFlash for ParameterFlash<B> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE_BYTES as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let page = from / PAGE_BYTES;
        if page > 1 || from != page * PAGE_BYTES || to != from + PAGE_BYTES {
            return Err(FlashFailed);
        }
        self.unlocked(|flash| {
            let select = ERASE_PAGE | BANK_2 | (FIRST_PAGE + page) << 3;
            flash.0.write(CR, select);
            flash.0.write(CR, select | START_ERASE);
            flash.idle()
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        whole(offset, bytes.len(), WORD)?;
        self.unlocked(|flash| {
            flash.0.write(CR, PROGRAM);
            let (words, _) = bytes.as_chunks::<4>();
            // The lower half, then the upper one, which begins the programming (3.3.7).
            for (at, word) in (0_u32..).zip(words) {
                flash
                    .0
                    .write(START + offset + 4 * at, u32::from_le_bytes(*word));
                if at % 2 == 1 {
                    flash.idle()?;
                }
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests;
