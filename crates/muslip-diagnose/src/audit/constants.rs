//! Every figure that the audit decides by, with what it is for.

/// Step of the grid on which the vehicle's balance is compared, s: slower than any recorder's, faster than any brake.
pub const VEHICLE_STEP_S: f64 = 0.010;
/// Step of the grid on which wheel and tyre are compared, s: a wheel changes its speed within some 30 ms.
pub const WHEEL_STEP_S: f64 = 0.006;
/// Delays tried for the vehicle speed, s: a satellite receiver with its filter, hold and logger is 0.25 s late at most.
pub const VEHICLE_RANGE_S: (f64, f64) = (-0.08, 0.28);
/// Delays tried for the wheel speed and the brake, s.
pub const WHEEL_RANGE_S: (f64, f64) = (-0.07, 0.07);
/// Steps of the coarse scans, s: half the width of the valleys that the refinement falls into.
pub const COARSE_STEP_S: f64 = 0.010;
/// Most rows a balance uses; longer campaigns are thinned by runs.
pub const MOST_ROWS: usize = 6_000;
/// Order of the autoregression that whitens a balance's residual.
pub const WHITENING_ORDER: usize = 6;
/// Fewest stretches that the spread of a delay is judged by; runs are cut until there are as many.
pub const FEWEST_BLOCKS: usize = 6;
/// Shortest stretch that tells of a delay, s.
pub const SHORTEST_BLOCK_S: f64 = 0.8;
/// A finding is told from so many standard deviations.
pub const TOLD_SIGMAS: f64 = 3.0;
/// A delay is told from this size, s: what no engineer would correct is no finding.
pub const LEAST_DELAY_S: f64 = 1e-3;
/// A standard deviation of a delay beyond which nothing is known of it, s.
pub const UNKNOWN_DELAY_S: f64 = 0.02;
/// Share of a recording step by which any delay may be off: samplers are out of step by up to half of it.
pub const STEP_SHARE: f64 = 0.1;
/// Slowest speed at which slip is defined, m/s.
pub const SLOWEST_M_S: f64 = 0.5;
/// Slowest usable speed as a share of the median.
pub const SLOWEST_SHARE: f64 = 0.15;
/// Renewals that a held channel must show.
pub const HELD_STEPS: usize = 8;
/// Share of samples that repeat their predecessor in a held channel, at least.
pub const HELD_REPEATS: f64 = 0.35;
/// Share of renewals that come in step, at least.
pub const HELD_REGULAR: f64 = 0.85;
/// Standard deviation of what is expected of the second moment between two channels of a rig, s²: filters of 12 Hz.
pub const MOMENT_S2: f64 = 1.5e-4;
/// Width over which the vehicle's speed is averaged in the tyre's law, s: what is quicker is the drag's impulse.
pub const SPEED_WIDTH_S: f64 = 0.25;
