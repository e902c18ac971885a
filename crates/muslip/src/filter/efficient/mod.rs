//! The efficient estimator: batch maximum likelihood, sample by sample, in fixed memory.
//!
//! In the logarithm of slip the two-parameter law is one hyperbolic secant that only moves:
//! mu = mup sech(ln s - ln sp). Slip is an angle, s = s0 cot(θ/2), about a fixed slip s0, and with
//! β = (sp - s0)/(sp + s0) = tanh(½ ln(sp/s0))
//!
//! ```text
//! p = cos θ = (s² - s0²)/(s² + s0²)      q = sin θ = 2 s s0/(s² + s0²)
//! mu(s) = mup (1 - β²) q / (1 - 2 β p + β²) = mup (1 - β²) q Σ U_k(p) β^k
//! mu(s)² = mup² (1 - β²) q² Σ (k + 1) U_k(p) β^k
//! ```
//!
//! with the Chebyshev polynomials of the second kind U_k (NIST Handbook of Mathematical Functions 18.12.10;
//! the second line is the derivative of tanh(ln s - ln sp) = p - 2 q² Σ U_k(p) β^(k + 1)). Slip and sp are
//! separated: a sample adds w z q U_k(p) and w q² U_k(p) to two rows of sums, and these hold the whole
//! likelihood
//!
//! ```text
//! -2 ln L = Σ w z² - 2 mup C(β) + mup² D(β)
//! C = (1 - β²) Σ A_k β^k      D = (1 - β²) Σ (k + 1) B_k β^k
//! ```
//!
//! at *every* peak friction and every sp, not only near the present estimate: nothing is linearised, so
//! nothing needs the samples again. The rows end at k = 8: what is left out is below β⁹, 1e-7 within
//! sp = s0 × (0.7 to 1.4) and 0.1 % at s0 × 0.38 and s0 × 2.63. An sp that lies beyond
//! for 16 samples that know it starts the sums anew about that end.
//!
//! A step of Gauss and Newton in (mup, ln sp) solves for the likelihood's maximum, with the expected information,
//! which the sums give too (Σ w sech² tanh² = (2 D + D'')/6, derivatives by ln sp). It follows a sample
//! whenever a quarter more samples have come since the last one, at the latest after 16, and after every
//! sample while sp is unsure (variance of ln sp above 0.02), that is surprising, or that is one of a limited [`Config::memory`]; to the others the estimate
//! moves by a step of the extended Kalman filter from the last solution, which the next solution
//! replaces: nothing of that filter's linearisation remains.
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
//! two divisions, four with a solution, no loop whose length depends on the data.

mod config;
mod estimate;
mod filter;
mod step;
mod sums;

pub use config::{Config, ConfigError, ConfigParameter};
pub use estimate::Estimate;
pub use filter::{EfficientFilter, update};
