//! Real inputs and real noise with an effect put in.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::ask::Ask;
use super::recording::{RADIUS, Recording};
use super::{figure, told};
use crate::contract::{list, text};
use crate::draw::Draw;
use crate::generate::files::seal;
use crate::generate::tyre::law;
use crate::judge::headline::{Better, Headline};
use crate::setup::Trial;
use crate::share::Share;
use crate::table::Table;

/// What is put into real inputs and real noise, with the strengths between which it is still this physics.
const INJECTED: [(&str, &str, &str, (f64, f64)); 7] = [
    ("force_delay", "delay", "s", (0.01, 0.3)),
    ("force_lag", "time_constant", "s", (0.01, 0.4)),
    ("zero_drift", "slope", "N/s", (1e-4, 0.2)),
    ("force_saturation", "limit", "N", (0.0, 0.6)),
    ("wear_drift", "friction_loss", "1", (0.005, 0.6)),
    ("speed_sensitivity", "", "", (0.005, 1.5)),
    ("effective_radius", "radius", "m", (0.001, 0.06)),
];

/// The sealed truth of a campaign of real noise.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Sealed {
    /// Empty where nothing was put in.
    id: String,
    parameter: String,
    value: f64,
    /// Whether the law was driven by the slip as recorded.
    exact: bool,
    /// Size after the base was refitted, in RMS of the noise.
    size: f64,
    runs: Vec<String>,
    noise_from: Vec<String>,
}

/// What real inputs would read with an effect of strength `a`, without noise: drag and wheel speed of one run.
fn reading(
    recording: &Recording,
    truth: (f64, f64),
    id: &str,
    a: f64,
    place: f64,
    half: usize,
) -> (Vec<f64>, Vec<f64>) {
    let [time, wheel, speed, _, load] = &recording.columns;
    let slip = recording.smoothed(&recording.slip(), half);
    let mut force: Vec<f64> = (0..time.len())
        .map(|k| {
            let friction = truth.0 * law(slip[k] / truth.1);
            let factor = match id {
                "wear_drift" => 1.0 - a * place,
                "speed_sensitivity" => (-a * (slip[k] * speed[k]).abs()).exp(),
                _ => 1.0,
            };
            load[k] * friction * factor
        })
        .collect();
    let mut wheel = wheel.clone();
    let peak = truth.0 * load.first().copied().unwrap_or(0.0);
    match id {
        "force_delay" => {
            let before = force.clone();
            for stretch in recording.stretches() {
                for k in stretch.clone() {
                    let wanted = time[k] - a;
                    let later =
                        stretch.start + time[stretch.clone()].partition_point(|t| *t < wanted);
                    force[k] = if later == stretch.start {
                        before[stretch.start]
                    } else {
                        let (t0, t1) = (time[later - 1], time[later]);
                        before[later - 1]
                            + (before[later] - before[later - 1]) * (wanted - t0) / (t1 - t0)
                    };
                }
            }
        }
        "force_lag" => {
            for stretch in recording.stretches() {
                for k in stretch.start + 1..stretch.end {
                    let keep = (-(time[k] - time[k - 1]) / a).exp();
                    force[k] = force[k - 1] * keep + force[k] * (1.0 - keep);
                }
            }
        }
        "zero_drift" => {
            let start = time.first().copied().unwrap_or(0.0);
            for (f, t) in force.iter_mut().zip(time) {
                *f += a * (t - start);
            }
        }
        "force_saturation" => {
            for f in &mut force {
                *f = f.min(peak * (1.0 - a));
            }
        }
        "effective_radius" => {
            for w in &mut wheel {
                *w *= 1.0 + a;
            }
        }
        _ => {}
    }
    (force, wheel)
}

/// RMS of what an effect leaves after the two-parameter law was fitted anew, N.
fn left_over(runs: &[(Recording, Vec<f64>, Vec<f64>)], half: usize) -> f64 {
    let points: Vec<(f64, f64, f64)> = runs
        .iter()
        .flat_map(|(recording, force, wheel)| {
            let mut read = recording.clone();
            read.columns[1].clone_from(wheel);
            let slip = recording.smoothed(&read.slip(), half);
            let load = recording.columns[4].clone();
            let force = force.clone();
            (0..force.len())
                .step_by(6)
                .map(move |k| (slip[k], load[k], force[k]))
        })
        .collect();
    let n = points.len().max(1) as f64;
    let error = |critical: f64| {
        let (mut ab, mut aa) = (0.0, 1e-300);
        for (slip, load, force) in &points {
            let shape = load * law(slip / critical);
            ab += shape * force;
            aa += shape * shape;
        }
        points
            .iter()
            .map(|(slip, load, force)| (force - ab / aa * load * law(slip / critical)).powi(2))
            .sum::<f64>()
            / n
    };
    // Two grids of the logarithm: one over all slips at the peak that there are, one between neighbours of the best.
    let mut best = (f64::INFINITY, 0.0);
    for (centre, half) in [(-1.75, 1.75), (f64::NAN, 0.1)] {
        let centre: f64 = if centre.is_nan() { best.1 } else { centre };
        for step in -20..=20 {
            let at = centre + half * f64::from(step) / 20.0;
            let now = error(at.exp());
            if now < best.0 {
                best = (now, at);
            }
        }
    }
    best.0.sqrt()
}

/// One campaign of real inputs and real noise.
fn conceal(
    circles: &[Recording],
    injection: Option<usize>,
    exact: bool,
    seed: u64,
) -> Result<(Sealed, Vec<Recording>)> {
    let half = if exact { 0 } else { 7 };
    let mut draw = Draw::new(seed, &[0xda27, injection.map_or(99, |i| i as u64)]);
    let mut order: Vec<usize> = (0..circles.len()).collect();
    for k in (1..order.len()).rev() {
        order.swap(k, draw.whole(0, k));
    }
    let (chosen, others) = order.split_at(4);
    let truth = (draw.between(0.65, 0.85), draw.between(0.1, 0.18));
    let noise: Vec<Vec<f64>> = others.iter().map(|k| circles[*k].scatter()).collect();
    let sigma = {
        let all: Vec<f64> = noise.iter().flatten().map(|x| x * x).collect();
        (all.iter().sum::<f64>() / all.len().max(1) as f64).sqrt()
    };
    let wanted = draw.one_of(&[1.0, 2.0]);
    let sign = if draw.chance(0.5) { -1.0 } else { 1.0 };
    let (id, parameter, _, range) =
        injection.map_or(("", "", "", (1.0, 1.0)), |place| INJECTED[place]);
    let sign = if matches!(id, "zero_drift" | "effective_radius" | "wear_drift") {
        sign
    } else {
        1.0
    };
    let ride = |a: f64| -> Vec<(Recording, Vec<f64>, Vec<f64>)> {
        chosen
            .iter()
            .enumerate()
            .map(|(index, k)| {
                let (force, wheel) =
                    reading(&circles[*k], truth, id, sign * a, index as f64 / 3.0, half);
                (circles[*k].clone(), force, wheel)
            })
            .collect()
    };
    let (mut low, mut high) = range;
    if injection.is_some() {
        if left_over(&ride(high), half) < 0.6 * sigma {
            bail!("{id} cannot be seen in these runs");
        }
        for _ in 0..12 {
            let middle = if low > 0.0 {
                (low * high).sqrt()
            } else {
                0.5 * (low + high)
            };
            if left_over(&ride(middle), half) > wanted * sigma {
                high = middle;
            } else {
                low = middle;
            }
        }
    }
    let runs = ride(high);
    let size = if injection.is_some() {
        left_over(&runs, half) / sigma
    } else {
        0.0
    };
    let a = sign * high;
    let load = runs[0].0.columns[4].first().copied().unwrap_or(0.0);
    let value = match id {
        "force_saturation" => truth.0 * load * (1.0 - a),
        "effective_radius" => RADIUS / (1.0 + a),
        _ => a,
    };
    let recordings = runs
        .into_iter()
        .enumerate()
        .map(|(index, (mut recording, force, wheel))| {
            let noise = &noise[index];
            let shift = draw.whole(0, noise.len() - 1);
            recording.columns[1] = wheel;
            recording.columns[3] = force
                .iter()
                .enumerate()
                .map(|(k, f)| f + noise[(k + shift) % noise.len()])
                .collect();
            recording
        })
        .collect();
    let names = |places: &[usize]| {
        places
            .iter()
            .map(|k| format!("circle{:02}", k + 1))
            .collect()
    };
    Ok((
        Sealed {
            id: id.to_owned(),
            parameter: parameter.to_owned(),
            value,
            exact,
            size,
            runs: names(chosen),
            noise_from: names(others),
        },
        recordings,
    ))
}

pub(super) fn injected(
    trial: &Trial,
    friction: &Path,
    work: &Path,
    ask: &Ask,
) -> Result<(Table, Vec<Headline>)> {
    let circles: Vec<Recording> = (1..=8)
        .map(|n| Ok(Recording::read(&friction.join(format!("circle{n:02}.csv")))?.bare()))
        .collect::<Result<_>>()?;
    let count = |full: f64| (full * trial.scale).ceil().max(2.0) as u64;
    let mut orders: Vec<(Option<usize>, u64)> = (0..count(16.0)).map(|k| (None, k)).collect();
    for place in 0..INJECTED.len() {
        orders.extend((0..count(6.0)).map(|k| (Some(place), 100 + k)));
    }
    let mut mixed: Vec<(u64, Option<usize>, u64)> = orders
        .into_iter()
        .map(|(place, k)| {
            let number = place.map_or(0, |p| p as u64 + 1);
            (Draw::new(trial.seed, &[7, number, k]).seed(), place, k)
        })
        .collect();
    mixed.sort_unstable();
    let open = work.join(format!("seed-{}", trial.seed));
    if open.exists() {
        fs::remove_dir_all(&open)?;
    }
    let mut cannot = Vec::new();
    for (index, (seed, place, k)) in mixed.iter().enumerate() {
        match conceal(&circles, *place, k % 2 == 0, *seed) {
            Ok((truth, recordings)) => {
                let name = format!("campaign-{index:04}");
                let (seen, sealed) = (open.join(&name), open.join("sealed").join(&name));
                fs::create_dir_all(&seen)?;
                fs::create_dir_all(&sealed)?;
                fs::copy(friction.join("rig.toml"), seen.join("rig.toml"))?;
                for (number, recording) in recordings.iter().enumerate() {
                    fs::write(
                        seen.join(format!("run{:02}.csv", number + 1)),
                        recording.text(),
                    )?;
                }
                fs::write(
                    sealed.join("truth.json"),
                    serde_json::to_string_pretty(&truth)? + "\n",
                )?;
            }
            Err(why) => cannot.push(why.to_string()),
        }
    }
    let hash = seal(&open)?;
    println!("sealed truth of real noise sha256 {hash}");
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(trial.jobs.max(1))
        .build()
        .context("no threads")?;
    let names = crate::generate::files::names(&open)?;
    let found: Vec<(String, Value)> = pool.install(|| {
        names
            .par_iter()
            .map(|name| -> Result<(String, Value)> {
                let runs: Vec<PathBuf> = (1..=4)
                    .map(|n| open.join(name).join(format!("run{n:02}.csv")))
                    .collect();
                let found = ask.diagnose(&open.join(name).join("rig.toml"), &runs)?;
                Ok((name.clone(), found.value))
            })
            .collect::<Result<_>>()
    })?;
    if seal(&open)? != hash {
        bail!("the sealed truth is not what was sealed");
    }
    let mut judged: Vec<(Sealed, Value)> = Vec::new();
    for (name, value) in found {
        let path = open.join("sealed").join(name).join("truth.json");
        judged.push((serde_json::from_str(&fs::read_to_string(path)?)?, value));
    }
    Ok((tabulate(&judged, &hash, &cannot), headlines(&judged)))
}

/// False alarms without an effect, and effects that were named first or in the set of the first.
fn headlines(judged: &[(Sealed, Value)]) -> Vec<Headline> {
    let named = |case: &&(Sealed, Value)| {
        list(&case.1, "mechanisms").first().is_some_and(|first| {
            text(first, "id") == case.0.id
                || list(first, "confusable_with")
                    .iter()
                    .any(|other| text(other, "id") == case.0.id)
        })
    };
    let with = |effect: bool| {
        judged
            .iter()
            .filter(move |case| case.0.id.is_empty() != effect)
    };
    vec![
        Headline::share(
            "real.alarms",
            "alarms at real inputs and real noise without an effect",
            Better::Lower,
            None,
            Share::count(with(false), |case| text(&case.1, "verdict") != "consistent"),
        ),
        Headline::share(
            "real.in_set",
            "effects put into real inputs and real noise that are named first, or confusable with the first",
            Better::Higher,
            None,
            Share::count(with(true), named),
        ),
    ]
}

fn tabulate(judged: &[(Sealed, Value)], hash: &str, cannot: &[String]) -> Table {
    let mut table = Table::new(
        "Real inputs and real noise with an effect put in",
        &[
            "put in",
            "inputs",
            "size, sigma",
            "n",
            "named first",
            "in set",
            "among the names",
            "figure within 3 std",
            "what was said",
        ],
    );
    let rows: Vec<&str> = std::iter::once("")
        .chain(INJECTED.iter().map(|entry| entry.0))
        .collect();
    for (id, exact) in rows.iter().flat_map(|id| [(*id, true), (*id, false)]) {
        let group: Vec<&(Sealed, Value)> = judged
            .iter()
            .filter(|case| case.0.id == id && case.0.exact == exact)
            .collect();
        let inputs = if exact { "exact" } else { "in error" };
        if group.is_empty() {
            continue;
        }
        let mut said: Vec<String> = group.iter().map(|case| told(&case.1)).collect();
        said.sort();
        said.dedup();
        let said = said.join(" / ");
        if id.is_empty() {
            let alarms = Share::count(group.iter(), |case| {
                text(&case.1, "verdict") != "consistent"
            });
            table.rows.push(vec![
                "nothing".into(),
                inputs.into(),
                "-".into(),
                group.len().to_string(),
                format!("{} false alarms", alarms.hits),
                "-".into(),
                "-".into(),
                "-".into(),
                said,
            ]);
            continue;
        }
        let first = |case: &Value| {
            list(case, "mechanisms")
                .first()
                .cloned()
                .unwrap_or(Value::Null)
        };
        let named_first = |case: &(Sealed, Value)| text(&first(&case.1), "id") == id;
        let in_set = |case: &(Sealed, Value)| {
            named_first(case)
                || list(&first(&case.1), "confusable_with")
                    .iter()
                    .any(|o| text(o, "id") == id)
        };
        let sizes: Vec<f64> = group.iter().map(|case| case.0.size).collect();
        let figures: Vec<f64> = group
            .iter()
            .filter_map(|case| {
                let (value, std) = figure(&case.1, id, &case.0.parameter)?;
                Some((value - case.0.value) / std.max(f64::MIN_POSITIVE))
            })
            .collect();
        let fraction = |share: Share| format!("{}/{}", share.hits, share.of);
        table.row([
            id.to_owned(),
            inputs.to_owned(),
            format!(
                "{:.1}..{:.1}",
                sizes.iter().copied().fold(f64::INFINITY, f64::min),
                sizes.iter().copied().fold(0.0, f64::max)
            ),
            group.len().to_string(),
            fraction(Share::count(group.iter(), |case| named_first(case))),
            fraction(Share::count(group.iter(), |case| in_set(case))),
            fraction(Share::count(group.iter(), |case| {
                list(&case.1, "mechanisms")
                    .iter()
                    .any(|m| text(m, "id") == id)
            })),
            fraction(Share::count(figures.iter(), |pull| pull.abs() <= 3.0)),
            said,
        ]);
    }
    let mut note = format!(
        "Four of eight measured runs a campaign, noise from the four others; sealed truth `{hash}`. Sigma: RMS of that noise, whose \
         correlation reaches over a tenth of a second, so that a size counts for less than in the campaigns above."
    );
    if !cannot.is_empty() {
        let _ = write!(
            note,
            " Not put in, since these runs are too slow for it: {}.",
            cannot.join("; ")
        );
    }
    table.note = Some(note);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slow slip cycles at 50 Hz with a gap in the middle.
    fn recording(phase: f64) -> Recording {
        let mut recording = Recording::default();
        for k in 0..3000 {
            let time = 0.02 * f64::from(k) + if k > 1500 { 1.0 } else { 0.0 };
            let slip = 0.12 * (1.0 - (1.1 * time + phase).cos());
            let cells = [
                time,
                2.0 * (1.0 - slip) / RADIUS,
                2.0,
                16.0 * (0.7 + 0.03 * (9.0 * time + phase).sin()),
                16.4,
            ];
            for (column, cell) in recording.columns.iter_mut().zip(cells) {
                column.push(cell);
            }
        }
        recording
    }

    #[test]
    fn a_lag_and_a_delay_settle_where_the_force_rests_and_do_not_cross_gaps() {
        let mut still = recording(0.0);
        let speed = still.columns[2].clone();
        for (wheel, v) in still.columns[1].iter_mut().zip(speed) {
            *wheel = 0.9 * v / RADIUS;
        }
        let plain = reading(&still, (0.8, 0.15), "", 1.0, 0.0, 7).0;
        for id in ["force_lag", "force_delay"] {
            let (force, _) = reading(&still, (0.8, 0.15), id, 0.2, 0.0, 7);
            assert!(
                force.iter().zip(&plain).all(|(a, b)| (a - b).abs() < 1e-9),
                "{id}"
            );
        }
        assert_eq!(still.stretches(), [0..1501, 1501..3000]);
    }

    #[test]
    fn what_is_put_in_has_the_ordered_size_and_is_gone_without_it() {
        let circles: Vec<Recording> = (0..8).map(|k| recording(f64::from(k))).collect();
        for (place, entry) in INJECTED.iter().enumerate() {
            let (truth, recordings) = conceal(&circles, Some(place), place % 2 == 0, 3).unwrap();
            assert_eq!(truth.id, entry.0);
            assert!((0.55..2.1).contains(&truth.size), "{truth:?}");
            assert!(
                recordings
                    .iter()
                    .all(|r| r.columns[3].iter().all(|f| f.is_finite()))
            );
            assert!(truth.runs.iter().all(|run| !truth.noise_from.contains(run)));
        }
        let (truth, recordings) = conceal(&circles, None, false, 3).unwrap();
        assert_eq!((truth.id.as_str(), truth.size), ("", 0.0));
        assert_eq!(recordings[0].columns[1].len(), 3000);
        let clean: Vec<_> = circles[..4]
            .iter()
            .map(|c| {
                let (force, wheel) = reading(c, (0.7, 0.12), "", 1.0, 0.0, 7);
                (c.clone(), force, wheel)
            })
            .collect();
        // Only the grid's step in critical slip is left.
        assert!(left_over(&clean, 7) < 0.03, "{}", left_over(&clean, 7));
    }
}
