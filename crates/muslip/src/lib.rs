//! no_std estimators and tyre laws of the mu-slip curve.
#![no_std]
#![forbid(unsafe_code)]
