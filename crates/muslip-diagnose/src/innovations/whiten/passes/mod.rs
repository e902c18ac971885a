//! The filter's passes over the runs.
//!
//! Each is compiled for the wider registers of newer processors, too, and the widest that is there runs. None fuses a
//! product with a sum, so all give the same digits. What belongs to the noise alone goes through several runs side by
//! side, what belongs to columns through several columns.

mod columns;
mod covariance;
mod traces;

pub use columns::{Apply, Expected, Squares};
pub use covariance::{Covariance, Found};
pub use traces::Traces;

use super::course::{Course, NOTHING, Step};
use super::part::MOST;

/// Runs that go through the filter side by side.
pub const RUNS: usize = 8;

/// One number of every run.
type ByRun<const R: usize> = [f64; R];
/// One of every state of every run.
type States<const R: usize> = [ByRun<R>; MOST];

/// The steps that the runs stand at, nothing where one has ended, and what each state keeps of itself over them.
#[inline(always)]
fn steps_at<'a, const R: usize>(
    courses: &[&'a Course; R],
    at: usize,
) -> ([&'a Step; R], States<R>) {
    let steps: [&Step; R] = core::array::from_fn(|r| courses[r].steps.get(at).unwrap_or(&NOTHING));
    let decays: [&[f64; MOST]; R] = core::array::from_fn(|r| courses[r].decay_of(steps[r]));
    let decay = core::array::from_fn(|i| decays.map(|own| own[i]));
    (steps, decay)
}

/// Length of the longest of these.
fn longest<const R: usize>(courses: &[&Course; R]) -> usize {
    courses.iter().map(|c| c.steps.len()).max().unwrap_or(0)
}
