//! Drag varies once (or a few times) a wheel revolution.

use super::once_a_turn::{FORMS, Form, Varies};
use super::prelude::*;

/// Largest amplitude of an order, as a share of the drag or of the load.
const LIMIT: f64 = 0.5;
/// Share of the largest drag from which the drag is that of a braked wheel.
const BRAKED: f64 = 0.3;
/// The same as a share of the radius.
const LIMIT_OF_RADIUS: f64 = 0.08;

/// What varies with the wheel's angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// The drag, in proportion to itself: a load that varies, a tyre unequally stiff.
    Drag,
    /// The drag, in proportion to the load, braked or not: a tyre out of round or unequally stiff along its tread.
    Load,
    /// The rolling radius, hence the slip.
    Radius,
}

impl Of {
    fn word(self, form: Form) -> &'static str {
        match (self, form.phase_per_run) {
            (Self::Drag, _) => form.as_str(),
            (Self::Load, false) => "load",
            (Self::Load, true) => "load_phase_per_run",
            (Self::Radius, false) => "radius",
            (Self::Radius, true) => "radius_phase_per_run",
        }
    }
}

/// Mean of the load over the drag of a braked wheel.
fn load_over_drag(series: &[Series], context: &Context) -> f64 {
    let least = BRAKED * context.max_drag;
    let (mut sum, mut count) = (0.0, 0.0);
    for s in series {
        for (load, drag) in s.load.smooth.iter().zip(&s.drag_smooth) {
            if *drag > least && load.is_finite() {
                sum += load / drag;
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

/// Drag varies once (or a few times) a wheel revolution.
pub struct RunOut {
    /// Orders and phases.
    pub form: Form,
    /// Of what.
    pub of: Of,
}

impl RunOut {
    /// All forms: of each, the orders and phases that are told apart.
    pub fn all() -> impl Iterator<Item = Self> {
        [Of::Drag, Of::Load, Of::Radius]
            .into_iter()
            .flat_map(|of| FORMS.map(|form| Self { form, of }))
            .filter(|own| own.of == Of::Drag || own.form.orders == 1)
    }
}

impl Describe for RunOut {
    fn facts(&self) -> Facts {
        let (stage, equation) = match self.of {
            Of::Drag => (
                Stage::Contact,
                "drag = normal_force mu(slip) (1 + sum a_k cos(k angle) + b_k sin(k angle))",
            ),
            Of::Load => (
                Stage::Contact,
                "drag = normal_force (mu(slip) + a cos(angle) + b sin(angle)) of a wheel that rolls",
            ),
            Of::Radius => (
                Stage::Kinematics,
                "slip = 1 - radius (1 + a cos(angle) + b sin(angle)) omega / v",
            ),
        };
        Facts {
            form: self.of.word(self.form),
            fed_by_chain: true,
            ..Facts::of(Id::RunOut, stage, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let limit = match self.of {
            Of::Drag | Of::Load => LIMIT,
            Of::Radius => LIMIT_OF_RADIUS,
        };
        self.form.parameters(context, limit)
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        // The ripple, which is common, is offered instead.
        let varies = Varies::of(search.series, search.context);
        if self.of == Of::Radius && varies == Varies::Encoder {
            return Vec::new();
        }
        self.form.starts(search.context)
    }
    fn is_rare(&self, context: &Context) -> bool {
        self.of == Of::Radius && !context.ripple_unread
    }
    fn rare_double(&self, series: &[Series], context: &Context) -> Option<Id> {
        // A control that holds what a rippling encoder reads makes the wheel turn unevenly instead.
        let held = self.of == Of::Radius && Varies::of(series, context) == Varies::Radius;
        held.then_some(Id::EncoderRipple)
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        let percent = 100.0 * reported[0].value;
        match self.of {
            Of::Drag => format!("drag varies once a wheel revolution by {percent:.2} % of itself"),
            Of::Load => format!(
                "drag varies once a wheel revolution in proportion to the load, braked or not; of a braked wheel's by {percent:.2} %"
            ),
            Of::Radius => format!(
                "the rolling radius varies once a wheel revolution; the drag at half the critical slip by {percent:.2} % of itself"
            ),
        }
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "A wheel or a drum that is out of round presses harder and less hard once a revolution, and a tyre is not equally stiff or equally large all around. The drag varies with the wheel's angle: in proportion to itself or to the load, or as the slip that a varying radius makes.",
            kind: Kind::Wheel,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[Alias {
                with: Id::EncoderRipple,
                why: "Both repeat with the wheel's angle; a rippling speed is a rippling slip, hence force.",
                run: "Turn the encoder's ring on the hub by a quarter and repeat: a ripple of the encoder moves with it, a run-out of the tyre does not.",
            }],
            smallest: "three percent of the drag",
            smallest_size: |_| 0.03,
            compensation: Compensation::Not("needs the wheel's angle, which a sample lacks"),
            carried: "its size as it is; its phase only where the wheel's angle is known from run to run",
            example: Example::of("first_order", &[0.06, 0.0]),
        }
    }
}

impl<T: Number> Mechanism<T> for RunOut {
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>) {
        if let Some(ripple) = self.form.ripple(p, series, &|_, _| 1.0) {
            match self.of {
                Of::Drag => {
                    for (force, r) in state.force.iter_mut().zip(ripple) {
                        *force = *force * (r + 1.0);
                    }
                }
                Of::Load => {
                    // A wheel that does not roll turns no unequal part into the contact.
                    for (k, r) in ripple
                        .into_iter()
                        .enumerate()
                        .filter(|(k, _)| series.rolling[*k])
                    {
                        state.force[k] += state.load[k] * r;
                    }
                }
                Of::Radius => {
                    let n = ripple.len();
                    let radius = state
                        .radius
                        .get_or_insert_with(|| vec![T::constant(context.radius); n]);
                    for (radius, r) in radius.iter_mut().zip(ripple) {
                        *radius = *radius * (r + 1.0);
                    }
                }
            }
        }
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let factor = match self.of {
            Of::Drag => 1.0,
            Of::Load => load_over_drag(fitted.series, fitted.context),
            // On the base curve d ln mu / d slip is 1.2 / critical slip at half of that.
            Of::Radius => 1.2 / fitted.law.critical.value(),
        };
        self.form.report(p, factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::Channel;

    #[test]
    fn a_share_of_the_load_is_told_as_one_of_a_braked_wheel_s_drag() {
        let channel = |smooth: Vec<f64>| Channel {
            smooth,
            ..Channel::default()
        };
        // Rolls freely, then brakes with 0.5 and 0.25 of the load.
        let series = Series {
            load: channel(vec![1000.0; 3]),
            drag_smooth: vec![10.0, 500.0, 250.0],
            ..Series::default()
        };
        let context = Context {
            max_drag: 500.0,
            ..Context::default()
        };
        let factor = load_over_drag(core::slice::from_ref(&series), &context);
        assert!((factor - 3.0).abs() < 1e-12, "{factor}");
        assert_eq!(load_over_drag(&[], &context), 0.0);
    }

    #[test]
    fn a_share_of_the_load_adds_nothing_at_a_standstill() {
        let run_out = RunOut {
            form: FORMS[0],
            of: Of::Load,
        };
        let series = Series {
            angle: vec![0.0, 0.0, 0.5],
            rolling: vec![false, true, true],
            ..Series::default()
        };
        let mut state = State {
            force: vec![0.0; 3],
            load: vec![1000.0; 3],
            ..State::empty()
        };
        run_out.apply(&[0.1, 0.2], &series, &Context::default(), &mut state);
        let later = 1000.0 * (0.1 * 0.5f64.cos() + 0.2 * 0.5f64.sin());
        assert_eq!(state.force[..2], [0.0, 100.0]);
        assert!((state.force[2] - later).abs() < 1e-9);
    }

    #[test]
    fn every_form_has_a_word_of_its_own() {
        let mut words: Vec<&str> = RunOut::all().map(|own| own.of.word(own.form)).collect();
        let all = words.len();
        words.sort_unstable();
        words.dedup();
        assert_eq!((words.len(), all), (7, 7));
    }
}
