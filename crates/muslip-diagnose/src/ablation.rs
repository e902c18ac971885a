//! Parts of the argument that can be left out, to measure what each is worth.

/// A part of the argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The free dependence that stands for what no mechanism of the vocabulary accounts for.
    Remainder,
    /// What keeps the noise of the inputs, slip above all, from passing for dynamics.
    ErrorsInVariables,
    /// The common smoothing of the channels before anything is modelled.
    Prefilter,
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 3] = [Self::Remainder, Self::ErrorsInVariables, Self::Prefilter];

    /// The word by which a part is ordered.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Remainder => "remainder",
            Self::ErrorsInVariables => "errors-in-variables",
            Self::Prefilter => "prefilter",
        }
    }
}

/// What a diagnosis is made without; nothing is left out by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ablation {
    /// No remainder.
    pub remainder: bool,
    /// No errors-in-variables correction.
    pub errors_in_variables: bool,
    /// No common prefilter.
    pub prefilter: bool,
}

impl Ablation {
    /// Parts that the engine can do without as it stands; the others are refused rather than ignored.
    pub const HONOURED: &[Part] = &Part::ALL;

    /// The same without one more part; `None` where the engine cannot do without it.
    #[must_use]
    pub fn without(mut self, part: Part) -> Option<Self> {
        if !Self::HONOURED.contains(&part) {
            return None;
        }
        match part {
            Part::Remainder => self.remainder = true,
            Part::ErrorsInVariables => self.errors_in_variables = true,
            Part::Prefilter => self.prefilter = true,
        }
        Some(self)
    }
}
