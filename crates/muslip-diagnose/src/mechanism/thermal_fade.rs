//! Friction changes with tread temperature, which friction power raises and time cools.

use super::prelude::*;

/// Forms of the dependence on temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Logarithm of friction linear in temperature.
    Linear,
    /// With a quadratic term: friction that first rises with warming, then fades.
    Curved,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::Linear, Form::Curved];

/// Shortest time constant in s: what forgets faster is no heat, and depends on the motion of the moment.
const SHORTEST_S: f64 = 0.05;

/// Friction changes with tread temperature, which friction power raises and time cools.
pub struct ThermalFade {
    /// Which form.
    pub form: Form,
}

impl Describe for ThermalFade {
    fn facts(&self) -> Facts {
        let (form, equation) = match self.form {
            Form::Linear => (
                "linear",
                "friction = mu(slip) exp(-c theta), d(theta)/dt = power/mean_power - theta/time_constant",
            ),
            Form::Curved => (
                "curved",
                "friction = mu(slip) exp(-c theta - c2 theta^2), d(theta)/dt = power/mean_power - theta/time_constant",
            ),
        };
        Facts {
            form,
            ..Facts::of(Id::ThermalFade, Stage::Friction, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let mut all = vec![
            Parameter::new("sensitivity", "1/s", -6.0, 12.0),
            Parameter::new(
                "time_constant",
                "s",
                SHORTEST_S,
                (10.0 * context.duration).max(5.0),
            ),
        ];
        if self.form == Form::Curved {
            all.push(Parameter::new("curvature", "1/s2", -20.0, 20.0));
        }
        all
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        [0.2, 0.6, 2.0, 6.0, 20.0, 60.0]
            .iter()
            .filter(|t| **t < 10.0 * search.context.duration)
            .map(|t| {
                if self.form == Form::Curved {
                    vec![0.0, *t, 0.0]
                } else {
                    vec![0.0, *t]
                }
            })
            .collect()
    }
    fn owns(&self, parameters: &[f64], _context: &Context) -> bool {
        above_limit(parameters[1], SHORTEST_S)
    }
    fn statement(&self, reported: &[Reported<f64>], p: &[f64]) -> String {
        format!(
            "friction {} as the tread heats; the heat decays with a time constant of {:.2} s",
            if p[0] >= 0.0 { "fades" } else { "rises" },
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Friction power heats the tread, and rubber grips less (cold rubber: more) as it warms; between applications it cools again. So the same slip gives another force later in the same application, and recovers after a rest.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::Run,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::SpeedSensitivity,
                    why: "Sliding speed and friction power rise together within one application.",
                    run: runs::RESTS,
                },
                Alias {
                    with: Id::WearDrift,
                    why: "Both lower friction the more work was done; only heat forgets.",
                    run: runs::RESTS,
                },
                Alias {
                    with: Id::CurveShape,
                    why: "Skid comes late in an application: heat takes from the same side of the curve.",
                    run: runs::RESTS,
                },
                Alias {
                    with: Id::ZeroDrift,
                    why: "Both grow with time in a run.",
                    run: runs::ZERO_BEFORE_AND_AFTER,
                },
                Alias {
                    with: Id::SlipHysteresis,
                    why: "The way back from a skid is hotter than the way there, so the curve opens into a loop.",
                    run: "Repeat the ramp at a third and at three times the pressure rate: a faster ramp heats less and narrows the loop, a hysteresis keeps it.",
                },
            ],
            smallest: "friction that changes by three percent within a run",
            smallest_size: |_| 0.05,
            compensation: Compensation::By(
                "follows the temperature by the measured friction power and divides friction by its factor; the estimate holds for the cold tread",
            ),
            carried: "starts cold in every run; heated by the fresh run's own friction power",
            example: Example::of("linear", &[0.35, 4.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for ThermalFade {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        let rate = T::constant(1.0) / p[1];
        let mut theta = T::constant(0.0);
        let scale = 1.0 / context.mean_power.max(1e-9);
        let mut step = f64::NAN;
        let mut stay = T::constant(1.0);
        for k in 0..state.friction.len() {
            if (series.dt[k] - step).abs() > 1e-9 || step.is_nan() {
                step = series.dt[k];
                stay = (-(rate * step)).exp();
            }
            let mut power = T::constant(0.0);
            if series.rolling[k] {
                let exponent = match p.get(2) {
                    Some(c) => -(p[0] * theta + *c * theta.squared()),
                    None => -(p[0] * theta),
                };
                let limited = if exponent.value() > 2.0 {
                    T::constant(2.0)
                } else {
                    exponent
                };
                let faded = state.friction[k] * limited.exp();
                state.friction[k] = faded;
                power = (faded * state.load[k] * state.slip[k] * state.speed[k]).abs() * scale;
            }
            let settled = p[1] * power;
            theta = (theta - settled) * stay + settled;
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![Reported::new("time_constant", "s", p[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_forgets_as_fast_as_it_may_is_no_heat() {
        let context = Context::default();
        for (form, rest) in [(Form::Linear, &[][..]), (Form::Curved, &[0.1][..])] {
            let own = |time_constant: f64| {
                let p = [&[0.3, time_constant], rest].concat();
                ThermalFade { form }.owns(&p, &context)
            };
            assert!(own(0.2) && !own(SHORTEST_S));
        }
    }
}
