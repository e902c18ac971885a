//! Flash sectors 10 and 11, erased and programmed by words (3.6, 3.9).

use core::ptr;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use stm32f4::stm32f405::FLASH;

use crate::settings::wait_for;

/// Where the parameters are (memory.x).
const START: u32 = 0x080C_0000;
const SECTOR_BYTES: u32 = 128 * 1024;
const FIRST_SECTOR: u32 = 10;

/// Reads of a busy flag; the core stalls on each while the flash is busy, so that few are ever needed.
const LIMIT: u32 = 100_000_000;

const BUSY: u32 = 1 << 16;
/// Operation, protection, alignment, parallelism and sequence errors.
const ERRORS: u32 = 1 << 1 | 1 << 4 | 1 << 5 | 1 << 6 | 1 << 7;
const PROGRAM: u32 = 1;
const ERASE_SECTOR: u32 = 1 << 1;
const START_ERASE: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// By 32 bits at once, at 2.7 V and above.
const WORDS: u32 = 0b10 << 8;

/// The two sectors.
pub struct ParameterFlash(FLASH);

/// The flash refused or did not finish.
#[derive(Debug, Clone, Copy)]
pub struct FlashFailed;

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ParameterFlash {
    /// The two sectors, locked.
    pub fn new(flash: FLASH) -> Self {
        Self(flash)
    }

    fn control(&self, bits: u32) {
        self.0.cr().write(|w| unsafe { w.bits(bits) });
    }

    /// Does something unlocked and locks again.
    fn unlocked(
        &mut self,
        work: impl FnOnce(&Self) -> Result<(), FlashFailed>,
    ) -> Result<(), FlashFailed> {
        // Errors of what was done before are none of this: cleared, they block nothing.
        self.finished()?;
        self.0.sr().write(|w| unsafe { w.bits(ERRORS) });
        for key in [0x4567_0123, 0xCDEF_89AB] {
            self.0.keyr().write(|w| unsafe { w.bits(key) });
        }
        let result = work(self);
        self.control(LOCK);
        // The data cache may hold what was there before (3.5.2): off, reset, on.
        let acr = self.0.acr().read().bits();
        for bits in [
            acr & !(1 << 10),
            acr & !(1 << 10) | 1 << 12,
            acr & !(1 << 10),
            acr,
        ] {
            self.0.acr().write(|w| unsafe { w.bits(bits) });
        }
        result
    }

    /// Waits for the flash, and answers its status.
    fn finished(&self) -> Result<u32, FlashFailed> {
        let mut status = 0;
        let done = wait_for(LIMIT, || {
            status = self.0.sr().read().bits();
            status & BUSY == 0
        });
        done.then_some(status).ok_or(FlashFailed)
    }

    /// Waits for the flash; an error flag is an error.
    fn idle(&self) -> Result<(), FlashFailed> {
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

impl ErrorType for ParameterFlash {
    type Error = FlashFailed;
}

impl ReadNorFlash for ParameterFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        inside(offset, bytes.len())?;
        for (byte, from) in bytes.iter_mut().zip(START + offset..) {
            // SAFETY: within the two sectors, which are flash that no Rust object lives in.
            *byte = unsafe { ptr::read_volatile(from as *const u8) };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR_BYTES as usize
    }
}

impl NorFlash for ParameterFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let sector = from / SECTOR_BYTES;
        if from != sector * SECTOR_BYTES || to != from + SECTOR_BYTES || sector > 1 {
            return Err(FlashFailed);
        }
        self.unlocked(|flash| {
            let select = ERASE_SECTOR | (FIRST_SECTOR + sector) << 3 | WORDS;
            flash.control(select);
            flash.control(select | START_ERASE);
            flash.idle()
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        inside(offset, bytes.len())?;
        if !offset.is_multiple_of(4) || !bytes.len().is_multiple_of(4) {
            return Err(FlashFailed);
        }
        self.unlocked(|flash| {
            flash.control(PROGRAM | WORDS);
            let words = bytes.as_chunks::<4>().0;
            for (word, to) in words.iter().zip((START + offset..).step_by(4)) {
                // SAFETY: as in `read`; aligned, by the check above.
                unsafe { ptr::write_volatile(to as *mut u32, u32::from_le_bytes(*word)) };
                flash.idle()?;
            }
            Ok(())
        })
    }
}
