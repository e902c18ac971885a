//! Locates and names what a simulation left out of a recording.
//!
//! A simulation of a braked wheel and recordings of it disagree. The engine says where (balance, channel, time,
//! operating region), what physics was left out (a mechanism of the [vocabulary](mechanism::Id), or the variable
//! that the rest depends on), repairs the model and proves it on data that no parameter and no choice saw.
//!
//! The modules are the argument, in its order:
//!
//! | step | module |
//! | --- | --- |
//! | what is given | [`campaign`], `cleaning`, [`prepare`], [`smooth`], [`data`] |
//! | what is kept for the proof | [`split`] |
//! | the simulation and its balances | [`model`], [`mechanism`], [`number`] |
//! | noise from the data | [`noise`], [`saturated`], [`omnibus`], [`variable`], [`regression`] |
//! | joint fit | [`fit`] |
//! | choice | [`choose`], [`validation`], [`otherwise`], [`place_or_time`], [`tyre_stage`], [`dynamics_stage`] |
//! | remainder | [`remainder`], [`lines`], [`dynamics_remainder`] |
//! | proof | [`proof`] |
//! | location | [`locate`], `size` |
//! | how sure, and what was looked for | [`confidence`], [`separating`], [`looked`] |
//! | what each part is worth | [`ablation`] |
//! | result and repaired model | [`diagnose`](mod@diagnose), [`outcome`], [`repaired`], [`imbalance`] |
//!
//! It knows no file format and no terminal, and gives the same result whatever the number of threads.
#![forbid(unsafe_code)]
#![expect(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x > 0.0)` sends NaN the refusing way"
)]

pub mod ablation;
pub mod answer;
pub mod audit;
pub mod campaign;
pub mod chain;
pub mod choose;
mod cleaning;
pub mod confidence;
pub mod data;
pub mod decide;
pub mod diagnose;
pub mod dynamics_remainder;
pub mod dynamics_stage;
pub mod fit;
pub mod imbalance;
pub mod innovations;
pub mod lines;
pub mod locate;
pub mod looked;
pub mod mechanism;
pub mod model;
pub mod noise;
pub mod number;
pub mod omnibus;
pub mod otherwise;
pub mod outcome;
pub mod place_or_time;
pub mod prepare;
pub mod proof;
pub mod regression;
pub mod remainder;
pub mod repaired;
pub mod saturated;
pub mod separating;
mod size;
pub mod smooth;
pub mod split;
pub mod tyre_stage;
pub mod validation;
pub mod variable;
