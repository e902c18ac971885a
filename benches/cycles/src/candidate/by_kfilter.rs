//! `kfilter`: its update with a measurement that is linearised anew for each sample.

use kfilter::KalmanUpdate;
use kfilter::kalman::{Kalman, KalmanFilter, KalmanLinearNoInput};
use kfilter::measurement::{LinearisableMeasurement, Measurement};
use nalgebra_034::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};

use super::peers_law::linearised;

pub type Memory = KalmanLinearNoInput<f32, 2>;

/// A measured friction and what was expected of it.
struct Friction {
    measured: Vector1<f32>,
    expected: Vector1<f32>,
    gradient: RowVector2<f32>,
    gradient_transposed: Vector2<f32>,
    variance: Matrix1<f32>,
}

impl Measurement<f32, 2, 1> for Friction {
    fn covariance(&self) -> &Matrix1<f32> {
        &self.variance
    }
    fn measurement(&self) -> &Vector1<f32> {
        &self.measured
    }
    fn set_measurement(&mut self, measured: Vector1<f32>) {
        self.measured = measured;
    }
    fn predict(&self, _: &Vector2<f32>) -> Vector1<f32> {
        self.expected
    }
}

impl LinearisableMeasurement<f32, 2, 1> for Friction {
    fn observation(&self) -> &RowVector2<f32> {
        &self.gradient
    }
    fn observation_transpose(&self) -> &Vector2<f32> {
        &self.gradient_transposed
    }
}

pub fn start() -> Memory {
    Kalman::new(
        Matrix2::identity(),
        Matrix2::zeros(),
        Vector2::new(0.6, 0.2),
        Matrix2::new(0.36, 0.0, 0.0, 0.04),
    )
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    let at = linearised((*memory.state()).into(), memory.covariance(), slip);
    let [h0, h1] = at.gradient;
    let measurement = Friction {
        measured: Vector1::new(friction),
        expected: Vector1::new(at.friction),
        gradient: RowVector2::new(h0, h1),
        gradient_transposed: Vector2::new(h0, h1),
        variance: Matrix1::new(at.variance),
    };
    // It fails only where the innovation has no variance.
    let _ = KalmanUpdate::update(memory, &measurement);
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    (*memory.state()).into()
}
