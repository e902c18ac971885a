//! The efficient estimator: batch maximum likelihood, sample by sample, in fixed memory.
//!
//! In the logarithm of slip the two-parameter law is one hyperbolic secant that only moves:
//! mu = mup sech(ln s - ln sp). Slip is an angle, s = s0 cot(θ/2), about a fixed slip s0, and with
//! β = (sp - s0)/(sp + s0) = tanh(½ ln(sp/s0))
//!
//! ```text
//! p = cos θ = (s² - s0²)/(s² + s0²)      q = sin θ = 2 s s0/(s² + s0²)
//! mu(s) = mup (1 - β²) q / (1 - 2 β p + β²) = mup (1 - β²) q Σ U_k(p) β^k
//! mu(s)² = mup² (1 - β²)² q² Σ G_k(p) β^k
//! ```
//!
//! with the Chebyshev polynomials of the second kind U_k and Gegenbauer's G_k = C_k^(2) (NIST Handbook of
//! Mathematical Functions 18.12.4). Slip and sp are separated: a sample adds w z q U_k(p) and
//! w q² G_k(p) to two rows of sums, and these hold the whole likelihood
//!
//! ```text
//! -2 ln L = Σ w z² - 2 mup C(β) + mup² D(β)
//! C = (1 - β²) Σ A_k β^k      D = (1 - β²)² Σ B_k β^k
//! ```
//!
//! at *every* peak friction and every sp, not only near the present estimate: nothing is linearised, so
//! nothing needs the samples again. The rows end at k = 8: what is left out is below β⁹, 1e-7 within
//! sp = s0 × (0.7 to 1.4) and 0.1 % at s0 × 0.38 and s0 × 2.63. An sp that lies beyond
//! for 16 samples that know it starts the sums anew about that end.
//!
//! After each sample one step of Gauss and Newton in (mup, ln sp) follows, with the expected information,
//! which the sums give too (Σ w sech² tanh² = (2 D + D'')/6, derivatives by ln sp).
//!
//! | what | how |
//! |---|---|
//! | noise | only its ratio between samples is believed; the level is learnt from the residual sum of squares, the declared one counting as half a sample |
//! | prior | peak friction N(start, start²); ln sp N(start, ½), faded as 1/(1 + information)² once samples speak |
//! | outliers | beyond the gate a measurement is rejected (three in a row at most); one that is surprising but not beyond it is summed twice, and taken out again if it still does not fit once the curve is known |
//! | tracking | [`Config::memory`] samples, exponentially forgotten; a fourth measurement in a row beyond the gate starts the sums anew |
//! | slip noise | not modelled: it lowers the estimate of the peak as it does that of any fit that takes slip as known |
//!
//! Memory: two rows twice and some fifteen numbers, below 256 bytes in `f32`, whatever the number of samples. Cost:
//! three divisions, no loop whose length depends on the data.

mod config;
mod filter;
mod sums;

pub use config::{Config, ConfigError, ConfigParameter};
pub use filter::{EfficientFilter, Estimate, update};
