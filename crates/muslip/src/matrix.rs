//! The core's small types as vectors and matrices of `nalgebra`, and back.
//!
//! What a law gives as an array needs no conversion here: `SVector::from(law.gradient(s))`, and
//! `SMatrix::from(law.hessian(s))`, whose rows are its columns.

use nalgebra::{SMatrix, SVector};

use crate::filter::mu_slip::{Covariance, NotSymmetric, State};
use crate::real::Real;

/// The vector (mup, sp).
impl<T: Real> From<State<T>> for SVector<T, 2> {
    fn from(state: State<T>) -> Self {
        Self::from(state.to_array())
    }
}

/// From the vector (mup, sp).
impl<T: Real> From<SVector<T, 2>> for State<T> {
    fn from(vector: SVector<T, 2>) -> Self {
        Self::from_array(vector.into())
    }
}

/// The matrix P.
impl<T: Real> From<Covariance<T>> for SMatrix<T, 2, 2> {
    fn from(covariance: Covariance<T>) -> Self {
        Self::from(covariance.rows())
    }
}

/// From the matrix P, if it is symmetric.
impl<T: Real> TryFrom<SMatrix<T, 2, 2>> for Covariance<T> {
    type Error = NotSymmetric;

    fn try_from(matrix: SMatrix<T, 2, 2>) -> Result<Self, NotSymmetric> {
        // By columns; only a symmetric one is taken.
        Self::from_rows(matrix.into())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

    use crate::filter::mu_slip::{Covariance, NotSymmetric, State};
    use crate::law::{Rudd, TyreLaw};

    #[test]
    fn a_state_is_the_vector_of_its_two_numbers() {
        let state = State {
            peak_friction: 0.6,
            critical_slip: 0.2,
        };
        assert_eq!(SVector::from(state), Vector2::new(0.6, 0.2));
        assert_eq!(State::from(Vector2::new(0.6, 0.2)), state);
    }

    #[test]
    fn a_covariance_is_a_symmetric_matrix_and_only_such_a_one_is_taken() {
        let p = Covariance {
            p00: 4.0,
            p01: 1.0,
            p11: 9.0,
        };
        assert_eq!(SMatrix::from(p), Matrix2::new(4.0, 1.0, 1.0, 9.0));
        assert_eq!(Covariance::try_from(SMatrix::from(p)), Ok(p));
        let lopsided = Matrix2::new(4.0, 1.0, 1.1, 9.0);
        assert_eq!(Covariance::try_from(lopsided), Err(NotSymmetric));
    }

    #[test]
    fn a_law_gives_what_nalgebra_takes() {
        let law = Rudd::new(0.8, 0.14).unwrap();
        let (gradient, hessian) = (law.gradient(0.05), law.hessian(0.05));
        let by_hand = Vector2::new(gradient[0], gradient[1]);
        assert_eq!(SVector::from(gradient), by_hand);
        let by_hand = Matrix2::new(hessian[0][0], hessian[0][1], hessian[1][0], hessian[1][1]);
        assert_eq!(SMatrix::from(hessian), by_hand);
    }
}
