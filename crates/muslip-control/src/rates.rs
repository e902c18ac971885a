//! How often a board samples, and how finely it stamps edges.

use muslip_record::{LINK_BYTES_PER_SECOND, SAMPLE_RATE_HZ};

use crate::number::nearest;

/// Slowest sampling that interlocks are made for, in Hz: a dump is one sample away.
pub const SLOWEST_HZ: u32 = 250;

/// The rates of a board. All else is in s or ms and becomes samples and ticks by these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rates {
    sample_hz: u32,
    edge_timer_hz: u32,
    /// Made once: a division by what is not known until it runs may panic.
    link_bytes: u32,
}

impl Rates {
    /// Samples a second, a divisor of 1,000 from [`SLOWEST_HZ`] to what the link carries ([`SAMPLE_RATE_HZ`]); ticks a second of
    /// the timers that stamp encoder edges, 1 to 500 MHz. For a constant: others stop the build.
    ///
    /// # Panics
    /// Outside these ranges.
    #[must_use]
    pub const fn new(sample_hz: u32, edge_timer_hz: u32) -> Self {
        assert!(sample_hz >= SLOWEST_HZ && sample_hz <= SAMPLE_RATE_HZ);
        assert!(1_000_u32.is_multiple_of(sample_hz));
        assert!(edge_timer_hz >= 1_000_000 && edge_timer_hz <= 500_000_000);
        Self {
            sample_hz,
            edge_timer_hz,
            link_bytes: LINK_BYTES_PER_SECOND / sample_hz * 4 / 3,
        }
    }

    /// Samples a second.
    #[must_use]
    pub const fn sample_hz(self) -> u32 {
        self.sample_hz
    }

    /// Ticks a second of the timers that stamp edges.
    #[must_use]
    pub const fn edge_timer_hz(self) -> u32 {
        self.edge_timer_hz
    }

    /// Seconds from one sample to the next.
    #[must_use]
    pub const fn sample_s(self) -> f32 {
        1.0 / nearest(self.sample_hz)
    }

    /// Seconds from one tick to the next.
    #[must_use]
    pub const fn tick_s(self) -> f32 {
        1.0 / nearest(self.edge_timer_hz)
    }

    /// Samples in so many ms, at most a million; at least one.
    #[must_use]
    pub const fn samples(self, ms: u32) -> u32 {
        let samples = ms * self.sample_hz / 1_000;
        if samples == 0 { 1 } else { samples }
    }

    /// Bytes that the link's wire brings in a sample, and some more.
    #[must_use]
    pub const fn link_bytes(self) -> u32 {
        self.link_bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_become_samples_and_ticks() {
        let rates = Rates::new(500, 170_000_000);
        assert_eq!(rates.sample_s(), 0.002);
        assert_eq!(rates.samples(250), 125);
        assert_eq!(rates.samples(1), 1);
        assert_eq!(rates.samples(120_000), 60_000);
        assert_eq!(rates.tick_s(), 1.0 / 170e6);
        let rates = Rates::new(1_000, 84_000_000);
        assert_eq!(rates.sample_s(), 0.001);
        assert_eq!(rates.samples(60_000), 60_000);
        // More than the wire brings, so that nothing is ever left.
        assert!(rates.link_bytes() * 1_000 > LINK_BYTES_PER_SECOND);
    }
}
