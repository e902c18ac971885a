//! Pictures of what each mechanism of a repaired model does, made from recordings.

use muslip_analysis::diagnose::wording::{axis_label, short_name, spoken};
use muslip_diagnose::campaign::Run;
use muslip_diagnose::chain::correct::Lateness;
use muslip_diagnose::imbalance::{Imbalance, Instant};
use muslip_diagnose::mechanism::{Against, Balance, Id};
use muslip_diagnose::outcome::Diagnosis;
use muslip_diagnose::repaired::{Correction, Repaired, Which};

use super::plots::interrupted;
use crate::axis::Axis;
use crate::figure::{Figure, Ink, Shape};

/// Length of the stretch about which a drag is shown, in s.
const STRETCH_S: f64 = 0.8;
/// Fewest samples of it.
const FEWEST_SAMPLES: usize = 60;
/// Most points of a line.
const MOST_POINTS: usize = 1200;
/// Length over which an acceleration is taken, in s: over one sample it would be all noise.
const MEAN_S: f64 = 0.05;
/// Ranges of what an effect is a function of, and fewest means of one that is shown.
const RANGES: usize = 24;
const FEWEST_MEANS: usize = 3;

/// A mechanism's pictures.
#[derive(Debug, Clone)]
pub struct Effect {
    /// The mechanism's id.
    pub id: String,
    /// What it does.
    pub figures: Vec<Figure>,
}

/// The pictures of every mechanism that was named and that the recordings kept can show.
#[must_use]
pub fn effects(diagnosis: &Diagnosis, runs: &[Run]) -> Vec<Effect> {
    let found = &diagnosis.found;
    let run = strongest(diagnosis, runs);
    let tyre = found.tyre.iter().enumerate().map(|(place, term)| {
        let figures =
            run.and_then(|run| on_drag(found, &without_term(found, place), &term.id, run));
        (term.id.as_str(), figures.unwrap_or_default())
    });
    let delays = diagnosis
        .mechanisms
        .iter()
        .filter(|named| Id::parse(named.id).is_some_and(is_delay_of_speed))
        .map(|named| {
            let without = Repaired {
                late: Lateness::default(),
                ..found.clone()
            };
            let figures = run.and_then(|run| on_drag(found, &without, named.id, run));
            (named.id, figures.unwrap_or_default())
        });
    let dynamics = found.dynamics.iter().enumerate().map(|(place, term)| {
        let figures = on_balance(found, runs, place, &term.id);
        (term.id.as_str(), figures)
    });
    tyre.chain(delays)
        .chain(dynamics)
        .map(|(id, figures)| Effect {
            id: id.to_owned(),
            figures,
        })
        .collect()
}

/// Whether a mechanism is in a model's timing and no term of it.
fn is_delay_of_speed(id: Id) -> bool {
    matches!(id, Id::WheelSpeedDelay | Id::VehicleSpeedDelay)
}

fn without_term(model: &Repaired, place: usize) -> Repaired {
    let mut without = model.clone();
    without.tyre.remove(place);
    without
}

/// The picture of a model's first mechanism on one run; `None` where the run does not show it.
pub(crate) fn of_first(model: &Repaired, run: &Run) -> Option<Figure> {
    let figures = match model.dynamics.first() {
        Some(term) => on_balance(model, core::slice::from_ref(run), 0, &term.id),
        None => on_drag(model, &without_term(model, 0), &model.tyre.first()?.id, run)?,
    };
    figures.into_iter().next()
}

/// The run with the strongest mismatch of the tyre; the first where none is flagged.
fn strongest<'a>(diagnosis: &Diagnosis, runs: &'a [Run]) -> Option<&'a Run> {
    let flagged = diagnosis.r#where.iter().filter(|i| i.balance == "tyre");
    flagged
        .filter_map(|interval| {
            let run = runs.iter().find(|run| run.name == interval.recording)?;
            Some((interval.z, run))
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, run)| run)
        .or_else(|| runs.first())
}

/// What a mechanism does to the drag: the stretch that shows it most, and the whole run.
fn on_drag(with: &Repaired, without: &Repaired, id: &str, run: &Run) -> Option<Vec<Figure>> {
    let drag = |model: &Repaired| {
        let alone = Repaired {
            corrections: Vec::new(),
            ..model.clone()
        };
        Some(alone.predict(run, Which::Repaired).ok()?.drag_force_n)
    };
    let (with_n, without_n) = (drag(with)?, drag(without)?);
    let difference: Vec<f64> = with_n.iter().zip(&without_n).map(|(a, b)| a - b).collect();
    let (from, to) = most_shown(&run.time_s, &difference);
    let line = |values: &[f64], (from, to): (usize, usize)| -> Vec<(f64, f64)> {
        let stride = (to - from).div_ceil(MOST_POINTS).max(1);
        let points = run.time_s.iter().copied().zip(values.iter().copied());
        points.take(to).skip(from).step_by(stride).collect()
    };
    let (name, recording) = (spoken(id), short_name(&run.name));
    let close_up = Figure::new(
        format!("The drag with {name} and without it, where {recording} shows it most."),
        Axis::new("time (s)"),
        Axis::new("drag (N)"),
    )
    .named(format!("effect-{id}"))
    .with(
        Ink::Measured,
        "measured",
        Shape::Points(line(&run.drag_force_n, (from, to))),
    )
    .with(
        Ink::Second,
        "model without it",
        Shape::Dashes(interrupted(line(&without_n, (from, to)))),
    )
    .with(
        Ink::Estimate,
        "model with it",
        Shape::Line(interrupted(line(&with_n, (from, to)))),
    );
    let whole = Figure::new(
        format!("Contribution of {name} to the drag over {recording}: model with it minus model without it."),
        Axis::new("time (s)"),
        Axis::new("difference of drag (N)"),
    )
    .named(format!("effect-{id}-over-time"))
    .with(Ink::Reference, "", Shape::Level(0.0))
    .with(
        Ink::Estimate,
        "contribution",
        Shape::Line(interrupted(line(&difference, (0, run.len())))),
    );
    Some(vec![close_up, whole])
}

/// The stretch in which values are largest on average: its first place, and the one after its last.
fn most_shown(time_s: &[f64], values: &[f64]) -> (usize, usize) {
    let mut best = (0.0, (0, values.len()));
    let (mut from, mut sum) = (0, 0.0);
    for (to, value) in values.iter().enumerate() {
        sum += value.abs();
        while time_s[to] - time_s[from] > STRETCH_S && to - from >= FEWEST_SAMPLES {
            let mean = sum / (to - from + 1) as f64;
            if mean > best.0 {
                best = (mean, (from, to + 1));
            }
            sum -= values[from].abs();
            from += 1;
        }
    }
    best.1
}

/// What a mechanism of wheel or vehicle does: what the balance lacks, and what the mechanism supplies, over what
/// it is a function of. One with a memory is a function of no channel: what it does over time, and how far the
/// recordings follow it.
fn on_balance(repaired: &Repaired, runs: &[Run], place: usize, id: &str) -> Vec<Figure> {
    let of = |run: &Run| repaired.imbalance(run, place).ok().flatten();
    let shown = runs
        .iter()
        .filter_map(|run| Some((short_name(&run.name), of(run)?)));
    let (names, mut all): (Vec<&str>, Vec<Imbalance>) = shown.unzip();
    let Some(first) = all.first() else {
        return Vec::new();
    };
    let (balance, against) = (first.balance, first.against);
    let (acts_on, unit) = match balance {
        Balance::Wheel => ("torque on the wheel", "N m"),
        _ => ("force on the vehicle", "N"),
    };
    let (balance, name) = (balance.as_str(), spoken(id));
    let up = Axis::new(format!("{acts_on} ({unit})"));
    let mut figures = Vec::new();
    let along = match axis_of(against) {
        Some(label) => label.to_owned(),
        None => {
            let most = names
                .iter()
                .zip(&all)
                .max_by(|a, b| largest(a.1).total_cmp(&largest(b.1)));
            if let Some((recording, imbalance)) = most {
                let caption = format!(
                    "Contribution of {name} to the {balance} balance over {recording}; positive slows the {balance}."
                );
                figures.push(
                    Figure::new(caption, Axis::new("time (s)"), up.clone())
                        .named(format!("effect-{id}-over-time"))
                        .with(Ink::Reference, "", Shape::Level(0.0))
                        .with(Ink::Estimate, &name, Shape::Line(over_time(imbalance))),
                );
            }
            for instant in all
                .iter_mut()
                .flat_map(|i| i.stretches.iter_mut().flatten())
            {
                instant.at = instant.supplied;
            }
            format!("{acts_on} by {name} ({unit})")
        }
    };
    let means = over_ranges(&all);
    if means.is_empty() {
        return figures;
    }
    let points = |of: fn(&Mean) -> f64| means.iter().map(|mean| (mean.at, of(mean))).collect();
    let band = means.iter().map(|mean| {
        let std = mean.std_of_mean;
        (mean.at, mean.lacking - std, mean.lacking + std)
    });
    figures.push(
        Figure::new(
            format!(
                "Residual of the {balance} balance without {name}, and the contribution of {name} (all \
                 recordings); positive slows the {balance}."
            ),
            Axis::new(along),
            up,
        )
        .named(format!("effect-{id}"))
        .with(Ink::Reference, "", Shape::Level(0.0))
        .with(
            Ink::Measured,
            "1-sigma of a mean",
            Shape::Band(band.collect()),
        )
        .with(
            Ink::Measured,
            "recorded, means",
            Shape::Points(points(|mean| mean.lacking)),
        )
        .with(
            Ink::Estimate,
            name,
            Shape::Line(points(|mean| mean.supplied)),
        ),
    );
    figures
}

/// The largest that a mechanism supplies.
fn largest(imbalance: &Imbalance) -> f64 {
    let instants = imbalance.stretches.iter().flatten();
    instants.map(|i| i.supplied.abs()).fold(0.0, f64::max)
}

/// What an effect is a function of; `None` where that is its own history.
fn axis_of(variable: Against) -> Option<&'static str> {
    match variable {
        Against::Time => None,
        Against::VehicleSpeed => Some("vehicle speed (m/s)"),
        Against::WheelSpeed => Some("wheel speed (rad/s)"),
        Against::NormalForce => Some("normal force (N)"),
        Against::Drag => Some("drag reading (N)"),
        Against::VehicleAcceleration => Some("acceleration of the vehicle (m/s\u{b2})"),
        Against::WheelAcceleration => Some("angular acceleration of the wheel (rad/s\u{b2})"),
    }
}

/// A mean of instants.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Mean {
    at: f64,
    lacking: f64,
    supplied: f64,
    /// Of `lacking`; not finite for a mean of one stretch of time.
    std_of_mean: f64,
}

/// Means over lengths of time of each stretch.
fn means(imbalance: &Imbalance, length_s: f64) -> Vec<Mean> {
    let mut means = Vec::new();
    for stretch in &imbalance.stretches {
        let mut rest = stretch.as_slice();
        while let Some(first) = rest.first() {
            let count = rest.partition_point(|i| i.time_s < first.time_s + length_s);
            let (block, others) = rest.split_at(count.max(1));
            rest = others;
            // What is left at the end of a stretch is shorter, and its noise larger.
            if rest.is_empty() && block.len() < stretch.len() && !means.is_empty() {
                break;
            }
            let mean =
                |of: fn(&Instant) -> f64| block.iter().map(of).sum::<f64>() / block.len() as f64;
            means.push(Mean {
                at: mean(|i| i.at),
                lacking: mean(|i| i.lacking),
                supplied: mean(|i| i.supplied),
                std_of_mean: f64::NAN,
            });
        }
    }
    means.retain(|mean| (mean.at + mean.lacking + mean.supplied).is_finite());
    means
}

/// What a mechanism supplies along one run.
fn over_time(imbalance: &Imbalance) -> Vec<(f64, f64)> {
    let count: usize = imbalance.stretches.iter().map(Vec::len).sum();
    let stride = count.div_ceil(MOST_POINTS).max(1);
    // A gap between stretches interrupts the line.
    let gap = |stretch: &Vec<Instant>| (stretch.last().map_or(f64::NAN, |i| i.time_s), f64::NAN);
    let points = |stretch: &Vec<Instant>| {
        let instants = stretch.iter().step_by(stride);
        instants.map(|i| (i.time_s, i.supplied)).collect::<Vec<_>>()
    };
    let stretches = imbalance.stretches.iter();
    stretches
        .flat_map(|stretch| points(stretch).into_iter().chain([gap(stretch)]))
        .collect()
}

/// Means over ranges of what the effect is a function of, of all runs.
fn over_ranges(all: &[Imbalance]) -> Vec<Mean> {
    let mut short: Vec<Mean> = all.iter().flat_map(|i| means(i, MEAN_S)).collect();
    short.sort_by(|a, b| a.at.total_cmp(&b.at));
    let (Some(first), Some(last)) = (short.first(), short.last()) else {
        return Vec::new();
    };
    let width = ((last.at - first.at) / RANGES as f64).max(f64::MIN_POSITIVE);
    let low = first.at;
    let range = |mean: &Mean| (((mean.at - low) / width) as usize).min(RANGES - 1);
    short
        .chunk_by(|a, b| range(a) == range(b))
        .filter(|members| members.len() >= FEWEST_MEANS)
        .map(|members| {
            let count = members.len() as f64;
            let mean = |of: fn(&Mean) -> f64| members.iter().map(of).sum::<f64>() / count;
            let lacking = mean(|m| m.lacking);
            let squares = members.iter().map(|m| (m.lacking - lacking).powi(2));
            let variance = squares.sum::<f64>() / (count - 1.0);
            Mean {
                at: mean(|m| m.at),
                lacking,
                supplied: mean(|m| m.supplied),
                std_of_mean: (variance / count).sqrt(),
            }
        })
        .collect()
}

/// The table of an empirical correction, drawn.
#[must_use]
pub fn correction(correction: &Correction) -> Option<Figure> {
    let (what, acts_on) = match correction.acts_on.as_str() {
        "friction" => ("friction", "relative change of friction"),
        "force" => ("drag", "added force / mean normal force"),
        "critical_slip" => ("critical slip", "relative change of critical slip"),
        "slip" => ("slip as read", "added slip"),
        _ => return None,
    };
    let points: Vec<(f64, f64)> = correction
        .knots
        .iter()
        .copied()
        .zip(correction.values.iter().copied())
        .collect();
    let label = axis_label(&correction.variable);
    (points.len() > 1).then(|| {
        Figure::new(
            format!("Correction of the {what} that no named mechanism explains."),
            Axis::new(label),
            Axis::new(acts_on),
        )
        .named(format!("correction-over-{}", correction.variable))
        .with(Ink::Reference, "", Shape::Level(0.0))
        .with(Ink::Estimate, "correction", Shape::Line(points.clone()))
        .with(Ink::Estimate, "its table", Shape::Points(points))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vehicle that rolls out for 10 s at 100 Hz under a force in proportion to its speed squared.
    fn imbalance(against: Against) -> Imbalance {
        let instant = |k: usize| {
            let time_s = k as f64 * 0.01;
            let speed = 30.0 - 2.0 * time_s;
            let noise = if k.is_multiple_of(2) { 50.0 } else { -50.0 };
            Instant {
                time_s,
                at: if against == Against::Time {
                    time_s
                } else {
                    speed
                },
                lacking: 0.5 * speed * speed + noise,
                supplied: 0.5 * speed * speed,
            }
        };
        Imbalance {
            balance: Balance::Vehicle,
            against,
            stretches: vec![(0..1000).map(instant).collect()],
        }
    }

    #[test]
    fn means_over_ranges_follow_the_effect_within_their_sigma() {
        let all = over_ranges(&[imbalance(Against::VehicleSpeed)]);
        assert!((20..=RANGES).contains(&all.len()), "{}", all.len());
        for mean in all {
            assert!((mean.lacking - mean.supplied).abs() <= 25.0, "{mean:?}");
            assert!((mean.supplied - 0.5 * mean.at * mean.at).abs() < 1.0);
            assert!(mean.std_of_mean > 0.0);
        }
    }

    #[test]
    fn a_line_over_time_is_bounded_and_ends_where_a_stretch_does() {
        let mut imbalance = imbalance(Against::Time);
        let second = imbalance.stretches[0].iter().map(|i| Instant {
            time_s: i.time_s + 20.0,
            ..*i
        });
        let second = second.collect();
        imbalance.stretches.push(second);
        let line = over_time(&imbalance);
        assert!(line.len() <= MOST_POINTS + 4, "{}", line.len());
        assert_eq!(line.iter().filter(|point| point.1.is_nan()).count(), 2);
    }

    #[test]
    fn the_stretch_that_shows_an_effect_most_holds_it() {
        let time: Vec<f64> = (0..5000).map(|k| f64::from(k) * 0.002).collect();
        let effect = |t: &f64| if (4.0..4.5).contains(t) { 7.0 } else { 0.1 };
        let values: Vec<f64> = time.iter().map(effect).collect();
        let (from, to) = most_shown(&time, &values);
        assert!(time[from] <= 4.0 && time[to - 1] >= 4.49, "{from} {to}");
        assert!(time[to - 1] - time[from] < 0.81);
        assert_eq!(most_shown(&time[..9], &values[..9]), (0, 9));
    }
}
