//! A concealed effect: a truth form with its strength and its other figures.

use serde::{Deserialize, Serialize};

use crate::draw::Draw;
use crate::generate::form::{Form, mechanism};
use crate::generate::plan::Plan;
use crate::generate::rig::Rig;

/// One concealed effect.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Effect {
    /// Mechanism of the contract, or `outside`.
    pub id: String,
    pub balance: String,
    pub form: Form,
    /// Strength: what the calibration turns until the effect has the ordered size.
    pub a: f64,
    /// The strengths between which the form is still this physics.
    pub a_range: (f64, f64),
    /// The form's other figures.
    pub p: [f64; 6],
    /// Strength after the base was refitted, in sigma.
    pub strength_sigma: f64,
}

/// Typical figures of a campaign, in which forms are scaled.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    pub load: f64,
    pub speed: f64,
    pub drag: f64,
    pub radius: f64,
    pub inertia: f64,
    pub critical: f64,
    /// Friction power in ordinary braking, W.
    pub power: f64,
    /// Sliding speed in ordinary braking, m/s.
    pub sliding: f64,
    /// Length of the shortest run, m and s.
    pub distance: f64,
    pub duration: f64,
    pub runs: f64,
    pub clock: f64,
    pub rate_hz: f64,
}

impl Scale {
    /// The typical figures of a rig under a plan.
    pub fn of(rig: &Rig, plan: &Plan) -> Scale {
        let shortest = |f: &dyn Fn(&crate::generate::plan::RunPlan) -> f64| {
            plan.fitted()
                .map(|run| f(run.1))
                .fold(f64::INFINITY, f64::min)
        };
        let slow = if rig.coasting { 0.6 } else { 1.0 };
        let last = plan.fitted().last().map(|run| run.1);
        Scale {
            load: rig.mean_load_n,
            speed: rig.mean_speed_m_s,
            drag: rig.peak_drag_n(),
            radius: rig.radius_m,
            inertia: rig.inertia_kg_m2,
            critical: rig.critical_slip,
            power: rig.peak_drag_n() * 1.5 * rig.critical_slip * rig.mean_speed_m_s,
            sliding: 1.5 * rig.critical_slip * rig.mean_speed_m_s,
            distance: shortest(&|run| {
                slow * run.duration_s * run.speed.first().map_or(1.0, |k| k.1)
            }),
            duration: shortest(&|run| run.duration_s),
            runs: plan.runs.len() as f64,
            clock: last.map_or(1.0, |run| run.clock_s + run.duration_s),
            rate_hz: rig.rate_hz,
        }
    }
}

impl Effect {
    /// An effect of the given form with drawn figures and a first guess of its strength.
    pub fn draw(form: Form, rig: &Rig, plan: &Plan, draw: &mut Draw) -> Effect {
        use Form::*;
        let scale = Scale::of(rig, plan);
        let mut p = [0.0; 6];
        let angle = |draw: &mut Draw| draw.between(0.0, std::f64::consts::TAU);
        let (low, high) = match form {
            CurveMagic => {
                p[0] = draw.between(1.15, 1.6);
                p[1] = draw.between(-1.0, 0.4);
                p[2] = magic_stiffness(p[0], p[1]);
                (0.0, 1.3)
            }
            CurveBurckhardt => {
                // So stiff that the full skid keeps an ordinary share of the peak.
                p[0] = burckhardt_stiffness(rig.critical_slip, draw.between(0.35, 0.65));
                (0.0, 1.3)
            }
            CurveBrush => {
                p[0] = draw.between(1.0, 1.5);
                p[1] = draw.between(0.1, 0.35);
                p[2] = draw.between(0.2, 0.6);
                (0.0, 1.3)
            }
            CurveBroad => {
                p[0] = if draw.chance(0.7) {
                    draw.between(1.35, 1.65)
                } else {
                    draw.between(2.4, 3.2)
                };
                (0.0, 1.3)
            }
            LoadPower => (0.0, 0.5),
            LoadLinear => (-0.3, 0.6),
            LoadPowerStiff => {
                p[0] = draw.between(0.3, 1.0);
                (0.0, 0.5)
            }
            SpeedSlideExponential | SpeedSlideRational => (0.0, 0.6),
            SpeedVehicleLinear => (-0.5, 0.8),
            SpeedStribeck => {
                p[0] = draw.between(0.7, 1.6);
                p[1] = draw.between(0.6, 2.0);
                (0.0, 0.6)
            }
            ThermalOneNode | ThermalAirCooled => {
                p[0] = scale.duration * draw.log_between(0.06, 0.5);
                (0.0, 1.0)
            }
            ThermalTwoNode => {
                p[0] = scale.duration * draw.log_between(0.05, 0.25);
                p[1] = p[0] * draw.between(6.0, 15.0);
                p[2] = draw.between(0.2, 0.8);
                (0.0, 1.0)
            }
            RelaxSlip | RelaxForce | RelaxBrush | RelaxLoadSlip => (0.0, 4.5 * rig.radius_m),
            RollConstant => {
                p[5] = if draw.chance(0.3) { 1.0 } else { 0.0 };
                (0.0, 0.12)
            }
            RollSpeed => {
                p[0] = draw.between(0.1, 0.6);
                p[5] = if draw.chance(0.3) { 1.0 } else { 0.0 };
                (0.0, 0.12)
            }
            RadiusConstant => (-0.03, 0.03),
            RadiusLoad | RadiusSpeed => {
                p[0] = draw.between(-0.3, 0.3);
                (-0.06, 0.06)
            }
            PatchHard | PatchSmooth => {
                p[0] = scale.distance * draw.between(0.12, 0.55);
                p[1] = p[0] + scale.distance * draw.between(0.12, 0.35);
                p[2] = if form == PatchHard {
                    0.0
                } else {
                    scale.distance * draw.between(0.005, 0.02)
                };
                (-0.4, 0.75)
            }
            PatchSeveral => {
                p[0] = scale.distance * draw.between(0.1, 0.25);
                p[1] = p[0] + scale.distance * draw.between(0.06, 0.15);
                p[2] = p[1] + scale.distance * draw.between(0.1, 0.2);
                p[3] = p[2] + scale.distance * draw.between(0.08, 0.18);
                p[4] = draw.between(0.5, 1.2);
                (0.0, 0.7)
            }
            WearEnergy | WearDistance => (0.0, 0.7),
            WearRun => (-0.4, 0.6),
            HysteresisDahl => {
                p[0] = draw.between(0.08, 0.35);
                (-0.3, 0.3)
            }
            HysteresisSign => {
                p[0] = rig.critical_slip * draw.between(0.1, 0.3);
                (-0.3, 0.3)
            }
            HysteresisPlay => (0.0, 0.5),
            DelayPure | DelayHold => (0.0, 0.08),
            VehicleLate | VehicleLateHeld => (0.0, 0.4),
            WheelLate | WheelLateWindow => (0.0, 0.08),
            LagOnePole | LagMovingAverage => (0.0, 0.1),
            LagTwoPoles => {
                p[0] = draw.between(0.65, 0.88);
                (0.0, 0.1)
            }
            ResonanceMode | ResonanceShare => {
                p[0] = draw.log_between(0.015, 0.2);
                p[1] = if form == ResonanceMode {
                    1.0
                } else {
                    draw.between(0.35, 0.8)
                };
                (3.2 / rig.rate_hz, 1.0 / 4.0)
            }
            InertialDirect => (-0.5, 0.5),
            InertialSoft => {
                p[0] = draw.between(0.001, 0.004);
                (-0.5, 0.5)
            }
            CrosstalkConstant => (-0.1, 0.1),
            CrosstalkBent => {
                p[0] = draw.between(-0.2, 0.2);
                (-0.1, 0.1)
            }
            DriftLinear | DriftClock => (-0.5, 0.5),
            DriftWarmUp => {
                p[0] = scale.duration * draw.between(0.12, 0.5);
                (-0.5, 0.5)
            }
            DriftSlow => {
                p[0] = draw.between(0.4, 1.3) / scale.duration;
                p[1] = p[0] * draw.between(1.6, 2.6);
                p[2] = draw.between(0.0, 1e3);
                (-0.5, 0.5)
            }
            GainConstant => (-0.35, 0.35),
            GainBent => {
                p[0] = draw.between(-0.1, 0.1);
                (-0.35, 0.35)
            }
            SaturationHard => (0.0, 1.5),
            SaturationSoft => {
                p[0] = draw.between(8.0, 16.0);
                (0.0, 1.5)
            }
            RunOutLoad => {
                p[0] = angle(draw);
                p[1] = draw.between(0.0, 0.4);
                p[2] = angle(draw);
                (0.0, 0.4)
            }
            RunOutRadius | RunOutAdditive => {
                p[0] = angle(draw);
                (0.0, 0.4)
            }
            RippleSine => {
                p[0] = angle(draw);
                p[1] = draw.between(0.0, 0.5);
                p[2] = angle(draw);
                (0.0, 0.08)
            }
            RippleTiming => {
                p[0] = angle(draw);
                p[1] = draw.one_of(&[48.0, 60.0, 96.0, 120.0]);
                (0.0, 0.08)
            }
            AeroStill => (0.0, 0.7),
            AeroHeadwind => {
                p[0] = rig.mean_speed_m_s * draw.between(-0.15, 0.15);
                (0.0, 0.7)
            }
            GradeConstant => (-0.4, 0.6),
            GradeDrive => (0.0, 0.3),
            MassConstant => (-0.35, 0.8),
            MassFuel => {
                p[0] = draw.between(0.01, 0.04);
                (-0.35, 0.8)
            }
            BearingConstant | BearingSpeed | BearingLoad => (0.0, 0.3),
            FadeTemperature => {
                p[0] = scale.duration * draw.between(0.15, 0.6);
                p[1] = scale.duration * draw.between(0.8, 3.0);
                (0.0, 0.8)
            }
            FadeEnergy => {
                p[0] = scale.duration * draw.between(0.2, 0.8);
                (0.0, 0.8)
            }
            BrakeLagOne => (0.0, 0.15),
            BrakeLagTwo => {
                p[0] = draw.between(0.65, 0.88);
                (0.0, 0.15)
            }
            BrakeLagDead => {
                p[0] = draw.between(0.15, 0.35);
                (0.0, 0.15)
            }
            InertiaConstant => (-0.6, 2.0),
            InertiaGrowth => (0.0, 2.0),
            OutColumnFriction | OutColumnSlip => (-0.35, 0.35),
            OutColumnSteer => (0.0, 0.5),
            OutColumnZero | OutColumnWind | OutColumnOil => (-0.3, 0.3),
            OutBrakeTime => {
                p[0] = scale.duration * draw.between(0.015, 0.05);
                (0.0, 0.7)
            }
            OutHum => {
                p[0] = if rig.rate_hz >= 200.0 { 50.0 } else { 16.7 };
                p[1] = draw.between(0.0, 1e3);
                (0.0, 0.6)
            }
            OutSlipBand => {
                p[0] = draw.between(1.2, 2.0);
                p[1] = draw.between(0.15, 0.35);
                (-0.5, 0.5)
            }
            OutLoadLag => (0.0, 0.5),
            OutSlipRate => {
                p[0] = 4.0 * rig.critical_slip;
                (-0.4, 0.4)
            }
            OutTrackWave => {
                p[0] = scale.distance / draw.between(6.0, 14.0);
                p[1] = angle(draw);
                (0.0, 0.5)
            }
            OutCellBacklash => (0.0, 0.3),
            OutSpeedBand => {
                p[0] = scale.speed * draw.between(0.6, 0.95);
                p[1] = scale.speed * draw.between(0.06, 0.15);
                (-0.1, 0.1)
            }
            OutLoadRate => {
                p[0] = 0.6;
                (-0.4, 0.4)
            }
            OutTimeStep => {
                p[0] = scale.duration * draw.between(0.3, 0.65);
                (-0.6, 0.5)
            }
            OutDiscWave => {
                p[0] = angle(draw);
                (0.0, 0.5)
            }
        };
        let negative = form.either_sign() && low < 0.0 && draw.chance(0.5);
        let bound = if negative { -low } else { high };
        let sign = if negative { -1.0 } else { 1.0 };
        let (id, balance) = crate::generate::form::VOCABULARY
            .iter()
            .find(|entry| entry.2.contains(&form))
            .map(|entry| (entry.0, entry.1))
            .or_else(|| {
                crate::generate::form::OUTSIDE
                    .iter()
                    .find(|entry| entry.0 == form)
                    .map(|entry| ("outside", entry.1))
            })
            .unwrap_or(("outside", "tyre"));
        debug_assert!(id == "outside" || mechanism(id).is_some());
        let a_range = if sign > 0.0 {
            (low.max(0.0), bound)
        } else {
            (-bound, 0.0)
        };
        Effect {
            id: id.to_owned(),
            balance: balance.to_owned(),
            form,
            a: if low > 0.0 {
                (low * high).sqrt()
            } else {
                sign * 0.15 * bound
            },
            a_range,
            p,
            strength_sigma: 0.0,
        }
    }
}

/// The stiffness that puts the magic formula's peak at relative slip 1.
fn magic_stiffness(shape: f64, curvature: f64) -> f64 {
    let wanted = (std::f64::consts::FRAC_PI_2 / shape).tan();
    let (mut low, mut high) = (0.05, 60.0);
    for _ in 0..80 {
        let middle: f64 = 0.5 * (low + high);
        if middle - curvature * (middle - middle.atan()) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The exponent (in relative slip) at which Burckhardt's law, with its peak at the critical slip,
/// has lost the given share of the peak at full skid.
fn burckhardt_stiffness(critical: f64, loss: f64) -> f64 {
    let skid = |k: f64| {
        let linear = k * (-k).exp();
        (1.0 - (-k / critical).exp() - linear / critical) / (1.0 - (-k).exp() - linear)
    };
    let (mut low, mut high) = (2.0, 14.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if skid(middle) < 1.0 - loss {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
