//! Where the chosen model differs from the base.

use super::answer::Answer;
use crate::correction::Levers;
use crate::innovations::rows::{rows_of, tyre_row_of};
use crate::law::closest;
use crate::locate::{intervals, regions};
use crate::mechanism::{Balance, Id};
use crate::model::Model;
use crate::outcome::{Interval, Region};
use crate::series::Series;
use crate::variable::Variable;

/// Time in s over which a speed's change is an acceleration.
const MEAN_S: f64 = 0.05;

impl Answer<'_> {
    /// Stretches and regions of operation; `drag_sigma` is the noise of one drag reading in N.
    pub(super) fn located(&self, drag_sigma: f64) -> (Vec<Interval>, Vec<Region>) {
        let data = &self.data;
        let mut found = Vec::new();
        let mut where_regions = Vec::new();
        for balance in [Balance::Tyre, Balance::Wheel, Balance::Vehicle] {
            if !self.touches(balance) {
                continue;
            }
            let difference = match balance {
                Balance::Tyre => self.of_reading(),
                Balance::Wheel | Balance::Vehicle => self.of_motion(balance),
            };
            let sigma = self.sigma_of(balance, drag_sigma);
            for (s, difference) in data.series.iter().zip(&difference) {
                let usable = s.segments(balance);
                for (start_s, end_s, z) in intervals(&s.time, difference, usable, sigma, sigma) {
                    found.push(Interval {
                        recording: s.name.clone(),
                        balance: balance.as_str(),
                        channel: self.channel_of(balance).to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            let usable: Vec<_> = data
                .series
                .iter()
                .map(|s| s.segments(balance).to_vec())
                .collect();
            let columns = self.columns_read(balance);
            let balance = balance.as_str();
            where_regions.extend(regions(
                data,
                balance,
                &difference,
                &usable,
                &columns,
                sigma,
            ));
        }
        (found, where_regions)
    }

    /// Whether anything was found in a balance.
    fn touches(&self, balance: Balance) -> bool {
        let chosen = &self.decision.chosen;
        let named = |id: Id| id.balance() == balance;
        let catalogue = &self.data.catalogue;
        let mut terms = chosen.model.terms.iter();
        terms.any(|t| named(catalogue.get(t.entry).id()))
            || chosen.extra.iter().any(|e| e.balance == balance)
    }

    /// Recorded columns that the chosen model reads in a balance.
    fn columns_read(&self, balance: Balance) -> Vec<Variable> {
        let own = self.decision.chosen.extra.iter();
        own.filter(|e| e.balance == balance && matches!(e.variable, Variable::Column(_)))
            .map(|e| e.variable.clone())
            .collect()
    }

    /// Channel that shows it.
    fn channel_of(&self, balance: Balance) -> &'static str {
        let catalogue = &self.data.catalogue;
        let terms = self.decision.chosen.model.terms.iter();
        let mechanisms = terms.map(|t| catalogue.get(t.entry));
        let mut own = mechanisms.filter(|m| m.id().balance() == balance);
        let usual = balance.channel();
        let first = own.next().map_or(usual, |m| m.facts().channel);
        if own.all(|m| m.facts().channel == first) {
            first
        } else {
            usual
        }
    }

    /// Chosen model less the base law that comes closest to it in the mean square, in N, by run. Beside the base law as
    /// fitted, which takes what does not follow it for noise, an effect would seem to be there and nowhere else; the
    /// best that the base law can do has its error everywhere.
    fn of_reading(&self) -> Vec<Vec<f64>> {
        let data = &self.data;
        let expected = |model: &Model, run: usize| -> Vec<f64> {
            let drag = data.series[run].drag.iter();
            let rows = tyre_row_of(data, model, run);
            drag.zip(rows).map(|(y, e)| y - e).collect()
        };
        let mut readings: Vec<Vec<f64>> = (0..data.series.len())
            .map(|run| expected(&self.decision.chosen.model, run))
            .collect();
        for (reading, corrected) in readings
            .iter_mut()
            .zip(self.decision.chosen.corrected(data))
        {
            for (y, corrected) in reading.iter_mut().zip(corrected) {
                *y += corrected;
            }
        }
        let base = closest(data, &self.decision.base.model, &readings);
        readings
            .into_iter()
            .enumerate()
            .map(|(run, reading)| {
                if reading.is_empty() {
                    return vec![0.0; data.series[run].len()];
                }
                let base = expected(&base, run);
                reading.iter().zip(base).map(|(y, f)| y - f).collect()
            })
            .collect()
    }

    /// The same of a wheel's or the vehicle's balance, as a moment in N m or a force in N.
    fn of_motion(&self, balance: Balance) -> Vec<Vec<f64>> {
        let data = &self.data;
        let free = self.decision.chosen.dependences();
        let levers = Levers::new(data, &self.decision.chosen.model);
        (0..data.series.len())
            .map(|run| {
                let s = &data.series[run];
                let level = |model: &Model| rows_of(data, model, run).of(balance).to_vec();
                let before = level(&self.decision.base.model);
                let after = level(&self.decision.chosen.model);
                let mut d: Vec<f64> = before.iter().zip(after).map(|(a, b)| b - a).collect();
                for (own, coefficients) in &free {
                    for (triple, c) in own.columns(data, &levers, run).iter().zip(coefficients) {
                        for (d, x) in d.iter_mut().zip(&triple[balance as usize]) {
                            *d += c * x;
                        }
                    }
                }
                if d.is_empty() {
                    return vec![0.0; s.len()];
                }
                let rate = |k: usize| (d[k] - d[k - 1]) / s.dt[k];
                (0..d.len())
                    .map(|k| if k == 0 { 0.0 } else { rate(k) })
                    .collect()
            })
            .collect()
    }

    /// Noise of a balance's residual, in N or N m.
    fn sigma_of(&self, balance: Balance, drag: f64) -> f64 {
        let data = &self.data;
        let context = &data.context;
        let mean = |f: &dyn Fn(&Series) -> f64| {
            data.series.iter().map(f).sum::<f64>() / data.series.len() as f64
        };
        let acceleration = |sigma: f64| {
            let samples = (MEAN_S / context.dt).max(2.0);
            sigma * (12.0 / samples).sqrt() / MEAN_S
        };
        match balance {
            Balance::Tyre => drag,
            Balance::Wheel => {
                let torque = mean(&|s| s.torque.as_ref().map_or(0.0, |t| t.sigma));
                let turning = context.inertia * acceleration(mean(&|s| s.wheel.sigma));
                (drag * context.radius).hypot(torque).hypot(turning)
            }
            Balance::Vehicle => drag.hypot(context.mass * acceleration(mean(&|s| s.speed.sigma))),
        }
    }
}
