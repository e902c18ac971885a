//! Derivatives of the rows in a model's parameters, by dual numbers no wider than it has such parameters.

use super::rows::{Triple, moved_rows, tyre_rows};
use crate::data::{Data, Listed, WIDTH};
use crate::model::Model;
use crate::number::{Dual, Number as _};

/// Derivatives of the rows in the parameters `which` of the model's vector; empty where a whole balance has none.
#[must_use]
pub fn slopes_in(data: &Data, model: &Model, run: usize, which: &[usize]) -> Vec<Triple> {
    which
        .chunks(WIDTH)
        .flat_map(|chunk| match chunk.len() {
            0..=2 => of_rows::<2>(data, model, run, chunk),
            3..=4 => of_rows::<4>(data, model, run, chunk),
            _ => of_rows::<WIDTH>(data, model, run, chunk),
        })
        .collect()
}

/// The same of the tyre's row alone.
#[must_use]
pub fn tyre_slopes_in(data: &Data, model: &Model, run: usize, which: &[usize]) -> Vec<Vec<f64>> {
    which
        .chunks(WIDTH)
        .flat_map(|chunk| match chunk.len() {
            0..=2 => of_tyre::<2>(data, model, run, chunk),
            3..=4 => of_tyre::<4>(data, model, run, chunk),
            _ => of_tyre::<WIDTH>(data, model, run, chunk),
        })
        .collect()
}

fn of_rows<const N: usize>(data: &Data, model: &Model, run: usize, which: &[usize]) -> Vec<Triple>
where
    Dual<N>: Listed,
{
    let p: Vec<Dual<N>> = variables(&model.vector(), which);
    let series = &data.series[run];
    let all = moved_rows(&data.catalogue, model, &p, series, &data.context);
    let slopes = |at: usize| [&all.tyre, &all.wheel, &all.vehicle].map(|x| slopes_at(x, at));
    (0..which.len()).map(slopes).collect()
}

fn of_tyre<const N: usize>(data: &Data, model: &Model, run: usize, which: &[usize]) -> Vec<Vec<f64>>
where
    Dual<N>: Listed,
{
    let p: Vec<Dual<N>> = variables(&model.vector(), which);
    let series = &data.series[run];
    let row = tyre_rows(&data.catalogue, model, &p, series, &data.context);
    (0..which.len()).map(|at| slopes_at(&row, at)).collect()
}

/// A vector of parameters with the derivatives in these of them, in their order.
fn variables<const N: usize>(p: &[f64], which: &[usize]) -> Vec<Dual<N>> {
    let number = |(i, v): (usize, &f64)| {
        let at = which.iter().position(|c| *c == i);
        at.map_or(Dual::constant(*v), |at| Dual::variable(*v, at))
    };
    p.iter().enumerate().map(number).collect()
}

fn slopes_at<const N: usize>(x: &[Dual<N>], at: usize) -> Vec<f64> {
    x.iter().map(|d| d.slope[at]).collect()
}
