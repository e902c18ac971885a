//! The wheel speed reading varies once (or a few times) a revolution.

use super::once_a_turn::Form;
use super::{
    Balance, Compensation, Context, Describe, Evidence, Example, Guide, Id, Kind, Law, Mechanism,
    Memory, Parameter, Reported, Sign, Stage, State,
};
use crate::number::Number;
use crate::prepare::Series;

/// Largest amplitude of an order, as a share of the wheel speed.
const LIMIT: f64 = 0.08;

/// The wheel speed reading varies once (or a few times) a revolution.
pub struct EncoderRipple {
    /// Which form.
    pub form: Form,
}

impl Describe for EncoderRipple {
    fn id(&self) -> Id {
        Id::EncoderRipple
    }
    fn form(&self) -> &'static str {
        self.form.as_str()
    }
    fn stage(&self) -> Stage {
        Stage::Kinematics
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        self.form.parameters(context, LIMIT)
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        self.form.starts(context)
    }
    fn equation(&self) -> &'static str {
        "measured omega = omega (1 + sum a_k cos(k angle) + b_k sin(k angle))"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the wheel speed reading varies once a revolution by {:.3} % of itself",
            100.0 * reported[0].value
        )
    }
    fn predicts(&self) -> bool {
        !self.form.phase_per_run
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A tone ring that is eccentric or unevenly cut makes the wheel speed seem to vary once a revolution while the wheel turns evenly. Slip takes it over, and where the curve is steep so does the predicted force.",
            kind: Kind::Wheel,
            touches: &[Balance::Tyre, Balance::Wheel],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[],
            smallest: "three thousandths of the wheel speed",
            smallest_size: |_| 0.003,
            compensation: Compensation::Not("needs the wheel's angle, which a sample lacks"),
            carried: "its size as it is; its phase only where the wheel's angle is known from run to run",
            example: Example {
                form: "first_order",
                parameters: &[0.01, 0.0],
            },
        }
    }
}

/// Smallest share that is believed: below it the line in the reading is all noise.
const LEAST_SHARE: f64 = 0.25;

/// Share of what repeats once a turn that smoothing has left in the wheel speed. The models run on the smoothed speed,
/// so that share of the ripple is all that they see of it.
fn share_left(series: &[Series]) -> f64 {
    let (mut product, mut power) = (0.0, 0.0);
    for run in series {
        let trend = mean_of_a_turn(&run.angle, &run.wheel.raw);
        let line = |values: &[f64]| {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for k in (0..run.len()).filter(|k| run.rolling[*k]) {
                let (s, c) = run.angle[k].sin_cos();
                cosine += c * (values[k] - trend[k]);
                sine += s * (values[k] - trend[k]);
            }
            (cosine, sine)
        };
        let (raw, smooth) = (line(&run.wheel.raw), line(&run.wheel.smooth));
        product += raw.0 * smooth.0 + raw.1 * smooth.1;
        power += raw.0 * raw.0 + raw.1 * raw.1;
    }
    let share = product / power;
    if share.is_finite() {
        share.clamp(LEAST_SHARE, 1.0)
    } else {
        1.0
    }
}

/// Centred mean over one turn of the wheel: what repeats once a turn is not in it.
fn mean_of_a_turn(angle: &[f64], values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let (mut from, mut to) = (0, 0);
    angle
        .iter()
        .map(|centre| {
            while to < values.len() && angle[to] <= centre + core::f64::consts::PI {
                sum += values[to];
                to += 1;
            }
            while angle[from] < centre - core::f64::consts::PI {
                sum -= values[from];
                from += 1;
            }
            sum / (to - from).max(1) as f64
        })
        .collect()
}

impl<T: Number> Mechanism<T> for EncoderRipple {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        if let Some(ripple) = self.form.ripple(p, series) {
            for (omega, r) in state.omega.iter_mut().zip(ripple) {
                *omega = *omega / (r + 1.0);
            }
        }
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        series: &[Series],
    ) -> Vec<Reported<T>> {
        self.form.report(p, 1.0 / share_left(series))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_a_turn_holds_the_trend_and_not_the_ripple() {
        let angle: Vec<f64> = (0..2000).map(|k| 0.05 * f64::from(k)).collect();
        let values: Vec<f64> = angle.iter().map(|a| 10.0 + 0.01 * a + a.sin()).collect();
        let trend = mean_of_a_turn(&angle, &values);
        for k in 100..1900 {
            let expected = 10.0 + 0.01 * angle[k];
            assert!((trend[k] - expected).abs() < 0.01, "{k}: {}", trend[k]);
        }
    }
}
