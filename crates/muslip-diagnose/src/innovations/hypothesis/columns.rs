//! A model's parameters and its columns: what of it is fitted, in which bounds, and with which products.

use super::filtered::Noise;
use crate::data::Data;
use crate::innovations::candidates::{Table, table};
use crate::innovations::dependence::{Dependence, width};
use crate::innovations::gram::{Gram, grams};
use crate::innovations::noise::Slopes;
use crate::mechanism::Residuals;
use crate::model::Model;

pub fn bounds(data: &Data, model: &Model) -> Vec<(f64, f64)> {
    let mut all = vec![(f64::NEG_INFINITY, f64::INFINITY); model.base.len()];
    let [peak, critical] = data.context.nominal;
    all[0] = ((0.05 * peak).ln(), (10.0 * peak).ln());
    all[1] = ((0.05 * critical).ln(), (10.0 * critical).ln());
    for term in &model.terms {
        all.extend(
            data.catalogue
                .get(term.entry)
                .parameters(&data.context)
                .iter()
                .map(|p| (p.low, p.high)),
        );
    }
    all
}

/// Columns of a model that nothing is to be added to.
pub fn table_of(
    data: &Data,
    model: &Model,
    chain: (&Slopes, &[Vec<f64>]),
    extra: &[Dependence],
) -> Table {
    let none = vec![Residuals::default(); data.series.len()];
    table(data, model, chain, &none, extra, &[], &|_| false)
}

/// Inner products of all columns of a table under this noise, by balance, run and half.
#[must_use]
pub fn grams_by_balance(noise: &Noise, table: &Table) -> Vec<Vec<[Gram; 2]>> {
    let balances = noise.balances();
    balances
        .map(|(part, filters)| grams(filters, &table.columns[part.balance as usize]))
        .collect()
}

/// The sum over the balances, by run and half.
#[must_use]
pub fn over_balances(data: &Data, table: &Table, by_balance: &[Vec<[Gram; 2]>]) -> Vec<[Gram; 2]> {
    let width = 1
        + table.base
        + table.nuisances.len()
        + table.candidates.last().map_or(0, |c| c.columns.end);
    let mut by_run = vec![[Gram::empty(width), Gram::empty(width)]; data.series.len()];
    for own in by_balance {
        for (into, own) in by_run.iter_mut().zip(own) {
            for (into, own) in into.iter_mut().zip(own) {
                into.add(own);
            }
        }
    }
    by_run
}

/// Inner products of all columns of a table under this noise, summed over the balances, by run and half.
#[must_use]
pub fn table_grams(data: &Data, noise: &Noise, table: &Table) -> Vec<[Gram; 2]> {
    over_balances(data, table, &grams_by_balance(noise, table))
}

/// Columns whose coefficients are at their best wherever the model stands: free dependences and the chain's nuisances.
pub fn linear(table: &Table, model: &Model) -> Vec<usize> {
    let first = 1 + model.free_places().len();
    (first..1 + table.base + table.nuisances.len()).collect()
}

/// Columns of what was added last: the last dependence's, or the last term's.
pub fn added_columns(model: &Model, extra: &[Dependence]) -> core::ops::Range<usize> {
    let terms = 1 + model.free_places().len();
    match extra.split_last() {
        Some((_, before)) => terms + width(before)..terms + width(extra),
        None => {
            let own = model.terms.last().map_or(0, |t| t.parameters.len());
            terms - own..terms
        }
    }
}
