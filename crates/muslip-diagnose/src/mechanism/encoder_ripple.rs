//! The wheel speed reading varies once (or a few times) a revolution.

use super::once_a_turn::{Form, Varies};
use super::prelude::*;
use crate::audit::Word;

/// Largest amplitude of an order, as a share of the wheel speed.
const LIMIT: f64 = 0.08;

/// The wheel speed reading varies once (or a few times) a revolution.
pub struct EncoderRipple {
    /// Which form.
    pub form: Form,
}

impl Describe for EncoderRipple {
    fn facts(&self) -> Facts {
        Facts {
            form: self.form.as_str(),
            through_force: false,
            fed_by_chain: true,
            channel: "wheel_speed_rad_s",
            finding: Some(Word::Ripple),
            ..Facts::of(
                Id::EncoderRipple,
                Stage::Kinematics,
                "measured omega = omega (1 + sum a_k cos(k angle) + b_k sin(k angle))",
            )
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        self.form.parameters(context, LIMIT)
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        if Varies::of(search.series, search.context) == Varies::Radius {
            return Vec::new();
        }
        self.form.starts(search.context)
    }
    fn is_rare(&self, context: &Context) -> bool {
        // Only a control that holds the reading takes its ripple out.
        context.ripple_unread
    }
    fn rare_double(&self, series: &[Series], context: &Context) -> Option<Id> {
        (Varies::of(series, context) == Varies::Encoder).then_some(Id::RunOut)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the wheel speed reading varies once a revolution by {:.3} % of itself",
            100.0 * reported[0].value
        )
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
            example: Example::of("first_order", &[0.01, 0.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for EncoderRipple {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let left = |order: usize, k: usize| {
            let frequency = order as f64 * series.wheel.smooth[k];
            (-series.wheel_smoothing * frequency * frequency).exp()
        };
        if let (Some(read), Some(smooth)) = (
            self.form.ripple(p, series, &|_, _| 1.0),
            self.form.ripple(p, series, &left),
        ) {
            // Slip is formed of the smoothed speed, the wheel's balance of the speed as read.
            let mut off = Vec::with_capacity(read.len());
            for (omega, (read, smooth)) in state.omega.iter_mut().zip(read.into_iter().zip(smooth))
            {
                let turning = *omega / (smooth + 1.0);
                off.push(turning * (smooth - read));
                *omega = turning;
            }
            state.read_off = Some(off);
        }
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        self.form.report(p, 1.0)
    }
}
