//! What the chain's own timing does not tell, and so what may be a memory of the chain's.

use crate::constants::LONGEST_TO_EARLY;

/// What the timing of the channels does not tell, in s: kernels differ by about as much as they delay, and a memory that
/// is shorter cannot be told from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Untold {
    /// What wheel speed and brake were off by, or are not known by.
    pub channels_s: f64,
    /// How late the drag may be against the wheel's or the vehicle's speed.
    pub drag_s: f64,
    /// How early the brake may be read.
    pub brake_s: f64,
    /// Whether the drag was left late, or the wheel speed early, for want of a chain that would make it so; or nothing shows
    /// that there is one.
    pub left: bool,
    /// Whether nothing shows that there is one, nor that a channel is out of step but for what is left.
    pub unchained: bool,
    /// Whether the wheel speed is late by turn.
    pub by_turn: bool,
}

impl Untold {
    /// Shortest memory of the tyre that is told from the chain's: longer than what it leaves of the drag's lateness for
    /// the chain to have caused, for a tyre makes the drag late as well.
    #[must_use]
    pub fn shortest_of_tyre_s(self) -> f64 {
        0.5 * self.drag_s
    }

    /// Longest memory of the brake that may be told: one that delays its torque shows its reading early, and what does
    /// not is how the channels' kernels differ.
    #[must_use]
    pub fn longest_of_brake_s(self) -> f64 {
        (LONGEST_TO_EARLY * self.brake_s).max(0.0)
    }
}
