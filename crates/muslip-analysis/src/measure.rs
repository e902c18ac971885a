//! Rows of a recording as measurements of friction at a slip: which are used, which are skipped and
//! why, and how noisy a measurement is.

use muslip::filter::mu_slip::Range;
use muslip::sample::{SampleError, SampleLimits, SlipFriction, slip_friction};
use muslip_recordings::input_error::InputError;
use muslip_recordings::recording::{Channel, Recording, Required, Row};
use muslip_recordings::rig_file::{RigFile, Tyre};

use crate::thin::Thinned;

/// Rows between two calls of a progress report.
const ROWS_A_REPORT: u64 = 4096;

/// Most points that the noise of a recording and the range of its tyre are found from.
const SURVEY_POINTS: usize = 1 << 17;

/// Share of the samples that lie below the friction and the slip that a recording is taken to reach: the
/// rest may be outliers.
const REACHED_BY: f64 = 0.99;

/// Peak friction from which a tyre is taken for a car's: midway between the starts of the two ranges.
const CAR_TYRE_FROM: f64 = 0.8;

/// Smallest friction noise that is believed, 1-sigma: a recording without any (a simulated one, say)
/// must still leave the filter's arithmetic well-posed, and no load cell reads finer than this.
pub const SMALLEST_FRICTION_STD: f64 = 1e-4;

/// How many rows were skipped, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Skipped {
    /// A cell of the five required columns is missing or not finite.
    pub not_finite: u64,
    /// Vehicle speed under the minimum.
    pub low_speed: u64,
    /// Normal force under the minimum.
    pub low_normal_force: u64,
    /// Slip outside 0..=1 by more than the margin.
    pub slip_out_of_range: u64,
    /// A delay is compensated, and the samples before do not reach back that far yet.
    pub delay_line_filling: u64,
    /// The estimator refused the measurement.
    pub refused: u64,
}

impl Skipped {
    /// All skipped rows.
    pub fn total(&self) -> u64 {
        self.reasons().iter().map(|(_, count)| count).sum()
    }

    /// The reasons in words with their counts.
    pub fn reasons(&self) -> [(&'static str, u64); 6] {
        [
            ("missing or not finite", self.not_finite),
            ("vehicle speed too low", self.low_speed),
            ("normal force too low", self.low_normal_force),
            ("slip outside 0 to 1", self.slip_out_of_range),
            ("delay line filling", self.delay_line_filling),
            ("refused by the estimator", self.refused),
        ]
    }

    /// The reasons that occurred, as in `3 normal force too low, 1 slip outside 0 to 1`.
    pub fn in_words(&self) -> String {
        self.reasons()
            .iter()
            .filter(|(_, count)| *count > 0)
            .map(|(reason, count)| format!("{count} {reason}"))
            .collect::<Vec<_>>()
            .join(", ")
    }

    pub(crate) fn count(&mut self, error: SampleError) {
        match error {
            SampleError::LowSpeed => self.low_speed += 1,
            SampleError::LowNormalForce => self.low_normal_force += 1,
            SampleError::SlipOutOfRange => self.slip_out_of_range += 1,
            _ => self.not_finite += 1,
        }
    }

    /// Adds the counts of another recording.
    pub fn add(&mut self, other: &Self) {
        self.not_finite += other.not_finite;
        self.low_speed += other.low_speed;
        self.low_normal_force += other.low_normal_force;
        self.slip_out_of_range += other.slip_out_of_range;
        self.delay_line_filling += other.delay_line_filling;
        self.refused += other.refused;
    }
}

/// Where the 1-sigma noise of a friction measurement comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrictionNoise {
    /// The rig file declares the noise of the drag channel, in N; friction's is that over the sample's
    /// normal force.
    Declared {
        /// 1-sigma of the drag channel in N.
        drag_std_n: f64,
    },
    /// Estimated from the recording: the scatter of friction about its course over slip.
    Estimated {
        /// 1-sigma of friction.
        friction_std: f64,
    },
    /// From the model that a diagnosis wrote: the noise of one drag reading.
    Modelled {
        /// 1-sigma of the drag channel in N, ...
        drag_std_n: f64,
        /// ... and the part of it that grows with the drag, as a share of the drag.
        share_of_drag: f64,
    },
}

impl FrictionNoise {
    /// 1-sigma of friction at a normal force in N, where about `friction` is expected.
    pub fn friction_std(&self, normal_force_n: f64, friction: f64) -> f64 {
        match *self {
            Self::Declared { drag_std_n } => drag_std_n / normal_force_n,
            Self::Estimated { friction_std } => friction_std,
            Self::Modelled {
                drag_std_n,
                share_of_drag,
            } => (drag_std_n / normal_force_n)
                .hypot(share_of_drag * friction)
                .max(SMALLEST_FRICTION_STD),
        }
    }
}

/// What a first pass over a recording finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Survey {
    /// What a row must satisfy to count as a measurement.
    pub limits: SampleLimits<f64>,
    /// Median of the finite normal forces in N; `NaN` where there are none.
    pub median_normal_force_n: f64,
    /// The noise of a friction measurement.
    pub noise: FrictionNoise,
    /// Range of tyres that the recording's is in: by the friction that it reaches and, where it does not go
    /// past the rig file's critical slip, by the rig file's peak friction.
    pub range: Range,
    /// Rows of the recording.
    pub rows: u64,
    /// The first finite time in s; `NaN` where there is none.
    pub first_time_s: f64,
    /// Mean time between rows in s; `NaN` of fewer than two.
    pub mean_step_s: f64,
}

impl Survey {
    /// Goes through a recording once for its median normal force, the range of its tyre and, where the rig
    /// file declares no drag noise, the noise of friction. `progress` receives the bytes read so far.
    ///
    /// # Errors
    /// [`InputError`] if the recording is malformed anywhere.
    pub fn of(
        recording: &mut Recording,
        rig: &RigFile,
        progress: &mut dyn FnMut(u64),
    ) -> Result<Self, InputError> {
        let declared = rig.noise.get(Channel::DragForce.name()).copied();
        let mut normal_forces = Vec::new();
        let mut samples = Thinned::new(SURVEY_POINTS);
        let mut rows = 0_u64;
        let (mut first_time_s, mut last_time_s) = (f64::NAN, f64::NAN);
        for_each_row(recording, progress, |row| {
            rows += 1;
            if row.time_s().is_finite() {
                last_time_s = row.time_s();
                if first_time_s.is_nan() {
                    first_time_s = last_time_s;
                }
            }
            let sample = row.rig_sample();
            if sample.normal_force_n.is_finite() {
                normal_forces.push(sample.normal_force_n);
            }
            samples.offer(|| sample);
        })?;
        let median_normal_force_n = median(&mut normal_forces).unwrap_or(f64::NAN);
        let limits = SampleLimits::for_median_normal_force(median_normal_force_n);
        let mut points: Vec<SlipFriction<f64>> = samples
            .items()
            .iter()
            .filter_map(|sample| slip_friction(sample, rig.wheel.radius_m, &limits).ok())
            .collect();
        let noise = match declared {
            Some(drag_std_n) => FrictionNoise::Declared { drag_std_n },
            None => {
                points.sort_by(|a, b| a.slip_ratio.total_cmp(&b.slip_ratio));
                FrictionNoise::Estimated {
                    friction_std: scatter_about_course(&points),
                }
            }
        };
        Ok(Self {
            limits,
            median_normal_force_n,
            noise,
            range: range_of(&points, &rig.tyre),
            rows,
            first_time_s,
            mean_step_s: (last_time_s - first_time_s) / (rows as f64 - 1.0),
        })
    }
}

/// One row as a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Time in s.
    pub time_s: f64,
    /// Slip and friction.
    pub point: SlipFriction<f64>,
    /// Normal force in N.
    pub normal_force_n: f64,
}

/// Goes through a recording and hands on every row that counts as a measurement, in file order; returns
/// how many rows were skipped. `progress` receives the bytes read so far.
///
/// # Errors
/// [`InputError`] if the recording is malformed anywhere, or what `take` answers.
pub fn for_each_measurement<E: From<InputError>>(
    recording: &mut Recording,
    radius_m: f64,
    limits: &SampleLimits<f64>,
    progress: &mut dyn FnMut(u64),
    mut take: impl FnMut(Measurement) -> Result<(), E>,
) -> Result<Skipped, E> {
    let mut skipped = Skipped::default();
    let mut outcome = Ok(());
    for_each_row(recording, progress, |row| {
        if outcome.is_err() {
            return;
        }
        let time_s = row.time_s();
        if !time_s.is_finite() {
            skipped.not_finite += 1;
            return;
        }
        let sample = row.rig_sample();
        match slip_friction(&sample, radius_m, limits) {
            Ok(point) => {
                outcome = take(Measurement {
                    time_s,
                    point,
                    normal_force_n: sample.normal_force_n,
                });
            }
            Err(error) => skipped.count(error),
        }
    })?;
    outcome.map(|()| skipped)
}

/// Goes through all rows of a recording. `progress` receives the bytes read so far.
///
/// # Errors
/// [`InputError`] if the recording is malformed anywhere.
pub(crate) fn for_each_row(
    recording: &mut Recording,
    progress: &mut dyn FnMut(u64),
    mut take: impl FnMut(&Row<'_>),
) -> Result<(), InputError> {
    let mut rows = recording.rows(Required::DragIncluded)?;
    let mut count = 0u64;
    while let Some(row) = rows.next_row()? {
        take(&row);
        count += 1;
        if count.is_multiple_of(ROWS_A_REPORT) {
            progress(rows.bytes_read());
        }
    }
    Ok(())
}

/// The median of finite values, the lower one of the middle two; `None` of none.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len().checked_sub(1)? / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}

/// The value that a share of values lies below; `None` of none.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    let index = (share * values.len().checked_sub(1)? as f64) as usize;
    let (_, value, _) = values.select_nth_unstable_by(index, f64::total_cmp);
    Some(*value)
}

/// The range of tyres that measurements come from, `declared` being the rig file's tyre.
fn range_of(points: &[SlipFriction<f64>], declared: &Tyre) -> Range {
    let reached = |of: fn(&SlipFriction<f64>) -> f64| {
        quantile(points.iter().map(of).collect(), REACHED_BY).unwrap_or(0.0)
    };
    let friction = reached(|point| point.friction);
    let past_the_peak = reached(|point| point.slip_ratio) > declared.critical_slip;
    let peak_friction = if past_the_peak {
        friction
    } else {
        friction.max(declared.peak_friction)
    };
    if peak_friction > CAR_TYRE_FROM {
        Range::Automotive
    } else {
        Range::Aircraft
    }
}

/// 1-sigma of friction about its course over slip, for points in the order of slip.
///
/// Each point is compared with the straight line through its two neighbours; the difference divided by
/// sqrt(1 + a^2 + b^2), with a and b the line's weights, has the noise's variance (T. Gasser, L. Sroka
/// and C. Jennen-Steinmetz, Biometrika 73 (1986) 625-633). Their median, times 1.4826 for a normal
/// distribution, stands for the sigma, so that outliers do not count. Noise of the slip channel counts
/// with the course's slope, as it should: the filter takes slip as known.
fn scatter_about_course(points: &[SlipFriction<f64>]) -> f64 {
    const NORMAL_SIGMA_PER_MEDIAN: f64 = 1.482_602_218_505_602;
    let mut residuals: Vec<f64> = points
        .windows(3)
        .map(|neighbours| {
            let [left, middle, right] = [neighbours[0], neighbours[1], neighbours[2]];
            let span = right.slip_ratio - left.slip_ratio;
            let a = if span > 0.0 {
                (right.slip_ratio - middle.slip_ratio) / span
            } else {
                0.5
            };
            let b = 1.0 - a;
            let line = a * left.friction + b * right.friction;
            ((middle.friction - line) / (1.0 + a * a + b * b).sqrt()).abs()
        })
        .collect();
    let sigma = NORMAL_SIGMA_PER_MEDIAN * median(&mut residuals).unwrap_or(0.0);
    if sigma.is_finite() {
        sigma.max(SMALLEST_FRICTION_STD)
    } else {
        SMALLEST_FRICTION_STD
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn noisy_points(sigma: f64, count: usize) -> Vec<SlipFriction<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        (0..count)
            .map(|index| {
                let slip_ratio = (index as f64 / count as f64).powi(2);
                let draw: f64 = StandardNormal.sample(&mut random);
                let friction = 2.0 * 0.35 * slip_ratio * 0.15 / (0.0225 + slip_ratio * slip_ratio);
                SlipFriction {
                    slip_ratio,
                    friction: friction + sigma * draw,
                }
            })
            .collect()
    }

    #[test]
    fn scatter_about_a_curve_is_its_noise() {
        for (count, tolerance) in [(4000, 0.05), (400, 0.15), (41, 0.4)] {
            let sigma = scatter_about_course(&noisy_points(0.04, count));
            assert!((sigma / 0.04 - 1.0).abs() < tolerance, "{count}: {sigma}");
        }
    }

    #[test]
    fn outliers_do_not_move_the_scatter() {
        let mut points = noisy_points(0.04, 4000);
        for point in points.iter_mut().step_by(50) {
            point.friction = 1e300;
        }
        let sigma = scatter_about_course(&points);
        assert!((sigma / 0.04 - 1.0).abs() < 0.15, "{sigma}");
    }

    #[test]
    fn a_recording_without_noise_still_gets_a_sigma() {
        assert_eq!(scatter_about_course(&[]), SMALLEST_FRICTION_STD);
        assert_eq!(
            scatter_about_course(&noisy_points(0.0, 4000)),
            SMALLEST_FRICTION_STD
        );
    }

    #[test]
    fn the_range_is_the_recording_s_and_short_of_the_peak_the_rig_file_s() {
        let tyre = |peak_friction| Tyre {
            peak_friction,
            critical_slip: 0.15,
            fixed: false,
        };
        let wet = noisy_points(0.04, 400);
        let short_of_peak = &wet[..100];
        let mut dry = wet.clone();
        dry.iter_mut().for_each(|point| point.friction *= 3.0);
        assert_eq!(range_of(&wet, &tyre(0.95)), Range::Aircraft);
        assert_eq!(range_of(&dry, &tyre(0.4)), Range::Automotive);
        assert_eq!(range_of(short_of_peak, &tyre(0.95)), Range::Automotive);
        assert_eq!(range_of(short_of_peak, &tyre(0.4)), Range::Aircraft);
        let mut outliers = wet;
        outliers[7].friction = 1e300;
        assert_eq!(range_of(&outliers, &tyre(0.95)), Range::Aircraft);
        assert_eq!(range_of(&[], &tyre(0.4)), Range::Aircraft);
    }

    #[test]
    fn the_median_of_an_even_number_is_the_lower_of_the_middle_two() {
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut []), None);
    }
}
