//! A balance in integrated form, the wheel's or the vehicle's: a level, and the rate that it is due to change by.
//!
//! Nothing that grows is kept: the filter's level is counted from the last reading of it, and what goes into it are
//! a step's own integral and the difference of two readings, which floating-point numbers hold exactly.

use muslip::real::Real;

use crate::settings::Coloured;
use crate::whitener::{Innovation, Kind, Part, PartError, Whitener};

/// So many readings refused in a row, and the level is taken as lost.
const PATIENCE: u8 = 10;

/// What enters: a walk, noise of the level's reading; integrated noise of the drag, a quick, a slow and a drifting
/// rate; of the run a scale and a zero of the rate.
const PARTS: usize = 8;

/// Noise of a balance, in its own units.
pub(crate) struct Noise<T> {
    /// White noise of the level's reading.
    pub(crate) level_std: T,
    /// What of it remembers.
    pub(crate) level_coloured: Coloured<T>,
    /// White noise of the rate's reading.
    pub(crate) rate_std: T,
    /// What else changes the level: noise of the drag that remembers; quick, slow, drifting.
    pub(crate) rates: [Coloured<T>; 4],
    /// Of the run, as a share of what is scaled.
    pub(crate) scale_std: T,
    /// Of the run, a rate.
    pub(crate) zero_std: T,
}

/// Rate at which the level is due to change.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rate<T> {
    pub(crate) total: T,
    /// The part of it that the run's scale is of.
    pub(crate) scaled: T,
}

/// What all balances are told at a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Step<T> {
    pub(crate) dt_s: T,
    pub(crate) longest_step_s: T,
    pub(crate) gate_stds: T,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Level<T> {
    pub(crate) whitener: Whitener<T, PARTS>,
    variance: T,
    last_reading: Option<T>,
    last_rate: Option<T>,
    refused: u8,
}

impl<T: Real> Level<T> {
    pub(crate) fn new(noise: &Noise<T>) -> Result<Self, PartError> {
        let [of_drag, quick, slow, drifting] = noise.rates.map(|part| Part {
            kind: Kind::Integrated {
                time_constant_s: part.time_constant_s,
            },
            std: part.std,
        });
        let constant = |std| Part {
            kind: Kind::IntegratedConstant,
            std,
        };
        let walk = Part {
            kind: Kind::Walk,
            std: noise.rate_std,
        };
        let coloured = Part {
            kind: Kind::Forgetting {
                time_constant_s: noise.level_coloured.time_constant_s,
            },
            std: noise.level_coloured.std,
        };
        let variance = noise.level_std.squared();
        if !(variance >= T::MIN_POSITIVE && variance.is_finite()) {
            return Err(PartError::Std);
        }
        Ok(Self {
            whitener: Whitener::new([
                walk,
                coloured,
                of_drag,
                quick,
                slow,
                drifting,
                constant(noise.scale_std),
                constant(noise.zero_std),
            ])?,
            variance,
            last_reading: None,
            last_rate: None,
            refused: 0,
        })
    }

    /// One step of time; `rate` is `None` where the balance cannot be formed, `level` where it was not read.
    pub(crate) fn step(
        &mut self,
        step: &Step<T>,
        rate: Option<Rate<T>>,
        level: Option<T>,
    ) -> Option<Innovation<T>> {
        let scaled = rate.map_or(T::ZERO, |rate| rate.scaled);
        let one = T::ONE;
        let rates = [T::ZERO, T::ZERO, one, one, one, one, scaled, one];
        self.whitener.predict(step.dt_s, &rates);
        let before = self.last_rate.filter(|_| step.dt_s <= step.longest_step_s);
        self.last_rate = rate.map(|rate| rate.total);
        match (before, rate) {
            (Some(before), Some(now)) => {
                let mean = T::HALF * (before + now.total);
                self.whitener.shift_level(mean * step.dt_s);
            }
            _ => self.whitener.forget_level(),
        }
        rate?;
        let level = level?;
        if let Some(last) = self.last_reading {
            self.whitener.shift_level(last - level);
        }
        self.last_reading = Some(level);
        let mut row = [T::ZERO; PARTS];
        for gain in row.iter_mut().take(2) {
            *gain = one;
        }
        // As counted from itself, the reading is zero.
        let innovation = self
            .whitener
            .update(T::ZERO, &row, self.variance, step.gate_stds)?;
        self.refused = if innovation.fused {
            0
        } else {
            self.refused.saturating_add(1)
        };
        if self.refused >= PATIENCE {
            self.refused = 0;
            self.whitener.forget_level();
        }
        Some(innovation)
    }

    pub(crate) fn is_finite(&self) -> bool {
        let finite = |value: Option<T>| value.is_none_or(T::is_finite);
        self.whitener.is_finite() && finite(self.last_reading) && finite(self.last_rate)
    }
}
