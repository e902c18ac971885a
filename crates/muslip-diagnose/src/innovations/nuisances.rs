//! Columns of the measuring chain's nuisances: what its channels may be late by or smoothed beyond what is known.

use super::noise::Slopes;
use super::rows::{Triple, integrated, noise_of_drag, quiet_force, tyre_row_of};
use crate::data::Data;
use crate::mechanism::{Balance, Stage};
use crate::model::{Model, filtered, is_filtered};
use crate::number::finite_or_zero;
use crate::prepare::mean_twice_about;
use crate::series::Series;
use crate::slip;

/// Second derivative of a smoothed channel from its rate.
fn second(rate: &[f64], time: &[f64]) -> Vec<f64> {
    let n = rate.len();
    (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(2), (k + 2).min(n - 1));
            let d = (rate[b] - rate[a]) / (time[b] - time[a]).max(1e-9);
            finite_or_zero(d)
        })
        .collect()
}

/// Shortest lateness of a vehicle speed in s of which the shape matters: poles or a mere delay.
const LEAST_POLE_S: f64 = 5e-3;

/// What an impulse gains where a channel is late by so many equal poles and was taken to be late by a delay, in N s:
/// the force through the poles, brought forward by their delay, less the force, over time.
fn poles_for_delay(time: &[f64], dt: &[f64], force: &[f64], late: f64, poles: usize) -> Vec<f64> {
    let mut passed = force.to_vec();
    for _ in 0..poles {
        let mut out = passed.first().copied().unwrap_or(0.0);
        let mut known = (f64::NAN, 0.0);
        for (x, dt) in passed.iter_mut().zip(dt) {
            if *dt != known.0 {
                known = (*dt, 1.0 - (-dt * poles as f64 / late).exp());
            }
            out += known.1 * (*x - out);
            *x = out;
        }
    }
    let early = at_times(time, &passed, late);
    let mut sum = 0.0;
    early
        .iter()
        .zip(force)
        .zip(dt)
        .map(|((early, force), dt)| {
            sum += (early - force) * dt.min(0.1);
            sum
        })
        .collect()
}

/// A column at so many s after each sample, the last value beyond its end.
fn at_times(time: &[f64], x: &[f64], after: f64) -> Vec<f64> {
    let last = time.len().saturating_sub(1);
    let mut at = 0;
    time.iter()
        .map(|t| {
            while at < last && time[at + 1] < t + after {
                at += 1;
            }
            let next = (at + 1).min(last);
            let span = time[next] - time[at];
            let share = if span > 0.0 {
                ((t + after - time[at]) / span).clamp(0.0, 1.0)
            } else {
                0.0
            };
            x[at] + share * (x[next] - x[at])
        })
        .collect()
}

/// The chain on one run: what its columns are made of.
struct Chain<'a> {
    data: &'a Data,
    model: &'a Model,
    series: &'a Series,
    slopes: &'a Slopes,
    /// The force in the levels, N.
    force: Vec<f64>,
    run: usize,
    /// Whether the model's force passes a filter.
    is_filtered: bool,
    /// Rates of the speeds, nothing where there are none.
    wheel_rate: Vec<f64>,
    speed_rate: Vec<f64>,
}

/// What stands in a balance at each sample.
type Entry<'a> = &'a dyn Fn(usize) -> f64;

impl<'a> Chain<'a> {
    fn new(
        data: &'a Data,
        model: &'a Model,
        (slopes, force): (&'a Slopes, &[Vec<f64>]),
        run: usize,
    ) -> Self {
        let series = &data.series[run];
        let finite = |rate: &[f64]| rate.iter().map(|x| finite_or_zero(*x)).collect();
        Self {
            data,
            model,
            series,
            slopes,
            force: quiet_force(series, &force[run]),
            run,
            is_filtered: is_filtered(&data.catalogue, model),
            wheel_rate: finite(&series.wheel.rate),
            speed_rate: finite(&series.speed.rate),
        }
    }

    /// Means over the blocks of what stands in each balance, sample by sample, where the balance is formed; nothing
    /// where it stands in none. What stands in the tyre's is a change of the force in the contact.
    fn columns(&self, entries: [Option<Entry<'_>>; 3]) -> Triple {
        self.columns_from(Stage::Contact, entries)
    }

    /// The same, what stands in the tyre's balance being a change of the force that comes about at this stage.
    fn columns_from(&self, stage: Stage, entries: [Option<Entry<'_>>; 3]) -> Triple {
        let blocks = &self.data.blocks[self.run];
        let balances = [Balance::Tyre, Balance::Wheel, Balance::Vehicle];
        core::array::from_fn(|b| match entries[b] {
            Some(entry) if !self.series.segments(balances[b]).is_empty() => {
                let entry = |k: usize| finite_or_zero(entry(k));
                if balances[b] == Balance::Tyre && self.is_filtered {
                    let read = self.filtered(stage, entry);
                    blocks[b].mean_of(|k| read[k])
                } else {
                    blocks[b].mean_of(entry)
                }
            }
            _ => Vec::new(),
        })
    }

    /// What the model's filters from a stage on leave of a change of the force: an error of the slip comes as late to the
    /// reading as the force that it makes. Where no tyre's balance is formed nothing is known of such an error.
    fn filtered(&self, from: Stage, change: impl Fn(usize) -> f64) -> Vec<f64> {
        let s = self.series;
        let mut known = vec![0.0; s.len()];
        for k in s.tyre.iter().flat_map(Clone::clone) {
            known[k] = change(k);
        }
        let Data {
            catalogue, context, ..
        } = self.data;
        let p = self.model.vector();
        filtered(catalogue, self.model, &p, from, s, context, known)
    }

    /// Where the wheel speed reads so much less.
    fn by_wheel(&self, u: impl Fn(usize) -> f64) -> Triple {
        let slope = &self.slopes.wheel[self.run];
        let inertia = self.data.context.inertia;
        let (force, level) = (|k: usize| -slope[k] * u(k), |k: usize| inertia * u(k));
        self.columns_from(Stage::Slip, [Some(&force), Some(&level), None])
    }

    /// Where the vehicle speed reads so much less.
    fn by_speed(&self, u: impl Fn(usize) -> f64) -> Triple {
        let slope = &self.slopes.speed[self.run];
        let mass = self.data.context.mass;
        let (force, level) = (|k: usize| -slope[k] * u(k), |k: usize| mass * u(k));
        self.columns_from(Stage::Slip, [Some(&force), None, Some(&level)])
    }

    /// Zero-phase: what inputs and reading differ by in bandwidth, and what smoothing leaves of the slip's noise.
    fn by_force(&self, reach: f64) -> Triple {
        let s = self.series;
        // As the readings say it: a lag that filters their noise must find that done already.
        let mut force = self.slopes.force[self.run].clone();
        for (force, beside) in force.iter_mut().zip(&s.beside_law) {
            *force -= beside;
        }
        let mean = mean_twice_about(&s.time, &force, &s.tyre, reach);
        self.columns([Some(&|k| force[k] - mean[k]), None, None])
    }

    /// What of the slip is faster than the smoother leaves of it: the drag follows as much of it as is no noise.
    fn by_fast_force(&self) -> Triple {
        let fast = &self.series.fast_force;
        if fast.is_empty() {
            return Triple::default();
        }
        self.columns_from(Stage::Slip, [Some(&|k| fast[k]), None, None])
    }

    /// A mean over noisy slip is not the law at the mean slip: half its second derivative times the noise's variance.
    fn by_curvature(&self) -> Triple {
        let s = self.series;
        let radius = self.data.context.radius;
        let curve = |k: usize| {
            if !s.rolling[k] {
                return 0.0;
            }
            let noise = (radius / s.speed.smooth[k] * s.wheel.sigma).powi(2)
                + (radius * s.wheel.smooth[k] / s.speed.smooth[k].powi(2) * s.speed.sigma).powi(2);
            -0.5 * self.slopes.curvature[self.run][k] * noise
        };
        self.columns([Some(&curve), None, None])
    }

    /// The same of a slip that moves within a window of a sensor or of the smoother: half the second derivative times
    /// the rate's square, by the window's variance in s².
    fn by_motion(&self) -> Triple {
        let s = self.series;
        let radius = self.data.context.radius;
        let curve = |k: usize| {
            if !s.rolling[k] {
                return 0.0;
            }
            let speeds = [s.wheel.smooth[k], s.speed.smooth[k]];
            let rate = slip::rate(radius, speeds, [self.wheel_rate[k], self.speed_rate[k]]);
            -0.5 * self.slopes.curvature[self.run][k] * rate * rate
        };
        self.columns([Some(&curve), None, None])
    }

    /// A force or torque smoothed over this reach, within the stretches where its balance is formed.
    fn smoothed(&self, x: &[f64], reach: f64) -> Vec<f64> {
        let s = self.series;
        mean_twice_about(&s.time, x, s.level_segments(), reach)
    }

    /// What smoothing over this reach takes off a force or torque, integrated.
    fn smoothed_away(&self, x: &[f64], reach: f64) -> Vec<f64> {
        let s = self.series;
        let mean = self.smoothed(x, reach);
        let mut sum = 0.0;
        (0..s.len())
            .map(|k| {
                let d = (x[k] - mean[k]) * s.dt[k].min(0.1);
                if d.is_finite() {
                    sum += d;
                }
                sum
            })
            .collect()
    }

    /// The brake smoothed, where it is integrated. A lag of the brake filters its reading's noise, and must find that
    /// done already; nothing does that to the drag's.
    fn by_brake(&self, reach: f64) -> Triple {
        let Some(torque) = &self.series.torque else {
            return Triple::default();
        };
        let level = self.smoothed_away(&torque.smooth, reach);
        self.columns([None, Some(&|k| level[k]), None])
    }

    /// The drag smoothed, where it is integrated.
    fn by_drag(&self, reach: f64) -> Triple {
        let level = self.smoothed_away(&self.force, reach);
        let lever = -self.data.context.radius;
        self.columns([None, Some(&|k| lever * level[k]), Some(&|k| level[k])])
    }

    /// The drag's own noise, integrated: it does not slow the vehicle, and is taken for force where the reading is. In the
    /// wheel's row what a wheel's sensor errs by, which is in the slip and in the level, would stand for it: 3 false names
    /// more on 98 campaigns behind chains.
    fn by_noise_of_drag(&self) -> Triple {
        let s = self.series;
        let noise = noise_of_drag(s, &tyre_row_of(self.data, self.model, self.run));
        if noise.is_empty() {
            return Triple::default();
        }
        let level = integrated(s, |k| noise[k], |_| 0.0);
        self.columns([None, None, Some(&|k| level[k])])
    }

    /// A wheel speed behind poles is late, wide and lopsided. Its delay is taken off, its width has columns of its own; what
    /// lopsidedness leaves of a balance goes by the second derivative of all that acts on the wheel, drag and brake
    /// alike. A lag of the brake leaves that of the brake alone, and is told from it by this column. In the tyre's row it
    /// would stand for what is the tyre's: 6 false names instead of 3 on 60 campaigns that lack nothing.
    fn by_poles_of_wheel(&self, reach: f64) -> Triple {
        let Some(torque) = &self.series.torque else {
            return Triple::default();
        };
        let radius = self.data.context.radius;
        let acting: Vec<f64> = core::iter::zip(&torque.smooth, &self.force)
            .map(|(torque, force)| torque - radius * force)
            .collect();
        let mean = self.smoothed(&acting, reach);
        self.columns([None, Some(&|k| reach * (acting[k] - mean[k])), None])
    }

    /// A vehicle speed late by so many poles instead of by a delay.
    fn by_poles(&self, poles: usize) -> Triple {
        let s = self.series;
        let late = self.data.vehicle_late;
        if !(late > LEAST_POLE_S) || s.vehicle_balance.is_empty() {
            return Triple::default();
        }
        let force: Vec<f64> = self.force.iter().map(|f| finite_or_zero(*f)).collect();
        let level = poles_for_delay(&s.time, &s.dt, &force, late, poles);
        self.columns([None, None, Some(&|k| level[k])])
    }
}

/// The columns on one run as means over blocks, with the prior standard deviations of their coefficients.
pub fn nuisances(
    data: &Data,
    model: &Model,
    of_model: (&Slopes, &[Vec<f64>]),
    run: usize,
) -> Vec<(f64, Triple)> {
    let chain = Chain::new(data, model, of_model, run);
    let s = chain.series;
    let (wheel_rate, speed_rate) = (&chain.wheel_rate, &chain.speed_rate);
    let wheel_second = second(wheel_rate, &s.time);
    let speed_second = second(speed_rate, &s.time);
    let mean = data.context.mean_wheel_speed;
    let torque = s.torque.as_ref().map(|torque| &torque.smooth);
    let braked = |k: usize| torque.map_or(0.0, |torque| torque[k]);
    let late = data.timing_std;
    vec![
        // Wheel speed late.
        (late.wheel, chain.by_wheel(|k| wheel_rate[k])),
        // Vehicle speed late.
        (late.vehicle, chain.by_speed(|k| speed_rate[k])),
        // Brake late.
        (late.brake, chain.columns([None, Some(&braked), None])),
        // Wheel speed late by turn.
        (
            late.wheel_by_turn,
            chain.by_wheel(|k| wheel_rate[k] * mean / s.wheel.smooth[k].abs().max(0.1 * mean)),
        ),
        // Force smoothed, 6 ms.
        (4.0, chain.by_force(0.006)),
        // Force smoothed, 20 ms.
        (3.0, chain.by_force(0.02)),
        // Force smoothed, 60 ms.
        (1.0, chain.by_force(0.06)),
        // Force as fast as the smoother does not leave it.
        (1.0, chain.by_fast_force()),
        // Brake smoothed, 6 ms.
        (4.0, chain.by_brake(0.006)),
        // Brake smoothed, 20 ms.
        (3.0, chain.by_brake(0.02)),
        // Drag smoothed, 20 ms.
        (3.0, chain.by_drag(0.02)),
        // Law's curvature under slip noise.
        (1.0, chain.by_curvature()),
        // Law's curvature under moving slip.
        (1e-4, chain.by_motion()),
        // Vehicle speed low-passed.
        (3e-3, chain.by_speed(|k| -0.5 * speed_second[k])),
        // Vehicle speed late by one pole, by two, instead of by a delay.
        (1.0, chain.by_poles(1)),
        (1.0, chain.by_poles(2)),
        // Wheel speed low-passed.
        (3e-4, chain.by_wheel(|k| -0.5 * wheel_second[k])),
        // Wheel speed behind poles, 20 ms.
        (3.0, chain.by_poles_of_wheel(0.02)),
        // The drag's noise.
        (1.0, chain.by_noise_of_drag()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::innovations::blocks::blocks;
    use crate::innovations::hypothesis::{Beside, judge_added};
    use crate::innovations::rows::rows_of;
    use crate::innovations::toy::{
        EFFORT, Lags, Noise, entry_of_form, settled, stop, stop_with, with_term,
    };
    use crate::mechanism::Id;
    use crate::model::Term;

    /// What a lag of the brake gains in nats, no price taken off, and its time constant in s.
    fn brake_lag_in(lags: Lags) -> (f64, f64) {
        let data = stop_with(Noise::TYPICAL, lags, 7);
        let base = settled(&data);
        let model = with_term(&data, &base, Id::BrakeLag, 0.01);
        let beside = Beside::new(&data, &base);
        let with = judge_added(&data, &model, &[], &beside, EFFORT).unwrap();
        (base.loss - with.loss, with.model.terms[0].parameters[0])
    }

    #[test]
    fn poles_of_the_wheel_s_sensor_are_no_lag_of_the_brake_and_a_lag_is() {
        let (gain, time_s) = brake_lag_in(Lags {
            wheel_sensor_s: 0.012,
            brake_s: 0.0,
        });
        assert!(gain < 8.0, "{gain} nats, {time_s} s");
        let (gain, time_s) = brake_lag_in(Lags {
            wheel_sensor_s: 0.0,
            brake_s: 0.02,
        });
        assert!(gain > 30.0, "{gain} nats, {time_s} s");
        assert!((time_s - 0.02).abs() < 0.004, "{time_s} s");
    }

    #[test]
    fn a_drag_that_follows_what_is_fast_in_the_slip_is_no_load_cell_that_rings() {
        let mut data = stop(Noise::TYPICAL, 7);
        let s = &mut data.series[0];
        // Up to 40 Hz and beyond, as drum and brake excite the wheel; nothing lasts.
        let swing = |t: f64| (150.0 * t).sin() + (233.0 * t).cos() + (311.0 * t + t * t).sin();
        s.fast_force = s.time.iter().map(|t| 60.0 * swing(*t)).collect();
        for k in 0..s.len() {
            s.drag[k] += 0.7 * s.fast_force[k];
        }
        // The toy's wheel and vehicle did not feel it.
        s.wheel_balance.clear();
        s.vehicle_balance.clear();
        data.blocks = blocks(&data.series);
        let base = settled(&data);
        let entry = entry_of_form(&data, Id::StructuralResonance, "fast_share");
        let mut model = base.model.clone();
        model.terms.push(Term {
            entry,
            parameters: vec![40.0, 0.2, 0.3],
        });
        let beside = Beside::new(&data, &base);
        let with = judge_added(&data, &model, &[], &beside, EFFORT).unwrap();
        let gain = base.loss - with.loss;
        // Three parameters and a name cost fifteen.
        assert!(gain < 12.0, "{gain} nats, {:?}", with.model.terms[0]);
    }

    #[test]
    fn a_mass_s_error_is_right_where_the_drag_s_noise_has_a_memory() {
        for seed in [7, 8] {
            let noise = Noise {
                vehicle: 0.02,
                drag_coloured: 60.0,
                ..Noise::TYPICAL
            };
            let mut data = stop(noise, seed);
            // The rig file's is a seventh too small.
            data.context.mass *= 6.0 / 7.0;
            let law = settled(&data);
            data.tell_law_error(&law.parts);
            let base = settled(&data);
            let model = with_term(&data, &base, Id::VehicleInertia, 0.0);
            let beside = Beside::new(&data, &base);
            let with = judge_added(&data, &model, &[], &beside, EFFORT).unwrap();
            let error = with.model.terms[0].parameters[0];
            // Without: 0.63 and 0.54.
            assert!((error - 1.0 / 6.0).abs() < 0.02, "{seed}: {error}");
            let gain = base.loss - with.loss;
            assert!(gain > 5.0, "{seed}: {gain}");
        }
    }

    #[test]
    fn a_change_of_the_force_comes_to_the_reading_as_a_filtered_model_has_it() {
        let plain = stop(Noise::FINE_WHEEL, 2);
        let base = settled(&plain);
        // A relaxation of the slip is none of a force that the reading brings about.
        let memories = [
            (Id::ForceDelay, 0.02),
            (Id::ForceLag, 0.02),
            (Id::RelaxationLength, 0.3),
        ];
        for (id, parameter) in memories {
            let model = with_term(&plain, &base, id, parameter);
            let change = |k: usize| 100.0 * (20.0 * plain.series[0].time[k]).sin();
            // The other way: rows of the model whose force is less by the change.
            let mut less = plain.clone();
            less.series[0].beside_law = (0..plain.series[0].len()).map(change).collect();
            let [before, after] = [&plain, &less].map(|data| rows_of(data, &model, 0).tyre);
            let moved = plain.blocks[0][0].mean_of(|k| after[k] - before[k]);
            let slopes = Slopes::new(&plain, &model);
            let chain = Chain::new(&plain, &model, (&slopes, &slopes.force), 0);
            let [column, ..] = chain.columns([Some(&change), None, None]);
            let most = moved.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            assert!(most > 50.0, "{id:?} {most}");
            for (column, moved) in column.iter().zip(&moved) {
                assert!(
                    (column - moved).abs() < 1e-9 * most,
                    "{id:?} {column} {moved}"
                );
            }
        }
    }

    #[test]
    fn a_step_through_a_pole_ahead_of_its_delay_leaves_what_has_not_passed_yet() {
        let (step, late, size) = (1e-4, 0.05, 300.0);
        let time: Vec<f64> = (0..4000).map(|k| f64::from(k) * step).collect();
        let dt = vec![step; time.len()];
        let from = 0.1;
        let force: Vec<f64> = time
            .iter()
            .map(|t| if *t >= from { size } else { 0.0 })
            .collect();
        let found = poles_for_delay(&time, &dt, &force, late, 1);
        // From the step on: size late exp(-(t - from + late) / late).
        for k in [1000, 1300, 2000, 3000] {
            let expected = size * late * (-(time[k] - from + late) / late).exp();
            assert!(
                (found[k] - expected).abs() < 0.01 * size * late,
                "{k}: {} {expected}",
                found[k]
            );
        }
        // Whatever the number of poles, in the end all of the impulse has passed.
        let two = poles_for_delay(&time, &dt, &force, late, 2);
        assert!(two[3400].abs() < 0.01 * size * late, "{}", two[3400]);
    }
}
