//! The figures of a concealed effect in the contract's definitions, measured on the true motion
//! wherever the truth form has no such figure of its own.

use serde::{Deserialize, Serialize};

use crate::generate::chain::{saturation_limit, share};
use crate::generate::effect::{Effect, Scale};
use crate::generate::form::{Form, OUTSIDE};
use crate::generate::rig::Rig;
use crate::generate::sim::{Motion, Stretch, bearing};
use crate::generate::tyre::{Contact, Wear, radius_change, slip_length, static_curve};

/// One figure of an effect in the contract's definition.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Figure {
    pub name: String,
    pub unit: String,
    /// More than one where the contract leaves the choice of variable open.
    pub values: Vec<f64>,
    /// What the best estimator with the true form could reach on these runs; none where the parameter is not the
    /// strength that was calibrated.
    pub attainable_std: Option<f64>,
}

/// A concealed effect as the truth file tells it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Concealed {
    pub effect: Effect,
    pub figures: Vec<Figure>,
    /// Names that count as right for this form.
    pub accept: Vec<String>,
    /// Names that may stand beside it without being wrong.
    pub tolerated: Vec<String>,
    /// For an effect outside the vocabulary: the variables that it may be said to depend on.
    pub variables: Vec<String>,
}

/// A run as it went, and where it stands in the campaign.
pub struct Ridden<'a> {
    pub motion: &'a Motion,
    pub index: usize,
    pub wear_before: Wear,
}

/// Everything that the truth file says of one effect.
pub fn concealed(
    effect: &Effect,
    rig: &Rig,
    scale: &Scale,
    runs: &[Ridden<'_>],
    column: Option<&str>,
) -> Concealed {
    let accept = match effect.form {
        Form::LagMovingAverage => vec!["force_lag", "force_delay"],
        Form::DelayHold => vec!["force_delay", "force_lag"],
        _ if effect.id == "outside" => vec![],
        _ => vec![effect.id.as_str()],
    };
    let tolerated: &[&str] = match effect.form {
        Form::RollConstant | Form::RollSpeed if effect.p[5] > 0.5 => &["bearing_drag"],
        Form::BrakeLagDead | Form::BrakeLagTwo => &[],
        _ => &[],
    };
    let variables = OUTSIDE
        .iter()
        .find(|entry| entry.0 == effect.form)
        .map(|entry| {
            entry
                .2
                .iter()
                .map(|word| {
                    if *word == "@" {
                        column.unwrap_or("?").to_owned()
                    } else {
                        (*word).to_owned()
                    }
                })
                .collect()
        })
        .unwrap_or_default();
    Concealed {
        effect: effect.clone(),
        figures: figures(effect, rig, scale, runs),
        accept: accept.into_iter().map(str::to_owned).collect(),
        tolerated: tolerated.iter().map(|id| (*id).to_owned()).collect(),
        variables,
    }
}

/// The effect's parameters in the contract's definition.
pub fn figures(
    effect: &Effect,
    rig: &Rig,
    scale: &Scale,
    runs: &[Ridden<'_>],
) -> Vec<Figure> {
    use Form::*;
    let (a, p) = (effect.a, &effect.p);
    let truth = (rig.peak_friction, rig.critical_slip);
    let one = |name: &str, unit: &str, values: Vec<f64>| {
        vec![Figure {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
            attainable_std: None,
        }]
    };
    match effect.form {
        CurveMagic | CurveBurckhardt | CurveBrush | CurveBroad => {
            let peak = (1..=1000)
                .map(|i| static_curve(std::slice::from_ref(effect), truth, f64::from(i) * 1e-3))
                .fold(0.0, f64::max);
            one(
                "full_skid_ratio",
                "1",
                vec![static_curve(std::slice::from_ref(effect), truth, 1.0) / peak],
            )
        }
        LoadPower | LoadPowerStiff => one("load_sensitivity", "1", vec![a]),
        LoadLinear => {
            let load = mean(runs, |s, i| Some(s.load[i])) / scale.load;
            one(
                "load_sensitivity",
                "1",
                vec![a * load / (1.0 - a * (load - 1.0))],
            )
        }
        SpeedSlideExponential | SpeedVehicleLinear | SpeedStribeck | SpeedSlideRational => {
            let factor = |sliding: f64, speed: f64| match effect.form {
                SpeedSlideExponential => (-a * sliding / scale.sliding).exp(),
                SpeedVehicleLinear => 1.0 - a * (speed / scale.speed - 1.0),
                SpeedStribeck => {
                    1.0 - a * (1.0 - (-(sliding / (scale.sliding * p[1])).powf(p[0])).exp())
                }
                _ => 1.0 / (1.0 + a * sliding / scale.sliding),
            };
            let against = |variable: &dyn Fn(&Stretch, usize) -> f64| {
                slope(runs, rig, &|s, i| {
                    let sliding = (s.speed[i] - rig.radius_m * s.wheel[i]).abs();
                    (variable(s, i), factor(sliding, s.speed[i]).max(1e-3).ln())
                })
            };
            let sliding = against(&|s, i| (s.speed[i] - rig.radius_m * s.wheel[i]).abs());
            let speed = against(&|s, i| s.speed[i]);
            let values = if effect.form == SpeedVehicleLinear {
                vec![speed, sliding]
            } else {
                vec![sliding, speed]
            };
            one("friction_change_per_m_s", "s/m", values)
        }
        ThermalOneNode | ThermalTwoNode => one("time_constant", "s", vec![p[0]]),
        ThermalAirCooled => {
            let cooling = mean(runs, |s, i| Some(0.5 * (1.0 + s.speed[i] / scale.speed)));
            one("time_constant", "s", vec![p[0] / cooling])
        }
        RelaxSlip | RelaxForce | RelaxBrush => one("length", "m", vec![a]),
        RelaxLoadSlip => {
            let length = mean(runs, |s, i| {
                let slip = 1.0 - rig.radius_m * s.wheel[i] / s.speed[i];
                (slip > 0.2 * rig.critical_slip)
                    .then(|| slip_length(effect, slip, s.load[i], scale))
            });
            one("length", "m", vec![length])
        }
        RollConstant => one("coefficient", "1", vec![a]),
        RollSpeed => one(
            "coefficient",
            "1",
            vec![mean(runs, |s, i| {
                Some(a * (1.0 + p[0] * (s.speed[i] / scale.speed).powi(2)))
            })],
        ),
        RadiusConstant | RadiusLoad | RadiusSpeed => {
            let contact = Contact {
                speed: mean(runs, |s, i| Some(s.speed[i])),
                load: mean(runs, |s, i| Some(s.load[i])),
                ..Contact::default()
            };
            one(
                "radius",
                "m",
                vec![rig.radius_m * (1.0 + radius_change(effect, &contact, scale))],
            )
        }
        PatchHard | PatchSmooth | PatchSeveral => one("start", "m", vec![p[0]]),
        WearEnergy | WearRun | WearDistance => {
            let level = |run: &Ridden<'_>| {
                let (after, before) = (run.motion.wear, run.wear_before);
                let (energy, slid) = (
                    0.5 * (after.energy + before.energy),
                    0.5 * (after.slid + before.slid),
                );
                match effect.form {
                    WearEnergy => {
                        (-a * energy / (0.25 * scale.power * scale.duration * scale.runs)).exp()
                    }
                    WearRun => 1.0 - a * run.index as f64 / (scale.runs - 1.0).max(1.0),
                    _ => {
                        1.0 - a
                            * (1.0
                                - (-slid / (0.15 * scale.sliding * scale.duration * scale.runs))
                                    .exp())
                    }
                }
            };
            one(
                "friction_loss",
                "1",
                match (runs.first(), runs.last()) {
                    (Some(first), Some(last)) => vec![1.0 - level(last) / level(first)],
                    _ => vec![],
                },
            )
        }
        HysteresisDahl | HysteresisSign => one("loop_share", "1", vec![a]),
        HysteresisPlay => {
            // Half the difference between rising and falling branch, where slip is on its way.
            let share = mean(runs, |s, i| {
                let x = (1.0 - rig.radius_m * s.wheel[i] / s.speed[i]) / rig.critical_slip;
                let law = crate::generate::tyre::law;
                (x > 0.25).then(|| 0.5 * (law(x - a) - law(x + a)).abs() / law(x))
            });
            one("loop_share", "1", vec![-share, share])
        }
        DelayPure | DelayHold | VehicleLate | VehicleLateHeld | WheelLate | WheelLateWindow => {
            one("delay", "s", vec![a])
        }
        LagOnePole | LagTwoPoles | LagMovingAverage => one("time_constant", "s", vec![a]),
        ResonanceMode | ResonanceShare => {
            let mut both = one("frequency", "Hz", vec![1.0 / a]);
            both.extend(one("damping_ratio", "1", vec![p[0]]));
            both
        }
        InertialDirect | InertialSoft => one("share", "kg m", vec![share(effect, scale)]),
        CrosstalkConstant => one("share", "1", vec![a]),
        CrosstalkBent => one(
            "share",
            "1",
            vec![mean(runs, |s, i| {
                Some(a * (1.0 + p[0] * (s.load[i] / scale.load - 1.0)))
            })],
        ),
        DriftLinear => one("slope", "N/s", vec![a * scale.drag / scale.duration]),
        DriftClock => one("slope", "N/s", vec![a * scale.drag / scale.clock]),
        DriftWarmUp => one("time_constant", "s", vec![p[0]]),
        GainConstant => one("gain", "1", vec![1.0 + a]),
        GainBent => one(
            "gain",
            "1",
            vec![mean(runs, |s, i| {
                (s.drag[i] > 0.2 * scale.drag)
                    .then(|| 1.0 + a * (1.0 + p[0] * (s.drag[i] / scale.drag - 0.5)))
            })],
        ),
        SaturationHard | SaturationSoft => one("limit", "N", vec![saturation_limit(effect, scale)]),
        RunOutLoad => one("amplitude", "1", vec![a]),
        RunOutAdditive => one(
            "amplitude",
            "1",
            vec![mean(runs, |s, i| {
                (s.drag[i] > 0.3 * scale.drag)
                    .then(|| 0.5 * a * rig.peak_friction * s.load[i] / s.drag[i])
            })],
        ),
        RippleSine | RippleTiming => one("amplitude", "1", vec![a]),
        AeroStill => one(
            "coefficient",
            "kg/m",
            vec![a * scale.drag / scale.speed.powi(2)],
        ),
        AeroHeadwind => one(
            "coefficient",
            "kg/m",
            vec![mean(runs, |s, i| {
                Some(a * scale.drag * ((s.speed[i] + p[0]) / (scale.speed * s.speed[i])).powi(2))
            })],
        ),
        GradeConstant => one("force", "N", vec![a * scale.drag]),
        GradeDrive => one("force", "N", vec![-a * scale.drag]),
        MassConstant | MassFuel => one("mass", "kg", vec![rig.mass_kg * (1.0 + a)]),
        BearingConstant | BearingSpeed | BearingLoad => {
            let torque = scale.radius * scale.drag;
            one(
                "torque",
                "N m",
                vec![mean(runs, |s, i| {
                    let contact = Contact {
                        load: s.load[i],
                        ..Contact::default()
                    };
                    Some(bearing(effect, &contact, s.wheel[i], torque, scale))
                })],
            )
        }
        FadeTemperature | FadeEnergy => one(
            "torque_loss",
            "1",
            vec![runs.iter().map(|run| run.motion.torque_loss).fold(0.0, f64::max)],
        ),
        BrakeLagOne | BrakeLagTwo | BrakeLagDead => one("time_constant", "s", vec![a]),
        InertiaConstant => one("inertia", "kg m2", vec![rig.inertia_kg_m2 * (1.0 + a)]),
        InertiaGrowth => {
            let growth = mean(runs, |s, i| {
                Some(0.7 + 0.3 * (s.wheel[i] * scale.radius / scale.speed).powi(2))
            });
            one(
                "inertia",
                "kg m2",
                vec![rig.inertia_kg_m2 * (1.0 + a * growth)],
            )
        }
        _ => vec![],
    }
}

/// The stretch in which the run proper took place.
fn main_stretch(motion: &Motion) -> Option<&Stretch> {
    motion.stretches.last()
}

fn mean(runs: &[Ridden<'_>], value: impl Fn(&Stretch, usize) -> Option<f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for stretch in runs.iter().filter_map(|run| main_stretch(run.motion)) {
        for i in (0..stretch.len()).step_by(20) {
            if let Some(value) = value(stretch, i) {
                sum += value;
                count += 1.0;
            }
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Least-squares slope over braking samples, weighted by drag squared.
fn slope(
    runs: &[Ridden<'_>],
    rig: &Rig,
    point: &dyn Fn(&Stretch, usize) -> (f64, f64),
) -> f64 {
    let (mut w, mut wx, mut wy, mut wxx, mut wxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for stretch in runs.iter().filter_map(|run| main_stretch(run.motion)) {
        for i in (0..stretch.len()).step_by(20) {
            if stretch.drag[i] < 0.2 * rig.peak_drag_n() || stretch.speed[i] < rig.slowest_m_s() {
                continue;
            }
            let weight = stretch.drag[i].powi(2);
            let (x, y) = point(stretch, i);
            w += weight;
            wx += weight * x;
            wy += weight * y;
            wxx += weight * x * x;
            wxy += weight * x * y;
        }
    }
    let spread = w * wxx - wx * wx;
    if spread > 0.0 {
        (w * wxy - wx * wy) / spread
    } else {
        0.0
    }
}
