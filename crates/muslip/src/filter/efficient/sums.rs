//! The sums that hold the likelihood, and what they say at a critical slip.

use crate::real::Real;

/// Terms of a row: powers of β from 0.
pub(super) const TERMS: usize = 9;

/// G_{k+1} = rise_k 2p G_k - fall_k G_{k-1} for k = 0..8: (k + 2)/(k + 1) and (k + 3)/(k + 1).
const RECURRENCE: [(f64, f64); TERMS - 1] = [
    (2.0, 3.0),
    (1.5, 2.0),
    (4.0 / 3.0, 5.0 / 3.0),
    (1.25, 1.5),
    (1.2, 1.4),
    (7.0 / 6.0, 4.0 / 3.0),
    (8.0 / 7.0, 9.0 / 7.0),
    (1.125, 1.25),
];

/// Sums over samples: all that the likelihood needs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Sums<T> {
    /// A_k = Σ w z q U_k(p).
    pub friction: [T; TERMS],
    /// B_k = Σ w q² G_k(p).
    pub law: [T; TERMS],
    /// Σ w z².
    pub square: T,
    /// Number of samples (with forgetting: of those that still count).
    pub count: T,
}

/// One sample as the sums take it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Term<T> {
    /// w z.
    pub weighted_friction: T,
    /// w.
    pub weight: T,
    /// z.
    pub friction: T,
    /// cos θ.
    pub p: T,
    /// sin θ.
    pub q: T,
}

/// Sums at a critical slip, with derivatives by its logarithm.
#[derive(Debug, Clone, Copy)]
pub(super) struct AtSlip<T> {
    /// C.
    pub friction: T,
    /// C'.
    pub friction_slope: T,
    /// D.
    pub law: T,
    /// D'/2.
    pub law_half_slope: T,
    /// Σ w (∂sech/∂ln sp)².
    pub slip_information: T,
}

impl<T: Real> Sums<T> {
    pub(super) fn none() -> Self {
        Self {
            friction: [T::ZERO; TERMS],
            law: [T::ZERO; TERMS],
            square: T::ZERO,
            count: T::ZERO,
        }
    }

    /// Adds one sample.
    #[inline(always)]
    pub(super) fn add(&mut self, term: &Term<T>) {
        let twice_p = term.p + term.p;
        let (mut before, mut now) = (T::ZERO, term.weighted_friction * term.q);
        for sum in &mut self.friction {
            *sum += now;
            (before, now) = (now, twice_p * now - before);
        }
        let (mut before, mut now) = (T::ZERO, term.weight * (term.q * term.q));
        let mut rows = self.law.iter_mut();
        if let Some(first) = rows.next() {
            *first += now;
        }
        for (sum, (rise, fall)) in rows.zip(RECURRENCE) {
            let next = T::from_f64(rise) * (twice_p * now) - T::from_f64(fall) * before;
            (before, now) = (now, next);
            *sum += now;
        }
        self.square += term.weighted_friction * term.friction;
        self.count += T::ONE;
    }

    /// All sums times a factor.
    pub(super) fn scale(&mut self, factor: T) {
        for sum in self.friction.iter_mut().chain(&mut self.law) {
            *sum *= factor;
        }
        self.square *= factor;
        self.count *= factor;
    }

    /// Takes other sums out of these.
    pub(super) fn subtract(&mut self, other: &Self) {
        for (sum, other) in self.friction.iter_mut().zip(other.friction) {
            *sum -= other;
        }
        for (sum, other) in self.law.iter_mut().zip(other.law) {
            *sum -= other;
        }
        self.square -= other.square;
        self.count -= other.count;
    }

    /// The sums at β.
    #[inline(always)]
    pub(super) fn at(&self, beta: T) -> AtSlip<T> {
        // Horner's rule with derivatives.
        let (mut c, mut c1) = (T::ZERO, T::ZERO);
        for &coefficient in self.friction.iter().rev() {
            c1 = c1 * beta + c;
            c = c * beta + coefficient;
        }
        let (mut d, mut d1, mut d2) = (T::ZERO, T::ZERO, T::ZERO);
        for &coefficient in self.law.iter().rev() {
            d2 = d2 * beta + d1;
            d1 = d1 * beta + d;
            d = d * beta + coefficient;
        }
        // dβ/d ln sp = g/2 with g = 1 - β²; C = g c, D = g² d, d² d/dβ² = 2 d2.
        let g = T::ONE - beta * beta;
        let (u, v) = (g * d1, beta * d);
        let law = g * g * d;
        // D'/2 = g²(g d1 - 4 β d)/4
        let law_half_slope = T::from_f64(0.25) * g * g * (u - T::from_f64(4.0) * v);
        // D'' = g² (g² d2/2 - 5/2 β g d1 + (4 β² - g) d)
        let second = g
            * g
            * (T::HALF * (g * g) * d2 - T::from_f64(2.5) * beta * u
                + (T::from_f64(4.0) * (beta * beta) - g) * d);
        AtSlip {
            friction: g * c,
            friction_slope: T::HALF * g * (g * c1 - T::TWO * beta * c),
            law,
            law_half_slope,
            slip_information: (law + law + second) * T::from_f64(1.0 / 6.0),
        }
    }

    /// Residual sum of squares of a curve.
    #[inline]
    pub(super) fn residual(&self, peak_friction: T, beta: T) -> T {
        let at = self.at(beta);
        self.square - peak_friction * (at.friction + at.friction - peak_friction * at.law)
    }

    pub(super) fn is_finite(&self) -> bool {
        // A sum is finite only if each term is.
        let mut all = self.square + self.count;
        for &sum in self.friction.iter().chain(&self.law) {
            all += sum;
        }
        all.is_finite()
    }
}
