//! Columns side by side: what one pass of the filter takes along at once.

use std::cell::RefCell;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Dyn};

use crate::number::finite_or_zero;

/// Columns that go through the filter side by side.
pub const LANES: usize = 8;

/// One reading of so many columns.
pub type Lane = [f64; LANES];

/// Rooms that a thread keeps for later: sizes of the noise are tried by the hundred, and fresh memory costs as much as a
/// pass of the filter.
const MOST_SPARE: usize = 8;

thread_local! {
    static SPARE: RefCell<Vec<Vec<Lane>>> = const { RefCell::new(Vec::new()) };
}

/// Columns of one run: reading by reading, all columns of one beside each other, in groups of [`LANES`].
#[derive(Debug, Default)]
pub struct Lanes {
    /// Number of columns.
    pub count: usize,
    readings: usize,
    /// By reading and group.
    values: Vec<Lane>,
}

impl Drop for Lanes {
    fn drop(&mut self) {
        let values = core::mem::take(&mut self.values);
        SPARE.with_borrow_mut(|spare| {
            if spare.len() < MOST_SPARE {
                spare.push(values);
            }
        });
    }
}

impl Lanes {
    /// Room for so many columns of so many readings, in which anything may stand.
    pub(super) fn room(count: usize, readings: usize) -> Self {
        let mut values = SPARE.with_borrow_mut(Vec::pop).unwrap_or_default();
        values.resize(readings * count.div_ceil(LANES), [0.0; LANES]);
        Self {
            count,
            readings,
            values,
        }
    }

    /// These columns at these samples.
    #[must_use]
    pub fn of(columns: &[&[f64]], samples: &[usize]) -> Self {
        let mut all = Self::room(columns.len(), samples.len());
        let groups = all.groups().max(1);
        for (group, own) in columns.chunks(LANES).enumerate() {
            let own: [&[f64]; LANES] =
                core::array::from_fn(|l| own.get(l).copied().unwrap_or_default());
            for (reading, &k) in all.values.chunks_exact_mut(groups).zip(samples) {
                reading[group] = own.map(|column| column.get(k).copied().unwrap_or(0.0));
            }
        }
        all
    }

    /// Groups of columns.
    pub(super) fn groups(&self) -> usize {
        self.count.div_ceil(LANES)
    }

    /// One array a reading and group, reading by reading.
    pub(super) fn values(&self) -> &[Lane] {
        &self.values
    }

    pub(super) fn values_mut(&mut self) -> &mut [Lane] {
        &mut self.values
    }

    /// A row a column, a column a reading.
    fn stacked(&self) -> DMatrixView<'_, f64, Dyn, Dyn> {
        let strides = (Dyn(1), Dyn(self.groups() * LANES));
        let shape = (Dyn(self.count), Dyn(self.readings));
        let values = self.values.as_flattened();
        DMatrixView::from_slice_with_strides_generic(values, shape.0, shape.1, strides.0, strides.1)
    }

    /// The same turned round.
    fn turned(&self) -> DMatrixView<'_, f64, Dyn, Dyn> {
        let strides = (Dyn(self.groups() * LANES), Dyn(1));
        let shape = (Dyn(self.readings), Dyn(self.count));
        let values = self.values.as_flattened();
        DMatrixView::from_slice_with_strides_generic(values, shape.0, shape.1, strides.0, strides.1)
    }

    /// Inner products over some of the readings; what is not finite is nothing.
    #[must_use]
    pub fn products(&self, from: usize, to: usize) -> DMatrix<f64> {
        if !self.values.as_flattened().iter().all(|x| x.is_finite()) {
            let mut finite = Self::room(self.count, self.readings);
            finite.values.copy_from_slice(&self.values);
            for x in finite.values.as_flattened_mut() {
                *x = finite_or_zero(*x);
            }
            return finite.products(from, to);
        }
        if self.count == 0 {
            return DMatrix::zeros(0, 0);
        }
        self.stacked().columns(from, to - from) * self.turned().rows(from, to - from)
    }

    /// These rows of so many columns.
    pub(super) fn of_readings<const C: usize>(rows: &[[f64; C]]) -> Self {
        let mut all = Self::room(C, rows.len());
        let width = all.groups() * LANES;
        let readings = all.values.as_flattened_mut().chunks_exact_mut(width);
        for (reading, row) in readings.zip(rows) {
            reading[..C].copy_from_slice(row);
            reading[C..].fill(0.0);
        }
        all
    }

    /// One column.
    pub(super) fn column(&self, index: usize) -> Vec<f64> {
        self.stacked().row(index).iter().copied().collect()
    }

    /// Inner products with other columns (a column each) over all readings.
    #[must_use]
    pub fn products_with(&self, other: &Self) -> DMatrix<f64> {
        self.stacked() * other.turned()
    }

    /// Sums of the columns, by how much of each (row) a sum (column) has.
    #[must_use]
    pub(super) fn sums(&self, weights: &DMatrix<f64>) -> Self {
        let mut all = Self::room(weights.ncols(), self.readings);
        let rows = all.groups() * LANES;
        debug_assert_eq!(rows, weights.ncols(), "whole groups");
        let into = all.values.as_flattened_mut();
        if self.count == 0 {
            into.fill(0.0);
            return all;
        }
        // A column a reading: what is written to has no gaps, for nalgebra 0.35 writes small products beside those.
        DMatrixViewMut::from_slice(into, rows, self.readings).gemm(
            1.0,
            &weights.transpose(),
            &self.stacked(),
            0.0,
        );
        all
    }
}
