//! The emergency stop: two channels that must agree, and a proof that it works before arming.

use crate::rates::Rates;

/// How long in ms the channels may differ: contacts never part at once.
pub const DIFFERING_MS: u32 = 100;

/// What both channels have said since the start.
#[derive(Debug, Clone, Copy)]
pub struct EmergencyStop {
    /// Samples for which they may differ, and have.
    tolerated: u32,
    differing: u32,
    seen_open: bool,
    proven: bool,
}

impl EmergencyStop {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new(rates: Rates) -> Self {
        Self {
            tolerated: rates.samples(DIFFERING_MS),
            differing: 0,
            seen_open: false,
            proven: false,
        }
    }

    /// Takes what the channels say at a sample: which are open.
    pub fn update(&mut self, open: [bool; 2]) {
        let [a, b] = open;
        self.differing = if a == b {
            0
        } else {
            self.differing.saturating_add(1)
        };
        if self.disagrees() {
            // It has failed where it should have proven itself.
            self.seen_open = false;
            self.proven = false;
        }
        self.seen_open |= a && b;
        self.proven |= self.seen_open && !a && !b;
    }

    /// Whether the channels have differed for too long: a contact is welded, or a wire is broken.
    pub fn disagrees(&self) -> bool {
        self.differing > self.tolerated
    }

    /// Whether both have been seen to open and to close again since the start.
    pub fn is_proven(&self) -> bool {
        self.proven
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(samples: &[([bool; 2], u32)]) -> EmergencyStop {
        let mut stop = EmergencyStop::new(Rates::new(1_000, 84_000_000));
        for &(open, times) in samples {
            for _ in 0..times {
                stop.update(open);
            }
        }
        stop
    }

    const CLOSED: [bool; 2] = [false; 2];
    const OPEN: [bool; 2] = [true; 2];
    const ONE: [bool; 2] = [true, false];
    const OTHER: [bool; 2] = [false, true];

    #[test]
    fn it_is_proven_by_both_channels_that_open_together_and_close_again() {
        assert!(!after(&[(CLOSED, 1000)]).is_proven());
        assert!(!after(&[(OPEN, 1000)]).is_proven());
        assert!(after(&[(OPEN, 1), (CLOSED, 1)]).is_proven());
        assert!(after(&[(ONE, 5), (OPEN, 1), (OTHER, 5), (CLOSED, 1)]).is_proven());
        // One after the other is not both.
        assert!(!after(&[(ONE, 50), (CLOSED, 1), (OTHER, 50), (CLOSED, 1)]).is_proven());
    }

    #[test]
    fn channels_that_differ_for_100_ms_disagree_and_prove_nothing() {
        for one in [ONE, OTHER] {
            assert!(!after(&[(one, 100)]).disagrees());
            assert!(after(&[(one, 101)]).disagrees());
            assert!(!after(&[(one, 60), (CLOSED, 1), (one, 60)]).disagrees());
            let failed = after(&[(OPEN, 1), (one, 101), (CLOSED, 1)]);
            assert!(!failed.disagrees() && !failed.is_proven());
        }
    }
}
