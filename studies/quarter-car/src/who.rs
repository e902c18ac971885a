//! The brake controllers by the names of the tables, and their settings.

use super::banked::Banked;
use super::drivers::{LockedWheel, PerfectState};
use super::error::SetupError;
use super::filtered::Filtered;
use super::rig_driven::{RigDriven, Setpoint};
use super::run::Driver;
use super::scenario::{Road, Scenario};

/// What the bank is told of the mass, 1 sigma in kg: 5 %.
pub const BANK_MASS_STD_KG: f64 = 22.5;
/// The same where the mass is uniform within 30 %, in kg.
const WIDE_MASS_STD_KG: f64 = 78.0;

/// A brake controller of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// (a)
    Perfect,
    /// (b)
    Tutorial,
    /// (c)
    Tuned,
    /// (d)
    Locked,
    /// (f) four channels, peak sought.
    RigSought,
    /// (f) four channels, slip 0.12.
    RigFixed,
    /// (f) wheel speed alone, bank of roads.
    Bank,
    /// The same, told that the mass is known to 30 % only.
    BankWide,
}

impl Who {
    /// Letter of the row.
    pub fn letter(self) -> &'static str {
        match self {
            Self::Perfect => "(a)",
            Self::Tutorial => "(b)",
            Self::Tuned => "(c)",
            Self::Locked => "(d)",
            Self::RigSought | Self::RigFixed | Self::Bank | Self::BankWide => "(f)",
        }
    }

    /// What it is.
    pub fn name(self) -> &'static str {
        match self {
            Self::Perfect => "perfect state",
            Self::Tutorial => "tutorial's filter",
            Self::Tuned => "tuned filter, road known",
            Self::Locked => "locked wheel",
            Self::RigSought => "four channels, peak sought",
            Self::RigFixed => "four channels, slip held at 0.12",
            Self::Bank => "wheel speed alone, bank of roads",
            Self::BankWide => "the same bank, told mass ±30 %",
        }
    }

    pub(super) fn driver(self, scenario: &Scenario) -> Result<Box<dyn Driver>, SetupError> {
        Ok(match self {
            Self::Perfect => Box::new(PerfectState::new(scenario)?),
            Self::Tutorial => Box::new(Filtered::tutorial(scenario)?),
            Self::Tuned => Box::new(Filtered::tuned(scenario)?),
            Self::Locked => Box::new(LockedWheel),
            Self::RigSought => Box::new(RigDriven::new(scenario, Setpoint::Sought)?),
            Self::RigFixed => Box::new(RigDriven::new(scenario, Setpoint::Fixed)?),
            Self::Bank => Box::new(Banked::new(scenario, BANK_MASS_STD_KG)?),
            Self::BankWide => Box::new(Banked::new(scenario, WIDE_MASS_STD_KG)?),
        })
    }

    /// The bar on the median of a stop as nominal on a road, where there is one.
    pub(super) fn bar(self, road: &Road) -> Option<f64> {
        let one_surface = road.patches.len() == 1;
        match self {
            Self::Tuned if matches!(road.name, "dry" | "wet") => Some(1.05),
            Self::RigSought if one_surface => Some(1.10),
            Self::RigSought => Some(1.15),
            _ => None,
        }
    }
}
