//! MDF 3 and 4, by `falcon_mdf`, on bytes that are first put into the shape that it reads without loss (`mdf_join`).

use std::collections::HashMap;
use std::sync::Arc;

use falcon_mdf::blocks::{ChannelType, SyncType};
use falcon_mdf::mdf3::Mdf3File;
use falcon_mdf::{Mf4File, OpenOptions, SignalValues, ValueKind};

use crate::MOST_BYTES;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::mdf_join::{Mended, mended3, mended4};
use crate::source::{Channel, Kind, Pieces, Series, Source};
use crate::time_text::rfc3339;

/// Records of a piece.
const ROWS_A_PIECE: usize = 1 << 16;

/// Where a channel is: data group, channel group, channel.
type At = (usize, usize, usize);

/// An MDF file.
pub(crate) struct MdfSource {
    file: Either,
    channels: Vec<Channel>,
    at: Vec<At>,
    faults: Vec<String>,
    /// Readings that each channel group announces.
    announced: HashMap<(usize, usize), u64>,
}

enum Either {
    Three(Box<Mdf3File>),
    Four(Box<Mf4File>),
}

fn problem(error: falcon_mdf::error::Mf4Error) -> Problem {
    Problem::whole(error.to_string())
}

impl MdfSource {
    pub(crate) fn open(bytes: FileBytes) -> Result<Self, Problem> {
        let version = bytes.exact(0, 64)?;
        let four = u16::from_le_bytes([version[28], version[29]]) >= 400 || version[8] == b'4';
        if four {
            Self::open4(bytes)
        } else {
            Self::open3(bytes)
        }
    }

    fn open4(bytes: FileBytes) -> Result<Self, Problem> {
        let Mended {
            source,
            announced,
            faults,
        } = mended4(bytes)?;
        let options = OpenOptions {
            max_decompressed: MOST_BYTES,
            ..OpenOptions::default()
        };
        let file = Mf4File::from_source_with_options(Arc::new(source), options).map_err(problem)?;
        let mut out = Self {
            channels: Vec::new(),
            at: Vec::new(),
            faults,
            announced: HashMap::new(),
            file: Either::Four(Box::new(file)),
        };
        let Either::Four(file) = &out.file else {
            return Err(Problem::whole("not MDF 4"));
        };
        if file.unfinalized().is_some() {
            out.faults.push(
                "the recorder never closed this file: its counts are taken from its data"
                    .to_owned(),
            );
        }
        let mut group = 0_usize;
        for (d, data) in file.data_groups().iter().enumerate() {
            for (c, channels) in data.channel_groups.iter().enumerate() {
                if channels.is_vlsd() {
                    continue;
                }
                let said = announced
                    .get(&channels.block_offset())
                    .copied()
                    .unwrap_or(0);
                out.announced.insert((d, c), said);
                // A file that nobody closed announces nothing yet.
                if channels.sample_count < said {
                    out.faults.push(format!(
                        "group {group}: {} of {said} announced readings are there",
                        channels.sample_count
                    ));
                }
                for (k, channel) in channels.channels.iter().enumerate() {
                    let time = channel.is_master() && channel.sync_type == SyncType::Time;
                    out.at.push((d, c, k));
                    out.channels.push(Channel {
                        group: group.to_string(),
                        name: channel.name.clone(),
                        unit: channel.unit.trim().to_owned(),
                        samples: channels.sample_count,
                        comment: channel.comment.trim().to_owned(),
                        kind: kind4(channel),
                        is_time: time,
                    });
                }
                group += 1;
            }
        }
        Ok(out)
    }

    fn open3(bytes: FileBytes) -> Result<Self, Problem> {
        let Mended {
            source,
            announced,
            faults,
        } = mended3(bytes)?;
        let file = Mdf3File::from_source(Arc::new(source)).map_err(problem)?;
        let mut channels = Vec::new();
        let mut at = Vec::new();
        let mut group = 0_usize;
        for (d, data) in file.data_groups().iter().enumerate() {
            for (c, one) in data.channel_groups.iter().enumerate() {
                for (k, channel) in one.channels.iter().enumerate() {
                    at.push((d, c, k));
                    channels.push(Channel {
                        group: group.to_string(),
                        name: channel.name.clone(),
                        unit: channel.unit.trim().to_owned(),
                        samples: u64::from(one.cycle_count),
                        comment: channel.description.trim().to_owned(),
                        // Codes 7 and 8 are text and bytes (MDF specification 3.3, CNBLOCK).
                        kind: if matches!(channel.data_type, 7 | 8) {
                            Kind::Text
                        } else {
                            Kind::Numeric
                        },
                        is_time: channel.is_time(),
                    });
                }
                group += 1;
            }
        }
        // Only what the values are tells text tables from numbers.
        for (channel, &(d, c, k)) in channels.iter_mut().zip(&at) {
            use falcon_mdf::mdf3::conversions::Mdf3ConversionOutput;
            let conversion = file.channel_conversion(d, c, k);
            if channel.kind == Kind::Numeric
                && conversion.is_ok_and(|it| matches!(it.output(), Mdf3ConversionOutput::Text))
            {
                channel.kind = Kind::Enum;
            }
        }
        let _ = announced;
        Ok(Self {
            file: Either::Three(Box::new(file)),
            channels,
            at,
            faults,
            announced: HashMap::new(),
        })
    }

    fn are_numbers(&self, wanted: &[usize]) -> Result<(), Problem> {
        let mut channels = wanted.iter().filter_map(|&k| self.channels.get(k));
        match channels.find(|channel| !channel.kind.is_number()) {
            Some(text) => Err(Problem::of(
                text.shown(),
                format!("{}, not a number", text.kind.word()),
            )),
            None => Ok(()),
        }
    }

    fn read4(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let mut all = vec![Series::default(); wanted.len()];
        let mut done = vec![false; wanted.len()];
        for first in 0..wanted.len() {
            if done[first] {
                continue;
            }
            let group = self.group_of(wanted[first]);
            // All of a group in one pass over its records.
            let places: Vec<usize> = (first..wanted.len())
                .filter(|&place| !done[place] && self.group_of(wanted[place]) == group)
                .collect();
            let members: Vec<usize> = places.iter().map(|&place| wanted[place]).collect();
            for (place, series) in places.into_iter().zip(self.read_group(&members)?) {
                done[place] = true;
                all[place] = series;
            }
        }
        let mut faults = Vec::new();
        for (&one, series) in wanted.iter().zip(&all) {
            let announced = self.announced.get(&self.group_of(one)).copied();
            let announced = announced.unwrap_or(0);
            if (series.values.len() as u64) < announced {
                faults.push(format!(
                    "{}: {} of {announced} announced readings are there",
                    self.channels[one].shown(),
                    series.values.len()
                ));
            }
        }
        for fault in faults {
            if !self.faults.contains(&fault) {
                self.faults.push(fault);
            }
        }
        Ok(all)
    }

    fn group_of(&self, channel: usize) -> (usize, usize) {
        let (data, group, _) = self.at[channel];
        (data, group)
    }

    /// Channels of one group.
    fn read_group(&self, members: &[usize]) -> Result<Vec<Series>, Problem> {
        if let Some(pieces) = self.pieces4(members)? {
            let mut times = None::<Vec<f64>>;
            let mut all = vec![Series::default(); members.len()];
            for piece in pieces {
                let piece = piece?;
                if let Some(more) = piece.first().and_then(|one| one.time_s.as_deref()) {
                    times.get_or_insert_default().extend(more);
                }
                for (one, more) in all.iter_mut().zip(piece) {
                    if let Some(flags) = more.invalid {
                        let flagged = one.invalid.get_or_insert_default();
                        flagged.resize(one.values.len(), false);
                        flagged.extend(flags);
                    }
                    one.values.extend(more.values);
                }
            }
            let times = times.map(Arc::new);
            for one in &mut all {
                if let Some(flags) = &mut one.invalid {
                    flags.resize(one.values.len(), false);
                }
                one.time_s.clone_from(&times);
            }
            return Ok(all);
        }
        let Either::Four(file) = &self.file else {
            return Err(Problem::whole("not MDF 4"));
        };
        let mut times = None;
        let mut all = Vec::with_capacity(members.len());
        for &one in members {
            let listed = &self.channels[one];
            let of = |problem: Problem| Problem::of(listed.shown(), problem.in_words());
            let found = self
                .channel4(one)
                .ok_or_else(|| of(Problem::whole("not in the file")))?;
            let signal = file.signal(found).map_err(problem).map_err(of)?;
            let (values, invalid) = readings(&signal, listed.kind).map_err(of)?;
            if times.is_none()
                && let Some(master) = self.master4(self.group_of(one))
            {
                let signal = file.signal(master).map_err(problem).map_err(of)?;
                times = Some(Arc::new(seconds(&signal, master).map_err(of)?));
            }
            all.push(whole(listed, values, times.clone(), invalid)?);
        }
        Ok(all)
    }

    fn group4(&self, (data, group): (usize, usize)) -> Option<&falcon_mdf::ChannelGroup> {
        let Either::Four(file) = &self.file else {
            return None;
        };
        file.data_groups().get(data)?.channel_groups.get(group)
    }

    fn channel4(&self, channel: usize) -> Option<&falcon_mdf::Channel> {
        self.group4(self.group_of(channel))?
            .channels
            .get(self.at[channel].2)
    }

    /// The time of a group.
    fn master4(&self, group: (usize, usize)) -> Option<&falcon_mdf::Channel> {
        let mut channels = self.group4(group)?.channels.iter();
        channels.find(|channel| channel.is_master() && channel.sync_type == SyncType::Time)
    }

    /// Channels of one group, some records at a time; `None` for others, and for channels that are no bytes of a record but are counted.
    fn pieces4(&self, wanted: &[usize]) -> Result<Option<Pieces<'_>>, Problem> {
        let (Either::Four(file), Some(&first)) = (&self.file, wanted.first()) else {
            return Ok(None);
        };
        let group = self.group_of(first);
        let members: Option<Vec<&falcon_mdf::Channel>> =
            wanted.iter().map(|&one| self.channel4(one)).collect();
        let (Some(mut members), Some(master)) = (members, self.master4(group)) else {
            return Ok(None);
        };
        members.push(master);
        let counted = |channel: &&falcon_mdf::Channel| {
            matches!(
                channel.channel_type,
                ChannelType::VirtualData | ChannelType::VirtualMaster
            )
        };
        if members.iter().any(counted) || wanted.iter().any(|&one| self.group_of(one) != group) {
            return Ok(None);
        }
        let chunks = file
            .signals_chunks(&members, ROWS_A_PIECE)
            .map_err(problem)?;
        let listed: Vec<&Channel> = wanted.iter().map(|&one| &self.channels[one]).collect();
        let piece = move |chunk: Result<Vec<falcon_mdf::Signal>, falcon_mdf::error::Mf4Error>| {
            let chunk = chunk.map_err(problem)?;
            let (Some(time), signals) = (chunk.last(), chunk.iter().zip(&listed)) else {
                return Ok(Vec::new());
            };
            let times = Arc::new(seconds(time, master)?);
            let series = signals.map(|(signal, listed)| {
                let read = readings(signal, listed.kind);
                let (values, invalid) =
                    read.map_err(|problem| Problem::of(listed.shown(), problem.in_words()))?;
                whole(listed, values, Some(Arc::clone(&times)), invalid)
            });
            series.collect()
        };
        Ok(Some(Box::new(chunks.map(piece))))
    }

    fn read3(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let Either::Three(file) = &self.file else {
            return Err(Problem::whole("not MDF 3"));
        };
        let mut times: HashMap<(usize, usize), Option<Arc<Vec<f64>>>> = HashMap::new();
        let mut all = Vec::with_capacity(wanted.len());
        for &one in wanted {
            let listed = &self.channels[one];
            let of = |problem: Problem| Problem::of(listed.shown(), problem.in_words());
            let (d, c, k) = self.at[one];
            let values = if listed.kind == Kind::Enum {
                file.channel_values(d, c, k)
            } else {
                file.channel_physical(d, c, k)
            };
            let values = numbers(values.map_err(problem).map_err(of)?).map_err(of)?;
            let time = match times.get(&(d, c)) {
                Some(time) => time.clone(),
                None => {
                    let master = self
                        .at
                        .iter()
                        .zip(&self.channels)
                        .find(|(at, channel)| (at.0, at.1) == (d, c) && channel.is_time);
                    let time = match master {
                        Some((&(d, c, k), _)) => Some(Arc::new(
                            numbers(
                                file.channel_physical(d, c, k)
                                    .map_err(problem)
                                    .map_err(of)?,
                            )
                            .map_err(of)?,
                        )),
                        None => None,
                    };
                    times.insert((d, c), time.clone());
                    time
                }
            };
            all.push(whole(listed, values, time, None)?);
        }
        Ok(all)
    }
}

/// A channel's numbers, and which of them are invalid.
fn readings(
    signal: &falcon_mdf::Signal,
    kind: Kind,
) -> Result<(Vec<f64>, Option<Vec<bool>>), Problem> {
    let values = if kind == Kind::Enum {
        signal.raw_values()
    } else {
        signal.values()
    };
    let invalid = signal
        .validity()
        .map(|valid| valid.into_iter().map(|valid| !valid).collect());
    Ok((numbers(values.map_err(problem)?)?, invalid))
}

/// A group's times in s.
fn seconds(signal: &falcon_mdf::Signal, master: &falcon_mdf::Channel) -> Result<Vec<f64>, Problem> {
    let mut values = numbers(signal.values().map_err(problem)?)?;
    let unit =
        crate::units::of(&master.unit).filter(|unit| unit.quantity == crate::units::Quantity::Time);
    if let Some(unit) = unit.filter(|unit| unit.factor != 1.0) {
        values.iter_mut().for_each(|value| *value *= unit.factor);
    }
    Ok(values)
}

/// As many readings as time stamps, or a word.
fn whole(
    channel: &Channel,
    values: Vec<f64>,
    time_s: Option<Arc<Vec<f64>>>,
    invalid: Option<Vec<bool>>,
) -> Result<Series, Problem> {
    if let Some(times) = time_s.as_ref().filter(|times| times.len() != values.len()) {
        return Err(Problem::of(
            channel.shown(),
            format!("{} readings and {} time stamps", values.len(), times.len()),
        ));
    }
    Ok(Series {
        time_s,
        values,
        invalid,
    })
}

fn kind4(channel: &falcon_mdf::Channel) -> Kind {
    if channel.is_array() {
        return Kind::Array;
    }
    // A maximum-length channel is bytes whatever its numbers say.
    if channel.channel_type == ChannelType::MaxLength {
        return Kind::Text;
    }
    match channel.value_kind() {
        kind if kind.is_numeric() => Kind::Numeric,
        ValueKind::Str
            if channel.raw_value_kind().is_numeric()
                && channel.channel_type != ChannelType::VariableLength =>
        {
            Kind::Enum
        }
        _ => Kind::Text,
    }
}

fn numbers(values: SignalValues) -> Result<Vec<f64>, Problem> {
    match values {
        SignalValues::F64(values) => Ok(values),
        other
            if other.kind().is_numeric()
                && !matches!(
                    other,
                    SignalValues::Array { .. } | SignalValues::ArrayVarLen { .. }
                ) =>
        {
            Ok(other.to_f64())
        }
        other => Err(Problem::whole(format!(
            "{} are no numbers",
            other.kind().name()
        ))),
    }
}

impl Source for MdfSource {
    fn start_time(&self) -> Option<String> {
        match &self.file {
            Either::Four(file) => {
                let start = file.start_time();
                (start.timestamp_ns != 0).then(|| {
                    let offset = i64::from(start.tz_offset_min) + i64::from(start.dst_offset_min);
                    rfc3339(start.timestamp_ns, offset)
                })
            }
            // Local time of the recorder; where it gives its zone it does so in text that falcon_mdf leaves alone.
            Either::Three(file) => file
                .start_time_ns()
                .and_then(|ns| i64::try_from(ns).ok())
                .map(|ns| rfc3339(ns, 0)),
        }
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        self.are_numbers(wanted)?;
        match self.file {
            Either::Three(_) => self.read3(wanted),
            Either::Four(_) => self.read4(wanted),
        }
    }

    fn pieces(&self, wanted: &[usize]) -> Result<Option<Pieces<'_>>, Problem> {
        self.are_numbers(wanted)?;
        self.pieces4(wanted)
    }

    fn faults(&self) -> Vec<String> {
        self.faults.clone()
    }
}
