//! The flash that parameters are kept in: two sectors of their own, erased one at a time and programmed by words.
//!
//! By addresses on a bus, registers and cells alike, so that a test can stand in for the chip and cut its power.

#[cfg(test)]
#[allow(
    clippy::missing_panics_doc,
    reason = "assertions that the chips' tests share"
)]
pub mod model;

use core::marker::PhantomData;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::registers::Registers;
use crate::stm32::wait_for;

/// What a chip's flash is, beyond what all have in common. Its board.x leaves the two sectors out of the program.
pub trait Interface {
    /// Where the two sectors begin.
    const START: u32;
    /// Bytes of each.
    const SECTOR_BYTES: u32;
    /// Bytes that are programmed at once, by writes of four.
    const WORD: usize;
    /// Its register ACR.
    const ACR: u32;
    /// Its register KEYR.
    const KEYR: u32;
    /// Its register SR.
    const SR: u32;
    /// Its register CR.
    const CR: u32;
    /// All errors of its status register.
    const ERRORS: u32;
    /// Reads of a busy flag until it has failed.
    const LIMIT: u32;
    /// Its control register while words are programmed.
    const PROGRAM: u32;

    /// Its control register while this one of the two sectors, 0 or 1, is erased.
    fn erase(sector: u32) -> u32;
}

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// Of SR.
const BUSY: u32 = 1 << 16;
/// Of CR.
const START_ERASE: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// Of ACR.
const DATA_CACHE: u32 = 1 << 10;
const RESET_DATA_CACHE: u32 = 1 << 12;

/// The two sectors.
pub struct ParameterFlash<I, B> {
    bus: B,
    interface: PhantomData<I>,
}

/// The flash refused or did not finish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlashFailed;

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<I: Interface, B: Registers> ParameterFlash<I, B> {
    /// The two sectors, locked. Whoever has the bus must be the only one who programs.
    pub fn new(bus: B) -> Self {
        Self {
            bus,
            interface: PhantomData,
        }
    }

    /// Does something unlocked and locks again.
    fn unlocked(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<(), FlashFailed>,
    ) -> Result<(), FlashFailed> {
        // Errors of what was done before are none of this: cleared, they block nothing.
        self.finished()?;
        self.bus.write(I::SR, I::ERRORS);
        for key in KEYS {
            self.bus.write(I::KEYR, key);
        }
        let result = work(self);
        self.bus.write(I::CR, LOCK);
        // The data cache may hold what was there before (RM0090, 3.5.2; RM0440, 3.3.7): off, reset, on.
        let acr = self.bus.read(I::ACR);
        let off = acr & !DATA_CACHE;
        for bits in [off, off | RESET_DATA_CACHE, off, acr] {
            self.bus.write(I::ACR, bits);
        }
        result
    }

    /// Waits for the flash, and answers its status.
    fn finished(&mut self) -> Result<u32, FlashFailed> {
        let mut status = 0;
        let done = wait_for(I::LIMIT, || {
            status = self.bus.read(I::SR);
            status & BUSY == 0
        });
        done.then_some(status).ok_or(FlashFailed)
    }

    /// Waits for the flash to have done well.
    fn idle(&mut self) -> Result<(), FlashFailed> {
        if self.finished()? & I::ERRORS == 0 {
            Ok(())
        } else {
            Err(FlashFailed)
        }
    }
}

/// Whether bytes are whole words, of so many bytes each, of the two sectors.
fn whole<I: Interface>(offset: u32, length: usize, word: usize) -> Result<(), FlashFailed> {
    let end = u64::from(offset) + length as u64;
    let aligned = (offset as usize).is_multiple_of(word) && length.is_multiple_of(word);
    if aligned && end <= 2 * u64::from(I::SECTOR_BYTES) {
        Ok(())
    } else {
        Err(FlashFailed)
    }
}

impl<I, B> ErrorType for ParameterFlash<I, B> {
    type Error = FlashFailed;
}

impl<I: Interface, B: Registers> ReadNorFlash for ParameterFlash<I, B> {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        whole::<I>(offset, bytes.len(), 4)?;
        let (words, _) = bytes.as_chunks_mut::<4>();
        for (word, from) in words.iter_mut().zip((I::START + offset..).step_by(4)) {
            *word = self.bus.read(from).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * I::SECTOR_BYTES as usize
    }
}

impl<I: Interface, B: Registers> NorFlash for ParameterFlash<I, B> {
    const WRITE_SIZE: usize = I::WORD;
    const ERASE_SIZE: usize = I::SECTOR_BYTES as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let sector = from / I::SECTOR_BYTES;
        if sector > 1 || from != sector * I::SECTOR_BYTES || to != from + I::SECTOR_BYTES {
            return Err(FlashFailed);
        }
        self.unlocked(|flash| {
            let select = I::erase(sector);
            flash.bus.write(I::CR, select);
            flash.bus.write(I::CR, select | START_ERASE);
            flash.idle()
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        whole::<I>(offset, bytes.len(), I::WORD)?;
        self.unlocked(|flash| {
            flash.bus.write(I::CR, I::PROGRAM);
            let (words, _) = bytes.as_chunks::<4>();
            for (word, to) in words.iter().zip((I::START + offset..).step_by(4)) {
                flash.bus.write(to, u32::from_le_bytes(*word));
                // Its last four bytes begin the programming of a word.
                if (to as usize + 4).is_multiple_of(I::WORD) {
                    flash.idle()?;
                }
            }
            Ok(())
        })
    }
}
