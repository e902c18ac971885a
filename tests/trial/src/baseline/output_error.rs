//! The wheel and vehicle balances as an output-error fit takes them: forces are integrated to speeds, and what the
//! speeds read beside them is taken for white noise.
//!
//! Over a stretch without a gap, J (ω − ω₀) = ∫(R F − T) dt + Σ θ ∫φ dt, and m (v − v₀) = −∫F dt + Σ θ ∫φ dt, with the
//! initial value of each stretch free. Small steady errors add up that accelerations bury in noise; in turn the noise
//! of the forces adds up to a random walk, which the method, as taught, does not know of.

use crate::baseline::record::Record;
use crate::baseline::select::Problem;
use crate::generate::rig::Rig;

/// A stretch shorter than this tells nothing beside its free initial value.
const FEWEST: usize = 20;

/// The wheel balance.
pub fn wheel(rig: &Rig, runs: &[Record]) -> Problem {
    const IDS: [&str; 6] = [
        "wheel_inertia",
        "bearing_drag",
        "bearing_drag",
        "brake_fade",
        "force_gain",
        "brake_lag",
    ];
    let mut problem = Problem::default();
    for record in runs {
        let run = &record.readings;
        let torque = record.smoothed(&run.torque);
        let mut heat = 0.0;
        let mut last = 0;
        stretches(rig, record, &IDS, &mut problem, |i| {
            // Heat, like the brake's own, goes on through what the balance leaves out.
            while last < i {
                let power = run.torque[last] * run.wheel[last] * record.period;
                heat += if power.is_finite() { power } else { 0.0 };
                last += 1;
            }
            let net = rig.radius_m * run.drag[i] - run.torque[i];
            Sample {
                output: rig.inertia_kg_m2 * run.wheel[i],
                force: -net,
                // By the model's own acceleration, which has no noise of the speed.
                rates: [
                    net,
                    1.0,
                    run.wheel[i],
                    run.torque[i] * heat,
                    run.drag[i],
                    0.0,
                ],
                // A torque that lags leaves the integral of its rate: itself.
                levels: [0.0, 0.0, 0.0, 0.0, 0.0, torque[i]],
            }
        });
    }
    problem
}

/// The vehicle balance. In it the mass and the force's gain are one column: the wheel balance, where it has found the
/// gain off, decides.
pub fn vehicle(rig: &Rig, runs: &[Record], gain_is_off: bool) -> Problem {
    let ids = [
        "grade_or_drive",
        "aero_drag",
        if gain_is_off {
            "force_gain"
        } else {
            "vehicle_inertia"
        },
    ];
    let mut problem = Problem::default();
    for record in runs {
        let run = &record.readings;
        let speed = record.smoothed(&run.speed);
        stretches(rig, record, &ids, &mut problem, |i| Sample {
            output: rig.mass_kg * run.speed[i],
            force: run.drag[i],
            rates: [1.0, speed[i].powi(2), run.drag[i]],
            levels: [0.0; 3],
        });
    }
    problem
}

/// What one sample brings: momentum as read, force that should make up for it, and the candidates, as rates to be
/// integrated or as integrals.
struct Sample<const N: usize> {
    output: f64,
    force: f64,
    rates: [f64; N],
    levels: [f64; N],
}

/// Integrates over each stretch in which the tool's base holds, and frees its initial value by taking off the means:
/// the same as a column of its own for each (Frisch, Waugh and Lovell).
fn stretches<const N: usize>(
    rig: &Rig,
    record: &Record,
    ids: &[&'static str; N],
    problem: &mut Problem,
    mut sample: impl FnMut(usize) -> Sample<N>,
) {
    let run = &record.readings;
    for stretch in &record.stretches {
        let fast = |i: &usize| run.speed[*i] > rig.slowest_m_s();
        let mut i = stretch.start;
        while i < stretch.end {
            let Some(start) = (i..stretch.end).find(fast) else {
                break;
            };
            let end = (start..stretch.end)
                .find(|i| !fast(i))
                .unwrap_or(stretch.end);
            i = end;
            if end - start < FEWEST {
                continue;
            }
            let mut rows: Vec<(f64, [f64; N])> = Vec::with_capacity(end - start);
            let mut impulse = 0.0;
            let mut sums = [0.0; N];
            let mut before: Option<Sample<N>> = None;
            for i in start..end {
                let now = sample(i);
                if let Some(before) = &before {
                    let half = 0.5 * (run.time[i] - run.time[i - 1]);
                    impulse += half * (now.force + before.force);
                    for (sum, (a, b)) in sums.iter_mut().zip(now.rates.iter().zip(&before.rates)) {
                        *sum += half * (a + b);
                    }
                }
                let mut row = sums;
                for (value, level) in row.iter_mut().zip(now.levels) {
                    *value += level;
                }
                rows.push((now.output + impulse, row));
                before = Some(now);
            }
            push_centred(problem, ids, &rows);
        }
    }
}

fn push_centred<const N: usize>(
    problem: &mut Problem,
    ids: &[&'static str; N],
    rows: &[(f64, [f64; N])],
) {
    let count = rows.len() as f64;
    let mean = rows.iter().map(|row| row.0).sum::<f64>() / count;
    let means: [f64; N] =
        std::array::from_fn(|place| rows.iter().map(|row| row.1[place]).sum::<f64>() / count);
    for (output, row) in rows {
        let centred: [[f64; 1]; N] = std::array::from_fn(|place| [row[place] - means[place]]);
        let named: [(&'static str, &[f64]); N] =
            std::array::from_fn(|place| (ids[place], centred[place].as_slice()));
        problem.push(output - mean, &[], &named);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_initial_value_leaves_no_trace() {
        let mut problem = Problem::default();
        push_centred(&mut problem, &["aero_drag"], &[(7.0, [1.0]), (9.0, [5.0])]);
        push_centred(
            &mut problem,
            &["aero_drag"],
            &[(107.0, [-1.0]), (109.0, [3.0])],
        );
        assert_eq!(problem.residual, [-1.0, 1.0, -1.0, 1.0]);
        assert_eq!(problem.candidates[0].1[0], [-2.0, 2.0, -2.0, 2.0]);
    }
}
