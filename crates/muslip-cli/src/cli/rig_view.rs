//! What a running rig shows on a terminal.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use muslip_record::{Estimate, Fault, Sample};

use super::terminal::shows_progress;

/// How often it is drawn.
const PERIOD: Duration = Duration::from_millis(100);

/// What was heard of the rig last.
#[derive(Default)]
pub(super) struct Seen {
    pub(super) sample: Option<Sample>,
    pub(super) estimate: Option<Estimate>,
    pub(super) fault: Option<Fault>,
}

/// A few lines on standard error, drawn over again; nothing where that is no terminal.
pub(super) struct LiveView {
    bar: Option<ProgressBar>,
    drawn: Instant,
}

impl LiveView {
    pub(super) fn new() -> Self {
        let bar = shows_progress().then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{msg}") {
                bar.set_style(style);
            }
            bar
        });
        Self {
            bar,
            drawn: Instant::now(),
        }
    }

    /// Draws, when it is time.
    pub(super) fn show(&mut self, seen: &Seen) {
        if let Some(bar) = &self.bar
            && self.drawn.elapsed() > PERIOD
        {
            self.drawn = Instant::now();
            bar.set_message(lines(seen).join("\n"));
        }
    }
}

impl Drop for LiveView {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// As lines that fit a terminal of 40 columns.
fn lines(seen: &Seen) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(sample) = seen.sample {
        lines.push(format!(
            "{:8} brake {:3.0} %",
            format!("{:?}", sample.state),
            100.0 * sample.brake_demand
        ));
        lines.push(format!(
            "vehicle {:5.2} m/s  wheel {:5.1} rad/s",
            sample.vehicle_speed_m_s, sample.wheel_speed_rad_s
        ));
    }
    if let Some(estimate) = seen.estimate {
        lines.push(format!(
            "slip {:6.3}  friction {:6.3}",
            estimate.slip_ratio, estimate.friction
        ));
        lines.push(format!(
            "peak {:.3} ± {:.3} at {:.3} ± {:.3}",
            estimate.peak_friction,
            estimate.p00.max(0.0).sqrt(),
            estimate.critical_slip,
            estimate.p11.max(0.0).sqrt()
        ));
    }
    if let Some(fault) = seen.fault {
        lines.push(format!("FAULT {fault:?}"));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::{Seen, lines};
    use muslip_record::{Estimate, Fault, Sample, State};

    #[test]
    fn every_line_fits_forty_columns_and_every_figure_is_there() {
        let seen = Seen {
            sample: Some(Sample {
                tick: 1,
                wheel_speed_rad_s: -1234.567,
                vehicle_speed_m_s: 123.456,
                drag_force_n: 0.0,
                normal_force_n: 0.0,
                brake_demand: 1.0,
                state: State::Release,
            }),
            estimate: Some(Estimate {
                tick: 1,
                slip_ratio: -0.123,
                friction: f32::NAN,
                peak_friction: 0.851,
                critical_slip: 0.142,
                p00: 1e-4,
                p01: 0.0,
                p11: 2.5e-5,
                updates: 3,
                estimating: muslip_record::Estimating::default(),
            }),
            fault: Some(Fault::VehicleSensorOutOfRange),
        };
        let lines = lines(&seen);
        assert_eq!(
            lines,
            [
                "Release  brake 100 %",
                "vehicle 123.46 m/s  wheel -1234.6 rad/s",
                "slip -0.123  friction    NaN",
                "peak 0.851 ± 0.010 at 0.142 ± 0.005",
                "FAULT VehicleSensorOutOfRange",
            ]
        );
        assert!(lines.iter().all(|line| line.chars().count() < 40));
    }
}
