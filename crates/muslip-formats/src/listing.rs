//! What `muslip channels` lists: each channel with what only reading it tells.

use std::sync::Arc;

use crate::error::FormatError;
use crate::roles::Roles;
use crate::source::{Channel, Series};
use crate::source_file::SourceFile;
use crate::steps::Steps;

/// Channels that are read at once.
const AT_ONCE: usize = 8;

/// A channel with the figures of its readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed {
    /// The channel as announced.
    pub channel: Channel,
    /// Readings that there are.
    pub samples: u64,
    /// Time of the first in s, where the channel has a time.
    pub first_s: Option<f64>,
    /// Time of the last in s.
    pub last_s: Option<f64>,
    /// Readings a second.
    pub rate_hz: Option<f64>,
    /// Readings that the file calls invalid.
    pub invalid: u64,
    /// The column that the map, or the guess, makes of it.
    pub role: Option<String>,
}

/// What reading a channel tells.
#[derive(Debug, Clone, Default)]
struct Figures {
    samples: u64,
    invalid: u64,
    /// Of its own times.
    time: Option<Steps>,
}

/// Reads every channel once, some at a time, and tells of each; a channel that cannot be read is listed with a fault. `progress` receives the
/// share done.
///
/// Memory: where the format is read in pieces, some of those; else the readings of eight channels.
pub fn listed(
    file: &mut SourceFile,
    roles: &Roles,
    progress: &mut dyn FnMut(f64),
) -> (Vec<Listed>, Vec<String>) {
    let channels = file.channels().to_vec();
    let mut faults = Vec::new();
    let shared = shared_time(file, roles);
    let numeric: Vec<usize> = (0..channels.len())
        .filter(|&k| channels[k].kind.is_number())
        .collect();
    let mut figures: Vec<Option<Figures>> = vec![None; channels.len()];
    let mut from = 0;
    while from < numeric.len() {
        let some = together(&channels, &numeric[from..]);
        from += some.len();
        // Where one of them cannot be read each is tried by itself.
        let before = from - some.len();
        let read = figures_of(file, some, &mut |share| {
            let done = before as f64 + share * some.len() as f64;
            progress(done / numeric.len() as f64);
        });
        let read = read.or_else(|error| match some {
            [_] => Err(error),
            _ => Ok(Vec::new()),
        });
        match read {
            Ok(all) if all.len() == some.len() => {
                for (&k, one) in some.iter().zip(all) {
                    figures[k] = Some(one);
                }
            }
            _ => {
                for &k in some {
                    match figures_of(file, &[k], &mut |_| {}) {
                        Ok(mut one) => figures[k] = one.pop(),
                        Err(error) => faults.push(format!(
                            "{}: {}",
                            channels[k].shown(),
                            error.problem.in_words()
                        )),
                    }
                }
            }
        }
    }
    let mut all = Vec::with_capacity(channels.len());
    for (k, (channel, figures)) in channels.into_iter().zip(figures).enumerate() {
        let role = roles.of_channel(k).map(str::to_owned);
        let one = Listed::of(channel, role, figures, shared.as_ref());
        if one.samples < one.channel.samples {
            faults.push(format!(
                "{}: {} of {} readings are there",
                one.channel.shown(),
                one.samples,
                one.channel.samples
            ));
        }
        all.push(one);
    }
    let mut told = file.faults();
    for fault in faults {
        if !told.contains(&fault) {
            told.push(fault);
        }
    }
    (all, told)
}

impl Listed {
    fn of(
        channel: Channel,
        role: Option<String>,
        figures: Option<Figures>,
        shared: Option<&Steps>,
    ) -> Self {
        let samples = figures.as_ref().map_or(channel.samples, |one| one.samples);
        let time = match figures.as_ref().map(|one| one.time.as_ref()) {
            Some(Some(own)) => Some(own),
            Some(None) => shared.filter(|shared| shared.count == samples),
            None => None,
        };
        Self {
            samples,
            first_s: time.and_then(|time| time.ends).map(|(first, _)| first),
            last_s: time.and_then(|time| time.ends).map(|(_, last)| last),
            rate_hz: time.and_then(Steps::rate_hz),
            invalid: figures.as_ref().map_or(0, |one| one.invalid),
            role,
            channel,
        }
    }
}

/// The channels that are read at once: the next so many of one group.
fn together<'a>(channels: &[Channel], numeric: &'a [usize]) -> &'a [usize] {
    let group = numeric.first().map(|&k| &channels[k].group);
    let same = numeric
        .iter()
        .take(AT_ONCE)
        .take_while(|&&k| Some(&channels[k].group) == group)
        .count();
    numeric.get(..same).unwrap_or_default()
}

/// The time of formats without one of their own.
fn shared_time(file: &mut SourceFile, roles: &Roles) -> Option<Steps> {
    let time = roles.time.as_ref()?;
    let factor =
        crate::convert::time_factor(file.channels().get(time.channel)?, &time.entry).ok()?;
    let mut steps = Steps::default();
    let mut has_own = false;
    each_piece(file, &[time.channel], |piece| {
        for series in piece {
            has_own |= series.time_s.is_some();
            series
                .values
                .iter()
                .for_each(|value| steps.next(value * factor));
        }
    })
    .ok()?;
    (!has_own).then_some(steps)
}

fn figures_of(
    file: &mut SourceFile,
    some: &[usize],
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Figures>, FormatError> {
    let mut all = vec![Figures::default(); some.len()];
    let announced = some.first().map_or(0, |&k| file.channels()[k].samples);
    // Whether the first channel's time was every other's in all pieces: then it is gone through once for all.
    let mut one_time = true;
    each_piece(file, some, |piece| {
        let first = piece.first().and_then(|series| series.time_s.clone());
        for (k, (one, series)) in all.iter_mut().zip(piece).enumerate() {
            one.samples += series.values.len() as u64;
            one.invalid += series.invalid_count();
            let Some(times) = &series.time_s else {
                continue;
            };
            one_time &= first
                .as_ref()
                .is_some_and(|first| Arc::ptr_eq(first, times));
            if k == 0 || !one_time {
                let steps = one.time.get_or_insert_default();
                times.iter().for_each(|&time| steps.next(time));
            }
        }
        let done = all.first().map_or(0, |one| one.samples);
        progress(done as f64 / announced.max(1) as f64);
    })?;
    if let (true, Some((first, others))) = (one_time, all.split_first_mut()) {
        for other in others {
            other.time.clone_from(&first.time);
        }
    }
    Ok(all)
}

/// Goes through channels of one group, in pieces where the format has them.
fn each_piece(
    file: &mut SourceFile,
    some: &[usize],
    mut take: impl FnMut(Vec<Series>),
) -> Result<(), FormatError> {
    if let Some(pieces) = file.pieces(some)? {
        for piece in pieces {
            take(piece?);
        }
        return Ok(());
    }
    take(file.read(some)?);
    Ok(())
}
