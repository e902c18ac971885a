//! A campaign's recordings as the baselines read them.

use std::ops::Range;
use std::path::Path;

use anyhow::Result;

use crate::generate::chain::Readings;
use crate::generate::files::read_column;
use crate::generate::measure::filled;
use crate::generate::rig::{BrakeColumn, Rig};
use crate::share::quantile;

/// One run, holes filled by straight lines, and its stretches without a gap in time.
#[derive(Clone, Debug)]
pub struct Record {
    pub readings: Readings,
    /// Between samples, s: the median, since a logger's clock need not be the nominal one.
    pub period: f64,
    pub stretches: Vec<Range<usize>>,
}

impl Record {
    /// Of readings whose angle and distance, which no file tells, follow from the speeds.
    pub fn new(mut readings: Readings) -> Record {
        let time = &readings.time;
        let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let period = quantile(&steps, 0.5).max(1e-6);
        let mut stretches = Vec::new();
        let mut start = 0;
        for (index, step) in steps.iter().enumerate() {
            if *step > 4.0 * period {
                stretches.push(start..index + 1);
                start = index + 1;
            }
        }
        if start < time.len() {
            stretches.push(start..time.len());
        }
        let running = |rate: &[f64]| -> Vec<f64> {
            let mut sum = 0.0;
            (0..rate.len())
                .map(|i| {
                    if i > 0 {
                        sum += 0.5 * (rate[i] + rate[i - 1]) * steps[i - 1].min(4.0 * period);
                    }
                    sum
                })
                .collect()
        };
        readings.angle = running(&readings.wheel);
        readings.distance = running(&readings.speed);
        Record {
            readings,
            period,
            stretches,
        }
    }

    /// Samples in 10 ms, over which noisy channels are smoothed to either side.
    fn half(&self) -> usize {
        (0.01 / self.period).ceil() as usize
    }

    /// Running means over 10 ms to either side, never across a gap.
    pub fn smoothed(&self, values: &[f64]) -> Vec<f64> {
        let half = self.half();
        let mut out = Vec::with_capacity(values.len());
        for stretch in &self.stretches {
            for i in stretch.clone() {
                let window = &values
                    [i.saturating_sub(half).max(stretch.start)..(i + half + 1).min(stretch.end)];
                out.push(window.iter().sum::<f64>() / window.len() as f64);
            }
        }
        out
    }

    /// Rates of change by central differences, never across a gap.
    pub fn rate(&self, values: &[f64]) -> Vec<f64> {
        let mut out = Vec::with_capacity(values.len());
        for stretch in &self.stretches {
            for i in stretch.clone() {
                let (a, b) = (
                    i.saturating_sub(1).max(stretch.start),
                    (i + 1).min(stretch.end - 1),
                );
                out.push((values[b] - values[a]) / ((b - a).max(1) as f64 * self.period));
            }
        }
        out
    }
}

/// The recordings of a campaign, in order.
pub fn records(campaign: &Path, rig: &Rig) -> Result<Vec<Record>> {
    let mut runs = Vec::new();
    for number in 1.. {
        let path = campaign.join(format!("run{number:02}.csv"));
        if !path.exists() {
            break;
        }
        runs.push(Record::new(read(&path, rig)?));
    }
    Ok(runs)
}

/// A run as written, missing cells filled; without a drag column the drag is not a number.
pub fn read(path: &Path, rig: &Rig) -> Result<Readings> {
    let column = |header: &str| read_column(path, header).map(|values| filled(&values));
    let time = column("time_s")?;
    let torque = match rig.brake {
        BrakeColumn::None => vec![0.0; time.len()],
        BrakeColumn::Torque => column("brake_torque_nm")?,
        BrakeColumn::Pressure => column("brake_pressure_pa")?
            .iter()
            .map(|p| p * rig.torque_per_pressure)
            .collect(),
    };
    Ok(Readings {
        drag: column("drag_force_n").unwrap_or_else(|_| vec![f64::NAN; time.len()]),
        load: column("normal_force_n")?,
        wheel: column("wheel_speed_rad_s")?,
        speed: column("vehicle_speed_m_s")?,
        command: torque.clone(),
        torque,
        time,
        ..Readings::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_smoothed_or_derived_across_a_gap() {
        let time: Vec<f64> = (0..40)
            .map(|i| f64::from(i) * 0.01 + if i < 20 { 0.0 } else { 5.0 })
            .collect();
        let record = Record::new(Readings {
            speed: (0..40).map(|i| if i < 20 { 0.0 } else { 9.0 }).collect(),
            wheel: vec![0.0; 40],
            time,
            ..Readings::default()
        });
        assert_eq!(record.stretches, [0..20, 20..40]);
        let speed = &record.readings.speed;
        assert_eq!(&record.smoothed(speed), speed);
        assert!(record.rate(speed).iter().all(|rate| *rate == 0.0));
    }
}
