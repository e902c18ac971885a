//! Locates and names what a simulation left out of a recording.
#![forbid(unsafe_code)]
