//! Whether a weak effect is still there when the inputs are smoothed otherwise.
//!
//! Noise that is left in the slip bends the mean force wherever the curve bends, and smoothing that is too strong
//! rounds off every ramp: both look like physics. The first falls with the window, the second grows with it; what
//! the tyre does depends on neither.

use crate::campaign::Run;
use crate::choose::{Search, candidate};
use crate::data::Data;
use crate::fit::{BalanceNoise, Fitted, Joint};
use crate::model::Model;
use crate::omnibus::{Action, Levers, group};
use crate::regression::Regression;
use crate::remainder::{Remainder, resolution, spline};
use crate::split::Split;
use crate::tyre_stage::problem;

/// Factors on the smoothing windows.
const FACTORS: [f64; 2] = [0.5, 2.0];
/// Share of the gain that must be left under the other windows.
const LEFT: f64 = 0.5;
/// Gain in nats a sample above which an effect is too strong to be an artefact of smoothing.
const BEYOND_DOUBT: f64 = 0.12;

/// The campaign under other windows, prepared when it is first asked for.
pub struct Otherwise<'a> {
    data: &'a Data,
    runs: &'a [Run],
    split: &'a Split,
    noise: &'a BalanceNoise,
    prepared: Vec<Data>,
}

impl<'a> Otherwise<'a> {
    /// Of a campaign and its noise.
    #[must_use]
    pub fn new(data: &'a Data, runs: &'a [Run], split: &'a Split, noise: &'a BalanceNoise) -> Self {
        Self {
            data,
            runs,
            split,
            noise,
            prepared: Vec::new(),
        }
    }

    fn joints(&mut self) -> Vec<Joint<'_>> {
        if self.prepared.is_empty() {
            self.prepared = FACTORS
                .iter()
                .map(|f| self.data.smoothed_otherwise(self.runs, *f))
                .collect();
        }
        self.prepared
            .iter()
            .map(|data| Joint {
                parts: vec![problem(data, self.split, self.noise)],
            })
            .collect()
    }

    /// Takes out of the chosen set what is weak and goes with the smoothing.
    #[must_use]
    pub fn kept(&mut self, joint: &Joint<'_>, mut found: Search) -> Search {
        while !found.chosen.ids.is_empty() {
            let full = &found.chosen.fitted;
            let mut worst: Option<(f64, Fitted)> = None;
            for place in 0..full.model.terms.len() {
                let without = joint.without(&found, place);
                let gain = without.loss - full.loss;
                if gain > BEYOND_DOUBT * found.count as f64 {
                    continue;
                }
                let least = self
                    .joints()
                    .iter()
                    .map(|other| {
                        let with = other.fit(&full.model, 8);
                        let fewer = other.fit(&without.model, 8);
                        (fewer.loss - with.loss) / gain.max(1e-9)
                    })
                    .fold(f64::INFINITY, f64::min);
                if least < LEFT && worst.as_ref().is_none_or(|w| least < w.0) {
                    worst = Some((least, without));
                }
            }
            let Some((_, without)) = worst else {
                break;
            };
            found.chosen = candidate(joint, without);
        }
        found
    }

    /// Whether a free dependence is strong, or still there under the other windows.
    #[must_use]
    pub fn holds(&mut self, joint: &Joint<'_>, model: &Model, remainder: &Remainder) -> bool {
        if remainder.gain > BEYOND_DOUBT * joint.count() as f64 {
            return true;
        }
        let (Some(variable), Some(action)) = (
            &remainder.variable,
            Action::parse(&remainder.correction.acts_on),
        ) else {
            return true;
        };
        self.joints().iter().all(|other| {
            let problem = &other.parts[0];
            let refitted = other.fit(model, 8).model;
            let levers = Levers::new(problem.data, &refitted);
            let regression = Regression::new(problem, &refitted);
            let gain = group(problem, &levers, variable, action, resolution(variable))
                .and_then(|g| spline(problem, &regression, variable, &g))
                .map_or(0.0, |r| r.gain);
            gain >= LEFT * remainder.gain
        })
    }
}
