//! A law's analytic derivatives against dual numbers on a second transcription of it.

use muslip::law::TyreLaw;
use nalgebra::SVector;
use num_dual::{Dual2SVec64, first_derivative, hessian};
use test_support::Tolerance;

/// Value, first and second derivatives of `law` at `slip` against those of `transcription`.
///
/// `scales` are the magnitudes of the parameters: a derivative is compared after multiplication with
/// them, so that all entries are fractions of a friction.
pub fn agrees<L, const N: usize>(
    law: L,
    slip: f64,
    transcription: impl Fn([Dual2SVec64<N>; N], Dual2SVec64<N>) -> Dual2SVec64<N>,
    by_slip: impl Fn([num_dual::Dual64; N], num_dual::Dual64) -> num_dual::Dual64,
) where
    L: TyreLaw<f64, N>,
{
    let parameters = law.parameters();
    let (value, gradient, hessian) = hessian(
        |p: SVector<Dual2SVec64<N>, N>| transcription(p.data.0[0], slip.into()),
        &SVector::from(parameters),
    );
    let near = Tolerance {
        absolute: 1e-12,
        relative: 1e-12,
    };
    near.check("friction", law.friction(slip), value);
    for i in 0..N {
        let scale_i = parameters[i].abs().max(1.0);
        let got = law.gradient(slip)[i] * scale_i;
        near.check(L::PARAMETER_NAMES[i], got, gradient[i] * scale_i);
        for j in 0..N {
            let scale = scale_i * parameters[j].abs().max(1.0);
            let got = law.hessian(slip)[i][j] * scale;
            // the scale of the terms that cancel in a second derivative
            let near = Tolerance {
                absolute: 1e-12 * scale,
                relative: 1e-11,
            };
            near.check(L::PARAMETER_NAMES[j], got, hessian[(i, j)] * scale);
            assert_eq!(law.hessian(slip)[i][j], law.hessian(slip)[j][i]);
        }
    }
    let constant = parameters.map(num_dual::Dual64::from);
    let (_, slope) = first_derivative(|s| by_slip(constant, s), slip);
    let near = Tolerance {
        absolute: 1e-11,
        relative: 1e-11,
    };
    near.check("slope", law.slip_derivative(slip), slope);
}
