//! A measured recording: its columns, and what is read off them.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::generate::files::read_column;

const COLUMNS: [&str; 5] = [
    "time_s",
    "wheel_speed_rad_s",
    "vehicle_speed_m_s",
    "drag_force_n",
    "normal_force_n",
];
/// Places of the columns that every recording has.
pub(super) const TIME: usize = 0;
pub(super) const WHEEL: usize = 1;
pub(super) const SPEED: usize = 2;
pub(super) const DRAG: usize = 3;
pub(super) const LOAD: usize = 4;
/// Radius of the scale car in m, as its rig file says.
pub(super) const RADIUS: f64 = 0.033;
/// A larger step in time ends a stretch, s.
const GAP: f64 = 0.035;

/// A recording: the five columns that each has, then whatever else was recorded, by header.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Recording {
    pub(super) columns: [Vec<f64>; 5],
    pub(super) others: Vec<(String, Vec<f64>)>,
}

impl Recording {
    pub(super) fn read(path: &Path) -> Result<Recording> {
        let mut recording = Recording::default();
        for (column, name) in recording.columns.iter_mut().zip(COLUMNS) {
            *column = read_column(path, name)?;
        }
        let text =
            fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let header = text.lines().find(|line| !line.starts_with('#'));
        for name in header.unwrap_or("").split(',').map(str::trim) {
            if !COLUMNS.contains(&name) {
                recording
                    .others
                    .push((name.to_owned(), read_column(path, name)?));
            }
        }
        Ok(recording)
    }

    /// Only the five columns: the others tell of a drag that is about to be replaced.
    pub(super) fn bare(mut self) -> Recording {
        self.others.clear();
        self
    }

    pub(super) fn len(&self) -> usize {
        self.columns[TIME].len()
    }

    /// Every column but time.
    pub(super) fn channels_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        self.columns[1..]
            .iter_mut()
            .chain(self.others.iter_mut().map(|other| &mut other.1))
    }

    pub(super) fn truncate(&mut self, rows: usize) {
        self.columns[TIME].truncate(rows);
        for column in self.channels_mut() {
            column.truncate(rows);
        }
    }

    pub(super) fn text(&self) -> String {
        let names = COLUMNS
            .into_iter()
            .chain(self.others.iter().map(|other| other.0.as_str()));
        let mut text = names.collect::<Vec<_>>().join(",") + "\n";
        let columns: Vec<&Vec<f64>> = self
            .columns
            .iter()
            .chain(self.others.iter().map(|other| &other.1))
            .collect();
        for k in 0..self.len() {
            for (place, column) in columns.iter().enumerate() {
                let comma = if place == 0 { "" } else { "," };
                let value = column[k];
                let _ = if value.is_finite() {
                    write!(text, "{comma}{}", rounded(value))
                } else {
                    write!(text, "{comma}")
                };
            }
            text.push('\n');
        }
        text
    }

    /// First and last time.
    pub(super) fn ends(&self) -> (f64, f64) {
        let time = &self.columns[TIME];
        (
            time.first().copied().unwrap_or(0.0),
            time.last().copied().unwrap_or(0.0),
        )
    }

    pub(super) fn duration(&self) -> f64 {
        let (first, last) = self.ends();
        last - first
    }

    /// Whether the drag moves at all: without that it can be neither swapped, nor copied, nor predicted.
    pub(super) fn has_drag(&self) -> bool {
        let drag = &self.columns[DRAG];
        drag.iter().any(|f| f.is_finite() && *f != drag[0])
    }

    /// Whether a brake torque or pressure moves.
    pub(super) fn has_brake(&self) -> bool {
        self.others
            .iter()
            .filter(|(name, _)| ["brake_torque_nm", "brake_pressure_pa"].contains(&name.as_str()))
            .any(|(_, values)| {
                let mut known = values.iter().filter(|x| x.is_finite());
                let first = known.next();
                known.any(|x| Some(x) != first)
            })
    }

    /// Stretches without a gap.
    pub(super) fn stretches(&self) -> Vec<std::ops::Range<usize>> {
        let time = &self.columns[TIME];
        let mut found = Vec::new();
        let mut from = 0;
        for to in 1..=time.len() {
            if to == time.len() || time[to] - time[to - 1] > GAP {
                found.push(from..to);
                from = to;
            }
        }
        found
    }

    /// Centred means over `2 half + 1` samples, within each stretch.
    pub(super) fn smoothed(&self, values: &[f64], half: usize) -> Vec<f64> {
        let mut out = vec![0.0; values.len()];
        for stretch in self.stretches() {
            for i in stretch.clone() {
                let reach = half.min(i - stretch.start).min(stretch.end - 1 - i);
                let window = &values[i - reach..=i + reach];
                out[i] = window.iter().sum::<f64>() / window.len() as f64;
            }
        }
        out
    }

    /// Slip of the scale car.
    pub(super) fn slip(&self) -> Vec<f64> {
        self.slip_at(RADIUS)
    }

    /// Slip of a wheel of this radius.
    pub(super) fn slip_at(&self, radius: f64) -> Vec<f64> {
        let [_, wheel, speed, _, _] = &self.columns;
        wheel
            .iter()
            .zip(speed)
            .map(|(w, v)| 1.0 - radius * w / v.max(1e-6))
            .collect()
    }

    /// Drag over load.
    pub(super) fn friction(&self) -> Vec<f64> {
        let [_, _, _, drag, load] = &self.columns;
        drag.iter().zip(load).map(|(f, n)| f / n).collect()
    }

    /// Scatter of the drag about its mean over two seconds, backwards; stretches shorter than that left out.
    pub(super) fn scatter(&self) -> Vec<f64> {
        const HALF: usize = 50;
        let drag = &self.columns[DRAG];
        let mean = self.smoothed(drag, HALF);
        let mut out: Vec<f64> = self
            .stretches()
            .into_iter()
            .filter(|stretch| stretch.len() > 4 * HALF)
            .flat_map(|stretch| {
                (stretch.start + HALF..stretch.end - HALF).map(|i| drag[i] - mean[i])
            })
            .collect();
        out.reverse();
        out
    }
}

/// Ten digits: more than any recording has, and short of the dust of arithmetic.
fn rounded(value: f64) -> f64 {
    if value == 0.0 {
        return 0.0;
    }
    let scale = 10f64.powi(9 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_and_every_hole_is_read_and_written() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("run.csv");
        let text = "# a remark\nyaw,time_s,wheel_speed_rad_s,vehicle_speed_m_s,normal_force_n,drag_force_n\n\
                    -0.5,0,2,3e-6,49923.183,1\n,0.1,2.5,,49923,nan\n";
        fs::write(&path, text).unwrap();
        let recording = Recording::read(&path).unwrap();
        assert_eq!(recording.others[0].0, "yaw");
        assert_eq!(
            recording.text(),
            "time_s,wheel_speed_rad_s,vehicle_speed_m_s,drag_force_n,normal_force_n,yaw\n\
             0,2,0.000003,1,49923.183,-0.5\n0.1,2.5,,,49923,\n"
        );
        assert_eq!(recording.bare().others, []);
    }
}
