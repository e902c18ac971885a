//! What `muslip channels` lists: each channel with what only reading it tells.

use crate::raster;
use crate::roles::Roles;
use crate::source::{Channel, Series};
use crate::source_file::SourceFile;

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

/// Reads every channel once, one after the other, and tells of each; a channel that cannot be read is listed with a fault.
///
/// Memory: the readings of eight channels at a time.
pub fn listed(file: &mut SourceFile, roles: &Roles) -> (Vec<Listed>, Vec<String>) {
    let channels = file.channels().to_vec();
    let mut faults = Vec::new();
    // The time of formats without one of their own.
    let shared = roles.time.as_ref().and_then(|time| {
        let factor = crate::convert::time_factor(channels.get(time.channel)?, &time.entry).ok()?;
        let series = file.read(&[time.channel]).ok()?.pop()?;
        series.time_s.is_none().then(|| {
            series
                .values
                .iter()
                .map(|value| value * factor)
                .collect::<Vec<f64>>()
        })
    });
    let numeric: Vec<usize> = (0..channels.len())
        .filter(|&k| channels[k].kind.is_number())
        .collect();
    // Some at a time: a text file is gone through once for each reading of it.
    let mut read: Vec<(usize, Series)> = Vec::new();
    let mut all = Vec::with_capacity(channels.len());
    for (k, channel) in channels.into_iter().enumerate() {
        let mut one = Listed {
            samples: channel.samples,
            first_s: None,
            last_s: None,
            rate_hz: None,
            invalid: 0,
            role: roles.of_channel(k).map(str::to_owned),
            channel,
        };
        if one.channel.kind.is_number() {
            if !read.iter().any(|(which, _)| *which == k) {
                let from = numeric.partition_point(|&which| which < k);
                let some = &numeric[from..(from + AT_ONCE).min(numeric.len())];
                // Where one of them cannot be read each is tried by itself.
                let series = file.read(some).unwrap_or_default();
                read = some.iter().copied().zip(series).collect();
            }
            let place = read.iter().position(|(which, _)| *which == k);
            let series = match place {
                Some(place) => Ok(Some(read.swap_remove(place).1)),
                None => file.read(&[k]).map(|mut series| series.pop()),
            };
            match series {
                Ok(Some(series)) => {
                    one.samples = series.values.len() as u64;
                    one.invalid = series.invalid_count();
                    let times = match (&series.time_s, &shared) {
                        (Some(times), _) => Some(times.as_slice()),
                        (None, Some(times)) if times.len() == series.values.len() => {
                            Some(times.as_slice())
                        }
                        _ => None,
                    };
                    if let Some(times) = times {
                        one.first_s = times.first().copied();
                        one.last_s = times.last().copied();
                        one.rate_hz = raster::rate_hz(times);
                    }
                    if one.samples < one.channel.samples {
                        faults.push(format!(
                            "{}: {} of {} readings are there",
                            one.channel.shown(),
                            one.samples,
                            one.channel.samples
                        ));
                    }
                }
                Ok(None) => {}
                Err(error) => faults.push(format!(
                    "{}: {}",
                    one.channel.shown(),
                    error.problem.in_words()
                )),
            }
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
