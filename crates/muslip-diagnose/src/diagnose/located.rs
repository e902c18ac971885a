//! Where the repaired model differs from the base.

use super::Outcome;
use crate::dynamics_stage::DynamicsStage;
use crate::fit::{Problem, moved};
use crate::locate::{intervals, regions};
use crate::mechanism::{Balance, Id};
use crate::model::Model;
use crate::noise::robust_sigma;
use crate::outcome::{Interval, Region};
use crate::size::means;
use crate::tyre_stage::TyreStage;

/// Most steps to the base law that comes closest to the repaired model.
const STEPS: usize = 12;
/// Halvings of a step that does not come closer.
const HALVINGS: i32 = 6;

impl Outcome<'_> {
    pub(super) fn located(&self) -> (Vec<Interval>, Vec<Region>) {
        let data = self.data;
        let mut found: Vec<Interval> = Vec::new();
        let mut where_regions = Vec::new();
        if let Some(stage) = self.tyre
            && !(stage.search.chosen.ids.is_empty() && stage.corrections.is_empty())
        {
            let sigma = self.residual_sigma(stage);
            let channel = if stage.search.chosen.ids == [Id::EncoderRipple] {
                "wheel_speed_rad_s"
            } else {
                "drag_force_n"
            };
            let difference = self.beside_closest_base(stage);
            for (run, series) in data.series.iter().enumerate() {
                for (start_s, end_s, z) in
                    intervals(&series.time, &difference[run], &series.tyre, sigma, sigma)
                {
                    found.push(Interval {
                        recording: series.name.clone(),
                        balance: "tyre",
                        channel: channel.to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            let usable: Vec<_> = data.series.iter().map(|s| s.tyre.clone()).collect();
            where_regions.extend(regions(data, "tyre", &difference, &usable, sigma));
        }
        if let Some(stage) = self.dynamics
            && !(stage.search.chosen.ids.is_empty() && stage.unexplained.is_empty())
        {
            self.locate_dynamics(stage, &mut found, &mut where_regions);
        }
        (found, where_regions)
    }

    /// Repaired model less the base law that comes closest to it in the mean square, in N, by run. Beside the base law
    /// as fitted, which takes what does not follow it for outliers, an effect would seem to be there and nowhere else;
    /// the best that the base law can do has its error everywhere.
    fn beside_closest_base(&self, stage: &TyreStage) -> Vec<Vec<f64>> {
        let problem = &self.tyre_joint(stage, false).parts[0];
        let repaired: Vec<Vec<f64>> = (0..self.data.series.len())
            .map(|run| stage.repaired(self.data, run))
            .collect();
        let difference = |model: &Model| -> Vec<Vec<f64>> {
            let p = model.vector();
            repaired
                .iter()
                .enumerate()
                .map(|(run, after)| {
                    // What the repaired model says of the reading, less what this one does.
                    problem
                        .residual(model, &p, run)
                        .iter()
                        .zip(after)
                        .zip(&self.data.series[run].drag)
                        .map(|((residual, after), reading)| residual - reading + after)
                        .collect()
                })
                .collect()
        };
        let mut model = stage.search.base.fitted.model.clone();
        let mut left = difference(&model);
        let mut least = square(problem, &left);
        let bounds = self.tyre_joint(stage, false).bounds(&model);
        for _ in 0..STEPS {
            let Some(step) = law_step(problem, &model, &left) else {
                break;
            };
            let closer = (0..HALVINGS).find_map(|halving| {
                let trial = model.with(&moved(
                    &model.vector(),
                    &step,
                    0.5f64.powi(halving),
                    &bounds,
                ));
                let left = difference(&trial);
                let value = square(problem, &left);
                (value < least).then_some((trial, left, value))
            });
            let Some((trial, nearer, value)) = closer else {
                break;
            };
            let gained = least - value;
            (model, left, least) = (trial, nearer, value);
            if gained < 1e-6 * least {
                break;
            }
        }
        left
    }

    pub(super) fn locate_dynamics(
        &self,
        stage: &DynamicsStage,
        found: &mut Vec<Interval>,
        where_regions: &mut Vec<Region>,
    ) {
        let data = self.data;
        let model = &stage.search.chosen.fitted.model;
        let joint = self.dynamics_joint(stage, false);
        let force_sigma = self
            .tyre
            .map_or(data.context.drag_sigma, |s| self.residual_sigma(s));
        for part in &joint.parts {
            let (unit, channel) = match part.balance {
                Balance::Wheel => (data.context.radius, "wheel_speed_rad_s"),
                _ => (1.0, "vehicle_speed_m_s"),
            };
            let gain = (stage.search.base.fitted.loss - stage.search.chosen.fitted.loss).max(0.0)
                + stage.unexplained.iter().map(|r| r.gain).sum::<f64>();
            let unnamed = |run: usize| {
                stage
                    .unexplained
                    .iter()
                    .filter(|r| r.balance == part.balance)
                    .map(move |r| &r.effect[run])
            };
            let after = |run: usize| {
                let mut left: Vec<f64> = part.residual(model, &model.vector(), run);
                for effect in unnamed(run) {
                    for (l, e) in left.iter_mut().zip(effect) {
                        *l -= e;
                    }
                }
                left
            };
            // That of a drag reading, and that of an acceleration taken over the span of the means.
            let sigma = (force_sigma * unit).hypot(robust_sigma(&means(part, after)));
            let difference: Vec<Vec<f64>> = (0..data.series.len())
                .map(|run| {
                    part.residual(&Model::default(), &[] as &[f64], run)
                        .iter()
                        .zip(after(run))
                        .map(|(before, after)| after - before)
                        .collect()
                })
                .collect();
            let usable: Vec<_> = data
                .series
                .iter()
                .map(|s| {
                    if part.balance == Balance::Wheel {
                        s.wheel_balance.clone()
                    } else {
                        s.vehicle_balance.clone()
                    }
                })
                .collect();
            let energy: f64 = difference
                .iter()
                .zip(&usable)
                .flat_map(|(d, u)| u.iter().flat_map(move |s| d[s.clone()].iter()))
                .map(|d| d * d)
                .sum();
            if !(energy > 0.0) {
                continue;
            }
            // Strength on the scale of the evidence: the differenced speeds' own noise is no measure.
            let per_sample = (energy / (2.0 * gain.max(1.0))).sqrt().max(1e-300);
            for (run, series) in data.series.iter().enumerate() {
                for (start_s, end_s, z) in intervals(
                    &series.time,
                    &difference[run],
                    &usable[run],
                    sigma,
                    per_sample,
                ) {
                    found.push(Interval {
                        recording: series.name.clone(),
                        balance: part.balance.as_str(),
                        channel: channel.to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            where_regions.extend(regions(
                data,
                part.balance.as_str(),
                &difference,
                &usable,
                per_sample,
            ));
        }
    }
}

/// Sum of squares of a column over the usable stretches of a problem.
fn square(problem: &Problem<'_>, column: &[Vec<f64>]) -> f64 {
    problem
        .runs
        .iter()
        .flat_map(|&run| {
            problem
                .segments(run)
                .iter()
                .flat_map(move |segment| &column[run][segment.clone()])
        })
        .map(|x| x * x)
        .sum()
}

/// Gauss-Newton step of peak friction and slip at the peak towards what is left; all others stay.
fn law_step(problem: &Problem<'_>, model: &Model, left: &[Vec<f64>]) -> Option<Vec<f64>> {
    let (mut a, mut b, mut c, mut u, mut v) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &run in problem.runs {
        let (_, slopes) = problem.slopes(model, run);
        for k in problem.segments(run).iter().flat_map(Clone::clone) {
            // The residual falls as the prediction rises.
            let (first, second) = (-slopes[0][k], -slopes[1][k]);
            a += first * first;
            b += first * second;
            c += second * second;
            u += first * left[run][k];
            v += second * left[run][k];
        }
    }
    let determinant = a * c - b * b;
    let mut step = vec![0.0; model.vector().len()];
    step[0] = (c * u - b * v) / determinant;
    step[1] = (a * v - b * u) / determinant;
    step.iter().all(|d| d.is_finite()).then_some(step)
}
