//! What the file of a mechanism is written with.

pub use super::describe::{
    Against, Audited, Describe, Facts, Fitted, Mechanism, Parameter, Reported, Residuals, Search,
    Speed, Stage, above_limit, below_limit,
};
pub use super::guide::{Alias, Compensation, Example, Guide, Kind, Memory, Sign, runs};
pub use super::id::Id;
pub use super::state::State;
pub use crate::balance::Balance;
pub use crate::context::Context;
pub use crate::number::Number;
pub use crate::series::Series;
