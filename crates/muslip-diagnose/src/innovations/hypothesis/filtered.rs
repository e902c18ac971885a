//! Noise of all balances with the filters that it makes, and the force that the chain's nuisances of the levels are of: made
//! once, for many models are weighed under one noise.

use std::sync::Arc;

use crate::data::Data;
use crate::innovations::gram::Filters;
use crate::innovations::noise::{BalanceParts, Slopes};
use crate::innovations::whiten::whiteners;
use crate::model::Model;

fn filters(data: &Data, parts: &BalanceParts) -> Arc<Filters> {
    Arc::new(whiteners(&parts.courses(data, 1), &parts.sizes()))
}

/// Noise of all balances with its filters.
#[derive(Clone)]
pub struct Noise {
    parts: Vec<BalanceParts>,
    filters: Vec<Arc<Filters>>,
    /// The force that nuisances of the levels are of, where that is another model's.
    held: Option<Arc<Vec<Vec<f64>>>>,
}

impl Noise {
    /// Of these parts.
    #[must_use]
    pub fn new(data: &Data, parts: Vec<BalanceParts>) -> Self {
        let filters = parts.iter().map(|own| filters(data, own));
        Self {
            filters: filters.collect(),
            parts,
            held: None,
        }
    }

    /// The same, the chain's nuisances of the levels held to the force of a model. A nuisance that is fitted takes a share of its
    /// column, so a parameter that changes the column changes what is left by as much, which the column of the parameter itself
    /// does not say: the way it points leads elsewhere.
    #[must_use]
    pub fn held_to(self, data: &Data, model: &Model) -> Self {
        Self {
            held: Some(Arc::new(Slopes::new(data, model).force)),
            ..self
        }
    }

    /// The same by parts of other sizes.
    #[must_use]
    pub fn of_parts(&self, data: &Data, parts: Vec<BalanceParts>) -> Self {
        Self {
            held: self.held.clone(),
            ..Self::new(data, parts)
        }
    }

    /// The force that nuisances of the levels are of beside a model.
    #[must_use]
    pub fn force_of_levels<'a>(&'a self, own: &'a Slopes) -> &'a [Vec<f64>] {
        self.held.as_ref().map_or(&own.force, |held| held)
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
