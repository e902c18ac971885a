//! The exact discrete first-order lag, for several channels at once.

use muslip::real::Real;

/// Below this ratio of step to time constant the coefficients come from their series.
const SMALL: f64 = 0.1;

/// A first-order lag y' = (u - y)/τ of `C` channels whose inputs are straight lines between samples.
///
/// Settled on its first input. With a = Δt/τ the update is exact:
///
/// ```text
/// y ← y e^(-a) + u₀ (1 - e^(-a)) + (u₁ - u₀)(1 - (1 - e^(-a))/a)
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct FirstOrder<T, const C: usize> {
    output: [T; C],
    input: [T; C],
}

impl<T: Real, const C: usize> FirstOrder<T, C> {
    /// At rest on an input.
    pub(super) fn settled(input: [T; C]) -> Self {
        Self {
            output: input,
            input,
        }
    }

    /// The output now.
    pub(super) fn output(&self) -> [T; C] {
        self.output
    }

    /// After a step of `a` time constants (≥ 0) to the next input.
    pub(super) fn stepped(&self, a: T, input: [T; C]) -> Self {
        let Shares { stay, come, lead } = Shares::of(a);
        let mut output = self.output;
        for ((y, before), now) in output.iter_mut().zip(self.input).zip(input) {
            *y = *y * stay + before * come + (now - before) * lead;
        }
        Self { output, input }
    }

    /// True where every number is finite.
    pub(super) fn is_finite(&self) -> bool {
        self.output
            .into_iter()
            .chain(self.input)
            .all(Real::is_finite)
    }
}

/// What a step of a time constants leaves of the old output, and takes of input and its change.
struct Shares<T> {
    /// e^(-a)
    stay: T,
    /// 1 - e^(-a)
    come: T,
    /// 1 - (1 - e^(-a))/a
    lead: T,
}

impl<T: Real> Shares<T> {
    fn of(a: T) -> Self {
        if a < T::from_f64(SMALL) {
            // lead = a (1/2! - a/3! + a²/4! - ...), from which the other two follow without cancellation.
            // In double precision the first term left out is below 1e-16 of the sum.
            let mut sum = T::from_f64(1.0 / 3_628_800.0);
            for reciprocal in [
                1.0 / 362_880.0,
                1.0 / 40_320.0,
                1.0 / 5_040.0,
                1.0 / 720.0,
                1.0 / 120.0,
                1.0 / 24.0,
                1.0 / 6.0,
                0.5,
            ] {
                sum = T::from_f64(reciprocal) - a * sum;
            }
            let lead = a * sum;
            let come = a * (T::ONE - lead);
            Self {
                stay: T::ONE - come,
                come,
                lead,
            }
        } else {
            let stay = (-a).exp();
            let come = T::ONE - stay;
            Self {
                stay,
                come,
                lead: T::ONE - come / a,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{FirstOrder, Shares};

    #[test]
    fn a_ramp_is_followed_exactly_whatever_the_step() {
        // y' = (t - y)/τ from rest: y = t - τ + τ e^(-t/τ)
        let tau = 0.05_f64;
        for dt in [1e-6, 1e-4, 4.99e-3, 5.01e-3, 0.1, 3.0] {
            let mut lag = FirstOrder::settled([0.0]);
            let mut t = 0.0;
            for _ in 0..50 {
                t += dt;
                lag = lag.stepped(dt / tau, [t]);
                let exact = t + tau * (-t / tau).exp_m1();
                let [y] = lag.output();
                assert!((y - exact).abs() <= 1e-13 * t, "{dt}: {y} {exact}");
            }
        }
    }

    #[test]
    fn series_and_exponential_join() {
        let below = Shares::of(0.1 - 1e-15_f64);
        let above = Shares::of(0.1 + 1e-15_f64);
        assert!((below.stay - above.stay).abs() < 1e-14);
        assert!((below.come - above.come).abs() < 1e-14);
        assert!((below.lead - above.lead).abs() < 1e-14);
    }

    #[test]
    fn single_precision_keeps_small_and_large_steps() {
        for a in [1e-7_f32, 1e-4, 0.05, 0.0999, 0.1001, 1.0, 50.0] {
            let (got, exact) = (Shares::of(a), Shares::of(f64::from(a)));
            for (g, e) in [
                (got.stay, exact.stay),
                (got.come, exact.come),
                (got.lead, exact.lead),
            ] {
                assert!((f64::from(g) - e).abs() <= 1e-5 * e + 1e-30, "{a}: {g} {e}");
            }
        }
    }

    #[test]
    fn an_endless_step_arrives_and_a_step_of_zero_changes_nothing() {
        let lag = FirstOrder::settled([1.0_f32]).stepped(0.5, [3.0]);
        assert_eq!(lag.stepped(0.0, [7.0]).output(), lag.output());
        let [y] = lag.stepped(f32::INFINITY, [7.0]).output();
        assert!((y - 7.0).abs() < 1e-6);
    }
}
