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
use crate::source::{Channel, Kind, Series, Source};
use crate::time_text::rfc3339;

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

    fn read4(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let Either::Four(file) = &self.file else {
            return Err(Problem::whole("not MDF 4"));
        };
        let groups = file.data_groups();
        let channel = |(d, c, k): At| groups.get(d)?.channel_groups.get(c)?.channels.get(k);
        let mut times: HashMap<(usize, usize), Option<Arc<Vec<f64>>>> = HashMap::new();
        let mut all = Vec::with_capacity(wanted.len());
        let mut faults = Vec::new();
        for &one in wanted {
            let listed = &self.channels[one];
            let of = |problem: Problem| Problem::of(listed.shown(), problem.in_words());
            let at = self.at[one];
            let found =
                channel(at).ok_or_else(|| Problem::of(listed.shown(), "not in the file"))?;
            let signal = file.signal(found).map_err(problem).map_err(of)?;
            let values = if listed.kind == Kind::Enum {
                signal.raw_values()
            } else {
                signal.values()
            };
            let values = numbers(values.map_err(problem).map_err(of)?).map_err(of)?;
            let invalid = signal
                .validity()
                .map(|valid| valid.into_iter().map(|valid| !valid).collect());
            let group = (at.0, at.1);
            let time = match times.get(&group) {
                Some(time) => time.clone(),
                None => {
                    let time = groups
                        .get(at.0)
                        .and_then(|data| data.channel_groups.get(at.1))
                        .and_then(|one| {
                            let mut masters = one.channels.iter();
                            masters.find(|channel| {
                                channel.is_master() && channel.sync_type == SyncType::Time
                            })
                        });
                    let time = match time {
                        Some(master) => {
                            let signal = file.signal(master).map_err(problem).map_err(of)?;
                            let mut values = numbers(signal.values().map_err(problem).map_err(of)?)
                                .map_err(of)?;
                            let factor = crate::units::of(&master.unit)
                                .filter(|unit| unit.quantity == crate::units::Quantity::Time);
                            if let Some(unit) = factor.filter(|unit| unit.factor != 1.0) {
                                values.iter_mut().for_each(|value| *value *= unit.factor);
                            }
                            Some(Arc::new(values))
                        }
                        None => None,
                    };
                    times.insert(group, time.clone());
                    time
                }
            };
            let announced = self.announced.get(&group).copied().unwrap_or(0);
            if (values.len() as u64) < announced {
                faults.push(format!(
                    "{}: {} of {announced} announced readings are there",
                    listed.shown(),
                    values.len()
                ));
            }
            all.push(whole(listed, values, time, invalid)?);
        }
        for fault in faults {
            if !self.faults.contains(&fault) {
                self.faults.push(fault);
            }
        }
        Ok(all)
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
        if let Some(text) = wanted
            .iter()
            .filter_map(|&k| self.channels.get(k))
            .find(|channel| !channel.kind.is_number())
        {
            return Err(Problem::of(
                text.shown(),
                format!("{}, not a number", text.kind.word()),
            ));
        }
        match self.file {
            Either::Three(_) => self.read3(wanted),
            Either::Four(_) => self.read4(wanted),
        }
    }

    fn faults(&self) -> Vec<String> {
        self.faults.clone()
    }
}
