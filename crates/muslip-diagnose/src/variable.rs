//! What a residual may be a function of: the words of the contract, and any recorded column.

use crate::data::Data;
use crate::slip;

/// A variable that a residual may depend on.
#[derive(Clone, Debug, PartialEq)]
pub enum Variable {
    /// Slip.
    Slip,
    /// Sliding speed s·v.
    SlidingSpeed,
    /// Vehicle speed.
    VehicleSpeed,
    /// Normal force.
    NormalForce,
    /// Time since the start of the run.
    Time,
    /// Time since the wheel last began to slip.
    SinceOnset,
    /// Distance run.
    Distance,
    /// Angle that the wheel has turned by since the start of the run.
    WheelAngle,
    /// Rate of change of slip.
    SlipRate,
    /// Rate of change of the normal force.
    NormalForceRate,
    /// Rate of change of the vehicle speed.
    VehicleSpeedRate,
    /// A recorded column, by its place in the campaign.
    Column(usize),
}

impl Variable {
    /// The contract's word (for a column: its header).
    #[must_use]
    pub fn word(&self, data: &Data) -> String {
        match self {
            Self::Slip => "slip".into(),
            Self::SlidingSpeed => "sliding_speed_m_s".into(),
            Self::VehicleSpeed | Self::VehicleSpeedRate => "vehicle_speed_m_s".into(),
            Self::NormalForce | Self::NormalForceRate => "normal_force_n".into(),
            Self::Time | Self::SinceOnset => "time_s".into(),
            Self::Distance => "distance_m".into(),
            Self::WheelAngle => "wheel_angle_rad".into(),
            Self::SlipRate => "slip_rate".into(),
            Self::Column(i) => data.extra_names.get(*i).cloned().unwrap_or_default(),
        }
    }

    /// A name that tells apart what the contract's word does not; stable, used in `model.toml`.
    #[must_use]
    pub fn key(&self, data: &Data) -> String {
        match self {
            Self::VehicleSpeedRate => "vehicle_speed_rate".into(),
            Self::NormalForceRate => "normal_force_rate".into(),
            Self::SinceOnset => "time_since_onset".into(),
            Self::Column(_) => format!("column:{}", self.word(data)),
            _ => self.word(data),
        }
    }

    /// All variables of a campaign.
    #[must_use]
    pub fn all(data: &Data) -> Vec<Self> {
        let mut all = vec![
            Self::Slip,
            Self::SlidingSpeed,
            Self::VehicleSpeed,
            Self::NormalForce,
            Self::Time,
            Self::SinceOnset,
            Self::Distance,
            Self::WheelAngle,
            Self::SlipRate,
            Self::NormalForceRate,
            Self::VehicleSpeedRate,
        ];
        all.extend((0..data.extra_names.len()).map(Self::Column));
        all
    }

    /// Its values on one run.
    #[must_use]
    pub fn values(&self, data: &Data, run: usize) -> Vec<f64> {
        let s = &data.series[run];
        let slip = || -> Vec<f64> {
            (0..s.len())
                .map(|k| s.slip(k, data.context.radius))
                .collect()
        };
        let start = s.time.first().copied().unwrap_or(0.0);
        match self {
            Self::Slip => slip(),
            Self::SlidingSpeed => slip()
                .iter()
                .zip(&s.speed.smooth)
                .map(|(a, v)| a * v)
                .collect(),
            Self::VehicleSpeed => s.speed.smooth.clone(),
            Self::NormalForce => s.load.smooth.clone(),
            Self::Time => s.time.iter().map(|t| t - start).collect(),
            Self::SinceOnset => {
                let slip = slip();
                let critical = data.context.nominal[1];
                let mut onset = None;
                (0..s.len())
                    .map(|k| {
                        // Begins when slip passes a quarter of the peak's, ends below an eighth.
                        if slip[k] > 0.25 * critical && onset.is_none() {
                            onset = Some(s.time[k]);
                        } else if slip[k] < 0.125 * critical {
                            onset = None;
                        }
                        onset.map_or(0.0, |t| s.time[k] - t)
                    })
                    .collect()
            }
            Self::Distance => s.distance.clone(),
            Self::WheelAngle => s.angle.clone(),
            Self::SlipRate => (0..s.len())
                .map(|k| {
                    if !s.rolling[k] {
                        return 0.0;
                    }
                    let speeds = [s.wheel.smooth[k], s.speed.smooth[k]];
                    slip::rate(
                        data.context.radius,
                        speeds,
                        [s.wheel.rate[k], s.speed.rate[k]],
                    )
                })
                .collect(),
            Self::NormalForceRate => s.load.rate.clone(),
            Self::VehicleSpeedRate => s.speed.rate.clone(),
            Self::Column(i) => s
                .extra
                .get(*i)
                .cloned()
                .unwrap_or_else(|| vec![f64::NAN; s.len()]),
        }
    }
}
