//! Rising slip and falling slip follow different curves, whatever the rate.

use super::prelude::*;

/// Along what the two curves lie apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Friction: by a share of it, on either side of their mean.
    Friction,
    /// Slip: the patch feels a slip that follows the wheel's with a play, and nothing where the curve is level.
    Slip,
    /// Friction, but the more the faster slip changes, up to a rate: what this says much better is no loop, for a loop does
    /// not depend on the rate.
    Rate,
}

/// All forms.
pub const FORMS: [Form; 3] = [Form::Friction, Form::Slip, Form::Rate];

/// Least half of a play, in slip: far below what any speed tells.
const LEAST_HALF_PLAY: f64 = 1e-4;
/// Largest half of a play, in slip.
const MOST_HALF_PLAY: f64 = 0.1;

/// Rising slip and falling slip follow different curves, whatever the rate.
pub struct SlipHysteresis {
    /// Which form.
    pub form: Form,
}

/// Part of the way from the middle of the loop to its branch, by sample: 1 where slip has risen for long, -1 where it has
/// fallen, 0 where the wheel does not roll; `width` is the slip over which it turns. Where a rate is given slower changes go
/// as much less far.
fn branch<T: Number>(width: T, full_rate: Option<T>, series: &Series, slip: &[T]) -> Vec<T> {
    let mut z = T::constant(0.0);
    let mut all = vec![z; slip.len()];
    for k in 1..slip.len() {
        if series.rolling[k] && series.rolling[k - 1] {
            let change = slip[k] - slip[k - 1];
            let direction = if change.value() >= 0.0 { 1.0 } else { -1.0 };
            let branch = match full_rate.map(|rate| change / (rate * series.dt[k])) {
                Some(share) if share.value().abs() < 1.0 => share,
                _ => T::constant(direction),
            };
            let stay = (-(change.abs() / width)).exp();
            z = (z - branch) * stay + branch;
            all[k] = z;
        }
    }
    all
}

/// Least half of a play that is told from the noise of a reading of the slip: a smaller one only averages that noise, which
/// predicts the drag better and says nothing of the tyre.
fn least_half_play(context: &Context) -> f64 {
    context.slip_sigma.clamp(LEAST_HALF_PLAY, MOST_HALF_PLAY)
}

/// Slip that follows with a play of so much on either side (the play operator: Brokate and Sprekels 1996, Hysteresis and
/// Phase Transitions); without any from where the wheel begins to roll.
fn with_play<T: Number>(half: T, series: &Series, slip: &mut [T]) {
    let mut felt: Option<T> = None;
    for (slip, rolling) in slip.iter_mut().zip(&series.rolling) {
        let (least, most) = (*slip - half, *slip + half);
        felt = rolling.then(|| match felt {
            Some(felt) if felt.value() < least.value() => least,
            Some(felt) if felt.value() > most.value() => most,
            Some(felt) => felt,
            None => *slip,
        });
        *slip = felt.unwrap_or(*slip);
    }
}

impl Describe for SlipHysteresis {
    fn facts(&self) -> Facts {
        let (form, amplitude, stage, equation) = match self.form {
            Form::Friction => (
                "",
                Some(0),
                Stage::Friction,
                "friction = mu(slip) * (1 + loop_share * z), dz/d(slip) = (sign(d slip) - z)/width * sign(d slip)",
            ),
            Form::Rate => (
                "rate",
                Some(0),
                Stage::Friction,
                "friction = mu(slip) * (1 + loop_share * z), dz/d(slip) = (r - z)/width * sign(d slip), r = min(max(rate/full_rate, -1), 1)",
            ),
            Form::Slip => (
                "slip",
                None,
                Stage::Slip,
                "friction = mu(slip'), slip' = min(max(slip', slip - half_play), slip + half_play)",
            ),
        };
        Facts {
            form,
            amplitude,
            counter_form: self.form == Form::Rate,
            ..Facts::of(Id::SlipHysteresis, stage, equation)
        }
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        match self.form {
            Form::Friction => vec![
                Parameter::new("loop_share", "1", -0.6, 0.6),
                Parameter::new("width", "1", 0.001, 0.15),
            ],
            Form::Slip => {
                let least = least_half_play(context);
                vec![Parameter::new("half_play", "1", least, MOST_HALF_PLAY)]
            }
            Form::Rate => vec![
                Parameter::new("loop_share", "1", -0.6, 0.6),
                Parameter::new("width", "1", 0.001, 0.15),
                Parameter::new("full_rate", "1/s", 0.01, 20.0),
            ],
        }
    }
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        let sizes = [0.003, 0.012, 0.04].into_iter();
        let critical = search.context.nominal[1];
        match self.form {
            Form::Friction => sizes.map(|width| vec![0.0, width]).collect(),
            Form::Slip => {
                let least = least_half_play(search.context);
                sizes
                    .filter(|half_play| *half_play > least)
                    .map(|half_play| vec![half_play])
                    .collect()
            }
            Form::Rate => [2.0, 8.0]
                .map(|rate| vec![0.0, 0.012, rate * critical])
                .to_vec(),
        }
    }
    fn owns(&self, p: &[f64], context: &Context) -> bool {
        self.form != Form::Slip || above_limit(p[0], least_half_play(context))
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        let percent = 100.0 * reported[0].value;
        match self.form {
            Form::Friction => format!(
                "friction follows a loop: rising and falling slip differ by {percent:.1} % either side of their mean, whatever the rate"
            ),
            Form::Rate => {
                format!("friction depends on how fast slip changes, by {percent:.1} % at most")
            }
            Form::Slip => format!(
                "friction follows a loop: the tyre's slip follows the wheel's with a play, so rising and falling slip differ by {percent:.1} % either side of their mean half way to the peak, and by nothing at it, whatever the rate"
            ),
        }
    }
    fn guide(&self) -> Guide {
        Guide {
            physics: "On the way into a skid the contact patch is stuck and on the way back it is already sliding, so rising and falling slip follow different curves. The loop does not depend on the rate: that is what a lag would do.",
            kind: Kind::Tyre,
            touches: &[Balance::Tyre],
            memory: Memory::Kernel,
            sign: Sign::Either,
            aliases: &[],
            smallest: "half a loop's height of three percent of friction",
            smallest_size: |_| 0.03,
            compensation: Compensation::NOT_IN_THE_FILTER,
            carried: "as it is: on the middle of the loop at the run's first sample",
            example: Example::of("", &[0.08, 0.02]),
        }
    }
}

impl<T: Number> Mechanism<T> for SlipHysteresis {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        match self.form {
            Form::Friction | Form::Rate => {
                let full_rate = (self.form == Form::Rate).then(|| p[2]);
                let branch = branch(p[1], full_rate, series, &state.slip);
                for (friction, z) in state.friction.iter_mut().zip(branch) {
                    *friction = *friction * (p[0] * z + 1.0);
                }
            }
            Form::Slip => with_play(p[0], series, &mut state.slip),
        }
    }
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>> {
        let loop_share = |share: T| Reported::new("loop_share", "1", share);
        match self.form {
            Form::Friction | Form::Rate => vec![loop_share(p[0].abs())],
            // Half way to the peak, where the curve is steep and friction not small.
            Form::Slip => {
                let at = |relative: T| fitted.law.friction(relative);
                let half = T::constant(0.5);
                let play = p[0] / fitted.law.critical;
                let share = (at(half + play) - at(half - play)) / at(half) * 0.5;
                vec![
                    loop_share(share.abs()),
                    Reported::new("half_play", "1", p[0]),
                ]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_s_branches_are_reached_over_its_width_at_any_rate() {
        // Up to a slip of 0.2 and back, in steps that differ by a factor of five.
        let up = (0..=100).map(|k| 0.002 * f64::from(k));
        let down = (1..=20).map(|k| 0.2 - 0.01 * f64::from(k));
        let slip: Vec<f64> = up.chain(down).collect();
        let series = Series {
            rolling: vec![true; slip.len()],
            ..Series::default()
        };
        let z: Vec<f64> = branch(0.02, None, &series, &slip);
        // 1 - exp(-s / width) on the way up; after the turn back by s: -1 + 2 exp(-s / width), as good as.
        for (k, s) in [(1, 0.002), (10, 0.02), (50, 0.1)] {
            assert!((z[k] - (1.0 - f64::exp(-s / 0.02))).abs() < 1e-9);
        }
        for (back, s) in [(1, 0.01), (4, 0.04)] {
            let expected = 2.0 * f64::exp(-s / 0.02) - 1.0;
            assert!((z[100 + back] - expected).abs() < 1e-4);
        }
        let still = Series {
            rolling: vec![false; slip.len()],
            ..Series::default()
        };
        assert!(branch(0.02, None, &still, &slip).iter().all(|z| *z == 0.0));
    }

    #[test]
    fn where_a_loop_asks_for_a_rate_slip_that_changes_at_half_of_it_goes_half_way() {
        let step_s = 0.01;
        // Up to a slip of 0.2 at 0.4 a second, and back at 2 a second.
        let up = (0..=50).map(|k| 0.004 * f64::from(k));
        let down = (1..=10).map(|k| 0.2 - 0.02 * f64::from(k));
        let slip: Vec<f64> = up.chain(down).collect();
        let series = Series {
            rolling: vec![true; slip.len()],
            dt: vec![step_s; slip.len()],
            ..Series::default()
        };
        let at = |full_rate: f64| branch(0.02, Some(full_rate), &series, &slip);
        assert!((at(0.8)[50] - 0.5).abs() < 1e-3);
        assert!((at(0.8)[60] + 1.0).abs() < 1e-3);
        // One that asks for next to none is a loop.
        let slow = at(1e-6);
        let loops: Vec<f64> = branch(0.02, None, &series, &slip);
        assert!(slow.iter().zip(loops).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_play_no_larger_than_the_noise_of_the_slip_is_none_of_its_own() {
        let play = SlipHysteresis { form: Form::Slip };
        let noisy = Context {
            slip_sigma: 0.004,
            ..Context::default()
        };
        assert!(!play.owns(&[0.004], &noisy) && play.owns(&[0.008], &noisy));
        let [parameter] = play.parameters(&noisy).try_into().unwrap();
        assert!((parameter.low - 0.004).abs() < 1e-12);
        let search = Search {
            context: &noisy,
            series: &[],
            residuals: &[],
        };
        assert_eq!(play.starts(&search), [[0.012], [0.04]]);
        // A loop of the friction has no such limit.
        let friction = SlipHysteresis {
            form: Form::Friction,
        };
        assert!(friction.owns(&[0.001, 0.001], &noisy));
    }

    #[test]
    fn a_slip_with_play_stays_until_the_play_is_taken_up_and_never_runs_against_the_wheel_s() {
        let slip: Vec<f64> = (0..400)
            .map(|k| 0.1 + 0.08 * (0.05 * f64::from(k)).sin())
            .collect();
        let series = Series {
            rolling: vec![true; slip.len()],
            ..Series::default()
        };
        let half = 0.01;
        let mut felt = slip.clone();
        with_play(half, &series, &mut felt);
        let steps = felt.windows(2).zip(slip.windows(2));
        for (felt, slip) in steps {
            let (own, of_wheel) = (felt[1] - felt[0], slip[1] - slip[0]);
            assert!(own * of_wheel >= 0.0 && own.abs() <= of_wheel.abs() + 1e-15);
        }
        let apart = |k: usize| slip[k] - felt[k];
        // Rising from the start, falling after the turn at 31, rising again after that at 94.
        assert!((apart(25) - half).abs() < 1e-12 && (apart(80) + half).abs() < 1e-12);
        assert!((apart(32) - apart(31)).abs() > 0.0 && (felt[32] - felt[31]).abs() < 1e-15);
        assert!((apart(150) - half).abs() < 1e-12);
    }
}
