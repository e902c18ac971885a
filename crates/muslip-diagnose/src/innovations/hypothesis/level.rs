//! What the slow part of a recorded level falls short by.

use super::filtered::Noise;
use super::judged::Judged;
use crate::data::Data;
use crate::innovations::gram::{grams, total};
use crate::mechanism::Balance;

/// Whole wheel speed over its slow part, as a model's noise weighs them: <slow, whole> / <slow, slow>.
///
/// An error of the inertia scales the whole speed. Its column is made of the slow part, for the reading's own noise in it
/// would be bought by a smaller inertia; that part lacks what is fast, and the coefficient comes out too large by this. The
/// slow part is an instrument for the whole: its noise is next to none (W. A. Fuller, Measurement Error Models, Wiley 1987,
/// section 1.4).
#[must_use]
pub fn whole_over_slow(data: &Data, judged: &Judged) -> f64 {
    let noise = Noise::new(data, judged.parts.clone());
    let runs = data.series.iter().zip(&data.blocks);
    let columns: Vec<_> = runs
        .map(|(s, blocks)| {
            let blocks = &blocks[Balance::Wheel as usize];
            vec![blocks.mean(&s.wheel.slow), blocks.mean(&s.wheel.raw)]
        })
        .collect();
    let of_wheel = noise
        .balances()
        .find(|(part, _)| part.balance == Balance::Wheel);
    let Some((_, filters)) = of_wheel else {
        return 1.0;
    };
    let products = total(&grams(filters, &columns)).products;
    let by = products[(0, 1)] / products[(0, 0)];
    if by.is_finite() { by.max(1.0) } else { 1.0 }
}
