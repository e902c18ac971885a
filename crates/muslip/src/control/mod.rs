//! Control of a braked wheel: slip held at a setpoint.
//!
//! [`slip::SlipController`] turns slip into brake torque. It knows no filter: slip may come from
//! [`QuarterCarFilter`](crate::filter::quarter_car::QuarterCarFilter), from measured speeds or, in a
//! simulation, from the truth.

pub mod lock_guard;
pub mod peak_seeker;
pub mod slip;
