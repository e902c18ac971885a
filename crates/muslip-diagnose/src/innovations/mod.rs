//! Residuals of the three balances, their covariance, and the innovations under it.

pub mod blocks;
pub mod candidates;
pub mod dependence;
pub mod derivatives;
pub mod estimate;
pub mod gram;
pub mod hypothesis;
pub mod noise;
mod nuisances;
pub mod rows;
pub mod screen;
pub mod slip;
#[cfg(test)]
pub mod toy;
pub mod whiten;
