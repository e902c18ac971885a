//! The wheel speed reading varies once (or a few times) a revolution.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// How many orders, and whether the phase is the same in every run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Orders of the wheel's angle, from the first.
    pub orders: usize,
    /// A phase of its own for each run.
    pub phase_per_run: bool,
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
        match (self.form.orders, self.form.phase_per_run) {
            (1, false) => "first_order",
            (_, false) => "three_orders",
            (1, true) => "first_order_phase_per_run",
            (_, true) => "three_orders_phase_per_run",
        }
    }
    fn stage(&self) -> Stage {
        Stage::Kinematics
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let runs = if self.form.phase_per_run {
            context.runs
        } else {
            1
        };
        let mut all = Vec::new();
        for run in 0..runs {
            for order in 1..=self.form.orders {
                for part in ["cos", "sin"] {
                    all.push(Parameter::new(
                        &format!("{part}{order}_{run}"),
                        "1",
                        -0.08,
                        0.08,
                    ));
                }
            }
        }
        all
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        if self.form.phase_per_run && context.runs < 2 {
            return Vec::new();
        }
        // The wheel's angle must be resolved by the samples.
        if context.dt * context.mean_wheel_speed * self.form.orders as f64 > 2.0 {
            return Vec::new();
        }
        let runs = if self.form.phase_per_run {
            context.runs
        } else {
            1
        };
        vec![vec![0.0; 2 * self.form.orders * runs]]
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
}

impl<T: Number> Mechanism<T> for EncoderRipple {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let width = 2 * self.form.orders;
        let from = if self.form.phase_per_run {
            width * series.index
        } else {
            0
        };
        let Some(p) = p.get(from..from + width) else {
            return;
        };
        let zero = T::constant(0.0);
        for k in 0..series.len() {
            let mut ripple = zero;
            for (order, part) in p.chunks_exact(2).enumerate() {
                let (sin, cos) = ((order + 1) as f64 * series.angle[k]).sin_cos();
                ripple += part[0] * cos + part[1] * sin;
            }
            state.omega[k] = state.omega[k] / (ripple + 1.0);
        }
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        let width = 2 * self.form.orders;
        let mut power = T::constant(1e-30);
        let mut runs = 0.0;
        for run in p.chunks_exact(width) {
            power += run[0].squared() + run[1].squared();
            runs += 1.0;
        }
        vec![Reported {
            name: "amplitude",
            unit: "1",
            value: (power / runs).sqrt(),
        }]
    }
}
