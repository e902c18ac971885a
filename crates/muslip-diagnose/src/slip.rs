//! The slip of a wheel, and how it changes with what it is made of.

use crate::constants::LEAST_BRAKING;
use crate::number::{Number, largest_but_for_outliers};

/// Slip of a wheel of rolling radius `radius` in m that turns at `wheel_speed` in rad/s under a vehicle at
/// `vehicle_speed` in m/s, not zero: 0 where it rolls freely, 1 where it is locked.
pub fn slip<T: Number>(radius: T, wheel_speed: T, vehicle_speed: T) -> T {
    -(radius * wheel_speed / vehicle_speed) + 1.0
}

/// Slopes of [`slip`] by the wheel speed, in s/rad, and by the vehicle speed, in s/m.
pub fn slopes(radius: f64, wheel_speed: f64, vehicle_speed: f64) -> [f64; 2] {
    let by_wheel = -radius / vehicle_speed;
    [by_wheel, -by_wheel * wheel_speed / vehicle_speed]
}

/// Rate of [`slip`] in 1/s, from both speeds, wheel first, and their rates.
pub fn rate(radius: f64, speeds: [f64; 2], rates: [f64; 2]) -> f64 {
    let [by_wheel, by_vehicle] = slopes(radius, speeds[0], speeds[1]);
    by_wheel * rates[0] + by_vehicle * rates[1]
}

/// Whether friction, drag over load at each sample, rises so far towards the rig file's peak that something brakes.
pub fn brakes(friction: Vec<f64>, peak: f64) -> bool {
    largest_but_for_outliers(friction).is_some_and(|largest| largest > LEAST_BRAKING * peak)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::Dual;

    #[test]
    fn slopes_are_those_of_the_slip() {
        let (radius, wheel, vehicle) = (0.31, 52.0, 19.0);
        let at = Dual::<2>::constant(radius);
        let dual = slip(at, Dual::variable(wheel, 0), Dual::variable(vehicle, 1));
        let told = slopes(radius, wheel, vehicle);
        assert!((dual.value() - slip(radius, wheel, vehicle)).abs() < 1e-15);
        for (own, told) in dual.slope.iter().zip(told) {
            assert!((own - told).abs() < 1e-15, "{own} {told}");
        }
    }

    #[test]
    fn friction_far_below_the_peak_is_no_braking() {
        let samples =
            |friction: f64, count: usize| [vec![friction; count], vec![0.05; 9000]].concat();
        assert!(brakes(samples(0.5, 100), 0.9));
        assert!(!brakes(samples(0.2, 100), 0.9));
        // Outliers are none, either.
        assert!(!brakes(samples(0.5, 5), 0.9));
        assert!(!brakes(vec![f64::NAN, f64::INFINITY], 0.9) && !brakes(Vec::new(), 0.9));
    }

    #[test]
    fn a_wheel_that_slows_with_its_vehicle_keeps_its_slip() {
        let rate = rate(0.31, [52.0, 19.0], [-5.2, -1.9]);
        assert!(rate.abs() < 1e-15, "{rate}");
        assert!(slip(0.31, 0.0, 19.0) == 1.0);
    }
}
