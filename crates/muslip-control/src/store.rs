//! Parameters in flash, so that a power cut at any instant leaves the old ones or the new ones.
//!
//! Two sectors. One is in use; each save appends a slot to it, and only when it is full is the other one
//! erased and begun. A slot is
//!
//! ```text
//! magic ‖ sequence ‖ length | postcard, padded with zeros | CRC-32 over all before it
//! ```
//!
//! written in that order, checksum last. The valid slot with the highest sequence counts. A slot torn by a cut
//! has no valid checksum and is passed over; so has a sector torn while it was erased, whose slots were older
//! anyway.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use embedded_storage::nor_flash::NorFlash;
use muslip_record::Parameters;

use crate::validate;

/// Bytes of a slot.
pub const SLOT_BYTES: usize = 256;

const MAGIC: u32 = 0x4D55_0001;
const HEADER_BYTES: usize = 12;
const CRC_BYTES: usize = 4;
const PAYLOAD_BYTES: usize = SLOT_BYTES - HEADER_BYTES - CRC_BYTES;
const BODY_BYTES: u32 = address(SLOT_BYTES - CRC_BYTES);

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Why parameters could not be saved or loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoreError<E> {
    /// The flash failed.
    Flash(E),
    /// The parameters do not fit a slot.
    TooLong,
    /// What was written does not read back.
    NotWritten,
}

/// Two sectors of flash: addresses 0 to one sector, and from there to the end, of `F`.
#[derive(Debug)]
pub struct Store<F> {
    flash: F,
}

/// Addresses of flash have 32 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "only used of constants, at compile time, where the assertion stops the build"
)]
const fn address(bytes: usize) -> u32 {
    assert!(bytes < 1 << 31);
    bytes as u32
}

struct Newest {
    sequence: u32,
    address: u32,
}

impl<F: NorFlash> Store<F> {
    /// A store on a flash of exactly two sectors.
    pub fn new(flash: F) -> Self {
        const { assert!(F::ERASE_SIZE.is_multiple_of(SLOT_BYTES)) };
        const { assert!(SLOT_BYTES.is_multiple_of(F::WRITE_SIZE)) };
        Self { flash }
    }

    /// Gives the flash back.
    pub fn into_inner(self) -> F {
        self.flash
    }

    fn sector_bytes() -> u32 {
        const { address(F::ERASE_SIZE) }
    }

    /// The newest parameters that are whole and within their ranges; none on a blank flash.
    ///
    /// # Errors
    /// [`StoreError::Flash`].
    pub fn load(&mut self) -> Result<Option<Parameters>, StoreError<F::Error>> {
        let Some(newest) = self.newest()? else {
            return Ok(None);
        };
        let slot = self.slot(newest.address)?;
        Ok(slot
            .get(HEADER_BYTES..)
            .and_then(|payload| postcard::take_from_bytes::<Parameters>(payload).ok())
            .map(|(parameters, _)| parameters)
            .filter(|parameters| validate::parameters(parameters).is_ok()))
    }

    /// Saves parameters; on return they are what [`Store::load`] answers.
    ///
    /// # Errors
    /// [`StoreError`]; what was there before still is, unless the new ones are.
    pub fn save(&mut self, parameters: &Parameters) -> Result<(), StoreError<F::Error>> {
        let mut slot = [0; SLOT_BYTES];
        let newest = self.newest()?;
        let sequence = newest
            .as_ref()
            .map_or(1, |newest| newest.sequence.wrapping_add(1));
        fill(&mut slot, sequence, parameters).ok_or(StoreError::TooLong)?;

        let sector = newest
            .as_ref()
            .map_or(0, |newest| newest.address / Self::sector_bytes());
        let address = match self.blank_slot(sector)? {
            Some(address) => address,
            None => {
                // Full: the other sector holds nothing newer.
                let other = 1 - sector.min(1);
                let start = other * Self::sector_bytes();
                self.flash
                    .erase(start, start + Self::sector_bytes())
                    .map_err(StoreError::Flash)?;
                start
            }
        };
        let (body, checksum) = slot
            .split_at_checked(SLOT_BYTES - CRC_BYTES)
            .ok_or(StoreError::TooLong)?;
        self.flash.write(address, body).map_err(StoreError::Flash)?;
        self.flash
            .write(address + BODY_BYTES, checksum)
            .map_err(StoreError::Flash)?;
        if self.slot(address)? == slot {
            Ok(())
        } else {
            Err(StoreError::NotWritten)
        }
    }

    fn slot(&mut self, address: u32) -> Result<[u8; SLOT_BYTES], StoreError<F::Error>> {
        let mut slot = [0; SLOT_BYTES];
        self.flash
            .read(address, &mut slot)
            .map_err(StoreError::Flash)?;
        Ok(slot)
    }

    fn newest(&mut self) -> Result<Option<Newest>, StoreError<F::Error>> {
        let mut newest: Option<Newest> = None;
        for address in (0..2 * Self::sector_bytes()).step_by(SLOT_BYTES) {
            let slot = self.slot(address)?;
            if let Some(sequence) = sequence_of(&slot)
                && newest
                    .as_ref()
                    .is_none_or(|newest| sequence > newest.sequence)
            {
                newest = Some(Newest { sequence, address });
            }
        }
        Ok(newest)
    }

    /// The first slot of a sector with nothing written in it or after it.
    fn blank_slot(&mut self, sector: u32) -> Result<Option<u32>, StoreError<F::Error>> {
        let start = sector * Self::sector_bytes();
        let mut blank = None;
        for address in (start..start + Self::sector_bytes()).step_by(SLOT_BYTES) {
            if self.slot(address)?.iter().all(|&byte| byte == 0xFF) {
                blank = blank.or(Some(address));
            } else {
                blank = None;
            }
        }
        Ok(blank)
    }
}

fn fill(slot: &mut [u8; SLOT_BYTES], sequence: u32, parameters: &Parameters) -> Option<()> {
    let (body, checksum) = slot.split_last_chunk_mut::<CRC_BYTES>()?;
    let (header, payload) = body.split_at_mut_checked(HEADER_BYTES)?;
    let length = postcard::to_slice(parameters, payload.get_mut(..PAYLOAD_BYTES)?)
        .ok()?
        .len();
    let length = u32::try_from(length).ok()?;
    for (place, word) in header.chunks_exact_mut(4).zip([MAGIC, sequence, length]) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    *checksum = CRC.checksum(body).to_le_bytes();
    Some(())
}

/// The sequence of a slot that is whole.
fn sequence_of(slot: &[u8; SLOT_BYTES]) -> Option<u32> {
    let (body, checksum) = slot.split_last_chunk::<CRC_BYTES>()?;
    let (magic, rest) = body.split_first_chunk::<4>()?;
    let (sequence, _) = rest.split_first_chunk::<4>()?;
    let whole =
        u32::from_le_bytes(*magic) == MAGIC && CRC.checksum(body) == u32::from_le_bytes(*checksum);
    whole.then(|| u32::from_le_bytes(*sequence))
}
