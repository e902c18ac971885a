//! The efficient estimator: batch maximum likelihood, sample by sample, in fixed memory.
//!
//! About a critical slip s0 the two-parameter law is, with x = ln s - ln s0 and sp = s0 e^δ,
//!
//! ```text
//! mu = mup sech(x - δ) = mup sech x (1 + δ tanh x) + O(δ²)
//! ```
//!
//! a straight line in (mup, mup δ). Five sums hold its least squares:
//! Σ w z sech, Σ w z sech tanh, Σ w sech², Σ w sech² tanh, Σ w sech² tanh² (w = 1/variance). Each sample
//! costs two divisions: one for sech and tanh, which are fractions of s and s0, and one for the solution,
//! which is one step of Gauss and Newton from s0.
//!
//! The step is exact only near s0. So that the sums can be taken about another s0 without the samples, these
//! are also summed by slip, into quarters of binades: what a sample says of the curve is carried to the
//! middle of its quarter, f = sech(x)/sech(x at the middle), as w f² and w f z. When sp has moved by a part
//! of its own standard deviation, one pass over the quarters gives the sums about where it is now, and so
//! the next step: batch Gauss-Newton, spread over the samples as they come. Passes become rare as the
//! logarithm of the samples.
//!
//! | what | how |
//! |---|---|
//! | noise | only its ratio between samples is believed; the level is learnt from the residual sum of squares, the declared one counting as half a sample |
//! | prior | peak friction N(start, start²); ln sp N(start, ½), faded as 1/(1 + information)² once samples speak |
//! | outliers | beyond the gate a measurement is rejected, and so is a burst of them: three to eight in a row at least, then until they agree on another peak, 64 at most (an eighth of the samples so far, 7 % of the memory). Where the residuals are larger than the noise can be, each quarter with few samples is judged by itself against the median of all: it may be left out, and taken in again |
//! | tracking | [`Config::memory`] samples, exponentially forgotten; measurements in a row beyond the gate that are believed in the end start the sums anew |
//! | slip noise | not modelled: it lowers the estimate of the peak as it does that of any fit that takes slip as known |
//!
//! Memory: 512 bytes in `f32`, whatever the number of samples. Cost: no loop whose length depends on
//! the data beyond the 24 quarters; noise, prior and thresholds are renewed each time that the samples
//! have doubled.

mod bins;
mod config;
mod dissent;
mod estimate;
mod filter;
mod fuse;
mod judge;
mod sums;

pub use config::{Config, ConfigError, ConfigParameter};
pub use estimate::Estimate;
pub use filter::{EfficientFilter, update_unchecked};
