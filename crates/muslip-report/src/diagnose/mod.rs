//! The page of a diagnosis, its pictures, its summary for a terminal, and its files.

mod blocks;
pub mod effects;
pub mod files;
pub mod page;
pub mod plots;
mod proof;
pub mod summary;
pub mod views;
