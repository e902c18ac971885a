//! `minikalman`: its extended observation on buffers of its own, without a heap.

use minikalman::buffers::types::{
    EstimateCovarianceMatrixBuffer, InnovationCovarianceMatrixBuffer, InnovationVectorBuffer,
    KalmanGainMatrixBuffer, MeasurementNoiseCovarianceMatrixBuffer, MeasurementVectorBuffer,
    ObservationMatrixMutBuffer, StateVectorBuffer, TemporaryHPMatrixBuffer,
    TemporaryKHPMatrixBuffer, TemporaryPHTMatrixBuffer,
    TemporaryResidualCovarianceInvertedMatrixBuffer,
};
use minikalman::extended::{ExtendedObservation, ExtendedObservationBuilder};
use minikalman::prelude::*;
use nalgebra::Matrix2;

use super::peers_law::linearised;

type One = MatrixDataArray<1, 1, 1, f32>;
type Row = MatrixDataArray<1, 2, 2, f32>;
type Column = MatrixDataArray<2, 1, 2, f32>;
type Square = MatrixDataArray<2, 2, 4, f32>;

pub struct Memory {
    state: StateVectorBuffer<2, f32, Column>,
    covariance: EstimateCovarianceMatrixBuffer<2, f32, Square>,
    observation: ExtendedObservation<
        2,
        1,
        f32,
        ObservationMatrixMutBuffer<1, 2, f32, Row>,
        MeasurementVectorBuffer<1, f32, One>,
        MeasurementNoiseCovarianceMatrixBuffer<1, f32, One>,
        InnovationVectorBuffer<1, f32, One>,
        InnovationCovarianceMatrixBuffer<1, f32, One>,
        KalmanGainMatrixBuffer<2, 1, f32, Column>,
        TemporaryResidualCovarianceInvertedMatrixBuffer<1, f32, One>,
        TemporaryHPMatrixBuffer<1, 2, f32, Row>,
        TemporaryPHTMatrixBuffer<2, 1, f32, Column>,
        TemporaryKHPMatrixBuffer<2, f32, Square>,
    >,
}

pub fn start() -> Memory {
    let one = || MatrixDataArray::new([0.0]);
    let row = || MatrixDataArray::new([0.0; 2]);
    let column = || MatrixDataArray::new([0.0; 2]);
    Memory {
        state: StateVectorBuffer::new(MatrixDataArray::new([0.6, 0.2])),
        covariance: EstimateCovarianceMatrixBuffer::new(MatrixDataArray::new([
            0.36, 0.0, 0.0, 0.04,
        ])),
        observation: ExtendedObservationBuilder::new::<2, 1, f32>(
            ObservationMatrixMutBuffer::new(row()),
            MeasurementVectorBuffer::new(one()),
            MeasurementNoiseCovarianceMatrixBuffer::new(one()),
            InnovationVectorBuffer::new(one()),
            InnovationCovarianceMatrixBuffer::new(one()),
            KalmanGainMatrixBuffer::new(column()),
            TemporaryResidualCovarianceInvertedMatrixBuffer::new(one()),
            TemporaryHPMatrixBuffer::new(row()),
            TemporaryPHTMatrixBuffer::new(column()),
            TemporaryKHPMatrixBuffer::new(MatrixDataArray::new([0.0; 4])),
        ),
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    let x = memory.state.as_matrix();
    let p = memory.covariance.as_matrix();
    let at = linearised(
        [x.get_row(0), x.get_row(1)],
        &Matrix2::new(
            p.get_at(0, 0),
            p.get_at(0, 1),
            p.get_at(1, 0),
            p.get_at(1, 1),
        ),
        slip,
    );
    let observation = &mut memory.observation;
    let [h0, h1] = at.gradient;
    observation.observation_jacobian_matrix_mut().apply(|h| {
        h.set_at(0, 0, h0);
        h.set_at(0, 1, h1);
    });
    observation
        .measurement_noise_covariance_mut()
        .apply(|r| r.set_at(0, 0, at.variance));
    observation
        .measurement_vector_mut()
        .apply(|z| z.set_row(0, friction));
    observation.correct_nonlinear(&mut memory.state, &mut memory.covariance, |_, expected| {
        expected.set_row(0, at.friction);
    });
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    let x = memory.state.as_matrix();
    [x.get_row(0), x.get_row(1)]
}
