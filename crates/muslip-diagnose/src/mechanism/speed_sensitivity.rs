//! Friction changes with sliding speed or vehicle speed.

use super::prelude::*;

/// Forms of the dependence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Linear in sliding speed.
    SlidingLinear,
    /// Exponential in sliding speed.
    SlidingExponential,
    /// Linear in vehicle speed about its mean.
    VehicleLinear,
    /// Exponential in vehicle speed about its mean.
    VehicleExponential,
    /// Exponential in sliding speed towards a floor (Stribeck).
    Stribeck,
}

/// All forms.
pub const FORMS: [Form; 5] = [
    Form::SlidingLinear,
    Form::SlidingExponential,
    Form::VehicleLinear,
    Form::VehicleExponential,
    Form::Stribeck,
];

/// Friction does not change its sign however steep the fitted line.
fn floor_at<T: Number>(factor: T) -> T {
    if factor.value() < 0.02 {
        T::constant(0.02)
    } else {
        factor
    }
}

/// Friction changes with sliding speed or vehicle speed.
pub struct SpeedSensitivity {
    /// Which form.
    pub form: Form,
}

impl Describe for SpeedSensitivity {
    fn facts(&self) -> Facts {
        let (form, equation) = match self.form {
            Form::SlidingLinear => ("sliding_linear", "friction = mu(slip) * (1 + k * slip * v)"),
            Form::SlidingExponential => (
                "sliding_exponential",
                "friction = mu(slip) * exp(k * slip * v)",
            ),
            Form::VehicleLinear => (
                "vehicle_linear",
                "friction = mu(slip) * (1 + k * (v - mean v))",
            ),
            Form::VehicleExponential => (
                "vehicle_exponential",
                "friction = mu(slip) * exp(k * (v - mean v))",
            ),
            Form::Stribeck => (
                "sliding_with_floor",
                "friction = mu(slip) * (floor + (1 - floor) exp(-slip * v / speed_scale))",
            ),
        };
        Facts {
            form,
            // By sliding speed friction falls where slip is small, as slip's noise makes it.
            fed_by_chain: !matches!(self.form, Form::VehicleLinear | Form::VehicleExponential),
            ..Facts::of(Id::SpeedSensitivity, Stage::Friction, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let steepest = 3.0 / context.max_speed.max(0.5);
        let slope = Parameter::new("friction_change_per_m_s", "s/m", -steepest, steepest);
        match self.form {
            Form::Stribeck => vec![
                // Friction falls towards the floor (Stribeck), over more than the first hundredths of slip: what rises there,
                // or is that short, is what timing and smoothing leave of the curve's beginning.
                Parameter::new("floor", "1", 0.05, 1.0),
                Parameter::new(
                    "speed_scale",
                    "m/s",
                    0.03 * context.max_speed,
                    3.0 * context.max_speed,
                ),
            ],
            _ => vec![slope],
        }
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        match self.form {
            Form::Stribeck => [0.03, 0.1, 0.3]
                .iter()
                .map(|share| vec![1.0, share * search.context.max_speed])
                .collect(),
            _ => vec![vec![0.0]],
        }
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "friction changes by {:.2} % for each m/s of {} speed",
            100.0 * reported[0].value,
            if matches!(self.form, Form::VehicleLinear | Form::VehicleExponential) {
                "vehicle"
            } else {
                "sliding"
            }
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "How well rubber grips depends on how fast it slides, for its losses depend on the rate at which the road's roughness deforms it; on a wet road water has less time to leave at higher speed. Friction then depends on the sliding speed or on the vehicle's, beside slip.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[
                Alias {
                    with: Id::CurveShape,
                    why: "Sliding speed is slip times speed: in a campaign at one speed the two are one variable.",
                    run: runs::TWO_SPEEDS,
                },
                Alias {
                    with: Id::LoadSensitivity,
                    why: "Where load moves with speed (pitch, downforce), either explains what the other does.",
                    run: runs::TWO_LOADS,
                },
                Alias {
                    with: Id::WearDrift,
                    why: "Where later runs are faster or slower, use and speed go together.",
                    run: runs::FIRST_RUN_AGAIN,
                },
            ],
            smallest: "a change of friction by 5 % over the campaign's mean speed",
            smallest_size: |c| 0.05 / c.mean_speed.max(0.1),
            compensation: Compensation::By(
                "divides friction by its factor at the sample's speed; the estimate holds without sliding or at the mean vehicle speed",
            ),
            carried: "as it is, from the fresh run's own speeds",
            example: Example::of("sliding_linear", &[-0.03]),
        }
    }
}

impl<T: Number> Mechanism<T> for SpeedSensitivity {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        for k in 0..state.friction.len() {
            if !series.rolling[k] {
                continue;
            }
            let v = state.speed[k];
            let sliding = (state.slip[k] * v).abs();
            let factor = match self.form {
                Form::SlidingLinear => floor_at(p[0] * sliding + 1.0),
                Form::SlidingExponential => (p[0] * sliding).exp(),
                Form::VehicleLinear => floor_at(p[0] * (v - context.mean_speed) + 1.0),
                Form::VehicleExponential => (p[0] * (v - context.mean_speed)).exp(),
                Form::Stribeck => p[0] + (-p[0] + 1.0) * (-(sliding / p[1])).exp(),
            };
            state.friction[k] = state.friction[k] * factor;
        }
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let slope = match self.form {
            // Mean slope from rest to the mean sliding speed of a skid, a fifth of the vehicle's.
            Form::Stribeck => {
                let sliding = 0.2 * fitted.context.mean_speed;
                (p[0] - 1.0) * (-((-(T::constant(sliding) / p[1])).exp()) + 1.0) / sliding
            }
            _ => p[0],
        };
        vec![Reported::new("friction_change_per_m_s", "s/m", slope)]
    }
}
