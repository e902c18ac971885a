//! The readings of channels that share one time, as they come.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::sink::StreamError;
use crate::convert::{self, Prepared};
use crate::error::Problem;
use crate::source::{Channel, Series};
use crate::source_file::{FilePieces, SourceFile};
use crate::steps::Steps;

/// Columns that share one time.
#[derive(Debug)]
pub(super) struct Group {
    /// Channels to be read: of a format without a time of its own its time first.
    pub(super) wanted: Vec<usize>,
    /// How readings of that time become seconds: factor, offset, whether it is kept as it is.
    pub(super) time: Option<(f64, f64, bool)>,
    /// How late they report.
    pub(super) delay_s: f64,
    /// Which of the columns they are.
    pub(super) members: Vec<usize>,
}

impl Group {
    /// Whether its time is the contract's own column.
    pub(super) fn keeps(&self) -> bool {
        matches!(self.time, Some((_, _, true)))
    }
}

/// The readings of a group as they come.
pub(super) struct Track<'a> {
    file: &'a SourceFile,
    pub(super) group: &'a Group,
    pieces: FilePieces<'a>,
    /// The channel that is named where its time is out of order.
    timed: &'a Channel,
    /// Of each member: factor and offset to SI, and the map's entry.
    members: Vec<(f64, f64, &'a crate::map::Entry)>,
    pub(super) steps: Steps,
    pub(super) untimed: u64,
    /// Readings of each member that are invalid in the file.
    pub(super) invalid: Vec<u64>,
    ended: bool,
    /// What was read and is needed still: times in s, and the members in SI units.
    pub(super) times: Vec<f64>,
    pub(super) columns: Vec<Vec<f64>>,
}

/// The times of a group, gone through.
pub(super) struct Seen {
    pub(super) steps: Steps,
    /// Equal where all times are.
    pub(super) times_hash: u64,
}

impl<'a> Track<'a> {
    /// A pass over some of the channels that a group wants: its time and the first ones.
    pub(super) fn new(
        prepared: &'a Prepared,
        file: &'a SourceFile,
        group: &'a Group,
        units: &[(f64, f64, String)],
        wanted: &[usize],
    ) -> Result<Self, StreamError> {
        let fail = |reason: &str| Problem::whole(reason).in_file(file.path());
        let pieces = file.pieces(wanted)?;
        let pieces = pieces.ok_or_else(|| fail("cannot be read in pieces"))?;
        let channels = &prepared.channels;
        let timed = wanted.first().and_then(|&at| channels.get(at));
        let count = wanted.len() - usize::from(group.time.is_some());
        let members = group.members.iter().take(count).map(|&place| {
            let (factor, offset, _) = &units[place];
            (*factor, *offset, &prepared.roles.assigned[place].entry)
        });
        Ok(Self {
            file,
            group,
            pieces,
            timed: timed.ok_or_else(|| fail("no channel"))?,
            members: members.collect(),
            steps: Steps::default(),
            untimed: 0,
            invalid: vec![0; count],
            ended: false,
            times: Vec::new(),
            columns: vec![Vec::new(); count],
        })
    }

    pub(super) fn keeps(&self) -> bool {
        self.group.keeps()
    }

    /// Appends the next piece to what is in memory; false at the end.
    pub(super) fn next(&mut self) -> Result<bool, StreamError> {
        let Some(piece) = self.pieces.next() else {
            self.ended = true;
            return Ok(false);
        };
        let fail = |problem: Problem| problem.in_file(self.file.path());
        let (times, series) = self.split(piece?).map_err(fail)?;
        for &time in times.iter().filter(|time| time.is_finite()) {
            if let Some((_, before)) = self.steps.ends
                && time <= before
            {
                let problem = convert::out_of_order(self.timed, self.steps.count, before, time);
                return Err(fail(problem).into());
            }
            self.steps.next(time);
        }
        let missing = times.iter().filter(|time| !time.is_finite()).count();
        self.untimed += missing as u64;
        let readings = series.into_iter().zip(&self.members);
        let told = self.invalid.iter_mut().zip(&mut self.columns);
        for ((series, &(factor, offset, entry)), (invalid, column)) in readings.zip(told) {
            let Series {
                mut values,
                invalid: flags,
                ..
            } = series;
            *invalid += convert::bring(&mut values, flags, entry, factor, offset);
            if missing > 0 {
                let mut timed = times.iter().map(|time| time.is_finite());
                values.retain(|_| timed.next().unwrap_or(true));
            }
            if column.is_empty() {
                *column = values;
            } else {
                column.extend(values);
            }
        }
        self.times
            .extend(times.into_iter().filter(|time| time.is_finite()));
        Ok(true)
    }

    /// Times in s, and the series of the members.
    fn split(&self, mut piece: Vec<Series>) -> Result<(Vec<f64>, Vec<Series>), Problem> {
        let delay_s = self.group.delay_s;
        let times: Vec<f64> = match self.group.time {
            Some((factor, offset, _)) if !piece.is_empty() => {
                let time = piece.remove(0).values.into_iter();
                time.map(|value| factor * value + offset - delay_s)
                    .collect()
            }
            _ => {
                let times = piece.first().and_then(|series| series.time_s.as_deref());
                let times = times.ok_or_else(|| Problem::whole("no time"))?;
                times.iter().map(|time| time - delay_s).collect()
            }
        };
        if let Some(other) = piece.iter().find(|one| one.values.len() != times.len()) {
            return Err(Problem::whole(format!(
                "{} readings and {} time stamps",
                other.values.len(),
                times.len()
            )));
        }
        Ok((times, piece))
    }

    /// Goes through the times alone.
    pub(super) fn seen(mut self) -> Result<Seen, StreamError> {
        let mut hasher = DefaultHasher::new();
        while self.next()? {
            for time in self.times.drain(..) {
                time.to_bits().hash(&mut hasher);
            }
            self.columns.iter_mut().for_each(Vec::clear);
        }
        Ok(Seen {
            steps: self.steps,
            times_hash: hasher.finish(),
        })
    }

    /// Leaves behind what lies before a time, but for the last reading there, and reads until there is one behind another time.
    pub(super) fn go_to(&mut self, from: f64, to: f64) -> Result<(), StreamError> {
        loop {
            let before = self.times.partition_point(|&time| time < from);
            let left = before.saturating_sub(1);
            self.times.drain(..left);
            for values in &mut self.columns {
                values.drain(..left);
            }
            let reaches = self.times.last().is_some_and(|&last| last > to);
            if self.ended || reaches {
                return Ok(());
            }
            self.next()?;
        }
    }
}
