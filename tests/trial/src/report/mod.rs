//! The whole trial and its pages.
//!
//! | what | module |
//! | --- | --- |
//! | the play | [`trial`] |
//! | what keeps it honest | [`seal`], [`ratchet`] |
//! | speed | [`pace`] |
//! | pages and pictures | [`pages`], [`plots`] |

pub mod pace;
pub mod pages;
pub mod plots;
pub mod ratchet;
pub mod seal;
pub mod trial;
