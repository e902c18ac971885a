//! Tolerances, seeded noise and reference scenarios shared by the tests.
#![forbid(unsafe_code)]

pub mod noise;
pub mod port;
pub mod scenario;
pub mod tolerance;

pub use noise::Noise;
pub use port::MemoryPort;
pub use tolerance::Tolerance;
