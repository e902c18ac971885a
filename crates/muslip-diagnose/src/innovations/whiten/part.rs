//! The parts of the noise.

/// Most states of one balance. All loops run over so many, so that they are unrolled: what a balance has less are
/// parts of no variance that enter nothing.
pub const MOST: usize = 8;

/// How one part of the noise goes in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Forgets with this time constant in s.
    Forgetting(f64),
    /// Stays what it is over a run.
    Constant,
    /// The level that all integrated parts enter, itself driven by white noise: its standard deviation grows with
    /// the root of time. Nothing is known of it at the start and after a gap. At most one a balance, the first part. Readings are
    /// means of it over the time since the one before: as points they would seem to be alike from one to the next, and a
    /// drag that is late or lags would explain it.
    Walk,
    /// Forgets with this time constant in s and is integrated into the walk.
    Integrated(f64),
    /// White noise that has passed two poles whose time constants are this one, in s, but for [`APART`]: what a filtered
    /// reading errs by. At most one a balance, of at most [`MOST`] less one parts.
    Filtered(f64),
}

/// By what factor the poles of filtered noise differ from their mean: equal ones would be no sum of two parts.
pub const APART: f64 = 1.2;

/// The second state of filtered noise is the last one.
pub const TWIN: usize = MOST - 1;

/// What a mean of a walk over a time has of the walk's variance over it, and shares with where the walk is at its end: white
/// noise comes into a mean by what is left of the time.
pub const MEAN_OF_WALK: [f64; 2] = [1.0 / 3.0, 0.5];

/// Filtered noise is the difference of two parts that one white noise drives, each forgetting with one of the poles.
#[derive(Clone, Copy)]
pub struct Pair {
    /// State of the first part; that of the second is [`TWIN`].
    pub at: usize,
    /// Variances of both and their covariance where the difference has a variance of one.
    variances: [f64; 3],
}

impl Pair {
    /// That of these parts, where one is filtered noise.
    pub fn of(parts: &[Part<'_>]) -> Option<Self> {
        let is_filtered = |part: &Part<'_>| matches!(part.kind, Kind::Filtered(_));
        let at = parts.iter().position(is_filtered)?;
        debug_assert!(parts.len() < MOST, "{} parts", parts.len());
        // Rates over that of the mean.
        let (fast, slow) = (APART, 1.0 / APART);
        let variances = [0.5 / slow, 0.5 / fast, 1.0 / (slow + fast)];
        let whole = variances[0] + variances[1] - 2.0 * variances[2];
        Some(Self {
            at,
            variances: variances.map(|v| v / whole),
        })
    }

    /// What a unit of variance adds over a step that keeps so much of the first part and of the second, to the first,
    /// the second and what they share.
    #[inline(always)]
    pub fn driven(&self, start: f64, a: f64, b: f64) -> [f64; 3] {
        let [first, second, shared] = self.variances;
        [
            first * (start + 1.0 - a * a),
            second * (start + 1.0 - b * b),
            shared * (start + 1.0 - a * b),
        ]
    }
}

/// One part of the noise on one run.
#[derive(Clone, Debug)]
pub struct Part<'a> {
    /// How it goes in time.
    pub kind: Kind,
    /// Standard deviation (of a walk: after one second).
    pub std: f64,
    /// By what it enters each reading; empty where by one.
    pub gain: &'a [f64],
}

/// What each part keeps of itself over a step of time.
pub fn decays(parts: &[Part<'_>], dt: f64) -> [f64; MOST] {
    let mut all = core::array::from_fn(|i| match parts.get(i).map(|part| part.kind) {
        Some(Kind::Forgetting(tau) | Kind::Integrated(tau)) => (-dt / tau).exp(),
        Some(Kind::Filtered(tau)) => (-dt / (APART * tau)).exp(),
        _ => 1.0,
    });
    for part in parts {
        if let Kind::Filtered(tau) = part.kind {
            all[TWIN] = (-dt * APART / tau).exp();
        }
    }
    all
}

/// How the parts go in time; what there is not stays nothing.
pub fn kinds(parts: &[Part<'_>]) -> [Kind; MOST] {
    core::array::from_fn(|i| parts.get(i).map_or(Kind::Constant, |part| part.kind))
}
