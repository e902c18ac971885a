//! Noise of all balances with the filters that it makes: made once, for many models are weighed under one noise.

use std::sync::Arc;

use crate::data::Data;
use crate::innovations::gram::Filters;
use crate::innovations::noise::BalanceParts;
use crate::innovations::whiten::whiteners;

fn filters(data: &Data, parts: &BalanceParts) -> Arc<Filters> {
    Arc::new(whiteners(&parts.courses(data, 1), &parts.sizes()))
}

/// Noise of all balances with its filters.
#[derive(Clone)]
pub struct Noise {
    parts: Vec<BalanceParts>,
    filters: Vec<Arc<Filters>>,
}

impl Noise {
    /// Of these parts.
    #[must_use]
    pub fn new(data: &Data, parts: Vec<BalanceParts>) -> Self {
        let filters = parts.iter().map(|own| filters(data, own));
        Self {
            filters: filters.collect(),
            parts,
        }
    }

    /// Its parts, balance by balance.
    #[must_use]
    pub fn parts(&self) -> &[BalanceParts] {
        &self.parts
    }

    /// The parts alone.
    #[must_use]
    pub fn into_parts(self) -> Vec<BalanceParts> {
        self.parts
    }

    /// Parts and filters, balance by balance.
    pub fn balances(&self) -> impl Iterator<Item = (&BalanceParts, &Filters)> {
        let filters = self.filters.iter().map(AsRef::as_ref);
        self.parts.iter().zip(filters)
    }

    /// Gives one balance other parts.
    pub fn replace(&mut self, data: &Data, at: usize, parts: BalanceParts) {
        self.filters[at] = filters(data, &parts);
        self.parts[at] = parts;
    }

    /// The filters of one balance.
    #[must_use]
    pub fn filters(&self, at: usize) -> &Filters {
        &self.filters[at]
    }
}
