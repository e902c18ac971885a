//! The tyre's balance: e = F − N mu(s), in N.

use muslip::law::{Rudd, TyreLaw};
use muslip::real::Real;
use muslip::sample::{RigSample, slip_friction};

use crate::settings::{Coloured, Setting, Settings};
use crate::whitener::{Innovation, Kind, Part, Whitener};

/// The law at one slip, times a normal force.
#[derive(Debug, Clone, Copy)]
struct Expansion<T> {
    /// N mu in N.
    force: T,
    /// N ∂mu/∂s in N.
    slope: T,
    /// N ∂²mu/∂s² in N.
    curvature: T,
}

/// Of mu = 2 mup x/(1 + x²), x = s/sp, by one division more than its constants: with w = 1/(1 + x²)
///
/// ```text
/// ∂mu/∂s = 2 mup/sp (1 − x²) w²     ∂²mu/∂s² = 2 mup/sp² 2x (x² − 3) w³
/// ```
fn expand<T: Real>(law: &Rudd<T>, slip_ratio: T, normal_force_n: T) -> Expansion<T> {
    let [peak_friction, critical_slip] = law.parameters();
    let per_slip = T::ONE / critical_slip;
    let x = slip_ratio * per_slip;
    let x2 = x * x;
    let w = T::ONE / (T::ONE + x2);
    let twice = (T::TWO * peak_friction) * (normal_force_n * w);
    let bend = T::TWO * x * (x2 - T::from_f64(3.0));
    Expansion {
        force: twice * x,
        slope: twice * per_slip * (T::ONE - x2) * w,
        curvature: twice * (per_slip * per_slip) * bend * (w * w),
    }
}

/// The balance taken at one slip.
struct Taken<T> {
    /// Reading minus law, in N.
    left: T,
    /// Gains of the parts, N per unit of each.
    row: [T; 8],
    /// White variance in N².
    variance: T,
    /// N ∂mu/∂s in N.
    slope: T,
}

/// How noise of the speeds enters the slip (v − R ω)/v.
struct OfSpeeds<T> {
    /// Per rad/s.
    by_wheel: T,
    /// Per m/s.
    by_vehicle: T,
    /// White variance of the slip.
    white: T,
}

/// Where the law is taken.
struct Agreed<T> {
    /// By how much the slip is moved from what is read.
    moved: T,
    /// Variance of what it is still off by.
    variance: T,
}

impl<T: Real> Agreed<T> {
    const fn as_read() -> Self {
        Self {
            moved: T::ZERO,
            variance: T::ZERO,
        }
    }
}

/// Farthest that the slip is moved, in standard deviations of the innovation, squared.
const FARTHEST_SQUARED: f64 = 9.0;

/// Parts in their order: two of friction, wheel speed, vehicle speed, drag; of the run friction, zero and slip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tyre<T> {
    pub(crate) whitener: Whitener<T, 8>,
}

impl<T: Real> Tyre<T> {
    pub(crate) fn new(settings: &Settings<T>) -> Result<Self, Setting> {
        let (own, sensors) = (&settings.unmodelled, &settings.sensors);
        let forgetting = |part: Coloured<T>| Part {
            kind: Kind::Forgetting {
                time_constant_s: part.time_constant_s,
            },
            std: part.std,
        };
        let constant = |std| Part {
            kind: Kind::Constant,
            std,
        };
        let whitener = Whitener::new([
            forgetting(own.friction_fast),
            forgetting(own.friction_slow),
            forgetting(sensors.wheel_speed_coloured_rad_s),
            forgetting(sensors.vehicle_speed_coloured_m_s),
            forgetting(sensors.drag_force_coloured_n),
            constant(own.friction_run_std),
            constant(own.drag_zero_run_std_n),
            constant(own.slip_run_std),
        ]);
        whitener
            .map(|whitener| Self { whitener })
            .map_err(|_| Setting::TyreNoise)
    }

    /// One step of time; `None` where no balance is formed at its end.
    pub(crate) fn step(
        &mut self,
        dt_s: T,
        sample: Option<&RigSample<T>>,
        settings: &Settings<T>,
    ) -> Option<Innovation<T>> {
        self.whitener.predict(dt_s, &[T::ZERO; 8]);
        let sample = sample?;
        if sample.wheel_speed_rad_s < settings.forming.minimum_wheel_speed_rad_s {
            return None;
        }
        let radius = settings.rig.effective_radius_m;
        let point = slip_friction(sample, radius, &settings.forming.sample).ok()?;
        let speeds = OfSpeeds::at(sample, settings);
        let as_read = taken(
            sample,
            settings,
            &speeds,
            point.slip_ratio,
            &Agreed::as_read(),
        );
        let agreed = self.agree(&as_read, &speeds);
        let balance = taken(sample, settings, &speeds, point.slip_ratio, &agreed);
        let gate = settings.forming.gate_stds;
        self.whitener
            .update(balance.left, &balance.row, balance.variance, gate)
    }

    /// The slip that speeds, what is known of their errors, and drag agree on.
    ///
    /// Its error is no longer that of the innovation, which gains made of the slip as read would turn into friction of
    /// the run (orthogonal regression; W. A. Fuller, Measurement Error Models, Wiley 1987, section 3.2). With ε the
    /// error of the slip as read, ε̂ what the parts say of it and y the innovation: s = s₀ − ε̂ − cov(ε, y)/var(y) y.
    fn agree(&self, as_read: &Taken<T>, speeds: &OfSpeeds<T>) -> Agreed<T> {
        let error = speeds.row();
        let (row, of_error) = (
            self.whitener.project(&as_read.row),
            self.whitener.project(&error),
        );
        let variance = as_read.variance + self.whitener.covariance(&row, &row);
        let both = self.whitener.covariance(&of_error, &row) - as_read.slope * speeds.white;
        let alone = self.whitener.covariance(&of_error, &of_error) + speeds.white;
        let mut innovation = as_read.left - self.whitener.prediction(&as_read.row);
        let farthest = T::from_f64(FARTHEST_SQUARED) * variance;
        if innovation.squared() > farthest {
            innovation *= (farthest / innovation.squared()).sqrt();
        }
        let told = both / variance;
        Agreed {
            moved: -self.whitener.prediction(&error) - told * innovation,
            variance: Real::max(alone - told * both, T::ZERO),
        }
    }
}

impl<T: Real> OfSpeeds<T> {
    fn at(sample: &RigSample<T>, settings: &Settings<T>) -> Self {
        let (sensors, radius) = (&settings.sensors, settings.rig.effective_radius_m);
        let per_speed = T::ONE / sample.vehicle_speed_m_s;
        let by_wheel = -radius * per_speed;
        let by_vehicle = radius * sample.wheel_speed_rad_s * per_speed.squared();
        let white = (by_wheel * sensors.wheel_speed_std_rad_s).squared()
            + (by_vehicle * sensors.vehicle_speed_std_m_s).squared();
        Self {
            by_wheel,
            by_vehicle,
            white,
        }
    }

    /// What the parts add to the slip's error.
    fn row(&self) -> [T; 8] {
        let o = T::ZERO;
        [o, o, self.by_wheel, self.by_vehicle, o, o, o, o]
    }
}

/// The balance with the law taken at a slip near the one that is read.
///
/// With s₀ the slip as read and s the one at which the law is taken, e = F − N mu(s) − N mu′ (s₀ − s): an error ε of s₀
/// enters as −N mu′ ε, and the variance V of what s is still off by, where the curve is bent, with a mean of
/// −N mu″ V/2 and with (N mu″ V)²/2 more variance.
fn taken<T: Real>(
    sample: &RigSample<T>,
    settings: &Settings<T>,
    speeds: &OfSpeeds<T>,
    slip_ratio: T,
    agreed: &Agreed<T>,
) -> Taken<T> {
    let load = sample.normal_force_n;
    let law = expand(&settings.law, slip_ratio + agreed.moved, load);
    let sensors = &settings.sensors;
    let bent = law.curvature * agreed.variance;
    let by_load = law.force / load * sensors.normal_force_std_n;
    Taken {
        left: sample.drag_force_n - law.force + law.slope * agreed.moved + T::HALF * bent,
        row: [
            law.force,
            law.force,
            -law.slope * speeds.by_wheel,
            -law.slope * speeds.by_vehicle,
            T::ONE,
            law.force,
            T::ONE,
            law.slope,
        ],
        variance: sensors.drag_force_std_n.squared()
            + by_load.squared()
            + law.slope.squared() * speeds.white
            + T::HALF * bent.squared(),
        slope: law.slope,
    }
}

#[cfg(test)]
mod tests {
    use muslip::law::{Rudd, TyreLaw};

    use super::expand;

    #[test]
    fn the_expansion_is_the_law_and_its_derivatives_in_slip() {
        let law = Rudd::new(0.9, 0.12).unwrap();
        for i in -20..=100 {
            let slip = f64::from(i) * 0.01;
            let got = expand(&law, slip, 4000.0);
            let step = 1e-5;
            let bend = (law.slip_derivative(slip + step) - law.slip_derivative(slip - step))
                / (2.0 * step);
            assert!((got.force - 4000.0 * law.friction(slip)).abs() < 1e-9);
            assert!((got.slope - 4000.0 * law.slip_derivative(slip)).abs() < 1e-8);
            assert!((got.curvature - 4000.0 * bend).abs() < 1e-6 * 4000.0 * 200.0);
        }
    }
}
