//! Where the chosen model differs from the base.

use super::Answer;
use crate::innovations::rows::rows_of;
use crate::locate::{intervals, regions};
use crate::mechanism::Balance;
use crate::outcome::{Interval, Region};
use crate::prepare::Series;

impl Answer<'_> {
    pub(super) fn located(&self) -> (Vec<Interval>, Vec<Region>) {
        let data = self.data;
        let (base, chosen) = (&self.decision.base.model, &self.decision.chosen.model);
        let both: Vec<_> = (0..data.series.len())
            .map(|run| (rows_of(data, base, run), rows_of(data, chosen, run)))
            .collect();
        let free = self.dependences();
        let mut found = Vec::new();
        let mut where_regions = Vec::new();
        let drag = self.white(Balance::Tyre).unwrap_or(data.context.drag_sigma);
        let mean_speed_noise = |f: &dyn Fn(&Series) -> f64| {
            data.series.iter().map(f).sum::<f64>() / data.series.len() as f64
        };
        for balance in [Balance::Tyre, Balance::Wheel, Balance::Vehicle] {
            let touched = chosen
                .terms
                .iter()
                .any(|t| data.catalogue.get(t.entry).id().balance() == balance)
                || self
                    .decision
                    .chosen
                    .extra
                    .iter()
                    .any(|e| e.balance == balance);
            if !touched {
                continue;
            }
            let usable: Vec<_> = data
                .series
                .iter()
                .map(|s| s.segments(balance).to_vec())
                .collect();
            let difference: Vec<Vec<f64>> = both
                .iter()
                .enumerate()
                .map(|(run, (a, b))| {
                    let s = &data.series[run];
                    let (before, after) = (a.of(balance), b.of(balance));
                    let mut d: Vec<f64> = before.iter().zip(after).map(|(a, b)| b - a).collect();
                    for (own, coefficients) in &free {
                        for (triple, c) in own.columns[run].iter().zip(coefficients) {
                            for (d, x) in d.iter_mut().zip(&triple[balance as usize]) {
                                *d += c * x;
                            }
                        }
                    }
                    if d.is_empty() {
                        return vec![0.0; s.len()];
                    }
                    if balance == Balance::Tyre {
                        return d;
                    }
                    (0..d.len())
                        .map(|k| {
                            if k == 0 {
                                0.0
                            } else {
                                (d[k] - d[k - 1]) / s.dt[k]
                            }
                        })
                        .collect()
                })
                .collect();
            let acceleration = |sigma: f64| {
                let samples = (0.05 / data.context.dt).max(2.0);
                sigma * (12.0 / samples).sqrt() / 0.05
            };
            let (sigma, channel) = match balance {
                Balance::Tyre => (drag, "drag_force_n"),
                Balance::Wheel => {
                    let torque = mean_speed_noise(&|s| s.torque.as_ref().map_or(0.0, |t| t.sigma));
                    let turning =
                        data.context.inertia * acceleration(mean_speed_noise(&|s| s.wheel.sigma));
                    (
                        (drag * data.context.radius).hypot(torque).hypot(turning),
                        "wheel_speed_rad_s",
                    )
                }
                Balance::Vehicle => (
                    drag.hypot(
                        data.context.mass * acceleration(mean_speed_noise(&|s| s.speed.sigma)),
                    ),
                    "vehicle_speed_m_s",
                ),
            };
            for (run, s) in data.series.iter().enumerate() {
                for (start_s, end_s, z) in
                    intervals(&s.time, &difference[run], &usable[run], sigma, sigma)
                {
                    found.push(Interval {
                        recording: s.name.clone(),
                        balance: balance.as_str(),
                        channel: channel.to_owned(),
                        start_s,
                        end_s,
                        z,
                    });
                }
            }
            where_regions.extend(regions(data, balance.as_str(), &difference, &usable, sigma));
        }
        (found, where_regions)
    }
}
