//! What the samples said of each part of the slip axis.

use super::sums::Sums;
use crate::real::{QUARTER_BINADES, Real};

/// Samples of one quarter of a binade of slip, as if all had been taken at its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Bin<T> {
    /// Σ w f², f being the middle's slip times the law at the sample's over the law at the middle.
    pub weight: T,
    /// Σ w f z.
    pub friction: T,
    /// Σ w z².
    pub square: T,
    /// Number of samples.
    pub count: T,
}

/// All parts of the slip axis.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Bins<T> {
    bins: [Bin<T>; QUARTER_BINADES],
    /// A bit for each that holds samples.
    pub occupied: u32,
    /// A bit for each that is taken for an outlier's.
    pub left_out: u32,
}

/// One sample as the bins and the sums take it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Term<T> {
    /// The bin.
    pub index: usize,
    /// f.
    pub ratio: T,
    /// w.
    pub weight: T,
    /// z.
    pub friction: T,
    /// sech(ln s - ln s0).
    pub sech: T,
    /// tanh(ln s - ln s0).
    pub tanh: T,
}

impl<T: Real> Bin<T> {
    const EMPTY: Self = Self {
        weight: T::ZERO,
        friction: T::ZERO,
        square: T::ZERO,
        count: T::ZERO,
    };

    /// Σ w (z - mu)² of a curve whose friction at the middle is so many times its slip.
    #[inline]
    pub(super) fn residual(&self, friction: T) -> T {
        self.square - friction * (self.friction + self.friction - friction * self.weight)
    }
}

impl<T: Real> Bins<T> {
    pub(super) const NONE: Self = Self {
        bins: [Bin::EMPTY; QUARTER_BINADES],
        occupied: 0,
        left_out: 0,
    };

    /// The bin of an index, an empty one beyond the last.
    #[inline]
    pub(super) fn get(&self, index: usize) -> Bin<T> {
        self.bins.get(index).copied().unwrap_or(Bin::EMPTY)
    }

    #[inline(always)]
    pub(super) fn add(&mut self, term: &Term<T>) {
        let Some(bin) = self.bins.get_mut(term.index) else {
            return;
        };
        let seen = term.weight * term.ratio;
        bin.weight += seen * term.ratio;
        bin.friction += seen * term.friction;
        bin.square += term.weight * term.friction * term.friction;
        bin.count += T::ONE;
        self.occupied |= 1 << term.index;
    }

    /// Empties a bin.
    pub(super) fn empty(&mut self, index: usize) {
        if let Some(bin) = self.bins.get_mut(index) {
            *bin = Bin::EMPTY;
            self.occupied &= !(1 << index);
            self.left_out &= !(1 << index);
        }
    }

    /// All weights times one factor, all counts times another.
    pub(super) fn scale(&mut self, weight: T, count: T) {
        for bin in &mut self.bins {
            bin.weight *= weight;
            bin.friction *= weight;
            bin.square *= weight;
            bin.count *= count;
        }
    }

    /// Adds the sums of what is not left out, about a slip.
    #[inline(never)]
    pub(super) fn add_about(&self, slip: T, sums: &mut Sums<T>) {
        let (twice, about) = (slip + slip, slip * slip);
        let mut left = self.occupied & !self.left_out;
        while left != 0 {
            // Two at a time: one division for both.
            let one = left.trailing_zeros() as usize;
            left &= left - 1;
            let other = left.trailing_zeros() as usize;
            let (bin, next) = (self.get(one), self.get(other));
            left &= left.wrapping_sub(1);
            let (a, b) = (
                T::middle_of_quarter_binade(one),
                T::middle_of_quarter_binade(other),
            );
            let (a2, b2) = (a * a, b * b);
            let (about_a, about_b) = (a2 + about, b2 + about);
            let inverse = T::ONE / (about_a * about_b);
            let (by_a, by_b) = (inverse * about_b, inverse * about_a);
            sums.add(twice * by_a, (a2 - about) * by_a, bin.weight, bin.friction);
            sums.add(
                twice * by_b,
                (b2 - about) * by_b,
                next.weight,
                next.friction,
            );
        }
    }

    /// Σ w z² and the number of samples of what is not left out.
    pub(super) fn totals(&self) -> (T, T) {
        let mut totals = (T::ZERO, T::ZERO);
        let mut left = self.occupied & !self.left_out;
        while left != 0 {
            let bin = self.get(left.trailing_zeros() as usize);
            left &= left - 1;
            totals.0 += bin.square;
            totals.1 += bin.count;
        }
        totals
    }

    pub(super) fn is_finite(&self) -> bool {
        // A sum is finite only if each term is.
        let mut all = T::ZERO;
        for bin in &self.bins {
            all += bin.weight + bin.friction + bin.square + bin.count;
        }
        all.is_finite()
    }
}
