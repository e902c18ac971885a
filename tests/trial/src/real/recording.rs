//! A measured recording: its five columns, and what is read off them.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;

use crate::generate::files::read_column;

const COLUMNS: [&str; 5] = [
    "time_s",
    "wheel_speed_rad_s",
    "vehicle_speed_m_s",
    "drag_force_n",
    "normal_force_n",
];
/// Radius of the scale car in m, as its rig file says.
pub(super) const RADIUS: f64 = 0.033;
/// A larger step in time ends a stretch, s.
const GAP: f64 = 0.035;

/// A recording's five columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Recording {
    pub(super) columns: [Vec<f64>; 5],
}

impl Recording {
    pub(super) fn read(path: &Path) -> Result<Recording> {
        let mut recording = Recording::default();
        for (column, name) in recording.columns.iter_mut().zip(COLUMNS) {
            *column = read_column(path, name)?;
        }
        Ok(recording)
    }

    pub(super) fn text(&self) -> String {
        let mut text = COLUMNS.join(",") + "\n";
        for k in 0..self.columns[0].len() {
            for (place, column) in self.columns.iter().enumerate() {
                let _ = write!(
                    text,
                    "{}{:.6}",
                    if place == 0 { "" } else { "," },
                    column[k]
                );
            }
            text.push('\n');
        }
        text
    }

    /// Stretches without a gap.
    pub(super) fn stretches(&self) -> Vec<std::ops::Range<usize>> {
        let time = &self.columns[0];
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

    pub(super) fn slip(&self) -> Vec<f64> {
        let [_, wheel, speed, _, _] = &self.columns;
        wheel
            .iter()
            .zip(speed)
            .map(|(w, v)| 1.0 - RADIUS * w / v.max(1e-6))
            .collect()
    }

    /// Scatter of the drag about its mean over two seconds, backwards; stretches shorter than that left out.
    pub(super) fn scatter(&self) -> Vec<f64> {
        const HALF: usize = 50;
        let drag = &self.columns[3];
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
