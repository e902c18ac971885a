//! Peak friction changes with normal force.

use super::prelude::*;

/// Exponent from which the force no longer grows with the load.
const LARGEST: f64 = 1.0;

/// Peak friction changes with normal force.
pub struct LoadSensitivity {
    /// Whether the slip at the peak changes with load too.
    pub with_stiffness: bool,
}

impl Describe for LoadSensitivity {
    fn facts(&self) -> Facts {
        let form = if self.with_stiffness {
            "peak_and_critical_slip"
        } else {
            "peak"
        };
        Facts {
            form,
            like_noise_of_load: true,
            ..Facts::of(
                Id::LoadSensitivity,
                Stage::Law,
                "peak_friction = peak_friction0 * (normal_force/mean)^(-load_sensitivity)",
            )
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let mut all = vec![Parameter::new("load_sensitivity", "1", -1.5, 1.5)];
        if self.with_stiffness {
            all.push(Parameter::new("critical_slip_exponent", "1", -2.0, 2.0));
        }
        all
    }
    /// A tyre that brakes less the harder it is pressed down is none, nor one whose friction grows faster than the load.
    fn owns(&self, parameters: &[f64], _context: &Context) -> bool {
        parameters[0].abs() < LARGEST
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "peak friction falls by {:.2} % for each 10 % more normal force",
            10.0 * reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Rubber grips by a real area of contact that grows more slowly than the load on it, so the friction coefficient falls as the wheel is pressed down harder. The slip at which it peaks may move as well, since the carcass stiffens with load.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[],
            smallest: "an exponent of a tenth: 1 % of friction for each 10 % of load",
            smallest_size: |_| 0.1,
            compensation: Compensation::By(
                "divides peak friction (and the slip at the peak) by their dependence on the sample's load; the estimate holds at the campaign's mean load",
            ),
            carried: "as it is, from the fresh run's own load",
            example: Example::of("peak", &[0.3]),
        }
    }
}

impl<T: Number> Mechanism<T> for LoadSensitivity {
    fn apply(&self, p: &[T], _series: &Series, context: &Context, state: &mut State<T>) {
        let n = state.load.len();
        let mut factor = Vec::with_capacity(n);
        let mut critical = Vec::new();
        for k in 0..n {
            let log_load = (state.load[k].abs() / context.mean_load + 1e-3).ln();
            factor.push((-(p[0] * log_load)).exp());
            if self.with_stiffness {
                critical.push((p[1] * log_load).exp());
            }
        }
        state.scale_friction(&factor);
        if self.with_stiffness {
            state.scale_critical(&critical);
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("load_sensitivity", "1", p[0])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::toy::{Noise, stop};

    #[test]
    fn a_force_that_falls_with_the_load_is_no_tyre_s() {
        let context = stop(Noise::TYPICAL, 2).context;
        let owns = |exponent: f64| {
            let own = LoadSensitivity {
                with_stiffness: false,
            };
            own.owns(&[exponent], &context)
        };
        assert!(owns(0.3) && owns(-0.3) && !owns(1.3) && !owns(-1.3));
    }
}
