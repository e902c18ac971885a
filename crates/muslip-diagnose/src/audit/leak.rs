//! Columns that reproduce the drag without the tyre law.

use nalgebra::{DMatrix, DVector};

use super::constants::{
    LEAK_BY_CHANCE, LEAK_COPIES, LEAK_IDLE, LEAK_LEVEL, LEAK_MOST_LATE, LEAK_READINGS, LEAK_SURE,
};
use super::finding::{Finding, Word};
use crate::campaign::Run;

fn correlation(pairs: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let finite = || {
        pairs
            .clone()
            .filter(|(a, b)| a.is_finite() && b.is_finite() && a.abs() < 1e15 && b.abs() < 1e15)
    };
    let count = finite().count().max(1) as f64;
    let (a, b) = finite().fold((0.0, 0.0), |s, p| (s.0 + p.0 / count, s.1 + p.1 / count));
    let (aa, bb, ab) = finite().fold((0.0, 0.0, 0.0), |s, p| {
        (
            s.0 + (p.0 - a).powi(2),
            s.1 + (p.1 - b).powi(2),
            s.2 + (p.0 - a) * (p.1 - b),
        )
    });
    // More than rounding makes of a constant.
    let varies = |square: f64, mean: f64| square > 1e-20 * count * mean * mean && square > 0.0;
    let value = if varies(aa, a) && varies(bb, b) {
        ab / (aa * bb).sqrt()
    } else {
        0.0
    };
    (value, count)
}

/// Another column beside the drag.
fn column<'a>(run: &'a Run, name: &str) -> Option<&'a [f64]> {
    let (_, values) = run.extra.iter().find(|(own, _)| own == name)?;
    (values.len() == run.drag_force_n.len()).then_some(values)
}

/// Third differences: nearly all noise.
fn rough(x: &[f64]) -> impl Iterator<Item = f64> + Clone + '_ {
    x.windows(4).map(|w| w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3])
}

/// Columns that reproduce the drag, alone or together.
#[must_use]
pub fn leaks(runs: &[Run]) -> Vec<Finding> {
    let mut names: Vec<&str> = runs
        .iter()
        .flat_map(|run| run.extra.iter().map(|(name, _)| name.as_str()))
        .collect();
    names.sort_unstable();
    names.dedup();
    let alone = copies(runs, &names);
    names.retain(|name| alone.iter().all(|found| found.channel != *name));
    let together = components(runs, names);
    alone.into_iter().chain(together).collect()
}

fn leak(name: &str, (level, count): (f64, f64), statement: String) -> Finding {
    let std = (1.0 - level * level) / count.sqrt();
    Finding {
        relative_to: "drag_force_n".to_owned(),
        ..Finding::of(name, Word::Leaks, (level, std), "1")
    }
    .saying(statement)
}

/// Squares of the drag and of columns, one row a sample at which all were read.
struct Squares {
    drag: DVector<f64>,
    columns: DMatrix<f64>,
}

impl Squares {
    fn new(runs: &[Run], names: &[&str]) -> Option<Self> {
        let mut drag = Vec::new();
        let mut columns = Vec::new();
        for run in runs {
            let own: Option<Vec<&[f64]>> = names.iter().map(|name| column(run, name)).collect();
            let own = own?;
            for (k, force) in run.drag_force_n.iter().enumerate() {
                let read = |x: f64| x.abs() < 1e15;
                if read(*force) && own.iter().all(|column| read(column[k])) {
                    drag.push(force * force);
                    columns.extend(own.iter().map(|column| column[k] * column[k]));
                }
            }
        }
        let columns = DMatrix::from_row_iterator(drag.len(), names.len(), columns);
        Some(Self {
            drag: DVector::from_vec(drag),
            columns,
        })
    }

    /// Share of the drag's square that a sum of these columns' squares leaves; none where they are too few, or say nothing.
    fn left(&self, chosen: &[usize]) -> Option<f64> {
        let rows = self.drag.len();
        if rows <= 50 + chosen.len() {
            return None;
        }
        let mut sums = self.columns.select_columns(chosen);
        for mut column in sums.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
            let size = column.norm();
            if !(size > 0.0) {
                return None;
            }
            column /= size;
        }
        let drag = self.drag.add_scalar(-self.drag.mean());
        let whole = drag.norm_squared();
        let products = sums.tr_mul(&sums) + DMatrix::identity(chosen.len(), chosen.len()) * 1e-12;
        let shares = products.cholesky()?.solve(&sums.tr_mul(&drag));
        (whole > 0.0).then(|| (drag - sums * shares).norm_squared() / whole)
    }
}

/// Columns of which the drag is the size: a force made from accelerations along and across. No fewer of them will do.
fn components(runs: &[Run], names: Vec<&str>) -> Vec<Finding> {
    let Some(squares) = Squares::new(runs, &names) else {
        return Vec::new();
    };
    let mut chosen: Vec<usize> = (0..names.len()).collect();
    let Some(mut left) = squares.left(&chosen) else {
        return Vec::new();
    };
    let level = |left: f64| (1.0 - left).max(0.0).sqrt();
    // Fewer columns leave no less.
    if !(level(left) > LEAK_SURE) {
        return Vec::new();
    }
    let least = left;
    loop {
        let without = |out: usize| {
            let fewer: Vec<usize> = chosen.iter().copied().filter(|&i| i != out).collect();
            Some((squares.left(&fewer)?, fewer))
        };
        let fewer = chosen.iter().filter_map(|&out| without(out));
        match fewer.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((more, fewer)) if !fewer.is_empty() && more < LEAK_IDLE * least + f64::EPSILON => {
                (left, chosen) = (more, fewer);
            }
            _ => break,
        }
    }
    let level = level(left);
    if !(level > LEAK_SURE) {
        return Vec::new();
    }
    let chosen: Vec<&str> = chosen.iter().map(|&i| names[i]).collect();
    let said = format!(
        "The drag is the size of {} (correlation {level:.4} of its square): they explain nothing.",
        chosen.join(" and ")
    );
    let count = squares.drag.len() as f64;
    chosen
        .iter()
        .map(|name| leak(name, (level, count), said.clone()))
        .collect()
}

/// Columns that follow the drag to within a thousandth, or nearly so and copy its noise, at its time or samples off it.
fn copies(runs: &[Run], names: &[&str]) -> Vec<Finding> {
    let of_name = |name: &&str| {
        let both: Vec<(&[f64], &[f64])> = runs
            .iter()
            .filter_map(|run| Some((run.drag_force_n.as_slice(), column(run, name)?)))
            .collect();
        let times = (-LEAK_MOST_LATE..=LEAK_MOST_LATE).map(|late| Copied::new(&both, late));
        // Neighbours of the right time copy a part of the noise as well.
        let copied = times
            .filter(Copied::leaks)
            .max_by(|a, b| a.noise.total_cmp(&b.noise))?;
        Some(copied.finding(name))
    };
    names.iter().filter_map(of_name).collect()
}

/// How a column correlates with the drag so many samples before.
struct Copied {
    late: isize,
    level: f64,
    count: f64,
    /// Of the noise alone, in the same sense as the level.
    noise: f64,
}

impl Copied {
    fn new(both: &[(&[f64], &[f64])], late: isize) -> Self {
        let [after, before] = [late.max(0), (-late).max(0)].map(isize::unsigned_abs);
        let both = both.iter().map(|(drag, column)| {
            (
                &drag[before.min(drag.len())..],
                &column[after.min(column.len())..],
            )
        });
        let levels = both
            .clone()
            .flat_map(|(a, b)| a.iter().copied().zip(b.iter().copied()));
        let (level, count) = correlation(levels);
        // The rest is not asked of a column that is far from the drag.
        let noise = if level.abs() > LEAK_LEVEL {
            level.signum() * correlation(both.flat_map(|(a, b)| rough(a).zip(rough(b)))).0
        } else {
            0.0
        };
        Self {
            late,
            level,
            count,
            noise,
        }
    }

    fn leaks(&self) -> bool {
        let level = self.level.abs();
        let by_chance = LEAK_BY_CHANCE / self.count.sqrt();
        let copied = level > LEAK_LEVEL && self.noise > LEAK_COPIES.max(by_chance);
        self.count > LEAK_READINGS && (level > LEAK_SURE || copied)
    }

    fn finding(&self, name: &str) -> Finding {
        let off = match self.late {
            0 => String::new(),
            late if late > 0 => format!(" {late} samples before"),
            early => format!(" {} samples after", -early),
        };
        let said = format!(
            "The column {name} reproduces the drag{off} (correlation {:.4}, of the noise alone {:.2}): it explains nothing.",
            self.level, self.noise
        );
        leak(name, (self.level, self.count), said)
    }
}

#[cfg(test)]
mod tests {
    use super::super::toy::white;
    use super::*;

    /// Leaks of a column beside a noisy drag.
    fn beside(drag: &[f64], column: Vec<f64>) -> Vec<Finding> {
        leaks(&[Run {
            time_s: (0..drag.len()).map(|k| k as f64).collect(),
            drag_force_n: drag.to_vec(),
            extra: vec![("column".to_owned(), column)],
            ..Run::default()
        }])
    }

    fn slow(k: usize) -> f64 {
        1000.0 * (k as f64 * 0.02).sin()
    }

    #[test]
    fn a_copy_of_the_drag_leaks_at_its_time_and_off_it_and_a_mere_likeness_does_not() {
        let drag: Vec<f64> = white(1)
            .take(500)
            .enumerate()
            .map(|(k, w)| slow(k) + 100.0 * w)
            .collect();
        let copy: Vec<f64> = drag.iter().map(|d| 0.001 * d + 2.0).collect();
        for late in -10i32..=10 {
            let mut moved = copy.clone();
            moved.rotate_right(late.rem_euclid(500) as usize);
            let found = beside(&drag, moved);
            assert_eq!(found.len(), 1, "{late} samples late");
            let off = format!("{} samples", late.abs());
            let said = found.first().map_or("", |f| f.statement.as_str());
            assert_eq!(said.contains(&off), late != 0, "{said}");
        }
        let mut far = copy;
        far.rotate_right(20);
        assert!(beside(&drag, far).is_empty());
        let like: Vec<f64> = (0..500).map(|k| (f64::from(k) * 0.021).sin()).collect();
        assert!(beside(&drag, like).is_empty());
        assert!(leaks(&[]).is_empty());
    }

    #[test]
    fn another_sensor_of_the_same_force_is_no_copy_however_short_the_recording() {
        for readings in [60, 200, 1000] {
            for seed in 0..200 {
                let sensor = |seed: u64| -> Vec<f64> {
                    let noise = white(seed).take(readings).enumerate();
                    noise.map(|(k, w)| slow(k) + 160.0 * w).collect()
                };
                let found = beside(&sensor(2 * seed + 1), sensor(2 * seed + 2));
                assert!(
                    found.is_empty(),
                    "{readings} readings, seed {seed}: {:?}",
                    found[0].statement
                );
            }
        }
    }

    #[test]
    fn a_force_made_from_accelerations_leaks_both_of_them_and_nothing_else() {
        let across: Vec<f64> = (0..400)
            .map(|k| 5.0 * (f64::from(k) * 0.01).sin())
            .collect();
        let along: Vec<f64> = (0..400)
            .map(|k| 0.5 * (f64::from(k) * 0.037).cos())
            .collect();
        let yaw: Vec<f64> = (0..400).map(|k| (f64::from(k) * 0.011).sin()).collect();
        let size = |noise: f64| -> Vec<f64> {
            let both = across.iter().zip(&along).enumerate();
            both.map(|(k, (a, b))| {
                1.7 * a.hypot(*b) + noise * f64::from((k as i32 * 7919) % 101 - 50) / 50.0
            })
            .collect()
        };
        let run = |drag: Vec<f64>| Run {
            time_s: (0..400).map(f64::from).collect(),
            drag_force_n: drag,
            extra: vec![
                ("yaw_rate_rad_s".to_owned(), yaw.clone()),
                ("lateral_m_s2".to_owned(), across.clone()),
                ("longitudinal_m_s2".to_owned(), along.clone()),
            ],
            ..Run::default()
        };
        let told = |drag: Vec<f64>| -> Vec<String> {
            let found = leaks(&[run(drag)]);
            found.into_iter().map(|f| f.channel).collect()
        };
        assert_eq!(told(size(0.0)), ["lateral_m_s2", "longitudinal_m_s2"]);
        // A load cell beside them errs by its own noise.
        assert!(told(size(0.5)).is_empty());
    }
}
