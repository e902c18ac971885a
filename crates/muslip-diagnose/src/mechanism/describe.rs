//! What a mechanism says of itself and what it does.

use super::guide::{Guide, Memory};
use super::id::Id;
use super::state::{Law, State};
use crate::audit::Word;
use crate::balance::Balance;
use crate::context::Context;
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

impl<T> Reported<T> {
    /// A figure with its unit.
    #[must_use]
    pub fn new(name: &'static str, unit: &'static str, value: T) -> Self {
        Self { name, unit, value }
    }
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

/// What a search for a mechanism's parameters can go by.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    /// What is common to all runs.
    pub context: &'a Context,
    /// The runs.
    pub series: &'a [Series],
    /// What the base model leaves over on each of them.
    pub residuals: &'a [Residuals],
}

/// What a mechanism's figures are formed with, beside its own parameters.
#[derive(Clone, Copy, Debug)]
pub struct Fitted<'a, T> {
    /// The base curve that was fitted along with it.
    pub law: &'a Law<T>,
    /// What is common to all runs.
    pub context: &'a Context,
    /// The runs that it was fitted to.
    pub series: &'a [Series],
}

/// What the audit shows of a mechanism without a tyre law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Audited {
    /// The brake is read before its torque acts.
    EarlyBrake,
    /// The drag rings.
    Ring,
}

/// What is the same for a form of a mechanism in every campaign.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Its id in the vocabulary.
    pub id: Id,
    /// Which of its forms this is; empty where there is one only.
    pub form: &'static str,
    /// Where it acts.
    pub stage: Stage,
    /// A second stage that it acts at: a scale of the drag is wrong on vehicle and wheel alike.
    pub acts_also_at: Option<Stage>,
    /// Its equation.
    pub equation: &'static str,
    /// Whether the drag that is predicted depends on it: by the force, or by a slip that is wrong in all runs alike.
    pub through_force: bool,
    /// Channel of a recording that shows it.
    pub channel: &'static str,
    /// What that channel does, in the word of `chain`: a name that is sure of it has its first figure told there, too.
    pub finding: Option<Word>,
    /// The speed whose lateness it is: found by the timing of the channels, not among the other mechanisms.
    pub late: Option<Speed>,
    /// What the audit has that shows it where the decision does not name it: a tyre law, fed with the speeds' noise, is no
    /// witness of what is faster.
    pub audited: Option<Audited>,
    /// What the picture of its effect is drawn over, where wheel or vehicle lack it.
    pub drawn_over: Against,
    /// Which parameter is its size, where one is: at its null the mechanism is absent.
    pub amplitude: Option<usize>,
    /// Whether it scales a level that is recorded, which is made of its slow part.
    pub scales_level: bool,
    /// Whether this form is of what the mechanism is mistaken for, and never named: where it says clearly more, the mechanism
    /// is refuted.
    pub counter_form: bool,
    /// Whether it is a filter: linear in the force, or the slip, that passes it, and adds nothing of its own.
    pub filters: bool,
    /// Whether what enters it has all that is fast in the slip, the wheel speed's noise too, and not only what the smoother
    /// leaves.
    pub of_fast_force: bool,
    /// Whether a measuring chain leaves what looks like it: kernels that differ, slip's noise that flattens the curve, the
    /// pitch of a ring.
    pub fed_by_chain: bool,
    /// Whether what the load is read off by looks like it: it has to predict the drag clearly.
    pub like_noise_of_load: bool,
    /// Whether it is another curve of friction over slip, as any free dependence along the slip is.
    pub another_curve: bool,
    /// Whether the noise has a part of each run that is like it, an offset of the slip or of the drag: only where runs are
    /// weighed against each other does it show that it is the same in all.
    pub like_noise_of_run: bool,
}

impl Facts {
    /// What every mechanism must say; the rest as it is for most, by the balance that the mechanism breaks.
    #[must_use]
    pub fn of(id: Id, stage: Stage, equation: &'static str) -> Self {
        let balance = id.balance();
        Self {
            id,
            form: "",
            stage,
            acts_also_at: None,
            equation,
            through_force: balance == Balance::Tyre,
            channel: balance.channel(),
            finding: None,
            late: None,
            audited: None,
            drawn_over: Against::Time,
            amplitude: Some(0),
            counter_form: false,
            scales_level: false,
            filters: false,
            of_fast_force: false,
            fed_by_chain: false,
            like_noise_of_load: false,
            another_curve: false,
            like_noise_of_run: false,
        }
    }
}

/// What a mechanism says of itself.
pub trait Describe: Send + Sync {
    /// What is the same in every campaign.
    fn facts(&self) -> Facts;
    /// Its id in the vocabulary.
    fn id(&self) -> Id {
        self.facts().id
    }
    /// Which of its forms this is; empty where there is one only.
    fn form(&self) -> &'static str {
        self.facts().form
    }
    /// Where it acts first.
    fn stage(&self) -> Stage {
        self.facts().stage
    }
    /// Whether it acts at this stage.
    fn acts_at(&self, stage: Stage) -> bool {
        let facts = self.facts();
        facts.stage == stage || facts.acts_also_at == Some(stage)
    }
    /// Its equation.
    fn equation(&self) -> &'static str {
        self.facts().equation
    }
    /// Its parameters for this campaign.
    fn parameters(&self, context: &Context) -> Vec<Parameter>;
    /// Where a search for its parameters may start: by default where nothing is there of it.
    fn starts(&self, search: &Search<'_>) -> Vec<Vec<f64>> {
        vec![vec![0.0; self.parameters(search.context).len()]]
    }
    /// One sentence for an engineer, with the figure and its unit.
    fn statement(&self, reported: &[Reported<f64>], parameters: &[f64]) -> String;
    /// Its section of the field guide, the same for all its forms.
    fn guide(&self) -> Guide;
    /// How long it remembers with these parameters, in s, where it has a memory: one that the measuring chain has, too.
    fn memory_s(&self, _parameters: &[f64], _context: &Context) -> Option<f64> {
        None
    }
    /// Whether a measuring chain leaves what looks like it: its descriptor says so, or it remembers no longer than a chain
    /// does.
    fn fed_by_chain(&self) -> bool {
        self.facts().fed_by_chain || self.guide().memory == Memory::Kernel
    }
    /// Whether it rings at these parameters, longer than any filter of a measuring chain does.
    fn rings(&self, _parameters: &[f64]) -> bool {
        false
    }
    /// Whether these parameters are of what begins where the recordings do: while the brake sets in a measuring chain leaves
    /// anything.
    fn begins_with_recordings(&self, _parameters: &[f64]) -> bool {
        false
    }
    /// Whether these parameters are its own, and not at a limit where its form is another's.
    fn owns(&self, _parameters: &[f64], _context: &Context) -> bool {
        true
    }
    /// Whether its size, where it has one, is smaller than the largest plausible: what asks for all of that is something else.
    fn is_plausible(&self, parameters: &[f64], context: &Context) -> bool {
        self.facts().amplitude.is_none_or(|size| {
            let bounds = &self.parameters(context)[size];
            let (value, highest) = if parameters[size] < 0.0 {
                (-parameters[size], -bounds.low)
            } else {
                (parameters[size], bounds.high)
            };
            below_limit(value, highest)
        })
    }
    /// Another mechanism that these parameters say as well, and that claims less.
    fn says_as_well(&self, _parameters: &[f64], _context: &Context) -> Option<Id> {
        None
    }
    /// Parameters that no figure tells and are nothing at zero: by what it varies about the figure, which is its mean.
    fn by_no_figure(&self) -> &'static [usize] {
        &[]
    }
    /// Whether it is rare beside what these recordings hardly tell it from.
    fn is_rare(&self, _context: &Context) -> bool {
        false
    }
    /// Another mechanism, rare beside it, that nothing in these recordings tells from it.
    fn rare_double(&self, _series: &[Series], _context: &Context) -> Option<Id> {
        None
    }
    /// Whether it goes by the order of the campaign's runs: a recording whose place in it is not known is predicted
    /// without it.
    fn by_order(&self, _context: &Context) -> bool {
        false
    }
}

/// Share of a limit within which a parameter is held there by it.
const AT_LIMIT: f64 = 0.01;

/// Whether a parameter is above its lowest value, and not held there by its limit.
pub fn above_limit(parameter: f64, lowest: f64) -> bool {
    parameter > (1.0 + AT_LIMIT) * lowest
}

/// Whether a parameter is below its highest value, and not held there by its limit.
pub fn below_limit(parameter: f64, highest: f64) -> bool {
    parameter < (1.0 - AT_LIMIT) * highest
}

/// What a mechanism does, in plain or dual numbers.
pub trait Mechanism<T: Number>: Describe {
    /// Changes the state of one run.
    fn apply(&self, p: &[T], series: &Series, context: &Context, state: &mut State<T>);
    /// The contract's figures from the parameters.
    fn report(&self, p: &[T], fitted: &Fitted<'_, T>) -> Vec<Reported<T>>;
}
