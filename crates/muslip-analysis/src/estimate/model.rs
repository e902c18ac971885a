//! What of a repaired model the estimate can compensate sample by sample, and what it cannot.

use muslip::filter::mu_slip::State;
use muslip::sample::RigSample;
use muslip_compensate::{
    Compensated, Compensation, Compensator, EffectiveRadius, ForceDelay, ForceLag, LoadCrosstalk,
    LoadSensitivity, Relaxation, SpeedSensitivity, StepError, ThermalFade, ZeroDrift,
};
use muslip_diagnose::mechanism::{self, Context, Id};
use muslip_diagnose::repaired::{Repaired, RepairedTerm};
use serde_json::json;

use crate::measure::Survey;

/// Why the zero's drift is left alone where no recording begins.
const NO_BEGINNING: &str =
    "its time counts from the beginning of a recording; tare the rig instead";
/// Why a mechanism that is not of the vocabulary is left alone.
const UNKNOWN: &str = "a mechanism that this program does not know";
/// Shortest time without a sample, in s, that counts as a gap, ...
const SHORTEST_GAP_S: f64 = 0.1;
/// ... and how many usual steps it must be at least.
const GAP_STEPS: f64 = 20.0;

/// One mechanism of a model, and what becomes of it in an estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelledMechanism {
    /// Its id in the vocabulary, or `correction` where the diagnosis could not name it.
    pub id: String,
    /// Its form, empty where there is one only.
    pub form: String,
    /// Its parameters with their units, as in the model file.
    pub parameters: Vec<(String, f64, String)>,
    /// Why it is not compensated; `None` where it is.
    pub not_compensated: Option<&'static str>,
}

impl ModelledMechanism {
    /// Id and form in words: `load_sensitivity (peak)`.
    pub fn name(&self) -> String {
        if self.form.is_empty() {
            self.id.clone()
        } else {
            format!("{} ({})", self.id, self.form)
        }
    }
}

/// An operation that an estimate with compensation holds at: a key and its value in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Operation {
    /// `normal_force_n`, `vehicle_speed_m_s`, `sliding_speed_m_s` or `temperature_s`.
    pub key: &'static str,
    /// The value; 0 for no sliding and for a cold tread.
    pub value: f64,
}

impl Operation {
    /// As part of a sentence.
    pub fn in_words(&self) -> String {
        let value = self.value;
        match self.key {
            "normal_force_n" => format!("a normal force of {value:.0} N"),
            "vehicle_speed_m_s" => format!("a vehicle speed of {value:.1} m/s"),
            "sliding_speed_m_s" => "vanishing sliding speed".to_owned(),
            _ => "a cold tread".to_owned(),
        }
    }
}

/// A model as the estimate uses it.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelUse {
    /// What is compensated.
    pub compensation: Compensation<f64>,
    /// Every mechanism of the model, in the file's order.
    pub mechanisms: Vec<ModelledMechanism>,
    /// The operation that the estimate holds at, where the model makes friction depend on it.
    pub holds_at: Vec<Operation>,
    /// The model's noise of one drag reading: constant part in N, and its share of the force.
    pub noise: (f64, f64),
}

impl ModelUse {
    /// Sorts a model's mechanisms into what can be compensated and what cannot, for one recording.
    pub fn of(model: &Repaired, recording: &str, survey: &Survey) -> Self {
        let run = RunInCampaign::find(model, recording, survey);
        let step_s = survey.mean_step_s.min(model.context.dt);
        Self::sorted(model, Some(&run), step_s)
    }

    /// The same for a rig that is sampled every `step_s` seconds, whatever was recorded before.
    pub fn on_a_rig(model: &Repaired, step_s: f64) -> Self {
        Self::sorted(model, None, step_s)
    }

    fn sorted(model: &Repaired, run: Option<&RunInCampaign>, step_s: f64) -> Self {
        let context = &model.context;
        let mut used = Self {
            compensation: Compensation {
                longest_step_s: Some(SHORTEST_GAP_S.max(GAP_STEPS * context.dt)),
                ..Compensation::none()
            },
            mechanisms: Vec::new(),
            holds_at: Vec::new(),
            noise: (model.noise.sigma_n, model.noise.share_of_force),
        };
        for term in &model.tyre {
            let outcome = used.compensate(term, context, run, step_s);
            used.mechanisms.push(described(term, outcome.err()));
        }
        for term in &model.dynamics {
            used.mechanisms.push(described(
                term,
                Some(Id::parse(&term.id).map_or(UNKNOWN, why_not)),
            ));
        }
        for correction in &model.corrections {
            used.mechanisms.push(ModelledMechanism {
                id: "correction".to_owned(),
                form: format!("{} over {}", correction.acts_on, correction.variable),
                parameters: Vec::new(),
                not_compensated: Some("a table without a named mechanism"),
            });
        }
        used
    }

    /// Switches one mechanism on, or says why not.
    fn compensate(
        &mut self,
        term: &RepairedTerm,
        context: &Context,
        run: Option<&RunInCampaign>,
        sampling_step_s: f64,
    ) -> Result<(), &'static str> {
        const UNKNOWN_FORM: &str = "a form that the filter has no compensation for";
        let value = |index: usize| {
            term.parameters
                .get(index)
                .map(|parameter| parameter.value)
                .ok_or("parameters are missing")
        };
        let mean_load = context.mean_load;
        let mean_speed = context.mean_speed;
        let form = term.form.as_str();
        let on = &mut self.compensation;
        let id = Id::parse(&term.id).ok_or(UNKNOWN)?;
        match id {
            Id::EffectiveRadius => {
                let relative_error = value(0)?;
                let radius = match form {
                    "constant" => EffectiveRadius::Constant { relative_error },
                    "with_load" => EffectiveRadius::WithLoad {
                        relative_error,
                        per_relative_load: value(1)?,
                        mean_normal_force_n: mean_load,
                    },
                    "with_speed" => EffectiveRadius::WithSpeed {
                        relative_error,
                        per_relative_speed_squared: value(1)?,
                        mean_vehicle_speed_m_s: mean_speed,
                    },
                    _ => return Err(UNKNOWN_FORM),
                };
                once(&mut on.effective_radius, radius)
            }
            Id::ForceDelay => once(
                &mut on.force_delay,
                ForceDelay {
                    delay_s: value(0)?,
                    sampling_step_s,
                },
            ),
            Id::ForceLag => once(
                &mut on.force_lag,
                ForceLag {
                    time_constant_s: value(0)?,
                },
            ),
            Id::ZeroDrift => {
                let run = run.ok_or(NO_BEGINNING)?;
                let start_s = if form.ends_with("through_runs") {
                    run.time_before_s
                } else {
                    0.0
                };
                let drift = match form {
                    "linear_in_run" | "linear_through_runs" => ZeroDrift::Linear {
                        slope_n_s: value(0)?,
                        offset_n: 0.0,
                        start_s,
                    },
                    "linear_with_offset" => ZeroDrift::Linear {
                        slope_n_s: value(0)?,
                        offset_n: value(1)?,
                        start_s,
                    },
                    "warm_up_in_run" | "warm_up_through_runs" => ZeroDrift::WarmUp {
                        rise_n: value(0)?,
                        time_constant_s: value(1)?,
                        start_s,
                    },
                    _ => return Err(UNKNOWN_FORM),
                };
                once(&mut on.zero_drift, drift)
            }
            Id::LoadCrosstalk => {
                let share = value(0)?;
                once(&mut on.load_crosstalk, LoadCrosstalk { share })
            }
            Id::LoadSensitivity => {
                let critical_slip_exponent = match form {
                    "peak" => 0.0,
                    "peak_and_critical_slip" => value(1)?,
                    _ => return Err(UNKNOWN_FORM),
                };
                let load = LoadSensitivity {
                    sensitivity: value(0)?,
                    critical_slip_exponent,
                    mean_normal_force_n: mean_load,
                };
                once(&mut on.load_sensitivity, load)?;
                self.holds("normal_force_n", mean_load)
            }
            Id::SpeedSensitivity => {
                let per_m_s = value(0)?;
                let mean_vehicle_speed_m_s = mean_speed;
                let (speed, at) = match form {
                    "sliding_linear" => (SpeedSensitivity::SlidingLinear { per_m_s }, None),
                    "sliding_exponential" => {
                        (SpeedSensitivity::SlidingExponential { per_m_s }, None)
                    }
                    "vehicle_linear" => (
                        SpeedSensitivity::VehicleLinear {
                            per_m_s,
                            mean_vehicle_speed_m_s,
                        },
                        Some(mean_speed),
                    ),
                    "vehicle_exponential" => (
                        SpeedSensitivity::VehicleExponential {
                            per_m_s,
                            mean_vehicle_speed_m_s,
                        },
                        Some(mean_speed),
                    ),
                    "sliding_with_floor" => (
                        SpeedSensitivity::SlidingWithFloor {
                            floor: value(0)?,
                            speed_scale_m_s: value(1)?,
                        },
                        None,
                    ),
                    _ => return Err(UNKNOWN_FORM),
                };
                once(&mut on.speed_sensitivity, speed)?;
                match at {
                    Some(speed) => self.holds("vehicle_speed_m_s", speed),
                    None => self.holds("sliding_speed_m_s", 0.0),
                }
            }
            Id::RelaxationLength => {
                let length_m = value(0)?;
                let relaxation = match form {
                    "slip" => Relaxation::Slip { length_m },
                    "force" => Relaxation::Force { length_m },
                    _ => return Err(UNKNOWN_FORM),
                };
                once(&mut on.relaxation, relaxation)
            }
            Id::ThermalFade => {
                let curvature_per_s2 = match form {
                    "linear" => 0.0,
                    "curved" => value(2)?,
                    _ => return Err(UNKNOWN_FORM),
                };
                let heat = ThermalFade {
                    sensitivity_per_s: value(0)?,
                    curvature_per_s2,
                    time_constant_s: value(1)?,
                    reference_power_w: context.mean_power.max(1e-9),
                };
                once(&mut on.thermal_fade, heat)?;
                self.holds("temperature_s", 0.0)
            }
            Id::CurveShape
            | Id::RollingResistance
            | Id::SurfacePatch
            | Id::WearDrift
            | Id::SlipHysteresis
            | Id::StructuralResonance
            | Id::InertialReaction
            | Id::ForceGain
            | Id::ForceSaturation
            | Id::RunOut
            | Id::EncoderRipple
            | Id::VehicleSpeedDelay
            | Id::WheelSpeedDelay
            | Id::AeroDrag
            | Id::GradeOrDrive
            | Id::VehicleInertia
            | Id::BearingDrag
            | Id::BrakeFade
            | Id::BrakeLag
            | Id::WheelInertia => Err(why_not(id)),
        }
    }

    fn holds(&mut self, key: &'static str, value: f64) -> Result<(), &'static str> {
        self.holds_at.push(Operation { key, value });
        Ok(())
    }

    /// What was compensated and what was not, as JSON.
    pub fn to_json(&self) -> serde_json::Value {
        let named = |mechanism: &ModelledMechanism| {
            let mut object = serde_json::Map::new();
            object.insert("id".into(), json!(mechanism.id));
            object.insert("form".into(), json!(mechanism.form));
            object
        };
        let compensated: Vec<_> = self
            .compensated()
            .map(|mechanism| {
                let mut object = named(mechanism);
                let parameters: Vec<_> = mechanism
                    .parameters
                    .iter()
                    .map(|(name, value, unit)| json!({"name": name, "value": value, "unit": unit}))
                    .collect();
                object.insert("parameters".into(), json!(parameters));
                object
            })
            .collect();
        let not_compensated: Vec<_> = self
            .not_compensated()
            .map(|(mechanism, reason)| {
                let mut object = named(mechanism);
                object.insert("reason".into(), json!(reason));
                object
            })
            .collect();
        let holds_at: serde_json::Map<_, _> = self
            .holds_at
            .iter()
            .map(|at| (at.key.to_owned(), json!(at.value)))
            .collect();
        json!({
            "compensated": compensated,
            "not_compensated": not_compensated,
            "holds_at": holds_at,
        })
    }

    /// Whether the force is compensated for a low-pass filter: a reading is then not the law at its slip.
    pub fn filters_force(&self) -> bool {
        self.compensation.force_lag.is_some()
            || matches!(self.compensation.relaxation, Some(Relaxation::Force { .. }))
    }

    /// Mechanisms that are compensated.
    pub fn compensated(&self) -> impl Iterator<Item = &ModelledMechanism> {
        self.mechanisms
            .iter()
            .filter(|mechanism| mechanism.not_compensated.is_none())
    }

    /// Mechanisms that are not, with the reason.
    pub fn not_compensated(&self) -> impl Iterator<Item = (&ModelledMechanism, &'static str)> {
        self.mechanisms
            .iter()
            .filter_map(|mechanism| Some((mechanism, mechanism.not_compensated?)))
    }
}

fn once<E>(place: &mut Option<E>, effect: E) -> Result<(), &'static str> {
    if place.is_some() {
        return Err("another form of the same mechanism is compensated already");
    }
    *place = Some(effect);
    Ok(())
}

fn described(term: &RepairedTerm, not_compensated: Option<&'static str>) -> ModelledMechanism {
    ModelledMechanism {
        id: term.id.clone(),
        form: term.form.clone(),
        parameters: term
            .parameters
            .iter()
            .map(|p| (p.name.clone(), p.value, p.unit.clone()))
            .collect(),
        not_compensated,
    }
}

/// Why a mechanism is left alone, as its descriptor says.
fn why_not(id: Id) -> &'static str {
    match id.guide().map(|guide| guide.compensation) {
        Some(mechanism::Compensation::Not(reason)) => reason,
        // The filter could, but not what stands among the terms of wheel and vehicle.
        Some(mechanism::Compensation::By(_)) | None => UNKNOWN,
    }
}

/// Where a recording lies in the campaign that the model was made from.
struct RunInCampaign {
    /// Time of earlier recordings in s, as mechanisms that go on through all of them count it.
    time_before_s: f64,
}

impl RunInCampaign {
    fn find(model: &Repaired, recording: &str, survey: &Survey) -> Self {
        let name = |path: &str| path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned();
        let index = model
            .recordings
            .iter()
            .position(|known| {
                known.samples as u64 == survey.rows
                    && known.first_time_s == survey.first_time_s
                    && name(&known.path) == name(recording)
            })
            // A recording that the model does not know comes after those that it does.
            .unwrap_or(model.recordings.len());
        let context = &model.context;
        Self {
            time_before_s: if context.clock_continues {
                survey.first_time_s - context.first_time
            } else {
                context.before(index).time
            },
        }
    }
}

/// A compensator with whatever room its delay line needs.
pub(super) trait Compensating {
    /// [`Compensator::step`].
    fn step(
        &mut self,
        sample: &RigSample<f64>,
        dt_s: f64,
        state: &State<f64>,
    ) -> Result<Compensated<f64>, StepError>;
}

impl<const N: usize> Compensating for Compensator<f64, N> {
    fn step(
        &mut self,
        sample: &RigSample<f64>,
        dt_s: f64,
        state: &State<f64>,
    ) -> Result<Compensated<f64>, StepError> {
        Compensator::step(self, sample, dt_s, state)
    }
}

/// Builds the compensator of a model.
///
/// # Errors
/// One sentence: parameters that cannot be compensated, or a delay of too many samples.
pub(super) fn compensator(
    used: &ModelUse,
    radius_m: f64,
    survey: &Survey,
) -> Result<Box<dyn Compensating>, String> {
    let compensation = used.compensation;
    let samples = compensation
        .force_delay
        .map_or(0.0, |delay| delay.delay_s / delay.sampling_step_s);
    // Twice what an even step needs: steps jitter.
    let room = 2.0 * samples + 16.0;
    fn build<const N: usize>(
        compensation: Compensation<f64>,
        radius_m: f64,
        survey: &Survey,
    ) -> Result<Box<dyn Compensating>, String> {
        match compensation.build::<N>(radius_m, survey.limits) {
            Ok(compensator) => Ok(Box::new(compensator)),
            Err(error) => Err(error.to_string()),
        }
    }
    if samples == 0.0 {
        build::<0>(compensation, radius_m, survey)
    } else if room <= 64.0 {
        build::<64>(compensation, radius_m, survey)
    } else if room <= 512.0 {
        build::<512>(compensation, radius_m, survey)
    } else {
        build::<4096>(compensation, radius_m, survey)
    }
}
