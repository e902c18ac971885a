//! Parameters in flash, so that a power cut at any instant leaves the old ones or the new ones.
//!
//! Two sectors. One is in use; each save appends a slot to it, and only when it is full is the other one
//! erased and begun. A slot is
//!
//! ```text
//! magic ‖ sequence ‖ schema hash ‖ length | postcard, padded with zeros | CRC-32 over all before it
//! ```
//!
//! written in that order, checksum last. Of the slots that are whole, of this schema and of this length, the one with
//! the highest sequence counts. A slot torn by a cut has no valid checksum and is passed over; so has a sector torn
//! while it was erased, whose slots were older anyway. Where something newer than the slot that counts is not whole or
//! of another schema, [`Loaded::newest`] says so: what was set last is lost.

use core::iter::StepBy;
use core::ops::Range;

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use embedded_storage::nor_flash::NorFlash;
use muslip_record::{PARAMETERS_HASH, Parameters};

use crate::validate;

/// Bytes of a slot.
pub const SLOT_BYTES: usize = 256;

const MAGIC: u32 = 0x4D55_0002;
const HEADER_BYTES: usize = 16;
const CRC_BYTES: usize = 4;
const PAYLOAD_BYTES: usize = SLOT_BYTES - HEADER_BYTES - CRC_BYTES;

/// Slots that a save tries: one that a cut left looking blank may refuse to be written.
const SLOTS_TRIED: usize = 3;

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
const fn address_of(bytes: usize) -> u32 {
    assert!(bytes < 1 << 31);
    bytes as u32
}

/// Parameters out of flash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loaded {
    /// The parameters.
    pub parameters: Parameters,
    /// False where newer ones were written or begun, and cannot be read.
    pub newest: bool,
}

/// What a slot holds.
#[expect(clippy::large_enum_variant, reason = "no heap to box it in")]
enum Content {
    /// Nothing was ever written.
    Blank,
    /// Something, but no whole slot.
    Torn,
    /// A whole slot with its sequence, and parameters where they are of this schema and in their ranges.
    Whole(u32, Option<Parameters>),
}

/// A slot and where it is.
struct Place<T> {
    sequence: u32,
    address: u32,
    content: T,
}

impl<F: NorFlash> Store<F> {
    /// A store on a flash of exactly two sectors.
    pub fn new(flash: F) -> Self {
        const { assert!(F::ERASE_SIZE.is_multiple_of(SLOT_BYTES)) };
        const { assert!(SLOT_BYTES.is_multiple_of(F::WRITE_SIZE) && F::WRITE_SIZE < SLOT_BYTES) };
        Self { flash }
    }

    /// Gives the flash back.
    pub fn into_inner(self) -> F {
        self.flash
    }

    fn sector_bytes() -> u32 {
        const { address_of(F::ERASE_SIZE) }
    }

    /// Bytes that are written last, checksum in them: a word of the flash, or the checksum.
    const LAST_BYTES: usize = if F::WRITE_SIZE > CRC_BYTES {
        F::WRITE_SIZE
    } else {
        CRC_BYTES
    };

    /// The newest parameters that are whole, of this schema and within their ranges; none on a blank flash.
    ///
    /// # Errors
    /// [`StoreError::Flash`].
    pub fn load(&mut self) -> Result<Option<Loaded>, StoreError<F::Error>> {
        let mut best: Option<Place<Parameters>> = None;
        let mut highest = 0;
        for address in Self::slots(0..2) {
            let Content::Whole(sequence, parameters) = self.content(address)? else {
                continue;
            };
            highest = highest.max(sequence);
            if let Some(content) = parameters
                && best.as_ref().is_none_or(|best| sequence > best.sequence)
            {
                best = Some(Place {
                    sequence,
                    address,
                    content,
                });
            }
        }
        let Some(best) = best else {
            return Ok(None);
        };
        let newest = highest == best.sequence && !self.is_torn_after(best.address)?;
        Ok(Some(Loaded {
            parameters: best.content,
            newest,
        }))
    }

    /// Whether a slot was begun where the next after an address would be.
    fn is_torn_after(&mut self, address: u32) -> Result<bool, StoreError<F::Error>> {
        let sector = address / Self::sector_bytes();
        let next = address + const { address_of(SLOT_BYTES) };
        if next == (sector + 1) * Self::sector_bytes() {
            // The sector is full: the next one goes into the other.
            return self.is_torn_anew(1 - sector.min(1));
        }
        for address in (next..(sector + 1) * Self::sector_bytes()).step_by(SLOT_BYTES) {
            if matches!(self.content(address)?, Content::Torn) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a sector was torn since it was left: while it was erased, or in its first slot after that. A sector is
    /// left when it is full, and begins with a whole slot; what was torn in it before then is of no interest.
    fn is_torn_anew(&mut self, sector: u32) -> Result<bool, StoreError<F::Error>> {
        let (mut torn, mut blank, mut begins_whole) = (false, false, None);
        for address in Self::slots(sector..sector + 1) {
            let content = self.content(address)?;
            begins_whole.get_or_insert(matches!(content, Content::Whole(..)));
            torn |= matches!(content, Content::Torn);
            blank |= matches!(content, Content::Blank);
        }
        Ok(torn && (blank || begins_whole != Some(true)))
    }

    /// Addresses of all slots of these sectors.
    fn slots(sectors: Range<u32>) -> StepBy<Range<u32>> {
        let bytes = Self::sector_bytes();
        (sectors.start * bytes..sectors.end * bytes).step_by(SLOT_BYTES)
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

        let mut sector = newest
            .as_ref()
            .map_or(0, |newest| newest.address / Self::sector_bytes());
        // What lies before the slot that was refused last is not tried again.
        let mut from = 0;
        let mut refused = StoreError::NotWritten;
        for _ in 0..SLOTS_TRIED {
            let address = match self.blank_slot(sector, from)? {
                Some(address) => address,
                None => {
                    // Full: the other sector holds nothing newer.
                    sector = 1 - sector.min(1);
                    let start = sector * Self::sector_bytes();
                    self.flash
                        .erase(start, start + Self::sector_bytes())
                        .map_err(StoreError::Flash)?;
                    start
                }
            };
            match self.write(address, &slot) {
                Ok(()) => return Ok(()),
                Err(error) => refused = error,
            }
            from = address + const { address_of(SLOT_BYTES) };
        }
        Err(refused)
    }

    /// Writes a slot, its last word last, and reads it back.
    fn write(&mut self, address: u32, slot: &[u8; SLOT_BYTES]) -> Result<(), StoreError<F::Error>> {
        let (body, last) = slot
            .split_at_checked(SLOT_BYTES - Self::LAST_BYTES)
            .ok_or(StoreError::TooLong)?;
        self.flash.write(address, body).map_err(StoreError::Flash)?;
        self.flash
            .write(
                address + const { address_of(SLOT_BYTES - Self::LAST_BYTES) },
                last,
            )
            .map_err(StoreError::Flash)?;
        if self.slot(address)? == *slot {
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

    fn content(&mut self, address: u32) -> Result<Content, StoreError<F::Error>> {
        Ok(content(&self.slot(address)?))
    }

    /// The whole slot with the highest sequence, whatever its schema.
    fn newest(&mut self) -> Result<Option<Place<()>>, StoreError<F::Error>> {
        let mut newest: Option<Place<()>> = None;
        for address in Self::slots(0..2) {
            if let Content::Whole(sequence, _) = self.content(address)?
                && newest
                    .as_ref()
                    .is_none_or(|newest| sequence > newest.sequence)
            {
                newest = Some(Place {
                    sequence,
                    address,
                    content: (),
                });
            }
        }
        Ok(newest)
    }

    /// The first slot of a sector, from an address on, with nothing written in it or after it.
    fn blank_slot(&mut self, sector: u32, from: u32) -> Result<Option<u32>, StoreError<F::Error>> {
        let mut blank = None;
        for address in Self::slots(sector..sector + 1).filter(|address| *address >= from) {
            if matches!(self.content(address)?, Content::Blank) {
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
    for (place, word) in header
        .chunks_exact_mut(4)
        .zip([MAGIC, sequence, PARAMETERS_HASH, length])
    {
        place.copy_from_slice(&word.to_le_bytes());
    }
    *checksum = CRC.checksum(body).to_le_bytes();
    Some(())
}

fn content(slot: &[u8; SLOT_BYTES]) -> Content {
    if slot.iter().all(|&byte| byte == 0xFF) {
        return Content::Blank;
    }
    match whole(slot) {
        Some((sequence, parameters)) => Content::Whole(sequence, parameters),
        None => Content::Torn,
    }
}

/// Sequence and parameters of a slot that is whole.
fn whole(slot: &[u8; SLOT_BYTES]) -> Option<(u32, Option<Parameters>)> {
    let (body, checksum) = slot.split_last_chunk::<CRC_BYTES>()?;
    let (header, payload) = body.split_first_chunk::<HEADER_BYTES>()?;
    let (words, _) = header.as_chunks::<4>();
    let [magic, sequence, schema, length] = words else {
        return None;
    };
    let [magic, sequence, schema, length] =
        [magic, sequence, schema, length].map(|word| u32::from_le_bytes(*word));
    if magic != MAGIC || CRC.checksum(body) != u32::from_le_bytes(*checksum) {
        return None;
    }
    let parameters = (schema == PARAMETERS_HASH)
        .then(|| decoded(payload, length))
        .flatten();
    Some((sequence, parameters))
}

/// Parameters of exactly so many bytes and within their ranges.
fn decoded(payload: &[u8], length: u32) -> Option<Parameters> {
    let bytes = payload.get(..usize::try_from(length).ok()?)?;
    let (parameters, rest) = postcard::take_from_bytes::<Parameters>(bytes).ok()?;
    (rest.is_empty() && validate::parameters(&parameters).is_ok()).then_some(parameters)
}
