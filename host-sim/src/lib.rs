//! Rig simulator, recordings and reports behind the `muslip` command.
#![forbid(unsafe_code)]
