//! A file of any length converted some rows at a time. Channels with times of their own go side by side: of each one only what the raster's next rows
//! need is in memory. Their times are gone through once before, because rates, gaps and the raster hang on all of them.

mod grid;
mod sink;
mod track;

use std::mem::take;

pub use self::sink::{RowSink, StreamError};

use self::grid::{Grid, MOST_ROWS, Next, Raster};
use self::sink::Out;
use self::track::{Group, Track};
use crate::convert::{self, Prepared, Told};
use crate::error::{FormatError, Problem};
use crate::made::{Fault, Made};
use crate::map::Map;
use crate::raster::{Bringing, Done};
use crate::roles::TIME;
use crate::source_file::SourceFile;
use crate::steps::Steps;

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

/// A conversion that can go some rows at a time.
#[derive(Debug)]
pub struct Stream {
    prepared: Prepared,
    groups: Vec<Group>,
    /// The group whose times are kept, or span the raster, where the map says so.
    raster: Option<usize>,
}

impl Stream {
    /// The conversion of a file by a map, or by a guess without one; `None` where it has to be read whole: a format that is not read in pieces, or
    /// one of several times in its columns.
    ///
    /// # Errors
    /// As [`convert::convert`].
    pub fn of(file: &SourceFile, map: Option<&Map>) -> Result<Option<Self>, FormatError> {
        let fail = |problem: Problem| problem.in_file(file.path());
        let prepared = Prepared::of(file, map).map_err(fail)?;
        let column = match prepared.one_time(file).map_err(fail)? {
            convert::OneTime::Column(at, entry) => {
                let channel = &prepared.channels[at];
                let factor = convert::time_factor(channel, &entry).map_err(fail)?;
                let offset = entry.offset - entry.delay_s;
                Some((at, (entry.scale * factor, offset, channel.name == TIME)))
            }
            convert::OneTime::Own => None,
            convert::OneTime::Several if file.format().has_own_time() => None,
            convert::OneTime::Several => return Ok(None),
        };
        let mut groups: Vec<(&str, Group)> = Vec::new();
        for (place, one) in prepared.roles.assigned.iter().enumerate() {
            let name = match column {
                Some(_) => "",
                None => prepared.channels[one.channel].group.as_str(),
            };
            let delay_s = one.entry.delay_s;
            let mut found = groups.iter_mut();
            let found = found.find(|(other, group)| *other == name && group.delay_s == delay_s);
            if let Some((_, group)) = found {
                group.wanted.push(one.channel);
                group.members.push(place);
                continue;
            }
            let mut wanted: Vec<usize> = column.iter().map(|(at, _)| *at).collect();
            wanted.push(one.channel);
            groups.push((
                name,
                Group {
                    wanted,
                    time: column.map(|(_, time)| time),
                    delay_s,
                    members: vec![place],
                },
            ));
        }
        let groups: Vec<Group> = groups.into_iter().map(|(_, group)| group).collect();
        for group in &groups {
            if file.pieces(&group.wanted)?.is_none() {
                return Ok(None);
            }
        }
        let raster = match &prepared.time.raster {
            None => None,
            Some(name) => {
                let place = prepared.raster_place(name).map_err(fail)?;
                groups
                    .iter()
                    .position(|group| group.members.contains(&place))
            }
        };
        Ok(Some(Self {
            prepared,
            groups,
            raster,
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

    /// Rows that the file announces: the most readings of a column.
    #[must_use]
    pub fn announced_rows(&self) -> u64 {
        let groups = self.groups.iter();
        groups.map(|group| self.announced(group)).max().unwrap_or(0)
    }

    fn announced(&self, group: &Group) -> u64 {
        let channels = &self.prepared.channels;
        let samples = group.wanted.iter().filter_map(|&at| channels.get(at));
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
        let units = self.prepared.units();
        let units = units.map_err(|problem| problem.in_file(file.path()))?;
        let mut tracks = Vec::with_capacity(self.groups.len());
        for group in &self.groups {
            tracks.push(Track::new(
                &self.prepared,
                file,
                group,
                &units,
                &group.wanted,
            )?);
        }
        let mut out = Out {
            sink,
            progress,
            rows: 0,
            empty: vec![0; units.len()],
        };
        let raster = match (&self.groups[..], self.prepared.time.rate_hz) {
            ([_], None) => self.kept(&mut tracks, &mut out)?,
            _ => self.brought(file, &units, &mut tracks, &mut out)?,
        };
        if out.rows == 0 {
            let problem = Problem::whole("the mapped channels have no readings");
            return Err(problem.in_file(file.path()).into());
        }
        let (rows, empty) = (out.rows, out.empty);
        let (notes, made) = self.told(file, &units, &tracks, &raster, &empty);
        Ok(Streamed {
            rows,
            start_time: file.start_time(),
            notes,
            made,
        })
    }

    /// One group whose times are kept: its readings as they come.
    fn kept(&self, tracks: &mut [Track<'_>], out: &mut Out<'_>) -> Result<Raster, StreamError> {
        let mut start_s = None;
        for track in &mut *tracks {
            while track.next()? {
                let Some(&first) = track.times.first() else {
                    continue;
                };
                let start_s = *start_s.get_or_insert(if track.keeps() { 0.0 } else { first });
                let times = take(&mut track.times);
                let mut columns = vec![times.iter().map(|time| time - start_s).collect()];
                columns.extend(track.columns.iter_mut().map(take));
                out.rows(&columns)?;
            }
        }
        let steps = tracks.first().map(|track| &track.steps);
        let column = self.prepared.roles.assigned.first();
        let column = self
            .prepared
            .time
            .raster
            .as_ref()
            .or(column.map(|one| &one.column));
        let rate_hz = steps.and_then(Steps::rate_hz);
        Ok(Raster {
            start_s: start_s.unwrap_or(0.0),
            rate_hz,
            words: convert::raster_words(column.map_or("", String::as_str), rate_hz),
            done: vec![Done::Kept; self.prepared.roles.assigned.len()],
        })
    }

    /// Several groups, or a raster of another rate.
    fn brought(
        &self,
        file: &SourceFile,
        units: &[(f64, f64, String)],
        tracks: &mut [Track<'_>],
        out: &mut Out<'_>,
    ) -> Result<Raster, StreamError> {
        let assigned = &self.prepared.roles.assigned;
        let mut seen = Vec::with_capacity(self.groups.len());
        for group in &self.groups {
            // Of the channels one, so that its times are given.
            let first = group.time.is_some().into();
            let wanted = group.wanted.get(..=first).unwrap_or_default();
            seen.push(Track::new(&self.prepared, file, group, units, wanted)?.seen()?);
        }
        let rate = |group: &usize| seen[*group].steps.rate_hz();
        // The first of equals in the order of the columns, as where all is read at once.
        let in_order = assigned.iter().enumerate().filter_map(|(place, _)| {
            let mut groups = self.groups.iter();
            groups.position(|group| group.members.contains(&place))
        });
        let fastest = in_order.reduce(|best, one| {
            let is_faster = rate(&one).unwrap_or(0.0) > rate(&best).unwrap_or(0.0) * (1.0 + 1e-6);
            if is_faster { one } else { best }
        });
        let chosen = self.raster.or(fastest).unwrap_or(0);
        let starts = seen
            .iter()
            .filter_map(|one| one.steps.ends)
            .map(|ends| ends.0);
        let keeps = self.groups.iter().any(Group::keeps);
        let first_s = starts.fold(f64::INFINITY, f64::min);
        let start_s = if keeps { 0.0 } else { first_s };
        let name = match &self.prepared.time.raster {
            Some(name) => name,
            None => &assigned[self.groups[chosen].members[0]].column,
        };
        let mut grid = match self.prepared.time.rate_hz {
            None => Grid::Times,
            Some(rate_hz) => {
                let rows = convert::even_rows(seen[chosen].steps.ends, rate_hz);
                let (first_s, rows) = rows.map_err(|problem| problem.in_file(file.path()))?;
                Grid::Even {
                    first_s,
                    rate_hz,
                    next: 0,
                    rows,
                }
            }
        };
        let (rate_hz, words) = match self.prepared.time.rate_hz {
            None => (rate(&chosen), convert::raster_words(name, rate(&chosen))),
            Some(rate_hz) => (Some(rate_hz), convert::even_words(name, rate_hz)),
        };
        let is_kept = |group: usize| {
            matches!(grid, Grid::Times) && seen[group].times_hash == seen[chosen].times_hash
        };
        let fastest_hz = (0..seen.len())
            .filter_map(|group| rate(&group))
            .fold(0.0, f64::max);
        // So many s of every channel are about so many readings of the fastest.
        let span_s = MOST_ROWS as f64 / fastest_hz;
        let mut done = vec![Done::Kept; assigned.len()];
        let mut ways: Vec<Vec<Bringing>> = Vec::with_capacity(seen.len());
        for (group, seen) in self.groups.iter().zip(&seen) {
            let way = |&place: &usize| {
                let method = assigned[place].entry.method;
                let steps = &seen.steps;
                Bringing::of(steps.interval_s(), steps.rate_hz(), rate_hz, method)
            };
            ways.push(group.members.iter().map(way).collect());
        }
        for (at, group) in self
            .groups
            .iter()
            .enumerate()
            .filter(|(at, _)| !is_kept(*at))
        {
            for (&place, way) in group.members.iter().zip(&ways[at]) {
                done[place] = way.done;
            }
        }
        while let Some(Next { times, mut kept }) = grid.next(&mut tracks[chosen], span_s)? {
            let (Some(&from), Some(&to)) = (times.first(), times.last()) else {
                break;
            };
            let mut columns = vec![Vec::new(); 1 + assigned.len()];
            for (at, (track, ways)) in tracks.iter_mut().zip(&ways).enumerate() {
                let members = track.group.members.iter().enumerate();
                if at == chosen && matches!(grid, Grid::Times) {
                    for ((_, &place), values) in members.zip(kept.drain(..)) {
                        columns[1 + place] = values;
                    }
                    continue;
                }
                let reach_s = ways.iter().map(Bringing::reach_s).fold(0.0, f64::max);
                track.go_to(from - reach_s, to + reach_s)?;
                for ((member, &place), way) in members.zip(ways) {
                    columns[1 + place] = way.values(&times, &track.times, &track.columns[member]);
                }
            }
            columns[0] = times.into_iter().map(|time| time - start_s).collect();
            out.rows(&columns)?;
        }
        // What lies behind the raster's end is counted as well.
        for track in tracks {
            track.go_to(f64::INFINITY, f64::INFINITY)?;
        }
        Ok(Raster {
            start_s,
            rate_hz,
            words,
            done,
        })
    }

    /// What was done, in words and for a diagnosis.
    fn told(
        &self,
        file: &SourceFile,
        units: &[(f64, f64, String)],
        tracks: &[Track<'_>],
        raster: &Raster,
        empty: &[u64],
    ) -> (Vec<String>, Made) {
        let Prepared {
            channels, roles, ..
        } = &self.prepared;
        let start_s = raster.start_s;
        let mut notes = vec![self.prepared.read_as(file)];
        notes.push(format!("{TIME}: {}", raster.words));
        let mut made = Made::default();
        let mut faults = self.prepared.left_out.clone();
        let mut gaps_in_words = Vec::new();
        let (mut first_s, mut last_s) = (f64::INFINITY, f64::NEG_INFINITY);
        for (place, one) in roles.assigned.iter().enumerate() {
            let mut of = tracks.iter().filter_map(|track| {
                let members = &mut track.group.members.iter();
                Some((track, members.position(|&other| other == place)?))
            });
            let Some((track, member)) = of.next() else {
                continue;
            };
            let gaps = track.steps.gaps(convert::MOST_GAPS);
            let told = Told {
                column: &one.column,
                channel: &channels[one.channel],
                unit: &convert::unit_words(&units[place].2, &one.entry),
                done: raster.done[place],
                interval_s: track.steps.interval_s(),
                rate_hz: track.steps.rate_hz(),
                raster_hz: raster.rate_hz,
                ends: track
                    .steps
                    .ends
                    .map(|(from, to)| (from - start_s, to - start_s)),
                gaps: gaps
                    .iter()
                    .map(|(from, to)| (from - start_s, to - start_s))
                    .collect(),
                empty: empty[place],
                invalid: track.invalid[member],
            };
            told.tell(&mut notes, &mut made);
            made.inherit(file.made(), &channels[one.channel].name, &one.column);
            if member == 0 {
                let prefix = match self.groups.len() {
                    1 => String::new(),
                    _ => format!("{}: ", channels[one.channel].shown()),
                };
                let (count, untimed) = (track.steps.count, track.untimed);
                let announced = self.announced(track.group);
                if count + untimed < announced {
                    let there = count + untimed;
                    faults.push(format!(
                        "{prefix}{there} of {announced} announced readings are there"
                    ));
                }
                if untimed > 0 {
                    faults.push(format!(
                        "{prefix}{untimed} readings without a time stamp were left out"
                    ));
                }
                gaps_in_words.extend(told.gaps.iter().map(|(from, to)| {
                    let (long, at) = (convert::rounded(to - from), convert::rounded(*from));
                    format!("{prefix}gap of {long} s at {at} s")
                }));
                if let Some((from, to)) = told.ends {
                    (first_s, last_s) = (first_s.min(from), last_s.max(to));
                }
            }
        }
        faults.extend(file.faults());
        made.faults.extend(faults.iter().map(|what| Fault {
            column: TIME.to_owned(),
            start_s: first_s,
            end_s: last_s,
            what: what.clone(),
        }));
        made.inherit(file.made(), TIME, TIME);
        let told = faults.into_iter().chain(gaps_in_words);
        notes.extend(told.map(|fault| format!("fault: {fault}")));
        (notes, made)
    }
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::path::PathBuf;
    use std::sync::Arc;

    use super::*;
    use crate::Format;
    use crate::convert::convert;
    use crate::source::{Channel, Kind, Pieces, Series, Source};

    /// Groups of channels with times of their own, which give so many readings at a time.
    struct Bench {
        channels: Vec<Channel>,
        series: Vec<Series>,
        piece: usize,
    }

    impl Source for Bench {
        fn start_time(&self) -> Option<String> {
            None
        }

        fn channels(&self) -> &[Channel] {
            &self.channels
        }

        fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
            Ok(wanted.iter().map(|&at| self.series[at].clone()).collect())
        }

        fn pieces(&self, wanted: &[usize]) -> Result<Option<Pieces<'_>>, Problem> {
            let wanted = wanted.to_vec();
            let length = self.series[wanted[0]].values.len();
            assert!(
                wanted
                    .iter()
                    .all(|&at| self.channels[at].group == self.channels[wanted[0]].group)
            );
            let pieces = (0..length).step_by(self.piece).map(move |from| {
                let range = from..(from + self.piece).min(length);
                let of = |&at: &usize| {
                    let one = &self.series[at];
                    let times = one
                        .time_s
                        .as_ref()
                        .map(|times| times[range.clone()].to_vec());
                    Series {
                        time_s: times.map(Arc::new),
                        values: one.values[range.clone()].to_vec(),
                        invalid: one
                            .invalid
                            .as_ref()
                            .map(|flags| flags[range.clone()].to_vec()),
                    }
                };
                Ok(wanted.iter().map(of).collect())
            });
            Ok(Some(Box::new(pieces)))
        }

        fn faults(&self) -> Vec<String> {
            vec!["a block is damaged".to_owned()]
        }
    }

    /// Channels of four rates: with gaps, missing and invalid readings, readings without a time, ends that differ, and jitter.
    fn bench(piece: usize) -> SourceFile {
        let groups: [(&str, &str, &str, usize, f64, f64); 5] = [
            ("0", "n", "rad/s", 4000, 400.0, 0.0),
            ("0", "v", "m/s", 4000, 400.0, 0.0),
            ("1", "Fx", "kN", 9000, 1000.0, 0.3),
            ("2", "Fz", "N", 120, 10.0, -1.0),
            ("3", "T", "°C", 4000, 400.0, 0.0),
        ];
        let (mut channels, mut series) = (Vec::new(), Vec::new());
        for (number, (group, name, unit, count, rate, start)) in groups.into_iter().enumerate() {
            let mut times: Vec<f64> = (0..count)
                .map(|k| {
                    let gap = if group == "1" && k > 4000 { 0.7 } else { 0.0 };
                    let jitter = if group == "2" {
                        0.003 * (k as f64).sin()
                    } else {
                        0.0
                    };
                    start + k as f64 / rate + gap + jitter
                })
                .collect();
            if group == "1" {
                times[77] = f64::NAN;
            }
            let mut values: Vec<f64> = (0..count)
                .map(|k| (k as f64 * 0.37 * (number + 1) as f64).sin() + k as f64 * 1e-3)
                .collect();
            values[count / 3] = f64::NAN;
            let mut invalid = vec![false; count];
            invalid[count / 2] = true;
            channels.push(Channel {
                group: group.to_owned(),
                name: name.to_owned(),
                unit: unit.to_owned(),
                samples: count as u64 + u64::from(group == "2"),
                comment: String::new(),
                kind: Kind::Numeric,
                is_time: false,
            });
            series.push(Series {
                time_s: Some(Arc::new(times)),
                values,
                invalid: Some(invalid),
            });
        }
        let source = Bench {
            channels,
            series,
            piece,
        };
        SourceFile::of_source(PathBuf::from("bench"), Format::Mdf4, Box::new(source))
    }

    #[derive(Default)]
    struct Rows(Vec<Vec<f64>>, usize);

    impl RowSink for Rows {
        fn rows(&mut self, columns: &[Vec<f64>]) -> io::Result<()> {
            self.0.resize(columns.len(), Vec::new());
            self.1 = self.1.max(columns[0].len());
            for (all, some) in self.0.iter_mut().zip(columns) {
                assert_eq!(some.len(), columns[0].len());
                all.extend(some);
            }
            Ok(())
        }
    }

    const MAP: &str = "[channels.wheel_speed_rad_s]\nname = \"n\"\n[channels.vehicle_speed_m_s]\nname = \"v\"\n\
        [channels.drag_force_n]\nname = \"Fx\"\n[channels.normal_force_n]\nname = \"Fz\"\n[channels.temperature]\nname = \"T\"\n";

    #[test]
    fn what_goes_by_pieces_is_what_is_converted_whole() {
        let variants = [
            String::new(),
            "[time]\nraster = \"normal_force_n\"\n".to_owned(),
            "[time]\nraster = \"wheel_speed_rad_s\"\n".to_owned(),
            "[time]\nrate_hz = 50.0\n".to_owned(),
            "[time]\nrate_hz = 3000.0\nraster = \"normal_force_n\"\n".to_owned(),
        ];
        for (variant, delay) in variants.iter().flat_map(|one| [(one, false), (one, true)]) {
            let mut text = format!("{MAP}{variant}");
            if delay {
                text = text.replace(
                    "name = \"v\"",
                    "name = \"v\"\ndelay_s = 0.0125\nmethod = \"hold\"",
                );
            }
            let map: Map = toml::from_str(&text).unwrap();
            let whole = convert(&mut bench(1 << 20), Some(&map)).unwrap();
            for piece in [1 << 20, 501, 7] {
                let file = bench(piece);
                let stream = Stream::of(&file, Some(&map)).unwrap().unwrap();
                assert_eq!(stream.names(), whole.names);
                let mut rows = Rows::default();
                let streamed = stream.run(&file, &mut rows, &mut |_| {}).unwrap();
                let same = |a: &f64, b: &f64| {
                    (a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-9 * b.abs().max(1.0)
                };
                for ((name, column), expected) in
                    whole.names.iter().zip(&rows.0).zip(&whole.columns)
                {
                    assert_eq!(column.len(), expected.len(), "{text}{piece}");
                    let wrong = column.iter().zip(expected).position(|(a, b)| !same(a, b));
                    assert_eq!(wrong, None, "{name} {piece} {text}");
                }
                assert_eq!(streamed.made.resampled.len(), whole.made.resampled.len());
                for (one, expected) in streamed.made.resampled.iter().zip(&whole.made.resampled) {
                    assert_eq!(one.column, expected.column);
                    assert!((one.interval_s / expected.interval_s - 1.0).abs() < 1e-5);
                }
                let of_columns = |made: &Made| -> Vec<Fault> {
                    let faults = made.faults.iter();
                    faults.filter(|one| one.column != TIME).cloned().collect()
                };
                assert_eq!(
                    of_columns(&streamed.made),
                    of_columns(&whole.made),
                    "{text}"
                );
                let columns = |notes: &[String]| -> Vec<String> {
                    let notes = notes.iter();
                    notes
                        .filter(|one| !one.starts_with("fault"))
                        .cloned()
                        .collect()
                };
                assert_eq!(columns(&streamed.notes), columns(&whole.notes));
                let faults: Vec<&str> = streamed
                    .made
                    .faults
                    .iter()
                    .filter(|one| one.column == TIME)
                    .map(|one| one.what.as_str())
                    .collect();
                assert_eq!(
                    faults,
                    [
                        "Fx [kN] (group 1): 1 readings without a time stamp were left out",
                        "Fz [N] (group 2): 120 of 121 announced readings are there",
                        "a block is damaged",
                    ]
                );
            }
        }
    }

    #[test]
    fn a_raster_far_slower_than_a_channel_holds_only_what_it_needs() {
        // At 10 Hz beside 1 kHz: rows come in many small portions, not as one that holds all.
        let map = format!("{MAP}[time]\nrate_hz = 0.5\n");
        let map: Map = toml::from_str(&map).unwrap();
        let file = bench(64);
        let stream = Stream::of(&file, Some(&map)).unwrap().unwrap();
        let group = stream.groups.iter().find(|one| one.members == [2]).unwrap();
        let units = stream.prepared.units().unwrap();
        let mut track = Track::new(&stream.prepared, &file, group, &units, &group.wanted).unwrap();
        let mut most = 0;
        for k in 0..90 {
            let time = 0.3 + f64::from(k) * 0.1;
            track.go_to(time - 0.05, time + 0.05).unwrap();
            most = most.max(track.times.len());
        }
        assert!(most < 100 + 3 * 64, "{most}");
    }
}
