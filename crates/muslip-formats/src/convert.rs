//! From the channels of a file to the columns of a recording: SI units, one time.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::Arc;

use crate::error::{FormatError, Problem};
use crate::format::Format;
pub use crate::made::{Fault, Made, Resampled};
use crate::map::{Entry, Map};
use crate::raster::{self, Done};
use crate::roles::{self, Assigned, Refused, Roles, TIME};
use crate::source::{Channel, Series};
use crate::source_file::SourceFile;
use crate::units::{self, Quantity};

/// Most gaps of a column that are told.
pub(crate) const MOST_GAPS: usize = 100;
/// Most rows that a raster of `rate_hz` may have.
const MOST_ROWS: f64 = 2e8;

/// A recording made of a file of another format.
#[derive(Debug, Clone)]
pub struct Converted {
    /// The file's format.
    pub format: Format,
    /// Start of the measurement in RFC 3339.
    pub start_time: Option<String>,
    /// Headers; the first is `time_s`.
    pub names: Vec<String>,
    /// As many columns, all of one length. Missing is `NaN`.
    pub columns: Vec<Vec<f64>>,
    /// What was read, converted, interpolated, decimated or dropped, one line each.
    pub notes: Vec<String>,
    /// What of it a diagnosis must know, also of a conversion that this file came from.
    pub made: Made,
    /// Columns of the contract that no channel became, and why.
    pub refused: Vec<Refused>,
    /// The roles as they were found, as a map.
    pub map: Map,
    /// Whether the roles are a guess.
    pub guessed: bool,
}

/// A channel brought to SI.
struct Ready {
    one: Assigned,
    channel: Channel,
    times: Arc<Vec<f64>>,
    /// `NaN` where missing or invalid.
    values: Vec<f64>,
    invalid: u64,
    unit: String,
}

/// Reads a file's columns by a map, or by a guess without one.
///
/// # Errors
/// [`FormatError`]: a name of the map that is not there or fits several channels, a unit that is missing, unknown or of another quantity, a channel
/// without a time, a time that repeats or goes back, no column at all, or what [`SourceFile::read`] says.
pub fn convert(file: &mut SourceFile, map: Option<&Map>) -> Result<Converted, FormatError> {
    let path = file.path().to_owned();
    let fail = |problem: Problem| problem.in_file(&path);
    let prepared = Prepared::of(file, map).map_err(fail)?;
    let read_as = prepared.read_as(file);
    let Prepared {
        channels,
        roles,
        left_out,
        time,
    } = prepared;
    let (ready, mut faults, keeps_time) = read(file, &channels, &roles)?;
    faults.extend(left_out);
    let first_s = ready
        .iter()
        .filter_map(|one| one.times.first())
        .copied()
        .fold(f64::INFINITY, f64::min);
    let start_s = if keeps_time { 0.0 } else { first_s };
    let (grid, raster_name) = grid(&ready, &time).map_err(fail)?;
    let mut out = Converted {
        format: file.format(),
        start_time: file.start_time(),
        names: vec![TIME.to_owned()],
        columns: vec![grid.iter().map(|time| time - start_s).collect()],
        notes: Vec::new(),
        made: Made::default(),
        refused: roles.refused.clone(),
        map: roles.as_map(&channels, &time),
        guessed: roles.guessed,
    };
    out.notes.push(read_as);
    out.notes.push(format!("{TIME}: {raster_name}"));
    for one in ready {
        let (values, done) = raster::onto(&grid, &one.times, &one.values, one.one.entry.method);
        out.tell(&one, &values, done, &grid, start_s);
        out.made
            .inherit(file.made(), &one.channel.name, &one.one.column);
        out.names.push(one.one.column);
        out.columns.push(values);
    }
    let (from, to) = (
        grid.first().copied().unwrap_or(0.0) - start_s,
        grid.last().copied().unwrap_or(0.0) - start_s,
    );
    let mut told = BTreeSet::new();
    for fault in faults.into_iter().chain(file.faults()) {
        if told.insert(fault.clone()) {
            out.notes.push(format!("fault: {fault}"));
            out.made.faults.push(Fault {
                column: TIME.to_owned(),
                start_s: from,
                end_s: to,
                what: fault,
            });
        }
    }
    out.made.inherit(file.made(), TIME, TIME);
    Ok(out)
}

/// What is known before anything is read: which channels become which columns.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub(crate) channels: Vec<Channel>,
    pub(crate) roles: Roles,
    /// What was guessed and cannot be used, in words.
    pub(crate) left_out: Vec<String>,
    pub(crate) time: crate::map::Time,
}

/// The time of all columns.
pub(crate) enum OneTime {
    /// Their channels' own, of one group.
    Own,
    /// One channel's readings.
    Column(usize, Entry),
    /// Not one.
    Several,
}

impl Prepared {
    pub(crate) fn of(file: &SourceFile, map: Option<&Map>) -> Result<Self, Problem> {
        let channels = file.channels().to_vec();
        let named = map.filter(|map| !map.channels.is_empty());
        let mut roles = match named {
            Some(map) => roles::by_map(&channels, map)?,
            None => roles::guess(&channels),
        };
        let left_out = if roles.guessed {
            if let Some(refused) = roles.ambiguous() {
                return Err(Problem::whole(&refused.reason));
            }
            drop_unusable(&mut roles, &channels)
        } else {
            Vec::new()
        };
        if roles.assigned.is_empty() {
            let mut refused = roles.refused.iter().filter(|one| one.column != TIME);
            let reason = refused
                .next()
                .map_or("the map names no channel", |one| one.reason.as_str());
            return Err(Problem::whole(reason));
        }
        Ok(Self {
            channels,
            roles,
            left_out,
            time: map.map(|map| map.time.clone()).unwrap_or_default(),
        })
    }

    /// Factor and offset to SI of each column, and the conversion in words.
    pub(crate) fn units(&self) -> Result<Vec<(f64, f64, String)>, Problem> {
        let unit = |one: &Assigned| to_si(&self.channels[one.channel], &one.column, &one.entry);
        self.roles.assigned.iter().map(unit).collect()
    }

    /// The place of the column whose times the map wants.
    pub(crate) fn raster_place(&self, name: &str) -> Result<usize, Problem> {
        place_of(
            name,
            self.roles.assigned.iter().map(|one| one.column.as_str()),
        )
    }

    /// How the file is read, in words.
    pub(crate) fn read_as(&self, file: &SourceFile) -> String {
        let read_as = if self.roles.guessed {
            "channels guessed from names and units"
        } else {
            "channels by the map"
        };
        let start = file
            .start_time()
            .map_or(String::new(), |start| format!(", started {start}"));
        format!("read as {}{start}; {read_as}", file.format().word())
    }

    /// Which time the columns have in common.
    pub(crate) fn one_time(&self, file: &SourceFile) -> Result<OneTime, Problem> {
        let of = self.roles.assigned.iter();
        let of: Vec<&Channel> = of.map(|one| &self.channels[one.channel]).collect();
        if file.format().has_own_time() {
            let one_group = of.windows(2).all(|pair| pair[0].group == pair[1].group);
            return Ok(if one_group {
                OneTime::Own
            } else {
                OneTime::Several
            });
        }
        let times = Times::new(&self.channels, &self.roles);
        let mut one: Option<(usize, Entry)> = None;
        for channel in of {
            let place = times.place(channel).map_err(Problem::whole)?;
            if one.as_ref().is_some_and(|one| one.0 != place.0) {
                return Ok(OneTime::Several);
            }
            one = Some(place);
        }
        Ok(one.map_or(OneTime::Several, |(at, entry)| OneTime::Column(at, entry)))
    }
}

/// Brings readings to SI, those that are invalid to `NaN`; answers with how many are.
pub(crate) fn bring(
    values: &mut [f64],
    invalid: Option<Vec<bool>>,
    entry: &Entry,
    factor: f64,
    offset: f64,
) -> u64 {
    for value in &mut *values {
        *value = entry.scale * (factor * *value + offset) + entry.offset;
        if !value.is_finite() {
            *value = f64::NAN;
        }
    }
    let mut count = 0;
    let flags = invalid.iter().flatten();
    for (value, _) in values
        .iter_mut()
        .zip(flags)
        .filter(|(_, invalid)| **invalid)
    {
        *value = f64::NAN;
        count += 1;
    }
    count
}

/// A column that no work requires and that was only guessed is left out where its unit does not do; answers with what was.
fn drop_unusable(roles: &mut Roles, channels: &[Channel]) -> Vec<String> {
    let mut told = Vec::new();
    roles.assigned.retain(|one| {
        let optional = roles::role(&one.column).is_some_and(|role| !role.required);
        let usable = channels
            .get(one.channel)
            .map(|channel| to_si(channel, &one.column, &one.entry));
        match usable {
            Some(Err(problem)) if optional => {
                told.push(format!("left out: {}", problem.in_words()));
                false
            }
            _ => true,
        }
    });
    told
}

impl Converted {
    fn tell(&mut self, one: &Ready, values: &[f64], done: Done, grid: &[f64], start_s: f64) {
        let longest = raster::longest_step_s(&one.times);
        let gaps = one.times.windows(2);
        let gaps = gaps.filter(|pair| pair[1] - pair[0] > longest);
        let ends = one.times.first().zip(one.times.last());
        let told = Told {
            column: &one.one.column,
            channel: &one.channel,
            unit: &one.unit,
            done,
            interval_s: raster::interval_s(&one.times),
            rate_hz: raster::rate_hz(&one.times),
            raster_hz: raster::rate_hz(grid),
            ends: ends.map(|(first, last)| (first - start_s, last - start_s)),
            gaps: gaps
                .take(MOST_GAPS)
                .map(|pair| (pair[0] - start_s, pair[1] - start_s))
                .collect(),
            empty: values.iter().filter(|value| value.is_nan()).count() as u64,
            invalid: one.invalid,
        };
        told.tell(&mut self.notes, &mut self.made);
    }
}

/// What became of a column: times in s of the recording.
pub(crate) struct Told<'a> {
    pub(crate) column: &'a str,
    pub(crate) channel: &'a Channel,
    /// Its conversion to SI in words.
    pub(crate) unit: &'a str,
    pub(crate) done: Done,
    /// Its own median interval.
    pub(crate) interval_s: Option<f64>,
    pub(crate) rate_hz: Option<f64>,
    pub(crate) raster_hz: Option<f64>,
    /// Its first and last reading.
    pub(crate) ends: Option<(f64, f64)>,
    pub(crate) gaps: Vec<(f64, f64)>,
    pub(crate) empty: u64,
    pub(crate) invalid: u64,
}

impl Told<'_> {
    /// Says it in a line of words, and to a diagnosis.
    pub(crate) fn tell(&self, notes: &mut Vec<String>, made: &mut Made) {
        let (own, wanted) = (rate_words(self.rate_hz), rate_words(self.raster_hz));
        let (in_short, in_full) = match self.done {
            Done::Kept => (format!("{own}, kept"), None),
            Done::Interpolated(method) => {
                let word = method.word();
                let what = format!(
                    "measured at {own}, interpolated ({word}) onto {wanted}: no more is known of it than its own readings"
                );
                (format!("{own}, brought onto {wanted} ({word})"), Some(what))
            }
            Done::Decimated { .. } => {
                let what = format!(
                    "measured at {own}, low-passed without delay and decimated to {wanted}"
                );
                (
                    format!("{own}, low-passed and decimated to {wanted}"),
                    Some(what),
                )
            }
        };
        let mut note = format!(
            "{}: {}{}; {in_short}",
            self.column,
            self.channel.shown(),
            self.unit
        );
        if self.empty > 0 {
            note.push_str(&format!("; {} empty", self.empty));
        }
        if self.invalid > 0 {
            note.push_str(&format!("; {} readings invalid in the file", self.invalid));
        }
        notes.push(note);
        let Some((first_s, last_s)) = self.ends else {
            return;
        };
        if let Some(interval_s) = self.interval_s.filter(|_| self.done != Done::Kept) {
            made.resampled.push(Resampled {
                column: self.column.to_owned(),
                interval_s,
                done: self.done,
            });
        }
        let mut fault = |start_s: f64, end_s: f64, what: String| {
            made.faults.push(Fault {
                column: self.column.to_owned(),
                start_s,
                end_s,
                what,
            });
        };
        if let Some(what) = in_full {
            fault(first_s, last_s, what);
        }
        for &(from, to) in &self.gaps {
            fault(from, to, format!("gap of {} s", rounded(to - from)));
        }
        if self.invalid > 0 {
            let what = format!(
                "{} readings are invalid in the file: left empty",
                self.invalid
            );
            fault(first_s, last_s, what);
        }
    }
}

/// A rate in words.
fn rate_words(rate_hz: Option<f64>) -> String {
    rate_hz.map_or("one reading".to_owned(), |rate| {
        format!("{} Hz", rounded(rate))
    })
}

/// Whose times the raster keeps, in words.
pub(crate) fn raster_words(column: &str, rate_hz: Option<f64>) -> String {
    format!("times of {column}, {}", rate_words(rate_hz))
}

/// The same of a raster of a rate.
pub(crate) fn even_words(column: &str, rate_hz: f64) -> String {
    format!("{rate_hz} Hz from the first to the last reading of {column}")
}

/// A conversion to SI in words, with what the map says of the channel's delay.
pub(crate) fn unit_words(unit: &str, entry: &Entry) -> String {
    if entry.delay_s == 0.0 {
        return unit.to_owned();
    }
    format!("{unit}, {} s of delay taken out", entry.delay_s)
}

/// Start and number of the rows of a raster of a rate, between the first and the last of its channel's times.
pub(crate) fn even_rows(ends: Option<(f64, f64)>, rate_hz: f64) -> Result<(f64, usize), Problem> {
    let Some((first, last)) = ends else {
        return Err(Problem::whole("the raster's channel has no readings"));
    };
    let rows = ((last - first) * rate_hz + 1e-6).floor() + 1.0;
    if rows.is_nan() || rows > MOST_ROWS {
        return Err(Problem::whole(format!(
            "{rate_hz} Hz over {} s are more rows than {MOST_ROWS:e}",
            last - first
        )));
    }
    Ok((first, rows as usize))
}

/// Three digits behind the point at most.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// Reads the channels of the roles; says what was dropped, and whether the time is the contract's own.
fn read(
    file: &mut SourceFile,
    channels: &[Channel],
    roles: &Roles,
) -> Result<(Vec<Ready>, Vec<String>, bool), FormatError> {
    let path = file.path().to_owned();
    let fail = |problem: Problem| problem.in_file(&path);
    // Before anything is read: a wrong unit is told at once.
    let mut units = Vec::with_capacity(roles.assigned.len());
    for one in &roles.assigned {
        units.push(to_si(&channels[one.channel], &one.column, &one.entry).map_err(fail)?);
    }
    let wanted: Vec<usize> = roles.assigned.iter().map(|one| one.channel).collect();
    let series = file.read(&wanted)?;
    let mut times = Times::new(channels, roles);
    let mut faults = Vec::new();
    let mut ready = Vec::with_capacity(series.len());
    for ((one, series), (factor, offset, unit)) in roles.assigned.iter().zip(series).zip(units) {
        let channel = &channels[one.channel];
        let Series {
            time_s,
            mut values,
            invalid,
        } = series;
        let own = time_s.is_some();
        let stamps = match time_s {
            Some(stamps) => stamps,
            None => times.of(file, channel, values.len())?,
        };
        if stamps.len() != values.len() {
            return Err(fail(Problem::of(
                channel.shown(),
                format!("{} readings and {} time stamps", values.len(), stamps.len()),
            )));
        }
        let count = bring(&mut values, invalid, &one.entry, factor, offset);
        let (stamps, values, dropped) = timed(stamps, values);
        if dropped > 0 {
            faults.push(format!(
                "{}: {dropped} readings without a time stamp were left out",
                channel.shown()
            ));
        }
        ordered(&stamps, channel, own, &times).map_err(fail)?;
        let stamps = if one.entry.delay_s == 0.0 {
            stamps
        } else {
            Arc::new(stamps.iter().map(|time| time - one.entry.delay_s).collect())
        };
        let unit = unit_words(&unit, &one.entry);
        ready.push(Ready {
            one: one.clone(),
            channel: channel.clone(),
            times: stamps,
            values,
            invalid: count,
            unit,
        });
    }
    if ready.iter().all(|one| one.values.is_empty()) {
        return Err(fail(Problem::whole("the mapped channels have no readings")));
    }
    Ok((ready, faults, times.keeps))
}

/// Readings whose time is a number.
fn timed(times: Arc<Vec<f64>>, values: Vec<f64>) -> (Arc<Vec<f64>>, Vec<f64>, usize) {
    let missing = times.iter().filter(|time| !time.is_finite()).count();
    if missing == 0 {
        return (times, values, 0);
    }
    let (times, values) = times
        .iter()
        .zip(values)
        .filter(|(time, _)| time.is_finite())
        .map(|(&time, value)| (time, value))
        .unzip();
    (Arc::new(times), values, missing)
}

fn ordered(times: &[f64], channel: &Channel, own: bool, shared: &Times<'_>) -> Result<(), Problem> {
    let Some(at) = times.windows(2).position(|pair| pair[1] <= pair[0]) else {
        return Ok(());
    };
    let timed = match (own, shared.named(channel)) {
        (false, Some(time)) => time,
        _ => channel,
    };
    Err(out_of_order(timed, at as u64 + 1, times[at], times[at + 1]))
}

/// A time that repeats or goes back, at a sample of a channel.
pub(crate) fn out_of_order(channel: &Channel, at: u64, before: f64, now: f64) -> Problem {
    let verb = if now == before {
        "repeats"
    } else {
        "goes back"
    };
    let group = if channel.group.is_empty() {
        String::new()
    } else {
        format!("group {}, ", channel.group)
    };
    Problem::whole(format!(
        "{group}channel {}: its time {verb} at sample {at}: {now} s after {before} s",
        channel.shown()
    ))
}

/// Times of formats that have none of their own: of the column of time, or of the channel that looks like one in the same group.
struct Times<'a> {
    channels: &'a [Channel],
    roles: &'a Roles,
    read: Vec<(usize, Arc<Vec<f64>>)>,
    /// Whether the time was the contract's own column.
    keeps: bool,
}

impl<'a> Times<'a> {
    fn new(channels: &'a [Channel], roles: &'a Roles) -> Self {
        Self {
            channels,
            roles,
            read: Vec::new(),
            keeps: false,
        }
    }

    /// The time of a channel by its group: the group's own, else the one there is.
    fn place(&self, channel: &Channel) -> Result<(usize, Entry), String> {
        let explicit = self.roles.time.as_ref();
        let in_group: Vec<usize> = (0..self.channels.len())
            .filter(|&k| self.channels[k].group == channel.group)
            .collect();
        if let Some(time) = explicit
            && (in_group.contains(&time.channel) || !self.roles.guessed)
        {
            return Ok((time.channel, time.entry.clone()));
        }
        let group: Vec<Channel> = in_group.iter().map(|&k| self.channels[k].clone()).collect();
        let guessed = roles::guess(&group);
        match (guessed.time, explicit) {
            (Some(time), _) => Ok((in_group[time.channel], time.entry)),
            (None, Some(time)) => Ok((time.channel, time.entry.clone())),
            (None, None) => {
                let mut refused = guessed.refused.into_iter();
                let refused = refused.find(|one| one.column == TIME);
                Err(refused.map_or_else(|| "no time".to_owned(), |one| one.reason))
            }
        }
    }

    fn named(&self, channel: &Channel) -> Option<&Channel> {
        let (time, _) = self.place(channel).ok()?;
        self.channels.get(time)
    }

    fn of(
        &mut self,
        file: &mut SourceFile,
        channel: &Channel,
        samples: usize,
    ) -> Result<Arc<Vec<f64>>, FormatError> {
        let path = file.path().to_owned();
        let (at, entry) = self
            .place(channel)
            .map_err(|reason| Problem::whole(reason).in_file(&path))?;
        let times = match self.read.iter().find(|(channel, _)| *channel == at) {
            Some((_, times)) => Arc::clone(times),
            None => {
                let of_time = &self.channels[at];
                let factor =
                    time_factor(of_time, &entry).map_err(|problem| problem.in_file(&path))?;
                let mut series = file.read(&[at])?;
                let values = series.pop().map(|series| series.values).unwrap_or_default();
                let values: Vec<f64> = values
                    .iter()
                    .map(|value| entry.scale * (factor * value) + entry.offset - entry.delay_s)
                    .collect();
                self.keeps |= of_time.name == TIME;
                let times = Arc::new(values);
                self.read.push((at, Arc::clone(&times)));
                times
            }
        };
        if times.len() == samples {
            return Ok(times);
        }
        let reason = format!(
            "{samples} readings, but its time {} has {}: give a time of the same length in a map, [channels.time_s]",
            self.channels[at].shown(),
            times.len()
        );
        Err(Problem::of(channel.shown(), reason).in_file(&path))
    }
}

/// Seconds in one of a time channel's units.
pub(crate) fn time_factor(channel: &Channel, entry: &Entry) -> Result<f64, Problem> {
    let (factor, ..) = to_si(channel, TIME, entry)?;
    Ok(factor)
}

/// Factor and offset to SI, and the conversion in words.
fn to_si(channel: &Channel, column: &str, entry: &Entry) -> Result<(f64, f64, String), Problem> {
    let wanted = roles::role(column).map(|role| role.quantity);
    let spelling = entry.unit.as_deref().unwrap_or(&channel.unit);
    let say = |reason: String| Problem::whole(format!("{column}: {}: {reason}", channel.shown()));
    let key = format!("[channels.{column}]");
    let words = |factor: f64, offset: f64, unit: &str, si: &str| {
        let mut words = String::new();
        let offset_in_words = if offset == 0.0 {
            String::new()
        } else {
            format!(" {} {}", if offset < 0.0 { '-' } else { '+' }, offset.abs())
        };
        if units::bare(unit) != si || offset != 0.0 {
            words = format!(", {si} = {factor} × {unit}{offset_in_words}");
        }
        if entry.scale != 1.0 || entry.offset != 0.0 {
            words.push_str(&format!(", then {} × it + {}", entry.scale, entry.offset));
        }
        words
    };
    if units::bare(spelling).is_empty() {
        return match wanted {
            // The contract's own header says the unit.
            Some(quantity) if channel.name == column => {
                Ok((1.0, 0.0, words(1.0, 0.0, quantity.si(), quantity.si())))
            }
            Some(quantity) => Err(say(format!(
                "it has no unit: give unit (of {}) in a map, {key}",
                quantity.si()
            ))),
            None => Ok((1.0, 0.0, words(1.0, 0.0, "", ""))),
        };
    }
    let Some(unit) = units::of(spelling) else {
        return match wanted {
            Some(quantity) => Err(say(format!(
                "unit {spelling:?} is not known: give unit (of {}) in a map, {key}",
                quantity.si()
            ))),
            None => Ok((1.0, 0.0, words(1.0, 0.0, spelling, spelling))),
        };
    };
    let quantity = wanted.unwrap_or(unit.quantity);
    let si = quantity.si();
    match (unit.quantity, quantity) {
        (own, wanted) if own == wanted && own != Quantity::Percent => Ok((
            unit.factor,
            unit.offset,
            words(unit.factor, unit.offset, spelling, si),
        )),
        (Quantity::Percent, _) => match entry.percent_of {
            Some(whole) => {
                let factor = unit.factor * whole;
                Ok((factor, 0.0, words(factor, 0.0, spelling, si)))
            }
            None if wanted.is_none() => Ok((1.0, 0.0, words(1.0, 0.0, spelling, spelling))),
            None => Err(say(format!(
                "% of what? give percent_of = (100 % in {si}) in a map, {key}"
            ))),
        },
        (Quantity::Frequency, Quantity::AngularSpeed) => match entry.teeth {
            Some(teeth) => {
                let factor = unit.factor * 2.0 * PI / teeth;
                Ok((factor, 0.0, words(factor, 0.0, spelling, si)))
            }
            None => Err(say(format!(
                "{spelling} of a tone ring with how many teeth? give teeth (1 for revolutions) in a map, {key}"
            ))),
        },
        _ => Err(say(format!(
            "{spelling} is no unit of {si}: give unit, or scale with unit = {si:?}, in a map, {key}"
        ))),
    }
}

/// The raster's times, and how they came about.
fn grid(ready: &[Ready], time: &crate::map::Time) -> Result<(Arc<Vec<f64>>, String), Problem> {
    let rate = |one: &Ready| raster::rate_hz(&one.times).unwrap_or(0.0);
    let chosen = match &time.raster {
        Some(name) => {
            let columns = ready.iter().map(|one| one.one.column.as_str());
            ready.get(place_of(name, columns)?)
        }
        // The first of equals, so that the order of the contract decides and not a rounding.
        None => ready.iter().reduce(|best, one| {
            if rate(one) > rate(best) * (1.0 + 1e-6) {
                one
            } else {
                best
            }
        }),
    };
    let chosen = chosen.ok_or_else(|| Problem::whole("no channel"))?;
    let column = &chosen.one.column;
    let Some(rate_hz) = time.rate_hz else {
        let words = raster_words(column, raster::rate_hz(&chosen.times));
        return Ok((Arc::clone(&chosen.times), words));
    };
    let ends = chosen
        .times
        .first()
        .copied()
        .zip(chosen.times.last().copied());
    let (first, rows) = even_rows(ends, rate_hz)?;
    let times = (0..rows).map(|k| first + k as f64 / rate_hz).collect();
    Ok((Arc::new(times), even_words(column, rate_hz)))
}

/// The place of the column whose times a map wants.
fn place_of<'a>(name: &str, columns: impl Iterator<Item = &'a str>) -> Result<usize, Problem> {
    let columns: Vec<&str> = columns.collect();
    let place = columns.iter().position(|column| *column == name);
    place.ok_or_else(|| {
        Problem::whole(format!(
            "time.raster = {name:?}: no such column; there are {}",
            columns.join(", ")
        ))
    })
}
