//! `muslip diagnose`, `muslip predict`: files in, engine, files out.

pub mod load;
