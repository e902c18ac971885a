//! The sharpness of the peak or the friction of the full skid is not that of the two-parameter law.

use super::prelude::*;

/// Forms of the curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Another b on either side of the peak.
    TwoSided,
    /// And a stretched falling side.
    Stretched,
}

/// All forms.
pub const FORMS: [Form; 2] = [Form::TwoSided, Form::Stretched];

/// The sharpness of the peak or the friction of the full skid is not that of the two-parameter law.
pub struct CurveShape {
    /// Which form.
    pub form: Form,
}

impl Describe for CurveShape {
    fn facts(&self) -> Facts {
        let form = match self.form {
            Form::TwoSided => "two_sided",
            Form::Stretched => "stretched",
        };
        Facts {
            form,
            fed_by_chain: true,
            another_curve: true,
            ..Facts::of(
                Id::CurveShape,
                Stage::Law,
                "mu = peak (2 + b) x / (1 + b x + x^2), x = (slip/critical_slip)^p, b and p of their own on the falling side",
            )
        }
    }
    fn parameters(&self, _context: &Context) -> Vec<Parameter> {
        let mut all = vec![
            Parameter::new("rising_shape", "1", -1.2, 3.0),
            Parameter::new("falling_shape", "1", -2.0, 6.0),
        ];
        if self.form == Form::Stretched {
            all.push(Parameter::new("falling_stretch", "1", -1.2, 1.2));
        }
        all
    }
    fn starts(&self, _search: &Search<'_>) -> Vec<Vec<f64>> {
        let mut starts = vec![vec![0.0, 0.0], vec![0.3, 1.0], vec![0.0, 2.0]];
        if self.form == Form::Stretched {
            for s in &mut starts {
                s.push(0.0);
            }
        }
        starts
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the curve has another shape: at full skid {:.2} of the peak friction is left",
            reported[0].value
        )
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "The tread's contact patch slides from its rear edge forward as slip grows, and how fast it does so, and how much grip a sliding block keeps, is not the same in every tyre. The peak is then sharper or blunter, and the full skid higher or lower, than the two-parameter law has it.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::None,
            sign: Sign::Either,
            aliases: &[Alias {
                with: Id::ForceSaturation,
                why: "Both flatten the curve at its top.",
                run: "Repeat the ramp under half the load: a channel clips at the same force, a curve scales with the load.",
            }],
            smallest: "a change of the full skid's friction by a tenth of the peak's",
            smallest_size: |_| 0.1,
            compensation: Compensation::Not("another law than the filter's two-parameter one"),
            carried: "as it is: the shape is the tyre's, whatever the run",
            example: Example::of("two_sided", &[0.0, 1.2]),
        }
    }
}

impl<T: Number> Mechanism<T> for CurveShape {
    fn apply(&self, p: &[T], _series: &Series, _context: &Context, state: &mut State<T>) {
        state.law.rise = Some(p[0]);
        state.law.fall = Some((p[1], p.get(2).copied()));
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let mut shaped = *fitted.law;
        shaped.rise = Some(p[0]);
        shaped.fall = Some((p[1], p.get(2).copied()));
        let full = shaped.shape(T::constant(1.0) / fitted.law.critical);
        vec![Reported::new("full_skid_ratio", "1", full)]
    }
}
