//! What rejected readings say to each other.

use crate::real::{QUARTER_BINADES, Real};

/// Readings that are rejected in a row before they may be believed for agreeing with each other.
const LEAST: (u16, u16) = (3, 8);
/// Readings that are rejected in a row, whatever they say.
const MOST: (u16, u16) = (3, 64);
/// Samples seen for each of [`LEAST`], and for each of [`MOST`].
const SEEN_FOR: (u16, u16) = (16, 8);
/// The same with forgetting, as a share of the memory: what is longer is no burst to it.
const SHARE_OF_MEMORY: f64 = 0.07;
/// Sum of squares about the level, in noise variances a reading, up to which readings agree.
const AGREEING: f64 = 2.0;
/// Readings that the sum is granted more than there are.
const FEW: f64 = 3.0;
/// What the sum would be at least were they off by the same amount each, or the same, over what it is, and in noise
/// variances beyond that, from which a level can be told from either.
const TELLING: (f64, f64) = (1.5, 40.0);

/// Readings rejected one after another, as a curve of the same slip at the peak and another peak.
///
/// A burst of glitches is no curve: its readings scatter, or are off by the same amount whatever the slip. Where
/// slip stands still a burst that does not scatter cannot be told from a change of friction, but by its length.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Dissent<T> {
    /// Σ sech.
    shape: T,
    /// Σ sech².
    law: T,
    /// Σ z sech.
    friction: T,
    /// Σ z².
    square: T,
    /// From the lowest: a bit for each bin that holds nothing but a rejected reading; the number of readings in a row
    /// that failed the gate; whether they are believed all the same.
    pending: u32,
}

const BINS: u32 = (1 << QUARTER_BINADES) - 1;
const READING: u32 = 1 << QUARTER_BINADES;
const OPEN: u32 = 1 << 31;
const _: () = assert!(QUARTER_BINADES + 7 <= 31);
/// More than enough to be open.
const MOST_COUNTED: u32 = 100;

impl<T: Real> Dissent<T> {
    pub(super) const NONE: Self = Self {
        shape: T::ZERO,
        law: T::ZERO,
        friction: T::ZERO,
        square: T::ZERO,
        pending: 0,
    };

    /// Whether nothing was rejected that a reading which passes the gate has to end.
    #[inline]
    pub(super) fn is_none(&self) -> bool {
        self.pending == 0
    }

    /// Keeps in mind that a bin holds nothing but a rejected reading.
    pub(super) fn keep(&mut self, index: usize) {
        self.pending |= 1 << index & BINS;
    }

    /// Forgets bins that are not left out any more.
    pub(super) fn keep_only(&mut self, left_out: u32) {
        self.pending &= left_out | !BINS;
    }

    /// A reading has passed the gate; whether its bin holds nothing but one that did not.
    pub(super) fn end(&mut self, index: usize) -> bool {
        let bin = 1 << index & BINS;
        let held = self.pending & bin != 0;
        *self = Self {
            pending: self.pending & BINS & !bin,
            ..Self::NONE
        };
        held
    }

    pub(super) fn is_finite(&self) -> bool {
        // A sum is finite only if each term is.
        (self.shape + self.law + self.friction + self.square).is_finite()
    }

    /// Takes a reading that failed the gate; whether it is to be believed all the same.
    ///
    /// `sech` is the law's at its slip, `noise` the variance that it has, `seen` the number of samples so far.
    pub(super) fn take(
        &mut self,
        (seen, memory): (u16, Option<T>),
        [sech, friction]: [T; 2],
        [peak_friction, noise]: [T; 2],
    ) -> bool {
        if self.pending & OPEN != 0 {
            return true;
        }
        self.add(sech, friction);
        let readings = self.readings();
        // What rests on few samples is sooner wrong.
        let (least, over) = match memory {
            Some(memory) => {
                let most = (memory * T::from_f64(SHARE_OF_MEMORY))
                    .max(T::from_f64(f64::from(MOST.0)))
                    .min(T::from_f64(f64::from(MOST.1)));
                (LEAST.0, count::<T>(readings) > most)
            }
            None => {
                let most = (seen / SEEN_FOR.1).max(MOST.0).min(MOST.1);
                let least = (seen / SEEN_FOR.0).max(LEAST.0).min(LEAST.1);
                (least, readings > u32::from(most))
            }
        };
        let open =
            over || readings > u32::from(least) && self.agrees(peak_friction, noise, readings);
        if open {
            self.pending |= OPEN;
        }
        open
    }

    fn readings(&self) -> u32 {
        (self.pending & !OPEN) >> QUARTER_BINADES
    }

    fn add(&mut self, sech: T, friction: T) {
        self.shape += sech;
        self.law += sech * sech;
        self.friction += sech * friction;
        self.square += friction * friction;
        self.pending += READING;
    }

    /// Takes a reading that passed the gate, and would have passed one about what was rejected as well: slip so small
    /// that it does not tell which is right. Whether it is such a one.
    ///
    /// Readings that scatter have no level to pass, and one beside the curve's own decides nothing at any slip:
    /// good readings after such a burst would count as rejected, and the next burst be believed for their number.
    pub(super) fn is_undecided(
        &mut self,
        [sech, friction]: [T; 2],
        [peak_friction, noise]: [T; 2],
        tolerated: T,
    ) -> bool {
        let readings = self.readings();
        if readings == 0 || readings >= MOST_COUNTED || self.pending & OPEN != 0 {
            return false;
        }
        let level = self.friction / self.law;
        let about = self.square - level * self.friction;
        let apart = level - peak_friction;
        let off = friction - level * sech;
        let undecided = off * off <= tolerated
            && apart * apart > tolerated
            && about <= agreeing(noise, count::<T>(readings));
        if undecided {
            self.add(sech, friction);
        }
        undecided
    }

    /// Whether the readings are those of one level, and of nothing else that glitches make.
    fn agrees(&self, peak_friction: T, noise: T, readings: u32) -> bool {
        let number = count::<T>(readings);
        let (share, beyond) = TELLING;
        let level = self.friction / self.law;
        let about = self.square - level * self.friction;
        let spread = self.law - self.shape * self.shape / number;
        let off = level - peak_friction;
        // Off by the same amount each, or all of the same value.
        let apart = (off * off).min(level * level) * spread;
        level > T::ZERO
            && about <= agreeing(noise, number)
            && apart > T::from_f64(share) * about + T::from_f64(beyond) * noise
    }
}

/// Sum of squares about their level up to which so many readings agree.
fn agreeing<T: Real>(noise: T, number: T) -> T {
    T::from_f64(AGREEING) * noise * (number + T::from_f64(FEW))
}

/// A small number, bit by bit: the scalar is made of constants only.
fn count<T: Real>(number: u32) -> T {
    let (mut sum, mut place, mut left) = (T::ZERO, T::ONE, number);
    while left != 0 {
        if left & 1 != 0 {
            sum += place;
        }
        place += place;
        left >>= 1;
    }
    sum
}
