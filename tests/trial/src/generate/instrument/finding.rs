//! What `chain` is to say of a measuring chain: the effects that a campaign has alone, and the truth of each.

use serde::{Deserialize, Serialize};

use super::vehicle::VehicleSensor;
use super::wheel::WheelSensor;
use super::{ChainKind, Common, Instruments};
use crate::draw::Draw;
use crate::generate::rig::Rig;

/// One entry of `chain` that is true of a campaign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    pub channel: String,
    /// The contract's word.
    pub finding: String,
    pub value: f64,
}

/// An effect of the chain that stands alone in a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    LateVehicle,
    LateWheel,
    LowPassedVehicle,
    LowPassedDrag,
    ColouredVehicle,
    ColouredDrag,
    CommonNoise,
    QuantisedWheel,
    HeldVehicle,
    HumDrag,
    RippleWheel,
    ZeroDrag,
    LeakingColumn,
}

/// All of them.
pub const FINDING_KINDS: [FindingKind; 13] = [
    FindingKind::LateVehicle,
    FindingKind::LateWheel,
    FindingKind::LowPassedVehicle,
    FindingKind::LowPassedDrag,
    FindingKind::ColouredVehicle,
    FindingKind::ColouredDrag,
    FindingKind::CommonNoise,
    FindingKind::QuantisedWheel,
    FindingKind::HeldVehicle,
    FindingKind::HumDrag,
    FindingKind::RippleWheel,
    FindingKind::ZeroDrag,
    FindingKind::LeakingColumn,
];

use FindingKind as K;

impl FindingKind {
    /// The kind's word.
    pub fn word(self) -> String {
        serde_json::to_value(self)
            .ok()
            .and_then(|value| value.as_str().map(str::to_owned))
            .unwrap_or_default()
    }

    /// Whether it shows only where the vehicle's speed changes under the brake.
    pub fn needs_coasting(self) -> bool {
        matches!(self, K::LateVehicle | K::LowPassedVehicle | K::HeldVehicle)
    }

    /// Ideal instruments but for this.
    pub fn instruments(self, rig: &Rig, draw: &mut Draw) -> Instruments {
        let mut chain = Instruments::ideal(ChainKind::Only(self));
        let s = &rig.sigmas;
        let unit = |std: f64| super::colour::Colour::white(std);
        chain.drag.noise = unit(s.drag_force_n);
        chain.load.noise = unit(s.normal_force_n);
        chain.brake.noise = unit(s.brake_torque_nm);
        chain.vehicle_noise = unit(s.vehicle_speed_m_s);
        // The plain wheel sensor, with its noise.
        let white_wheel = |pole_s: f64, ripple: f64| WheelSensor::Tacho {
            pole_s,
            poles: 1,
            noise: unit(s.wheel_speed_rad_s),
            ripple,
            order: 1.0,
        };
        chain.wheel = white_wheel(0.0, 0.0);
        match self {
            K::LateVehicle => chain.vehicle_late_s = draw.log_between(0.02, 0.08),
            K::LateWheel => chain.wheel_late_s = draw.log_between(0.01, 0.04),
            K::LowPassedVehicle => {
                chain.vehicle = VehicleSensor::Gps {
                    rate_hz: rig.rate_hz,
                    latency_s: 0.0,
                    pole_s: draw.log_between(0.04, 0.15),
                    interpolated: true,
                    phase: 0.0,
                };
            }
            K::LowPassedDrag => {
                chain.drag.poles = 1;
                chain.drag.pole_s = draw.log_between(0.015, 0.06);
            }
            K::ColouredVehicle => {
                chain.vehicle_noise.std *= draw.between(2.0, 5.0);
                chain.vehicle_noise.slow = 0.95;
                chain.vehicle_noise.time_constant_s = draw.log_between(0.1, 0.5);
            }
            K::ColouredDrag => {
                chain.drag.noise.std *= draw.between(1.5, 3.0);
                chain.drag.noise.slow = 0.9;
                chain.drag.noise.time_constant_s = draw.log_between(0.03, 0.2);
            }
            K::CommonNoise => {
                let own = (s.wheel_speed_rad_s * rig.radius_m / rig.mean_speed_m_s)
                    .max(s.vehicle_speed_m_s / rig.mean_speed_m_s);
                chain.common = Some(Common {
                    relative: own * draw.between(3.0, 8.0),
                    time_constant_s: draw.log_between(0.01, 0.1),
                });
            }
            K::QuantisedWheel => {
                let spin = rig.mean_speed_m_s / rig.radius_m;
                let window_s = (1.0 / rig.rate_hz).max(0.005);
                let counts = draw.log_between(40.0, 150.0);
                chain.wheel = WheelSensor::Counts {
                    lines: (counts / (spin * window_s) * std::f64::consts::TAU).round(),
                    window_s,
                    held: false,
                };
            }
            K::HeldVehicle => {
                chain.vehicle = VehicleSensor::Gps {
                    rate_hz: draw.one_of(&[5.0, 10.0, 20.0]),
                    latency_s: 0.0,
                    pole_s: 0.0,
                    interpolated: false,
                    phase: draw.between(0.0, 1.0),
                };
            }
            K::HumDrag => {
                chain.drag.hum = s.drag_force_n * draw.between(1.0, 3.0);
                // A slow recorder folds 50 Hz onto anything; a railway's mains it can show.
                let mains = if rig.rate_hz < 250.0 {
                    50.0 / 3.0
                } else {
                    draw.one_of(&[50.0, 60.0])
                };
                chain.drag.hum_hz = mains * draw.between(0.999, 1.001);
            }
            K::RippleWheel => {
                let own = s.wheel_speed_rad_s * rig.radius_m / rig.mean_speed_m_s;
                chain.wheel = white_wheel(0.0, own * draw.between(1.5, 4.0));
            }
            K::ZeroDrag => {
                let sign = if draw.chance(0.5) { -1.0 } else { 1.0 };
                chain.drag.zero = sign * s.drag_force_n * draw.between(1.0, 3.0);
            }
            K::LeakingColumn => chain.leak = true,
        }
        chain
    }

    /// What `chain` is to say: the channel, the contract's word and the value; where an error is of two channels, of
    /// either. `mean` is the mean of wheel and of vehicle speed.
    pub fn truth(
        self,
        chain: &Instruments,
        mean: (f64, f64),
        leak: Option<(&str, f64)>,
    ) -> Vec<Finding> {
        let finding = |channel: &str, finding: &str, value: f64| Finding {
            channel: channel.to_owned(),
            finding: finding.to_owned(),
            value,
        };
        let (vehicle, wheel, drag) = ("vehicle_speed_m_s", "wheel_speed_rad_s", "drag_force_n");
        let found = match self {
            K::LateVehicle => finding(vehicle, "late", chain.vehicle_late_s),
            K::LateWheel => finding(wheel, "late", chain.wheel_late_s),
            K::LowPassedVehicle => finding(vehicle, "low_passed", chain.vehicle.delay()),
            K::LowPassedDrag => finding(drag, "low_passed", chain.drag.delay()),
            K::ColouredVehicle => finding(
                vehicle,
                "coloured_noise",
                chain.vehicle_noise.std * chain.vehicle_noise.slow.sqrt(),
            ),
            K::ColouredDrag => finding(
                drag,
                "coloured_noise",
                chain.drag.noise.std * chain.drag.noise.slow.sqrt(),
            ),
            K::CommonNoise => {
                let relative = chain.common.map_or(0.0, |common| common.relative);
                return vec![
                    finding(wheel, "common_noise", relative * mean.0),
                    finding(vehicle, "common_noise", relative * mean.1),
                ];
            }
            K::QuantisedWheel => finding(
                wheel,
                "quantised",
                match &chain.wheel {
                    WheelSensor::Counts {
                        lines, window_s, ..
                    } => std::f64::consts::TAU / (lines * window_s),
                    _ => f64::NAN,
                },
            ),
            K::HeldVehicle => finding(
                vehicle,
                "held",
                match &chain.vehicle {
                    VehicleSensor::Gps { rate_hz, .. } => 1.0 / rate_hz,
                    _ => f64::NAN,
                },
            ),
            K::HumDrag => finding(drag, "hum", chain.drag.hum),
            K::RippleWheel => finding(
                wheel,
                "ripple",
                match &chain.wheel {
                    WheelSensor::Tacho { ripple, .. } => *ripple,
                    _ => f64::NAN,
                },
            ),
            K::ZeroDrag => finding(drag, "zero", chain.drag.zero),
            K::LeakingColumn => {
                let (header, correlation) = leak.unwrap_or(("", f64::NAN));
                finding(header, "leaks", correlation)
            }
        };
        vec![found]
    }

    /// Names that say the same of the chain as the finding does.
    pub fn tolerated(self) -> &'static [&'static str] {
        match self {
            K::LateVehicle | K::LowPassedVehicle | K::HeldVehicle => &["vehicle_speed_delay"],
            K::LateWheel | K::QuantisedWheel => &["wheel_speed_delay"],
            K::LowPassedDrag => &["force_lag", "force_delay"],
            K::RippleWheel => &["encoder_ripple"],
            K::ZeroDrag => &["zero_drift"],
            _ => &[],
        }
    }
}
