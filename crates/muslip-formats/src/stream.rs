//! A file of any length converted some rows at a time, where its mapped channels share one time: nothing has to be brought onto another then.

use std::io;

use crate::convert::{self, Prepared};
use crate::error::{FormatError, Problem};
use crate::made::{Fault, Made};
use crate::map::Map;
use crate::roles::TIME;
use crate::source::Series;
use crate::source_file::SourceFile;
use crate::steps::Steps;

/// Who takes the rows of a conversion.
pub trait RowSink {
    /// Takes rows, by column: `time_s` first.
    ///
    /// # Errors
    /// The sink's own.
    fn rows(&mut self, columns: &[Vec<f64>]) -> io::Result<()>;
}

/// What a conversion came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Streamed {
    /// Rows that the sink took.
    pub rows: u64,
    /// Start of the measurement in RFC 3339.
    pub start_time: Option<String>,
    /// What was read, converted or dropped, one line each, as [`convert::Converted::notes`].
    pub notes: Vec<String>,
    /// What of it a diagnosis must know.
    pub made: Made,
}

/// Why there is none.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The file.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The sink.
    #[error(transparent)]
    Sink(#[from] io::Error),
}

/// A conversion that can go some rows at a time.
#[derive(Debug)]
pub struct Stream {
    prepared: Prepared,
    /// Channels to be read: of a format without a time of its own its time first.
    wanted: Vec<usize>,
    /// How readings of that time become seconds: factor, offset, whether it is kept as it is.
    time: Option<(f64, f64, bool)>,
}

impl Stream {
    /// The conversion of a file by a map, or by a guess without one; `None` where it has to be read whole: channels with times of their own, a raster
    /// of another rate, a format that is not read in pieces.
    ///
    /// # Errors
    /// As [`convert::convert`].
    pub fn of(file: &SourceFile, map: Option<&Map>) -> Result<Option<Self>, FormatError> {
        let fail = |problem: Problem| problem.in_file(file.path());
        let prepared = Prepared::of(file, map).map_err(fail)?;
        let roles = &prepared.roles;
        let is_plain = prepared.time.rate_hz.is_none()
            && roles.assigned.iter().all(|one| one.entry.delay_s == 0.0)
            && prepared
                .time
                .raster
                .as_ref()
                .is_none_or(|raster| roles.assigned.iter().any(|one| &one.column == raster));
        if !is_plain {
            return Ok(None);
        }
        let mut wanted: Vec<usize> = roles.assigned.iter().map(|one| one.channel).collect();
        let time = match prepared.one_time(file).map_err(fail)? {
            convert::OneTime::Own => None,
            convert::OneTime::Column(at, entry) => {
                let channel = &prepared.channels[at];
                let factor = convert::time_factor(channel, &entry).map_err(fail)?;
                wanted.insert(0, at);
                let offset = entry.offset - entry.delay_s;
                Some((entry.scale * factor, offset, channel.name == TIME))
            }
            convert::OneTime::Several => return Ok(None),
        };
        let can = file.pieces(&wanted)?.is_some();
        Ok(can.then_some(Self {
            prepared,
            wanted,
            time,
        }))
    }

    /// Headers of the columns; the first is `time_s`.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let columns = self.prepared.roles.assigned.iter();
        let columns = columns.map(|one| one.column.clone());
        std::iter::once(TIME.to_owned()).chain(columns).collect()
    }

    /// Columns of the contract that no channel became, and why; empty where a map says which there are.
    #[must_use]
    pub fn refused(&self) -> &[crate::roles::Refused] {
        &self.prepared.roles.refused
    }

    /// Whether the roles are a guess.
    #[must_use]
    pub fn guessed(&self) -> bool {
        self.prepared.roles.guessed
    }

    /// Rows that the file announces.
    #[must_use]
    pub fn announced_rows(&self) -> u64 {
        let channels = &self.prepared.channels;
        let samples = self.wanted.iter().filter_map(|&at| channels.get(at));
        samples.map(|channel| channel.samples).max().unwrap_or(0)
    }

    /// Converts the file; `progress` receives the rows done.
    ///
    /// # Errors
    /// [`StreamError`]: what reading and the order of times come to, or the sink's.
    pub fn run(
        &self,
        file: &SourceFile,
        sink: &mut dyn RowSink,
        progress: &mut dyn FnMut(u64),
    ) -> Result<Streamed, StreamError> {
        let fail = |problem: Problem| problem.in_file(file.path());
        let Some(pieces) = file.pieces(&self.wanted)? else {
            return Err(fail(Problem::whole("cannot be read in pieces")).into());
        };
        let units = self.prepared.units().map_err(fail)?;
        let assigned = &self.prepared.roles.assigned;
        let mut steps = Steps::default();
        let mut start_s = None;
        let mut untimed = 0_u64;
        let mut told = vec![(0_u64, 0_u64); assigned.len()];
        for piece in pieces {
            let (times, series) = self.times(piece?).map_err(fail)?;
            let start_s = *start_s.get_or_insert_with(|| match self.time {
                Some((_, _, true)) => 0.0,
                _ => times
                    .iter()
                    .copied()
                    .find(|time| time.is_finite())
                    .unwrap_or(0.0),
            });
            let kept: Vec<bool> = times.iter().map(|time| time.is_finite()).collect();
            let mut columns = vec![Vec::with_capacity(times.len())];
            for &time in times.iter().filter(|time| time.is_finite()) {
                if let Some((_, before)) = steps.ends
                    && time <= before
                {
                    let channel = match self.time {
                        Some(_) => &self.prepared.channels[self.wanted[0]],
                        None => &self.prepared.channels[assigned[0].channel],
                    };
                    let problem = convert::out_of_order(channel, steps.count, before, time);
                    return Err(fail(problem).into());
                }
                steps.next(time);
                columns[0].push(time - start_s);
            }
            let is_whole = kept.iter().all(|kept| *kept);
            untimed += kept.iter().filter(|kept| !**kept).count() as u64;
            for (((one, series), (factor, offset, _)), (empty, invalid)) in
                assigned.iter().zip(series).zip(&units).zip(&mut told)
            {
                let Series {
                    mut values,
                    invalid: flags,
                    ..
                } = series;
                *invalid += convert::bring(&mut values, flags, &one.entry, *factor, *offset);
                if !is_whole {
                    let mut kept = kept.iter();
                    values.retain(|_| kept.next().copied().unwrap_or(true));
                }
                *empty += values.iter().filter(|value| value.is_nan()).count() as u64;
                columns.push(values);
            }
            sink.rows(&columns)?;
            progress(steps.count);
        }
        if steps.count == 0 {
            return Err(fail(Problem::whole("the mapped channels have no readings")).into());
        }
        let announced = self.announced_rows();
        let mut faults = self.prepared.left_out.clone();
        if steps.count + untimed < announced {
            faults.push(format!(
                "{} of {announced} announced readings are there",
                steps.count + untimed
            ));
        }
        if untimed > 0 {
            faults.push(format!(
                "{untimed} readings without a time stamp were left out"
            ));
        }
        let start_s = start_s.unwrap_or(0.0);
        let gaps: Vec<(f64, f64)> = steps
            .gaps(convert::MOST_GAPS)
            .into_iter()
            .map(|(from, to)| (from - start_s, to - start_s))
            .collect();
        faults.extend(file.faults());
        let ends = steps.ends.unwrap_or_default();
        let ends = (ends.0 - start_s, ends.1 - start_s);
        let made = self.made(file, ends, &gaps, &told, &faults);
        let in_words = gaps.iter().map(|(from, to)| {
            format!(
                "gap of {} s at {} s",
                convert::rounded(to - from),
                convert::rounded(*from)
            )
        });
        faults.extend(in_words);
        Ok(Streamed {
            rows: steps.count,
            start_time: file.start_time(),
            notes: self.notes(&steps, &told, faults, file),
            made,
        })
    }

    /// What a diagnosis must know: of each column, and of the file as a whole.
    fn made(
        &self,
        file: &SourceFile,
        ends: (f64, f64),
        gaps: &[(f64, f64)],
        told: &[(u64, u64)],
        faults: &[String],
    ) -> Made {
        let mut made = Made::default();
        let Prepared {
            channels, roles, ..
        } = &self.prepared;
        for (one, &(_, invalid)) in roles.assigned.iter().zip(told) {
            let faults = convert::reading_faults(&one.column, ends, gaps, invalid);
            made.faults.extend(faults);
            made.inherit(file.made(), &channels[one.channel].name, &one.column);
        }
        made.faults.extend(faults.iter().map(|what| Fault {
            column: TIME.to_owned(),
            start_s: ends.0,
            end_s: ends.1,
            what: what.clone(),
        }));
        made.inherit(file.made(), TIME, TIME);
        made
    }

    /// Times in s, and the series of the columns.
    fn times(&self, mut piece: Vec<Series>) -> Result<(Vec<f64>, Vec<Series>), Problem> {
        let times = match self.time {
            Some((factor, offset, _)) => {
                let time = piece.remove(0);
                let seconds = time.values.into_iter().map(|value| factor * value + offset);
                seconds.collect()
            }
            None => {
                let times = piece.first().and_then(|series| series.time_s.as_deref());
                times.cloned().ok_or_else(|| Problem::whole("no time"))?
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

    fn notes(
        &self,
        steps: &Steps,
        told: &[(u64, u64)],
        faults: Vec<String>,
        file: &SourceFile,
    ) -> Vec<String> {
        let Prepared {
            channels, roles, ..
        } = &self.prepared;
        let mut notes = vec![self.prepared.read_as(file)];
        let rate = steps.rate_hz().map_or("one reading".to_owned(), |rate| {
            format!("{} Hz", convert::rounded(rate))
        });
        let raster = self.prepared.time.raster.as_ref();
        let raster = raster.or_else(|| roles.assigned.first().map(|one| &one.column));
        if let Some(raster) = raster {
            notes.push(format!("{TIME}: times of {raster}, {rate}"));
        }
        let units = self.prepared.units().unwrap_or_default();
        let all = roles.assigned.iter().zip(units).zip(told);
        for ((one, (_, _, unit)), &(empty, invalid)) in all {
            let channel = &channels[one.channel];
            let kept = format!("{rate}, kept");
            notes.push(convert::column_note(
                &one.column,
                channel,
                &unit,
                &kept,
                empty,
                invalid,
            ));
        }
        notes.extend(faults.into_iter().map(|fault| format!("fault: {fault}")));
        notes
    }
}
