//! What varies once (or a few times) a revolution of the wheel: shared by run-out and encoder ripple.

use super::{Context, Parameter, Reported};
use crate::number::Number;
use crate::series::Series;

/// Largest advance of the highest order's phase from one sample to the next, in rad.
const MOST_ADVANCE: f64 = 2.0;

/// How many orders, and whether the phase is the same in every run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Orders of the wheel's angle, from the first.
    pub orders: usize,
    /// A phase of its own for each run.
    pub phase_per_run: bool,
}

/// What varies once a turn, as far as it is known before any fit: a rolling radius, or what an encoder reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Varies {
    /// Whichever the wheel's balance bears out: there is a brake.
    Told,
    /// The encoder, which is common; or a radius that the wheel's speed follows.
    Encoder,
    /// The radius: the wheel's speed does not follow.
    Radius,
}

impl Varies {
    #[must_use]
    pub fn of(series: &[Series], context: &Context) -> Self {
        if series.iter().any(|s| !s.wheel_balance.is_empty()) {
            Self::Told
        } else if context.ripple_unread {
            Self::Radius
        } else {
            Self::Encoder
        }
    }
}

/// Whether the samples resolve so many orders of the wheel's angle.
#[must_use]
pub fn resolves_angle(context: &Context, orders: usize) -> bool {
    context.dt * context.mean_wheel_speed * orders as f64 <= MOST_ADVANCE
}

/// All forms.
pub const FORMS: [Form; 3] = [
    Form {
        orders: 1,
        phase_per_run: false,
    },
    Form {
        orders: 1,
        phase_per_run: true,
    },
    Form {
        orders: 3,
        phase_per_run: true,
    },
];

impl Form {
    /// Word in model files.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match (self.orders, self.phase_per_run) {
            (1, false) => "first_order",
            (_, false) => "three_orders",
            (1, true) => "first_order_phase_per_run",
            (_, true) => "three_orders_phase_per_run",
        }
    }

    fn phases(self, context: &Context) -> usize {
        if self.phase_per_run { context.runs } else { 1 }
    }

    /// Parameters of one phase: a cosine and a sine for each order.
    fn width(self) -> usize {
        2 * self.orders
    }

    /// Cosine and sine amplitudes of every order and phase, within `limit` on either side.
    #[must_use]
    pub fn parameters(self, context: &Context, limit: f64) -> Vec<Parameter> {
        (0..self.phases(context))
            .flat_map(|run| {
                (1..=self.orders).flat_map(move |order| {
                    ["cos", "sin"].map(|part| {
                        Parameter::new(&format!("{part}{order}_{run}"), "1", -limit, limit)
                    })
                })
            })
            .collect()
    }

    /// No ripple; no start where the samples do not resolve the wheel's angle, or one run has a phase of its own.
    #[must_use]
    pub fn starts(self, context: &Context) -> Vec<Vec<f64>> {
        if (self.phase_per_run && context.runs < 2) || !resolves_angle(context, self.orders) {
            return Vec::new();
        }
        vec![vec![0.0; self.width() * self.phases(context)]]
    }

    /// The relative ripple at every sample of a run, each order times what is left of it there; `None` for a run whose
    /// phase is not known.
    pub fn ripple<T: Number>(
        self,
        p: &[T],
        series: &Series,
        left: &dyn Fn(usize, usize) -> f64,
    ) -> Option<Vec<T>> {
        let from = if self.phase_per_run {
            self.width() * series.index
        } else {
            0
        };
        let own = p.get(from..from + self.width())?;
        Some(
            series
                .angle
                .iter()
                .enumerate()
                .map(|(k, angle)| {
                    let mut ripple = T::constant(0.0);
                    for (part, order) in own.chunks_exact(2).zip(1..) {
                        let (sin, cos) = (order as f64 * angle).sin_cos();
                        ripple += (part[0] * cos + part[1] * sin) * left(order, k);
                    }
                    ripple
                })
                .collect(),
        )
    }

    /// Amplitude of the first order, root mean square over the phases, times a factor.
    pub fn report<T: Number>(self, p: &[T], factor: f64) -> Vec<Reported<T>> {
        // Not zero, so that the root has a derivative.
        let mut power = T::constant(1e-30);
        let mut phases = 0.0;
        for own in p.chunks_exact(self.width()) {
            power += own[0].squared() + own[1].squared();
            phases += 1.0;
        }
        let amplitude = (power / phases).sqrt() * factor;
        vec![Reported::new("amplitude", "1", amplitude)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::catalogue;

    #[test]
    fn what_the_reading_lacks_is_rarely_an_encoder_s_and_what_it_has_rarely_a_radius_s() {
        let rare = |ripple_unread: bool| -> Vec<(&str, &str)> {
            let context = Context {
                ripple_unread,
                ..Context::default()
            };
            let all = catalogue::<f64>();
            let rare = all.iter().filter(|own| own.is_rare(&context));
            rare.map(|own| (own.id().as_str(), own.form())).collect()
        };
        let radius = ["radius", "radius_phase_per_run"].map(|form| ("run_out", form));
        let encoder = FORMS.map(|form| ("encoder_ripple", form.as_str()));
        assert_eq!(
            (rare(false), rare(true)),
            (radius.to_vec(), encoder.to_vec())
        );
    }
}
