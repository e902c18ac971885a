//! The load cell and its mount ring: a lightly damped second-order response.

use super::filters::second_order;
use super::prelude::*;
use crate::constants::RINGING;
use crate::prepare::BRISK_S;

/// How much of the force passes through what rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// All of it: one mode.
    Whole,
    /// A share: the mode is one of several, the others far above.
    Share,
    /// All of it, with what of the slip is faster than the smoother leaves: more that rings, and more noise.
    Fast,
    /// A share of that.
    FastShare,
}

/// All forms.
pub const FORMS: [Form; 4] = [Form::Whole, Form::Share, Form::Fast, Form::FastShare];

/// The load cell and its mount ring: a lightly damped second-order response.
pub struct StructuralResonance {
    /// Which form.
    pub form: Form,
}

impl Describe for StructuralResonance {
    fn facts(&self) -> Facts {
        const WHOLE: &str =
            "reading'' + 2 zeta W reading' + W^2 reading = W^2 drag, W = 2 pi frequency";
        const SHARE: &str = "reading = drag + share (y - drag), y'' + 2 zeta W y' + W^2 y = W^2 drag, W = 2 pi frequency";
        let (form, equation) = match self.form {
            Form::Whole => ("", WHOLE),
            Form::Share => ("share", SHARE),
            Form::Fast => ("fast", WHOLE),
            Form::FastShare => ("fast_share", SHARE),
        };
        let amplitude = self.is_share().then_some(2);
        Facts {
            form,
            amplitude,
            filters: true,
            of_fast_force: self.is_of_fast_force(),
            audited: (self.form == Form::Whole).then_some(Audited::Ring),
            ..Facts::of(Id::StructuralResonance, Stage::Structure, equation)
        }
    }
    fn memory_s(&self, p: &[f64], _context: &Context) -> Option<f64> {
        let omega = core::f64::consts::TAU * p.first()?;
        let damping = p.get(1).copied().unwrap_or(1.0);
        // What rings remembers as long as it rings.
        Some(1.0 / (omega * if self.rings(p) { damping } else { 1.0 }))
    }
    fn rings(&self, p: &[f64]) -> bool {
        p.get(1).is_some_and(|damping| *damping < RINGING)
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        let mut all = vec![
            Parameter::new("frequency", "Hz", 2.0, self.highest_hz(context)),
            Parameter::new("damping_ratio", "1", 0.002, self.most_damping()),
        ];
        if self.is_share() {
            all.push(Parameter::new("share", "1", 0.0, 1.5));
        }
        all
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        let top = self.highest_hz(search.context).min(0.4 / search.context.dt);
        let mut starts = Vec::new();
        let mut frequency = 4.0;
        while frequency < top.min(150.0) {
            if self.is_share() {
                starts.extend([0.03, 0.12].map(|zeta| vec![frequency, zeta, 0.0]));
            } else {
                starts.extend([0.03, 0.15].map(|zeta| vec![frequency, zeta]));
            }
            frequency *= 1.19;
        }
        starts
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the load cell and its mount ring at {:.1} Hz with a damping ratio of {:.3}",
            reported[0].value, reported[1].value
        )
    }
    fn owns(&self, parameters: &[f64], _context: &Context) -> bool {
        !self.is_share() || below_limit(parameters[1], self.most_damping())
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "Load cell and mount are a mass on a spring: each change of the force makes them ring at their own frequency until damping has taken it. The mean is right, the oscillation is not the tyre's.",
            kind: Kind::LoadCell,
            touches: &[Balance::Tyre, Balance::Wheel, Balance::Vehicle],
            memory: Memory::Kernel,
            sign: Sign::Positive,
            aliases: &[
                Alias {
                    with: Id::RunOut,
                    why: "At one speed a revolution is a frequency.",
                    run: runs::TAP_STANDING,
                },
                Alias {
                    with: Id::InertialReaction,
                    why: "A wheel that oscillates is read as a force that does.",
                    run: runs::TAP_STANDING,
                },
            ],
            smallest: "a frequency that lies within the recording's band: below about 30 Hz it disturbs a ramp",
            smallest_size: |_| 30.0,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is: settled at the run's first sample",
            example: Example::of("", &[18.0, 0.05]),
        }
    }
}

impl StructuralResonance {
    /// A share that hardly rings is any difference between two filters.
    fn most_damping(&self) -> f64 {
        if self.is_share() { 0.25 } else { 0.3 }
    }

    /// Highest frequency that the steps of a recording show; of what is fast in the slip, that the means leave which it is
    /// taken from.
    fn highest_hz(&self, context: &Context) -> f64 {
        let of_steps = 0.45 / context.dt;
        if self.is_of_fast_force() {
            of_steps.min(0.25 / BRISK_S)
        } else {
            of_steps
        }
    }

    fn is_of_fast_force(&self) -> bool {
        matches!(self.form, Form::Fast | Form::FastShare)
    }

    fn is_share(&self) -> bool {
        matches!(self.form, Form::Share | Form::FastShare)
    }
}

impl<T: Number> Mechanism<T> for StructuralResonance {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let ring = |force: &mut Vec<T>| second_order(force, &series.dt, p[0], p[1]);
        let share = self.is_share().then(|| p[2]);
        match share {
            None => ring(&mut state.force),
            Some(share) => {
                let mut ringing = state.force.clone();
                ring(&mut ringing);
                for (y, ringing) in state.force.iter_mut().zip(ringing) {
                    *y += share * (ringing - *y);
                }
            }
        }
        if !self.is_of_fast_force() {
            return;
        }
        let mut fast: Vec<T> = state.fast_force.iter().map(|f| T::constant(*f)).collect();
        ring(&mut fast);
        for (y, fast) in state.force.iter_mut().zip(&mut fast) {
            *fast = *fast * share.unwrap_or(T::constant(1.0));
            *y += *fast;
        }
        state.read_of_fast = fast;
    }
    fn report(&self, p: &[T], _fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        vec![
            Reported::new("frequency", "Hz", p[0]),
            Reported::new("damping_ratio", "1", p[1]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a form makes of a constant force of 1,200 N in a tenth of a second, in N, with what is fast beside it.
    fn read(form: Form, fast: &[f64]) -> Vec<f64> {
        let series = Series {
            dt: vec![1e-3; 100],
            ..Series::default()
        };
        let mut state = State {
            force: vec![1200.0; 100],
            fast_force: fast.to_vec(),
            ..State::empty()
        };
        let resonance = StructuralResonance { form };
        resonance.apply(&[30.0, 0.05, 0.5], &series, &Context::default(), &mut state);
        state.force
    }

    #[test]
    fn what_is_fast_in_the_slip_makes_only_the_forms_of_it_ring() {
        let fast: Vec<f64> = (0..100)
            .map(|k| 80.0 * (0.2 * f64::from(k)).sin())
            .collect();
        let still = [1200.0; 100];
        assert_eq!(read(Form::Whole, &fast), still);
        assert_eq!(read(Form::Share, &fast), still);
        // Linear: half of all of it, and none of it where nothing is fast.
        let (all, half) = (read(Form::Fast, &fast), read(Form::FastShare, &fast));
        let largest = all.iter().map(|y| (y - 1200.0).abs()).fold(0.0, f64::max);
        assert!(largest > 100.0, "{largest}");
        let apart = all.iter().zip(&half).map(|(a, h)| 0.5 * (a + 1200.0) - h);
        assert!(apart.into_iter().all(|e| e.abs() < 1e-9));
        let none = read(Form::Fast, &[]);
        assert!(none.iter().all(|y| (y - 1200.0).abs() < 1e-9));
    }

    #[test]
    fn a_share_that_rings_as_little_as_it_may_is_a_filter_s() {
        let context = Context::default();
        let [whole, share] = [Form::Whole, Form::Share].map(|form| StructuralResonance { form });
        let rings = |p: &[f64]| share.owns(p, &context);
        assert!(rings(&[20.0, 0.11, 0.4]) && !rings(&[20.0, 0.25, 0.4]));
        assert!(whole.owns(&[20.0, 0.3], &context));
    }
}
