//! The whole trial and its pages.

pub mod pace;
pub mod pages;
pub mod trial;
