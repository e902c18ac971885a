//! Flash sectors 10 and 11, erased and programmed by words (RM0090, 3.6, 3.9).
//!
//! By addresses on a bus, registers and cells alike, so that a test can stand in for the chip and cut its power.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::registers::Registers;
use crate::stm32::wait_for;

/// Where the parameters are (board.x beside this).
const START: u32 = 0x080C_0000;
const SECTOR_BYTES: u32 = 128 * 1024;
const FIRST_SECTOR: u32 = 10;

/// Registers (3.9).
const ACR: u32 = 0x4002_3C00;
const KEYR: u32 = ACR + 0x04;
const SR: u32 = ACR + 0x0C;
const CR: u32 = ACR + 0x10;

/// Reads of a busy flag; the core stalls on each while the flash is busy, so that few are ever needed.
const LIMIT: u32 = 100_000_000;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
const BUSY: u32 = 1 << 16;
/// Operation, protection, alignment, parallelism and sequence errors.
const ERRORS: u32 = 1 << 1 | 1 << 4 | 1 << 5 | 1 << 6 | 1 << 7;
const PROGRAM: u32 = 1;
const ERASE_SECTOR: u32 = 1 << 1;
const START_ERASE: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// By 32 bits at once, at 2.7 V and above.
const WORDS: u32 = 0b10 << 8;
const DATA_CACHE: u32 = 1 << 10;
const RESET_DATA_CACHE: u32 = 1 << 12;

/// The two sectors.
pub struct ParameterFlash<B>(B);

/// The flash refused or did not finish.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlashFailed;

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<B: Registers> ParameterFlash<B> {
    /// The two sectors, locked. Whoever has the bus must be the only one who programs.
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
        // The data cache may hold what was there before (3.5.2): off, reset, on.
        let acr = self.0.read(ACR);
        let off = acr & !DATA_CACHE;
        for bits in [off, off | RESET_DATA_CACHE, off, acr] {
            self.0.write(ACR, bits);
        }
        result
    }

    /// Waits for the flash, and answers its status.
    fn finished(&mut self) -> Result<u32, FlashFailed> {
        let mut status = 0;
        let done = wait_for(LIMIT, || {
            status = self.0.read(SR);
            status & BUSY == 0
        });
        done.then_some(status).ok_or(FlashFailed)
    }

    /// Waits for the flash; an error flag is an error.
    fn idle(&mut self) -> Result<(), FlashFailed> {
        if self.finished()? & ERRORS == 0 {
            Ok(())
        } else {
            Err(FlashFailed)
        }
    }
}

fn inside(offset: u32, length: usize) -> Result<(), FlashFailed> {
    let end = u64::from(offset) + length as u64;
    if end <= u64::from(2 * SECTOR_BYTES) {
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
        inside(offset, bytes.len())?;
        if !offset.is_multiple_of(4) || !bytes.len().is_multiple_of(4) {
            return Err(FlashFailed);
        }
        for (word, from) in bytes
            .as_chunks_mut::<4>()
            .0
            .iter_mut()
            .zip((START + offset..).step_by(4))
        {
            *word = self.0.read(from).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR_BYTES as usize
    }
}

impl<B: Registers> NorFlash for ParameterFlash<B> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let sector = from / SECTOR_BYTES;
        if sector > 1 || from != sector * SECTOR_BYTES || to != from + SECTOR_BYTES {
            return Err(FlashFailed);
        }
        self.unlocked(|flash| {
            let select = ERASE_SECTOR | (FIRST_SECTOR + sector) << 3 | WORDS;
            flash.0.write(CR, select);
            flash.0.write(CR, select | START_ERASE);
            flash.idle()
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        inside(offset, bytes.len())?;
        if !offset.is_multiple_of(4) || !bytes.len().is_multiple_of(4) {
            return Err(FlashFailed);
        }
        self.unlocked(|flash| {
            flash.0.write(CR, PROGRAM | WORDS);
            let words = bytes.as_chunks::<4>().0;
            for (word, to) in words.iter().zip((START + offset..).step_by(4)) {
                flash.0.write(to, u32::from_le_bytes(*word));
                flash.idle()?;
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests;
