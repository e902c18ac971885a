//! `adskalman`: its update with an observation model that is linearised anew for each sample.

use adskalman::{CovarianceUpdateMethod, ObservationModel, StateAndCovariance};
use nalgebra::{Matrix1, Matrix2, RowVector2, U1, U2, Vector1, Vector2};

use super::peers_law::linearised;

pub type Memory = StateAndCovariance<f32, U2>;

/// The law at a slip, as expected of the present state.
struct Friction {
    expected: Vector1<f32>,
    gradient: RowVector2<f32>,
    gradient_transposed: Vector2<f32>,
    variance: Matrix1<f32>,
}

impl ObservationModel<f32, U2, U1> for Friction {
    fn predict_observation(&self, _: &Vector2<f32>) -> Vector1<f32> {
        self.expected
    }
    fn H(&self) -> &RowVector2<f32> {
        &self.gradient
    }
    fn HT(&self) -> &Vector2<f32> {
        &self.gradient_transposed
    }
    fn R(&self) -> &Matrix1<f32> {
        &self.variance
    }
}

pub fn start() -> Memory {
    StateAndCovariance::new(Vector2::new(0.6, 0.2), Matrix2::new(0.36, 0.0, 0.0, 0.04))
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    let at = linearised((*memory.state()).into(), memory.covariance(), slip);
    let [h0, h1] = at.gradient;
    let model = Friction {
        expected: Vector1::new(at.friction),
        gradient: RowVector2::new(h0, h1),
        gradient_transposed: Vector2::new(h0, h1),
        variance: Matrix1::new(at.variance),
    };
    if let Ok(after) = model.update(
        memory,
        &Vector1::new(friction),
        CovarianceUpdateMethod::OptimalKalman,
    ) {
        *memory = after;
    }
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    (*memory.state()).into()
}
