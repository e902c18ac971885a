//! Sizes of the noise, fitted balance by balance.

use nalgebra::DMatrix;

use super::filtered::Noise;
use crate::data::Data;
use crate::innovations::candidates::Table;
use crate::innovations::estimate::{self, Readings};
use crate::innovations::gram::{Columns, Gram, grams, total};
use crate::innovations::noise::{BalanceParts, Source};
use crate::innovations::screen::precision;
use crate::mechanism::Balance;

/// How much work a judgement may be.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Steps towards the best parameters.
    pub steps: usize,
    /// Steps towards the best sizes of the noise.
    pub noise_steps: usize,
    /// Every so many blocks are read for the sizes of the noise.
    pub noise_stride: usize,
}

/// Blocks of one balance that are enough for the sizes of its noise.
const ENOUGH_BLOCKS: usize = 20_000;

/// Every so many blocks are enough for the sizes of the noise.
#[must_use]
pub fn noise_stride(data: &Data) -> usize {
    let count = |balance: usize| {
        let blocks = data.blocks.iter().map(|b| b[balance].time.len());
        blocks.sum::<usize>()
    };
    let most = (0..3).map(count).max().unwrap_or(0);
    most.div_ceil(ENOUGH_BLOCKS).max(1)
}

/// The noise with every part at most as large as the sensors make plausible.
#[must_use]
pub fn capped(parts: &[BalanceParts]) -> Vec<BalanceParts> {
    changed(parts, |source| {
        source.log_std = source.log_std.min(source.log_cap);
    })
}

/// The noise with no part free to grow beyond both what it is and what the sensors make plausible: what is added to a model
/// is to explain what the model leaves, not to make the rest of it noise.
#[must_use]
pub fn no_less_plausible(parts: &[BalanceParts]) -> Vec<BalanceParts> {
    changed(parts, |source| {
        source.log_most = source.log_std.max(source.log_cap);
    })
}

fn changed(parts: &[BalanceParts], change: impl FnMut(&mut Source)) -> Vec<BalanceParts> {
    let mut all = parts.to_vec();
    all.iter_mut().flat_map(|p| &mut p.sources).for_each(change);
    all
}

/// Sizes of the noise carried over to gains taken about another model.
pub fn with_sizes(mut fresh: Vec<BalanceParts>, old: &[BalanceParts]) -> Vec<BalanceParts> {
    for (new, old) in fresh.iter_mut().zip(old) {
        for (new, old) in new.sources.iter_mut().zip(&old.sources) {
            new.log_std = old.log_std;
        }
    }
    fresh
}

/// How often the noise of every balance is fitted in turn where nothing is known of any.
pub const SWEEPS: usize = 2;

/// Precision, in its column's own, of a coefficient that is known.
const KNOWN: f64 = 1e9;

/// Fits the noise of one balance after the other, by the likelihood of all: they share the coefficients. `by_balance`
/// are the inner products of the table's columns under the noise as it is, and then as fitted. Coefficients of the first
/// columns that are `held` are known: a parameter at its bound has no size of the noise that its way beyond would leave.
pub fn fit_in_turn(
    data: &Data,
    table: &Table,
    noise: &mut Noise,
    by_balance: &mut [Vec<[Gram; 2]>],
    held: &[bool],
    touched: &dyn Fn(Balance) -> bool,
    effort: Effort,
) {
    let mut products: Vec<DMatrix<f64>> =
        by_balance.iter().map(|own| total(own).products).collect();
    let known = held.iter().enumerate().map(|(i, held)| {
        let own: f64 = products.iter().map(|of| of[(1 + i, 1 + i)]).sum();
        if *held { KNOWN * own } else { 0.0 }
    });
    let known: Vec<f64> = known.collect();
    let prior = |i: usize| precision(table, i) + known.get(i.wrapping_sub(1)).unwrap_or(&0.0);
    for at in 0..products.len() {
        let mut part = noise.parts()[at].clone();
        if !touched(part.balance) {
            continue;
        }
        let mut others = DMatrix::zeros(products[at].nrows(), products[at].ncols());
        for (_, own) in products.iter().enumerate().filter(|(i, _)| *i != at) {
            others += own;
        }
        let columns = &table.columns[part.balance as usize];
        let readings = Readings {
            data,
            columns,
            precision: &prior,
            others: &others,
            stride: effort.noise_stride,
        };
        estimate::fit(&readings, &mut part, effort.noise_steps);
        noise.replace(data, at, part);
        by_balance[at] = grams(noise.filters(at), columns);
        products[at] = total(&by_balance[at]).products;
    }
}

/// Whether any of these columns is more than nothing in a balance.
pub fn touches(columns: &[Columns], which: core::ops::Range<usize>) -> bool {
    columns
        .iter()
        .filter(|run| run.len() >= which.end)
        .any(|run| run[which.clone()].iter().flatten().any(|x| *x != 0.0))
}
