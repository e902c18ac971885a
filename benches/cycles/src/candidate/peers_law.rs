//! The model function that all peers are given: the law, its gradient, and the noise with pseudonoise.

use super::Matrix2;

/// (3 · 0.04)²
const INFLATED: f32 = 0.0144;

/// What the law says at a state and a slip.
pub struct Linearised {
    pub friction: f32,
    pub gradient: [f32; 2],
    /// Variance of the measurement, pseudonoise included.
    pub variance: f32,
}

#[inline(always)]
pub fn linearised([mup, sp]: [f32; 2], p: &Matrix2<f32>, s: f32) -> Linearised {
    let (s2, sp2) = (s * s, sp * sp);
    let w = 1.0 / (sp2 + s2);
    let h0 = 2.0 * s * sp * w;
    let friction = mup * h0;
    let by_both = 2.0 * s * (s2 - sp2) * w * w;
    let second = friction * (sp2 - 3.0 * s2) * w * w;
    let p11 = p[(1, 1)];
    Linearised {
        friction,
        gradient: [h0, mup * by_both],
        variance: INFLATED + p11 * (by_both * by_both * p[(0, 0)] + second * second * p11),
    }
}
