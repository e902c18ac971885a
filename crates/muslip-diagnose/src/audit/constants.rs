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
/// Standard deviation of what is expected of the second moment of a brake column against its torque, s²: lags of 30 ms.
pub const BRAKE_MOMENT_S2: f64 = 1e-3;
/// Width over which the vehicle's speed is averaged in the tyre's law, s: what is quicker is the drag's impulse.
pub const SPEED_WIDTH_S: f64 = 0.25;
/// Step at which channels are kept as integrals, s: a third of the finest grid.
pub const KNOT_S: f64 = 0.002;
/// Most knots of a channel; longer runs are kept more coarsely.
pub const MOST_KNOTS: usize = 60_000;
/// Width over which a held vehicle's speed is averaged for the instruments, s: it is only programmed to change slowly.
pub const HELD_WIDTH_S: f64 = 0.7;
/// Factor on the standard deviation of a delay: it is judged by half a dozen stretches (Student's quantile at two).
pub const SPREAD_FACTOR: f64 = 1.3;
/// What a delay may be off by because filters differ in shape from what they are taken for, s and as a share of it.
pub const FORM_S: f64 = 3e-4;
/// As [`FORM_S`].
pub const FORM_SHARE: f64 = 0.04;
/// Coherence with its period that a held channel's renewals must have, 0 to 1; chance gives less than a fifth.
pub const HELD_COHERENCE: f64 = 0.45;
/// Differences of a channel that its lattice is read off, at most.
pub const LATTICE_VALUES: usize = 4000;
/// A step is one of the channel from so many last decimals on.
pub const LATTICE_DECIMALS: f64 = 2.5;
/// Mean cosine of the differences over the step, at least; values on no lattice give nothing.
pub const LATTICE_COHERENCE: f64 = 0.7;
/// Correlation with the drag beyond which a column is the drag.
pub const LEAK_SURE: f64 = 0.9995;
/// The same where it copies the drag's noise as well.
pub const LEAK_LEVEL: f64 = 0.98;
/// Correlation of the noises from which a column copies it: two sensors' noises have none.
pub const LEAK_COPIES: f64 = 0.25;
/// Most samples by which a copy is later or earlier than the drag.
pub const LEAK_MOST_LATE: isize = 10;
/// Correlation of two sensors' noises that chance makes at most, times the root of the readings: differences of white noise
/// have one of 1.5 (1 standard deviation), and several columns and times are looked at.
pub const LEAK_BY_CHANCE: f64 = 6.0;
/// Readings that say something of a column, at least.
pub const LEAK_READINGS: f64 = 50.0;
/// What columns together leave of the drag may grow so many times without one of them that it had no part in it.
pub const LEAK_IDLE: f64 = 2.0;
/// Lowest frequency at which a line is looked for, Hz: brakes are worked at lower ones.
pub const HUM_LOWEST_HZ: f64 = 12.0;
/// Length of the windows that hum is looked for in, s.
pub const HUM_WINDOW_S: f64 = 2.5;
/// Orders of the wheel's turning that hum could be mistaken for.
pub const HUM_ORDERS: core::ops::RangeInclusive<usize> = 1..=12;
/// Spread of hum's amplitude over windows, as a share of it, at most.
pub const HUM_SPREAD: f64 = 0.5;
/// Relative distance from a line up to which an order of the wheel's turning may be it.
pub const HUM_NEAR: f64 = 0.3;
/// Share of a line's power that the wheel's angle may explain as well as the clock.
pub const HUM_SHARE: f64 = 0.7;
/// A line's power against the median of its neighbours'.
pub const LINE_RATIO: f64 = 15.0;
/// An order's power against that beside it.
pub const RIPPLE_RATIO: f64 = 5.0;
/// Share of a ripple that the law's slip shows below which the wheel speed's own reading lacks it: an encoder's is all
/// in it, a radius that varies leaves it to the wheel to follow. With three standard deviations added none of ten encoders of
/// development campaigns has less than 1.0, none of ten radii more than 0.73.
pub const READ_SHARE: f64 = 0.8;
/// As [`READ_SHARE`]: fewest pieces of a few turns that tell, by their weights.
pub const FEWEST_TURNED: f64 = 6.0;
/// Orders of the wheel's turning that are looked at.
pub const ORDERS: [usize; 6] = [1, 2, 3, 4, 7, 11];
/// Width of the smooth course that lines are looked for beside, s.
pub const SMOOTH_S: f64 = 0.12;
/// Relative change of the wheel speed over twice [`SMOOTH_S`] up to which it is calm.
pub const CALM: f64 = 0.015;
/// A filter is told from so many standard deviations of its second moment.
pub const FILTER_SIGMAS: f64 = 5.0;
/// Whitened squares by which a filter of the drag explains it better than a delay and than a tyre's length: on
/// development campaigns with such a filter hundreds to thousands.
pub const POLE_SQUARES: f64 = 50.0;
/// Shortest time constant that is told, s.
pub const LEAST_FILTER_S: f64 = 0.008;
/// Longest time constant of a channel's noise, s: what lasts longer is physics or drift.
pub const LONGEST_COLOUR_S: f64 = 0.7;
/// Share of its free-rolling speed from which a wheel counts as rolling.
pub const ROLLING_SHARE: f64 = 0.95;
/// Length of the blocks that second differences are summed over, s: shorter than a braking.
pub const MEMORY_BLOCK_S: f64 = 0.3;
/// Groups of blocks that are left out in turn for the spread.
pub const MEMORY_GROUPS: usize = 12;
/// Lags of second differences, evenly in their logarithm.
pub const MEMORY_LAGS: usize = 20;
/// Time constants that are tried.
pub const MEMORY_TIMES: usize = 24;
/// A memory is told from so many standard deviations of its variance.
pub const MEMORY_SIGMAS: f64 = 4.0;
/// A second difference of so many standard deviations, as most of them have, is no noise's: a motion breaks off there. Of
/// noise hardly one in a hundred thousand is as large.
pub const MEMORY_BREAK_SIGMAS: f64 = 4.5;
/// Longest lag at which wheel and vehicle speed are compared, s.
pub const COMMON_LAG_S: f64 = 0.3;
/// A common error is told from this share of each speed's own noise.
pub const COMMON_SHARE: f64 = 0.7;
/// Longest lag at which a channel's own memory is looked for, s.
pub const OWN_LAG_S: f64 = 0.8;
/// A channel's lasting noise is told from this share of its white noise's standard deviation.
pub const LASTING_SHARE: f64 = 0.7;
/// Lag at which blocks are seen to move, s: noise has many such in a block.
pub const MEMORY_MOTION_S: f64 = 0.02;
/// Least share of the square of what is rough in the drag that a hum makes, for it to be said to be left unexplained. Hums of
/// measuring chains on 120 development campaigns made up to 0.21; of as much as all noise of the tyre's balance, 0.29.
pub const HUM_BEYOND_NOISE: f64 = 0.25;
/// Share of a drag's zero by which law and wheel's balance may tell it differently.
pub const ZERO_SHARE: f64 = 0.25;
/// Fewest standard deviations of a zero that only the law tells.
pub const ZERO_ALONE_SIGMAS: f64 = 5.0;
/// Factor on what the law's zero is said to be uncertain by: the law's form is only nearly a tyre's.
pub const ZERO_LAW_FACTOR: f64 = 2.0;
/// Share of the drag's squares that the rig file's law explains, at whatever peak, from which the drag speaks of slip.
pub const DRAG_OF_SLIP: f64 = 0.5;
/// A wheel rolls where the ratio of its speeds is so near to the run's median.
pub const ROLLING_NEAR: f64 = 0.15;
/// Longest stretch that has a radius of its own, s: the slip of a wheel that drives goes with road and wind.
pub const LONGEST_ROLLING_S: f64 = 8.0;
/// Share of what moves in the vehicle speed that the wheel's must explain to be a clock of it.
pub const ROLLING_EXPLAINED: f64 = 0.5;
/// Least scale of a speed that is told: by half a percent a tyre's radius changes with load and pressure.
pub const LEAST_SCALE: f64 = 0.005;

// Ringing of the drag.

/// Longest window of its spectra, s: what decays within it shows its width.
pub const RING_WINDOW_S: f64 = 1.5;
/// Slowest ring that is looked for, Hz.
pub const RING_SLOWEST_HZ: f64 = 5.0;
/// Fastest, as a share of the sampling rate: above it filters and decimation end the spectrum.
pub const RING_FASTEST: f64 = 0.2;
/// Least gain on unseen runs, nats: of 576 campaigns without a mode none in which the
/// runs are as alike has 150.
pub const RING_LEAST_NATS: f64 = 200.0;
/// Least t of the gains' signed roots.
pub const RING_ALIKE_T: f64 = 3.0;
/// Orders of the wheel's turning that are no ring.
pub const RING_ORDERS: [f64; 3] = [1.0, 2.0, 3.0];
/// How near to an order a frequency is that order's, as a share of it.
pub const RING_NEAR_ORDER: f64 = 0.08;
