//! The drag channel reports late by a fixed time.

use super::{Context, Describe, Evidence, Id, Law, Mechanism, Parameter, Reported, Stage, State};
use crate::number::Number;
use crate::prepare::Series;

/// The drag channel reports late by a fixed time.
pub struct ForceDelay;

impl Describe for ForceDelay {
    fn id(&self) -> Id {
        Id::ForceDelay
    }
    fn stage(&self) -> Stage {
        Stage::Chain
    }
    fn parameters(&self, context: &Context) -> Vec<Parameter> {
        vec![Parameter::new(
            "delay",
            "s",
            0.0,
            0.15_f64.min(0.25 * context.duration),
        )]
    }
    fn starts(
        &self,
        context: &Context,
        _series: &[Series],
        _evidence: &[Evidence],
    ) -> Vec<Vec<f64>> {
        [0.5, 1.5, 4.0, 10.0, 25.0, 60.0]
            .iter()
            .map(|m| vec![m * 1e-3])
            .filter(|s| s[0] > 0.2 * context.dt)
            .collect()
    }
    fn equation(&self) -> &'static str {
        "reading(t) = drag(t - delay)"
    }
    fn statement(&self, reported: &[Reported<f64>], _p: &[f64]) -> String {
        format!(
            "the drag channel reports {:.1} ms late",
            1e3 * reported[0].value
        )
    }
}

impl<T: Number> Mechanism<T> for ForceDelay {
    fn apply(&self, p: &[T], series: &Series, _context: &Context, state: &mut State<T>) {
        let delay = p[0].value();
        if delay <= 0.0 && p[0] == T::constant(0.0) {
            return;
        }
        let input = state.force.clone();
        let n = input.len();
        let mut at = 0;
        for k in 0..n {
            let wanted = series.time[k] - delay;
            while at + 1 < n && series.time[at + 1] <= wanted {
                at += 1;
            }
            if wanted <= series.time[0] || n < 4 {
                state.force[k] = input[0];
                continue;
            }
            // Cubic Lagrange over the four samples around the wanted time.
            let from = at.saturating_sub(1).min(n - 4);
            let mut y = T::constant(0.0);
            for (i, value) in input.iter().enumerate().skip(from).take(4) {
                let mut weight = T::constant(1.0);
                for j in from..from + 4 {
                    if i != j {
                        let gap = series.time[i] - series.time[j];
                        weight = weight * ((-p[0] + (series.time[k] - series.time[j])) / gap);
                    }
                }
                y += *value * weight;
            }
            state.force[k] = y;
        }
    }
    fn report(
        &self,
        p: &[T],
        _law: &Law<T>,
        _context: &Context,
        _series: &[Series],
    ) -> Vec<Reported<T>> {
        vec![Reported {
            name: "delay",
            unit: "s",
            value: p[0],
        }]
    }
}
