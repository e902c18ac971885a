//! What each format is to everything above it: channels and their readings.

use std::sync::Arc;

use crate::error::Problem;
use crate::made::Made;

/// What the readings of a channel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Numbers.
    Numeric,
    /// Text, which no role can be.
    Text,
    /// Several numbers at a time, which no role can be.
    Array,
    /// Two values.
    Bool,
    /// Numbers with names.
    Enum,
}

impl Kind {
    /// The word for it in `muslip channels --json`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Numeric => "numeric",
            Self::Text => "text",
            Self::Array => "array",
            Self::Bool => "bool",
            Self::Enum => "enum",
        }
    }

    /// Whether its readings are single numbers.
    #[must_use]
    pub fn is_number(self) -> bool {
        matches!(self, Self::Numeric | Self::Bool | Self::Enum)
    }
}

/// A channel as its file announces it.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Group, folder or structure that it is in; empty where the format has none.
    pub group: String,
    /// Name, without a unit.
    pub name: String,
    /// Unit as the file spells it; empty where it has none.
    pub unit: String,
    /// Readings that the file announces.
    pub samples: u64,
    /// What the file says about it.
    pub comment: String,
    /// What its readings are.
    pub kind: Kind,
    /// Whether it is the time of its group, in s.
    pub is_time: bool,
}

impl Channel {
    /// The channel in a message: `nWheelFL [1/min] (group 2)`.
    #[must_use]
    pub fn shown(&self) -> String {
        let unit = if self.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", self.unit)
        };
        let group = if self.group.is_empty() {
            String::new()
        } else {
            format!(" (group {})", self.group)
        };
        crate::error::one_line(&format!("{}{unit}{group}", self.name))
    }
}

/// Readings of a channel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Times in s since the start of the file's measurement, where the format says them. As many as `values`.
    pub time_s: Option<Arc<Vec<f64>>>,
    /// The readings in the file's unit. A missing one is `NaN`.
    pub values: Vec<f64>,
    /// Which of them the file calls invalid; `None` where it calls none.
    pub invalid: Option<Vec<bool>>,
}

impl Series {
    /// Readings that the file calls invalid.
    #[must_use]
    pub fn invalid_count(&self) -> u64 {
        let flags = self.invalid.iter().flatten();
        flags.filter(|&&invalid| invalid).count() as u64
    }
}

/// Readings of several channels, some at a time: of each channel as many as of the others.
pub type Pieces<'a> = Box<dyn Iterator<Item = Result<Vec<Series>, Problem>> + 'a>;

/// A source of channels: what each format is to everything above it.
pub trait Source: Send {
    /// What start the file gives, in RFC 3339.
    fn start_time(&self) -> Option<String>;

    /// The channels, in the order of the file.
    fn channels(&self) -> &[Channel];

    /// Reads channels by their place in [`Source::channels`], in the order asked for.
    ///
    /// # Errors
    /// [`Problem`] where a channel is no number, a block of it is damaged, or a filter of it is not supported.
    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem>;

    /// Reads channels of one length some readings at a time, so that a file of any length fits into memory; `None` where these have to be read
    /// whole. What is missing at the end is not told here: who goes through them counts.
    ///
    /// # Errors
    /// As [`Source::read`].
    fn pieces(&self, wanted: &[usize]) -> Result<Option<Pieces<'_>>, Problem> {
        let _ = wanted;
        Ok(None)
    }

    /// What the file says of a conversion that it came from.
    fn made(&self) -> Made {
        Made::default()
    }

    /// What of the file was found damaged or left out so far, one line each.
    fn faults(&self) -> Vec<String>;
}
