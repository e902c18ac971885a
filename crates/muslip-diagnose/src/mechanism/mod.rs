//! The vocabulary: what a simulation may have left out, one type per mechanism.
//!
//! A new mechanism is a new file here, a variant of [`Id`] and a line in [`catalogue`]. Each has its section of the
//! field guide ([`Guide`]: physics, look-alikes, the run that tells them apart) and says where
//! in the chain from speeds to reading it acts ([`Stage`]), what its parameters are and where a search
//! for them starts, and how it changes the [`State`] of one run. Some have several forms (a speed
//! effect may follow the sliding or the vehicle speed); each form is an entry of the catalogue.

mod aero_drag;
mod bearing_drag;
mod brake_fade;
mod brake_lag;
mod curve_shape;
mod effective_radius;
mod encoder_ripple;
mod filters;
mod force_delay;
mod force_gain;
mod force_lag;
mod force_saturation;
mod grade_or_drive;
mod guide;
mod id;
mod inertial_reaction;
mod load_crosstalk;
mod load_sensitivity;
mod once_a_turn;
mod relaxation_length;
mod rolling_resistance;
mod run_out;
mod slip_hysteresis;
mod speed_delay;
mod speed_sensitivity;
mod structural_resonance;
mod surface_patch;
mod thermal_fade;
mod vehicle_inertia;
mod vehicle_speed_delay;
mod wear_drift;
mod wheel_inertia;
mod wheel_speed_delay;
mod zero_drift;

pub use guide::{Alias, Compensation, Example, Guide, Kind, Memory, Sign};
pub use id::Id;

pub use crate::balance::Balance;
pub use crate::context::{Before, Context};
use crate::number::Number;
use crate::series::Series;

/// Where in the chain from speeds to reading a mechanism acts; stages run in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Wheel speed and radius, before slip is formed.
    Kinematics,
    /// The slip that the tyre feels.
    Slip,
    /// The shape of the friction law.
    Law,
    /// The friction coefficient, by a factor.
    Friction,
    /// The force in the contact.
    Contact,
    /// What the load cell adds to that force.
    Reading,
    /// What the load cell's structure does to the reading.
    Structure,
    /// What its filter does.
    Filter,
    /// How late its line is.
    Line,
    /// Where its input clips.
    Input,
    /// Forces on the vehicle.
    Vehicle,
    /// Torques on the wheel.
    Wheel,
}

/// A speed that may be late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Wheel speed.
    Wheel,
    /// Vehicle speed.
    Vehicle,
}

/// What the picture of an effect on wheel or vehicle is drawn over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// Time in s: the effect has a memory.
    Time,
    /// Vehicle speed in m/s.
    VehicleSpeed,
    /// Wheel speed in rad/s.
    WheelSpeed,
    /// Normal force in N.
    NormalForce,
    /// Drag reading in N.
    Drag,
    /// Vehicle acceleration in m/s².
    VehicleAcceleration,
    /// Wheel acceleration in rad/s².
    WheelAcceleration,
}

/// A parameter of a mechanism: bounds of what is physically plausible.
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Name, as in `model.toml`.
    pub name: String,
    /// Unit in ASCII.
    pub unit: &'static str,
    /// Smallest plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
}

impl Parameter {
    /// A parameter with its unit and bounds.
    #[must_use]
    pub fn new(name: &str, unit: &'static str, low: f64, high: f64) -> Self {
        Self {
            name: name.to_owned(),
            unit,
            low,
            high,
        }
    }
}

/// A figure of the result, by the contract's definition.
#[derive(Clone, Debug)]
pub struct Reported<T> {
    /// Name by the contract.
    pub name: &'static str,
    /// Unit in ASCII.
    pub unit: &'static str,
    /// Value.
    pub value: T,
}

/// What the base model leaves over on one run: a search can look at it to find where to start.
#[derive(Clone, Debug, Default)]
pub struct Residuals {
    /// Reading predicted by the model so far in N.
    pub predicted: Vec<f64>,
    /// Measured minus predicted in N.
    pub residual: Vec<f64>,
    /// Inverse noise variance in 1/N² (zero where the sample is not used).
    pub weight: Vec<f64>,
}

/// The friction law: mu = peak (2 + b) x/(1 + b x + x²), x = (slip/critical)^p, with its own b (and p) on the
/// falling side. b = 0, p = 1 is the two-parameter law mu = 2 peak x/(1 + x²).
#[derive(Clone, Copy, Debug)]
pub struct Law<T> {
    /// Peak friction.
    pub peak: T,
    /// Slip at the peak.
    pub critical: T,
    /// b on the rising side, as ln(1 + b/2).
    pub rise: Option<T>,
    /// b on the falling side, as ln(1 + b/2), and ln p there.
    pub fall: Option<(T, Option<T>)>,
}

impl<T: Number> Law<T> {
    /// The two-parameter law.
    #[must_use]
    pub fn rudd(peak: T, critical: T) -> Self {
        Self {
            peak,
            critical,
            rise: None,
            fall: None,
        }
    }

    /// Friction at a slip over the slip at the peak; odd in slip.
    #[inline]
    #[must_use]
    pub fn friction(&self, relative_slip: T) -> T {
        self.peak * self.shape(relative_slip)
    }

    /// Friction over peak friction.
    #[must_use]
    pub fn shape(&self, x: T) -> T {
        let magnitude = x.abs();
        let falling = magnitude.value() > 1.0;
        let w = match (falling, self.rise, self.fall) {
            (false, Some(rise), _) => rational(magnitude, rise),
            (true, _, Some((fall, None))) => rational(magnitude, fall),
            (true, _, Some((fall, Some(stretch)))) => {
                rational((magnitude.ln() * stretch.exp()).exp(), fall)
            }
            _ => return x * 2.0 / (x.squared() + 1.0),
        };
        if x.value() < 0.0 { -w } else { w }
    }
}

fn rational<T: Number>(x: T, log_b: T) -> T {
    let b = (log_b.exp() - 1.0) * 2.0;
    (b + 2.0) * x / (b * x + x.squared() + 1.0)
}

/// The quantities of one run that mechanisms change, in chain order.
#[derive(Clone, Debug)]
pub struct State<T> {
    /// Wheel speed in rad/s.
    pub omega: Vec<T>,
    /// By what the wheel speed as read is off beyond the smoothed one, in rad/s, where it is.
    pub read_off: Option<Vec<T>>,
    /// Vehicle speed in m/s.
    pub speed: Vec<T>,
    /// Normal force in N.
    pub load: Vec<T>,
    /// Free-rolling radius in m where it is not the rig file's.
    pub radius: Option<Vec<T>>,
    /// Slip.
    pub slip: Vec<T>,
    /// Friction law.
    pub law: Law<T>,
    /// Factor on the slip at the peak, where it varies.
    pub critical_factor: Option<Vec<T>>,
    /// Factor on the peak friction, where it varies.
    pub peak_factor: Option<Vec<T>>,
    /// Friction coefficient.
    pub friction: Vec<T>,
    /// Force: in the contact, then as read.
    pub force: Vec<T>,
    /// Contact force as it was before the measuring chain (kept from stage `Contact`).
    pub contact: Option<Vec<T>>,
    /// Relative change of inertia (wheel) or mass (vehicle).
    pub inertia_change: T,
    /// Relative error of the drag channel's scale.
    pub gain_change: T,
    /// Force on the vehicle (N) or torque on the wheel (N m) beside the base model's.
    pub opposing: Vec<T>,
    /// Brake torque in N m.
    pub brake: Vec<T>,
    /// Moment of the rolling resistance on the wheel in N m, where there is one.
    pub rolling_moment: Option<Vec<T>>,
}

impl<T: Number> State<T> {
    /// A state with nothing in it.
    #[must_use]
    pub fn empty() -> Self {
        let zero = T::constant(0.0);
        Self {
            omega: Vec::new(),
            read_off: None,
            speed: Vec::new(),
            load: Vec::new(),
            radius: None,
            slip: Vec::new(),
            law: Law::rudd(zero, zero),
            critical_factor: None,
            peak_factor: None,
            friction: Vec::new(),
            force: Vec::new(),
            contact: None,
            inertia_change: zero,
            gain_change: zero,
            opposing: Vec::new(),
            brake: Vec::new(),
            rolling_moment: None,
        }
    }
}

impl<T: Number> State<T> {
    /// Multiplies the peak friction by a factor a sample.
    pub fn scale_friction(&mut self, factor: &[T]) {
        multiply(&mut self.peak_factor, factor);
    }
    /// Multiplies the slip at the peak by a factor a sample.
    pub fn scale_critical(&mut self, factor: &[T]) {
        multiply(&mut self.critical_factor, factor);
    }
}

fn multiply<T: Number>(into: &mut Option<Vec<T>>, factor: &[T]) {
    match into {
        Some(present) => {
            for (a, b) in present.iter_mut().zip(factor) {
                *a = *a * *b;
            }
        }
        None => *into = Some(factor.to_vec()),
    }
}

/// What a mechanism says of itself.
pub trait Describe: Send + Sync {
    /// Its id in the vocabulary.
    fn id(&self) -> Id;
    /// Which of its forms this is; empty where there is one only.
    fn form(&self) -> &'static str {
        ""
    }
    /// Where it acts.
    fn stage(&self) -> Stage;
    /// A second stage that it acts at: a scale of the drag is wrong on vehicle and wheel alike.
    fn acts_also_at(&self) -> Option<Stage> {
        None
    }
    /// Whether it acts at this stage.
    fn acts_at(&self, stage: Stage) -> bool {
        self.stage() == stage || self.acts_also_at() == Some(stage)
    }
    /// Whether it works through the force that is predicted, and not on the speeds or on another balance.
    fn through_force(&self) -> bool {
        self.id().balance() == Balance::Tyre
    }
    /// Channel of a recording that shows it.
    fn channel(&self) -> &'static str {
        self.id().balance().channel()
    }
    /// The speed whose lateness it is: found by the timing of the channels, not among the other mechanisms.
    fn late(&self) -> Option<Speed> {
        None
    }
    /// How long it remembers with these parameters, in s, where it has a memory: one that the measuring chain has, too.
    fn memory_s(&self, _parameters: &[f64], _context: &Context) -> Option<f64> {
        None
    }
    /// What the picture of its effect is drawn over, where wheel or vehicle lack it.
    fn drawn_over(&self) -> Against {
        Against::Time
    }
    /// Its parameters for this campaign.
    fn parameters(&self, context: &Context) -> Vec<Parameter>;
    /// Where a search for its parameters may start.
    fn starts(&self, context: &Context, series: &[Series], evidence: &[Residuals])
    -> Vec<Vec<f64>>;
    /// Its equation.
    fn equation(&self) -> &'static str;
    /// One sentence for an engineer, with the figure and its unit.
    fn statement(&self, reported: &[Reported<f64>], parameters: &[f64]) -> String;
    /// Its section of the field guide, the same for all its forms.
    fn guide(&self) -> Guide;
    /// Which parameter is its size, where one is: at its null the mechanism is absent.
    fn amplitude(&self) -> Option<usize> {
        Some(0)
    }
    /// Whether these parameters are its own, and not at a limit where its form is another's.
    fn owns(&self, _parameters: &[f64]) -> bool {
        true
    }
    /// Whether it is rare beside what recordings hardly tell it from.
    fn rare(&self) -> bool {
        false
    }
    /// Whether it goes by the order of the campaign's runs: a recording whose place in it is not known is predicted
    /// without it.
    fn by_order(&self, _context: &Context) -> bool {
        false
    }
    /// Whether the figures of this form can be carried over to a run it was not fitted to.
    fn predicts(&self) -> bool {
        true
    }
}

/// What a mechanism does, in plain or dual numbers.
pub trait Mechanism<T: Number>: Describe {
    /// Changes the state of one run.
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>);
    /// The contract's figures from the parameters.
    fn report(
        &self,
        p: &[T],
        law: &Law<T>,
        context: &Context,
        series: &[Series],
    ) -> Vec<Reported<T>>;
}

/// All mechanisms in all their forms. The order is part of no file format.
#[must_use]
pub fn catalogue<T: Number>() -> Vec<Box<dyn Mechanism<T>>> {
    let mut all: Vec<Box<dyn Mechanism<T>>> = vec![
        Box::new(load_crosstalk::LoadCrosstalk),
        Box::new(inertial_reaction::InertialReaction),
        Box::new(force_delay::ForceDelay),
        Box::new(force_lag::ForceLag),
        Box::new(load_sensitivity::LoadSensitivity {
            with_stiffness: false,
        }),
        Box::new(load_sensitivity::LoadSensitivity {
            with_stiffness: true,
        }),
        Box::new(slip_hysteresis::SlipHysteresis),
        Box::new(rolling_resistance::RollingResistance { growing: false }),
        Box::new(rolling_resistance::RollingResistance { growing: true }),
        Box::new(surface_patch::SurfacePatch { patches: 1 }),
        Box::new(surface_patch::SurfacePatch { patches: 2 }),
        Box::new(force_gain::ForceGain),
        Box::new(aero_drag::AeroDrag),
        Box::new(grade_or_drive::GradeOrDrive),
        Box::new(vehicle_inertia::VehicleInertia),
        Box::new(brake_fade::BrakeFade),
        Box::new(brake_lag::BrakeLag),
        Box::new(wheel_inertia::WheelInertia),
    ];
    for form in structural_resonance::FORMS {
        all.push(Box::new(structural_resonance::StructuralResonance { form }));
    }
    for form in force_saturation::FORMS {
        all.push(Box::new(force_saturation::ForceSaturation { form }));
    }
    for form in curve_shape::FORMS {
        all.push(Box::new(curve_shape::CurveShape { form }));
    }
    for form in speed_sensitivity::FORMS {
        all.push(Box::new(speed_sensitivity::SpeedSensitivity { form }));
    }
    for form in thermal_fade::FORMS {
        all.push(Box::new(thermal_fade::ThermalFade { form }));
    }
    for form in relaxation_length::FORMS {
        all.push(Box::new(relaxation_length::RelaxationLength { form }));
    }
    for form in effective_radius::FORMS {
        all.push(Box::new(effective_radius::EffectiveRadius { form }));
    }
    for form in wear_drift::FORMS {
        all.push(Box::new(wear_drift::WearDrift { form }));
    }
    for form in zero_drift::FORMS {
        all.push(Box::new(zero_drift::ZeroDrift { form }));
    }
    for form in once_a_turn::FORMS {
        let of = run_out::Of::Drag;
        all.push(Box::new(run_out::RunOut { form, of }));
        if form.orders == 1 {
            let of = run_out::Of::Radius;
            all.push(Box::new(run_out::RunOut { form, of }));
        }
    }
    for form in once_a_turn::FORMS {
        all.push(Box::new(encoder_ripple::EncoderRipple { form }));
    }
    for form in bearing_drag::FORMS {
        all.push(Box::new(bearing_drag::BearingDrag { form }));
    }
    all.push(Box::new(vehicle_speed_delay::VehicleSpeedDelay));
    all.push(Box::new(wheel_speed_delay::WheelSpeedDelay));
    all
}
