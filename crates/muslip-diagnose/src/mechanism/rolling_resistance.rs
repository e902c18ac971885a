//! Drag on a rolling, unbraked wheel, proportional to load, absent at standstill.

use super::prelude::*;

/// Drag on a rolling, unbraked wheel, proportional to load, absent at standstill.
pub struct RollingResistance {
    /// Whether it grows with speed squared.
    pub growing: bool,
}

impl Describe for RollingResistance {
    fn facts(&self) -> Facts {
        let form = if self.growing {
            "growing_with_speed"
        } else {
            "constant"
        };
        Facts {
            form,
            like_noise_of_run: true,
            ..Facts::of(
                Id::RollingResistance,
                Stage::Contact,
                "drag = normal_force * (mu(slip) + coefficient)",
            )
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let mut all = vec![Parameter::new("coefficient", "1", -0.02, 0.15)];
        if self.growing {
            all.push(Parameter::new("growth", "1", -1.0, 5.0));
        }
        all
    }
    fn starts(&self, _search: &Search<'_>) -> Vec<Vec<f64>> {
        vec![if self.growing {
            vec![0.01, 0.0]
        } else {
            vec![0.0]
        }]
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the rolling wheel drags with {:.4} of the normal force without any braking",
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A rolling tyre loses energy in the rubber that is bent at every turn, which shows as a drag in proportion to the load even without braking. It is gone at standstill, and acts on the wheel's balance as well.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre, Balance::Wheel],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::EffectiveRadius,
                    why: "A wrong radius biases slip by a constant, which near free rolling is a constant force.",
                    run: runs::ROLL_AND_DRIVE,
                },
                Alias {
                    with: Id::ZeroDrift,
                    why: "Both are a force while nothing brakes.",
                    run: runs::ZERO_BEFORE_AND_AFTER,
                },
            ],
            smallest: "one percent of the load",
            smallest_size: |_| 0.01,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is, from the fresh run's own load and speed",
            example: Example::of("constant", &[0.015]),
        }
    }
}

impl<T: Number> Mechanism<T> for RollingResistance {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        let mut moment = vec![T::constant(0.0); state.force.len()];
        for (k, moment) in moment.iter_mut().enumerate() {
            // Gone at standstill and when the wheel no longer rolls.
            let surface = series.wheel.smooth[k] * context.radius;
            if !series.rolling[k] || !(surface > 0.0) {
                continue;
            }
            let mut coefficient = p[0] * (surface / 0.3).tanh();
            if self.growing {
                let relative = series.speed.smooth[k] / context.mean_speed;
                coefficient = coefficient * (p[1] * (relative * relative - 1.0) + 1.0);
            }
            state.force[k] += coefficient * state.load[k];
            *moment = coefficient * state.load[k] * context.radius;
        }
        // The force may act at the hub: only the growing form takes it for a moment on the wheel as well.
        if self.growing {
            state.rolling_moment = Some(moment);
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("coefficient", "1", p[0])]
    }
}
