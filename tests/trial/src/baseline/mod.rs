//! What a reader may compare with: textbook methods on the same files.

pub mod regression;
