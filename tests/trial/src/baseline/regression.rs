//! The wheel and vehicle balances as a textbook regression takes them: accelerations over 50 ms, whose noise in the
//! columns is not accounted for.

use crate::baseline::record::Record;
use crate::baseline::select::Problem;
use crate::generate::rig::Rig;

/// Means over 50 ms, with the difference quotient of one channel across each.
fn blocks(
    rig: &Rig,
    record: &Record,
    rate_of: &[f64],
    mut use_block: impl FnMut(f64, &dyn Fn(&[f64]) -> f64),
) {
    let run = &record.readings;
    let width = (0.05 / record.period).round().max(2.0) as usize;
    for stretch in &record.stretches {
        for start in (stretch.start..stretch.end.saturating_sub(width)).step_by(width) {
            let end = start + width;
            if run.speed[start] < rig.slowest_m_s() {
                continue;
            }
            let mean = |values: &[f64]| values[start..end].iter().sum::<f64>() / width as f64;
            let span = run.time[end] - run.time[start];
            use_block((rate_of[end] - rate_of[start]) / span, &mean);
        }
    }
}

/// The wheel balance.
pub fn wheel(rig: &Rig, runs: &[Record]) -> Problem {
    let mut problem = Problem::default();
    for record in runs {
        let run = &record.readings;
        let torque_rate = record.rate(&record.smoothed(&run.torque));
        let mut heat = 0.0;
        blocks(rig, record, &run.wheel, |rate, mean| {
            let torque = mean(&run.torque);
            heat += torque * mean(&run.wheel);
            problem.push(
                rig.inertia_kg_m2 * rate - rig.radius_m * mean(&run.drag) + torque,
                &[],
                &[
                    ("wheel_inertia", &[rate]),
                    ("bearing_drag", &[1.0]),
                    ("bearing_drag", &[mean(&run.wheel)]),
                    ("brake_fade", &[torque * heat]),
                    ("force_gain", &[mean(&run.drag)]),
                    ("brake_lag", &[mean(&torque_rate)]),
                ],
            );
        });
    }
    problem
}

/// The vehicle balance. The residual is the sum of its own acceleration and force: with a column of each, any noise
/// would be fitted without remainder. So the wheel balance, where it has found the gain off, decides which it is.
pub fn vehicle(rig: &Rig, runs: &[Record], gain_is_off: bool) -> Problem {
    let mut problem = Problem::default();
    for record in runs {
        let run = &record.readings;
        blocks(rig, record, &run.speed, |rate, mean| {
            let (id, column) = if gain_is_off {
                ("force_gain", mean(&run.drag))
            } else {
                ("vehicle_inertia", rate)
            };
            problem.push(
                rig.mass_kg * rate + mean(&run.drag),
                &[],
                &[
                    ("grade_or_drive", &[1.0]),
                    ("aero_drag", &[mean(&run.speed).powi(2)]),
                    (id, &[column]),
                ],
            );
        });
    }
    problem
}
