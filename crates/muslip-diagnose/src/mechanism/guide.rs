//! What a mechanism says of itself to people and to what decides: the field guide's section, one type a mechanism.
//!
//! Every field is demanded, so that a mechanism cannot be added without any of it. What two mechanisms are mistaken
//! for is said once, in the file of either; [`Id::aliases`] finds it from both.

use super::{Balance, Context, Id, Mechanism, catalogue};

/// Runs that tell several pairs apart, each told once.
pub mod runs {
    /// Brake lifted.
    pub const BRAKE_LIFTED: &str = "Spin the lifted wheel up and apply the brake in steps, cold and hot: inertia and bearing show in the coast-down, lag and fade in the stops.";
    /// Rests.
    pub const RESTS: &str = "Repeat the same ramp after rests of 0, 30 and 120 s: heat recovers, wear does not, speed and shape do not care.";
    /// Ramp speeds.
    pub const RAMP_SPEEDS: &str = "Repeat the same brake ramp at a third and at three times the speed: a lag of the channel keeps its time, a relaxation length keeps its distance.";
    /// Stop lifted.
    pub const STOP_LIFTED: &str = "Spin the lifted wheel up and stop it with the brake: a reaction shows without any tyre force.";
    /// Known weight.
    pub const KNOWN_WEIGHT: &str = "Hang a known weight on the load cell; or ballast the vehicle by a known mass and repeat the stop.";
    /// Coast down.
    pub const COAST_DOWN: &str =
        "Coast down unbraked from the highest speed, in both directions of the track.";
    /// Tap standing.
    pub const TAP_STANDING: &str = "Tap the load cell with the wheel standing, then repeat the ramp at another speed: a resonance keeps its frequency.";
    /// Free speeds.
    pub const FREE_SPEEDS: &str = "Speed up and slow down in a freely rolling wheel, brake released: a late speed shows as slip in proportion to the acceleration, a force that is late shows nothing.";
    /// Track again.
    pub const TRACK_AGAIN: &str = "Run the same track again, entering it ten metres later: a patch stays where it is on the track.";
    /// Two speeds.
    pub const TWO_SPEEDS: &str = "Repeat the ramp at two speeds a factor of three apart, at one load: shape follows slip, speed sensitivity follows sliding speed.";
    /// Two loads.
    pub const TWO_LOADS: &str = "Repeat the ramp at one speed under two loads: load sensitivity changes the peak, speed sensitivity does not.";
    /// Ramp rates.
    pub const RAMP_RATES: &str = "Repeat the ramp at a third and at three times the pressure rate: what comes late opens a wider loop at the faster rate, a hysteresis keeps its loop.";
    /// Zero before and after.
    pub const ZERO_BEFORE_AND_AFTER: &str = "Read the zero before and after the run, the wheel lifted and standing: only a drift has moved it.";
    /// First run again.
    pub const FIRST_RUN_AGAIN: &str = "Repeat the first run at the end, and read the zero with the wheel lifted before and after.";
    /// Load steps.
    pub const LOAD_STEPS: &str = "Load the standing wheel in steps, brake released: crosstalk moves the reading with the load, nothing else does.";
    /// Tap impulse.
    pub const TAP_IMPULSE: &str = "Tap the load cell (an impulse, wheel standing): a delay keeps the pulse's shape, a filter widens it, a resonance rings.";
    /// Tap brake.
    pub const TAP_BRAKE: &str = "Tap the brake of the wheel at a held vehicle speed, then change the vehicle speed with the wheel rolling freely: each delay shows in the one that moves its own channel.";
    /// Roll and drive.
    pub const ROLL_AND_DRIVE: &str = "Roll unbraked and then drive the wheel slightly: rolling resistance stays, a wrong radius changes its sign with slip.";
}

/// Where a mechanism sits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The channels' own timing: not physics by the contract.
    Chain,
    /// The tyre and the road.
    Tyre,
    /// The load cell and what it is mounted on.
    LoadCell,
    /// The wheel, its brake and its speed sensor.
    Wheel,
    /// The vehicle.
    Vehicle,
}

impl Kind {
    /// In words.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Chain => "measuring chain",
            Self::Tyre => "tyre",
            Self::LoadCell => "load cell",
            Self::Wheel => "wheel",
            Self::Vehicle => "vehicle",
        }
    }
}

/// What of the past acts now: what remembers is fed by other things that remember, and dearer to name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// Only the present.
    None,
    /// The last second or less: a delay, a filter, a relaxation, a loop.
    Kernel,
    /// The run so far: heat.
    Run,
    /// All runs so far: wear, a zero that drifts.
    Campaign,
}

impl Memory {
    /// In words.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Kernel => "the last second or less",
            Self::Run => "the run so far",
            Self::Campaign => "the runs so far",
        }
    }
}

/// The sign that the size of the effect may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Only as the contract counts it: no negative lag, no air that drives.
    Positive,
    /// Either.
    Either,
}

impl Sign {
    /// In words.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Positive => "positive only",
            Self::Either => "either",
        }
    }
}

/// Whether `muslip estimate --model` compensates a mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compensation {
    /// Yes: how.
    By(&'static str),
    /// No: why not.
    Not(&'static str),
}

impl Compensation {
    /// What acts on vehicle or wheel.
    pub const NOT_OF_THE_TYRE: Self =
        Self::Not("not of the tyre balance: it does not touch the curve");
    /// What could be compensated but is not.
    pub const NOT_IN_THE_FILTER: Self = Self::Not("the filter has no compensation for it");
}

/// Two mechanisms that can be mistaken for each other, said by one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Alias {
    /// The other one.
    pub with: Id,
    /// What is alike, read from either side.
    pub why: &'static str,
    /// The run that tells them apart.
    pub run: &'static str,
}

/// A size of the effect that a picture shows, on the guide's rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Example {
    /// The form.
    pub form: &'static str,
    /// Its parameters.
    pub parameters: &'static [f64],
}

impl Example {
    /// This form with these parameters.
    #[must_use]
    pub const fn of(form: &'static str, parameters: &'static [f64]) -> Self {
        Self { form, parameters }
    }
}

/// The field guide's section of a mechanism, beside what [`Describe`](super::Describe) says already.
#[derive(Clone, Copy, Debug)]
pub struct Guide {
    /// Its physics in two sentences.
    pub physics: &'static str,
    /// Where it sits.
    pub kind: Kind,
    /// All balances in whose residuals it shows.
    pub touches: &'static [Balance],
    /// What of the past acts now.
    pub memory: Memory,
    /// The sign that its size may have.
    pub sign: Sign,
    /// What it is mistaken for, where the other one does not say so.
    pub aliases: &'static [Alias],
    /// The smallest effect that matters, in words, ...
    pub smallest: &'static str,
    /// ... and as the size of the contract's first figure, in its unit.
    pub smallest_size: fn(&Context) -> f64,
    /// Whether the estimator compensates it.
    pub compensation: Compensation,
    /// How it is carried to a run that it was not fitted to: phase, order of runs, memory.
    pub carried: &'static str,
    /// What the guide's picture shows.
    pub example: Example,
}

impl Id {
    /// Its entries in the catalogue, one a form.
    #[must_use]
    pub fn entries(self) -> Vec<Box<dyn Mechanism<f64>>> {
        let mut all = catalogue::<f64>();
        all.retain(|entry| entry.id() == self);
        all
    }

    /// Its section of the guide; `None` for an id without an entry, of which there is none.
    #[must_use]
    pub fn guide(self) -> Option<Guide> {
        self.entries().first().map(|entry| entry.guide())
    }

    /// What it is mistaken for, whichever of the two says so.
    #[must_use]
    pub fn aliases(self) -> Vec<Alias> {
        let mut found = Vec::new();
        for &other in Self::ALL {
            let said = other.guide().map_or(&[][..], |guide| guide.aliases);
            if other == self {
                found.extend_from_slice(said);
            } else {
                let of_self = said.iter().filter(|alias| alias.with == self);
                found.extend(of_self.map(|alias| Alias {
                    with: other,
                    ..*alias
                }));
            }
        }
        found.sort_by_key(|alias| alias.with);
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a descriptor must say, field by field: adding a field to [`Guide`] breaks this until it is judged here.
    #[test]
    fn every_descriptor_says_all_that_a_descriptor_must_say() {
        for entry in catalogue::<f64>() {
            let id = entry.id();
            let word = id.as_str();
            let Guide {
                physics,
                kind: _,
                touches,
                memory: _,
                sign: _,
                aliases,
                smallest,
                smallest_size,
                compensation: Compensation::By(reason) | Compensation::Not(reason),
                carried,
                example,
            } = entry.guide();
            let sentences = physics.matches(". ").count() + 1;
            assert_eq!(sentences, 2, "{word}: physics in two sentences");
            assert!(physics.ends_with('.'), "{word}");
            assert!(touches.contains(&id.balance()), "{word}: {touches:?}");
            for text in [smallest, reason, carried, entry.equation()] {
                assert!(text.len() >= 5, "{word}: {text:?}");
            }
            let size = smallest_size(&context());
            assert!(size > 0.0 && size.is_finite(), "{word}: {size}");
            for alias in aliases {
                assert!(alias.why.ends_with('.') && alias.why.len() > 20, "{word}");
                assert!(alias.run.ends_with('.') && alias.run.len() > 40, "{word}");
            }
            let shown = id.entries().into_iter().find(|e| e.form() == example.form);
            let shown = shown.unwrap_or_else(|| panic!("{word} has no form {:?}", example.form));
            let parameters = shown.parameters(&context());
            assert_eq!(parameters.len(), example.parameters.len(), "{word}");
            for (parameter, value) in parameters.iter().zip(example.parameters) {
                assert!(
                    (parameter.low..=parameter.high).contains(value),
                    "{word}: {} = {value}",
                    parameter.name
                );
            }
        }
    }

    fn context() -> Context {
        Context {
            radius: 0.31,
            inertia: 1.25,
            mass: 420.0,
            nominal: [0.85, 0.14],
            mean_load: 4000.0,
            mean_speed: 15.0,
            max_speed: 20.0,
            mean_wheel_speed: 45.0,
            mean_power: 5e3,
            total_work: 1e5,
            mean_brake_power: 1e4,
            dt: 0.002,
            duration: 4.0,
            total_time: 4.0,
            runs: 1,
            distance: 60.0,
            drag_sigma: 30.0,
            max_drag: 3500.0,
            ..Context::default()
        }
    }

    #[test]
    fn what_asks_for_the_most_that_is_plausible_is_no_plausible_size() {
        let context = context();
        let mut tried = 0;
        for mechanism in catalogue::<f64>() {
            let Some(size) = mechanism.facts().amplitude else {
                continue;
            };
            let all = mechanism.parameters(&context);
            let at = |share: f64| {
                let mut p: Vec<f64> = all.iter().map(|p| 0.5 * (p.low + p.high)).collect();
                let bound = if share < 0.0 {
                    -all[size].low
                } else {
                    all[size].high
                };
                p[size] = share * bound;
                mechanism.is_plausible(&p, &context)
            };
            assert!(at(0.5) && !at(1.0), "{:?}", mechanism.id());
            if all[size].low < 0.0 {
                assert!(at(-0.5) && !at(-1.0), "{:?}", mechanism.id());
            }
            tried += 1;
        }
        assert!(tried > 20, "{tried}");
    }

    #[test]
    fn every_id_has_an_entry_and_every_form_the_same_guide() {
        for &id in Id::ALL {
            let entries = id.entries();
            assert!(!entries.is_empty(), "{}", id.as_str());
            for entry in &entries {
                assert_eq!(entry.guide().physics, entries[0].guide().physics);
            }
        }
    }

    #[test]
    fn what_is_mistaken_for_another_is_so_from_both_sides_and_said_once() {
        for &id in Id::ALL {
            let aliases = id.aliases();
            for (place, alias) in aliases.iter().enumerate() {
                assert_ne!(alias.with, id);
                let twice = aliases[place + 1..].iter().any(|a| a.with == alias.with);
                assert!(!twice, "{} and {}", id.as_str(), alias.with.as_str());
                let back = alias.with.aliases();
                let back = back.iter().find(|a| a.with == id).unwrap();
                assert_eq!((back.why, back.run), (alias.why, alias.run));
            }
        }
    }

    #[test]
    fn nothing_stands_alone() {
        for &id in Id::ALL {
            assert!(!id.aliases().is_empty(), "{}", id.as_str());
        }
    }

    #[test]
    fn the_chain_is_the_contract_s_four_names() {
        let chain: Vec<&str> = Id::ALL
            .iter()
            .filter(|id| id.guide().is_some_and(|guide| guide.kind == Kind::Chain))
            .map(|id| id.as_str())
            .collect();
        let expected = [
            "force_delay",
            "force_lag",
            "vehicle_speed_delay",
            "wheel_speed_delay",
        ];
        assert_eq!(chain, expected);
    }
}
