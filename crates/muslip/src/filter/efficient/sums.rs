//! The sums that hold the likelihood near one critical slip.

use crate::real::Real;

/// Sums over samples about a critical slip s0.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sums<T> {
    /// Σ w z sech.
    pub friction: T,
    /// Σ w z sech tanh.
    pub friction_slope: T,
    /// Σ w sech².
    pub law: T,
    /// Σ w sech² tanh.
    pub law_slope: T,
    /// Σ w sech² tanh².
    pub law_curvature: T,
}

impl<T: Real> Sums<T> {
    pub(super) const NONE: Self = Self {
        friction: T::ZERO,
        friction_slope: T::ZERO,
        law: T::ZERO,
        law_slope: T::ZERO,
        law_curvature: T::ZERO,
    };

    /// Adds to the five sums of the law what has weight w and weighted friction w z.
    #[inline(always)]
    pub(super) fn add(&mut self, sech: T, tanh: T, weight: T, weighted_friction: T) {
        let weighted = weight * sech;
        let friction = weighted_friction * sech;
        let law = weighted * sech;
        let law_slope = law * tanh;
        self.friction += friction;
        self.friction_slope += friction * tanh;
        self.law += law;
        self.law_slope += law_slope;
        self.law_curvature += law_slope * tanh;
    }

    /// All weights times a factor.
    pub(super) fn scale(&mut self, weight: T) {
        for sum in [
            &mut self.friction,
            &mut self.friction_slope,
            &mut self.law,
            &mut self.law_slope,
            &mut self.law_curvature,
        ] {
            *sum *= weight;
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        // A sum is finite only if each term is.
        (self.friction + self.friction_slope + self.law + self.law_slope + self.law_curvature)
            .is_finite()
    }
}
