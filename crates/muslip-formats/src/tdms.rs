//! TDMS 1 and 2, from NI's public text "TDMS File Format Internal Structure".
//!
//! A file is a row of segments; each tells of objects (file, groups, channels), their properties, and how the raw data behind it is laid out, or
//! takes over what the segment before told. First all segments are gone through, which places every run of values; reading then fetches them.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use crate::cursor::Cursor;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::number::Number;
use crate::source::{Channel, Kind, Series, Source};
use crate::tdms_property::Property;
use crate::tdms_scaling::Scaling;
use crate::time_text::rfc3339;

/// Seconds from 1904-01-01, the format's epoch, to 1970-01-01.
const EPOCH_S: i64 = 2_082_844_800;
/// Bytes fetched at a time.
const PIECE: u64 = 1 << 22;
/// Most metadata that a segment may have, in bytes.
const MOST_METADATA: u64 = 1 << 28;

// Bits of a segment's table of contents.
const METADATA: u32 = 1 << 1;
const NEW_OBJECTS: u32 = 1 << 2;
const RAW_DATA: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
const DAQMX: u32 = 1 << 7;

/// Type of a channel's raw values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Raw {
    Number(Number),
    Bool,
    Text,
    Time,
    /// DAQmx: what the values are is told by their scalers.
    Scaled,
    /// Complex or extended numbers, of so many bytes.
    Other(u64),
}

impl Raw {
    fn of(code: u32) -> Option<Self> {
        Some(match code {
            1 => Self::Number(Number::I8),
            2 => Self::Number(Number::I16),
            3 => Self::Number(Number::I32),
            4 => Self::Number(Number::I64),
            5 => Self::Number(Number::U8),
            6 => Self::Number(Number::U16),
            7 => Self::Number(Number::U32),
            8 => Self::Number(Number::U64),
            9 | 0x19 => Self::Number(Number::F32),
            10 | 0x1a => Self::Number(Number::F64),
            11 | 0x1b => Self::Other(16),
            0x20 => Self::Text,
            0x21 => Self::Bool,
            0x44 => Self::Time,
            0x0008_000c => Self::Other(8),
            0x0010_000d => Self::Other(16),
            0xffff_ffff => Self::Scaled,
            _ => return None,
        })
    }

    fn size(self) -> u64 {
        match self {
            Self::Number(number) => number.size() as u64,
            Self::Bool => 1,
            Self::Time => 16,
            Self::Other(bytes) => bytes,
            Self::Text | Self::Scaled => 0,
        }
    }
}

/// One value of a DAQmx row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Scaler {
    number: Number,
    buffer: usize,
    /// Byte in the row, and the bit in it for a digital line.
    byte: u64,
    bit: Option<u32>,
    /// A time stamp of 16 bytes.
    time: bool,
    id: u32,
}

impl Scaler {
    fn size(&self) -> u64 {
        if self.time {
            16
        } else {
            self.number.size() as u64
        }
    }
}

/// How a channel's values lie in a chunk.
#[derive(Debug, Clone, PartialEq)]
struct Layout {
    raw: Raw,
    values: u64,
    /// All bytes of a chunk's texts, with their ends.
    text_bytes: u64,
    scalers: Vec<Scaler>,
    widths: Vec<u64>,
}

/// Values that lie in one stride.
#[derive(Debug, Clone, Copy)]
struct Run {
    offset: u64,
    count: u64,
    stride: u64,
    number: Number,
    big: bool,
    bit: Option<u32>,
    time: bool,
    /// The same again, so many times in all, each so many bytes after the other.
    chunks: u64,
    chunk: u64,
}

#[derive(Debug, Clone, Default)]
struct Object {
    properties: BTreeMap<String, Property>,
    layout: Option<Layout>,
    /// By number of the scaler; channels without have the one of `None`.
    runs: BTreeMap<Option<u32>, Vec<Run>>,
    samples: u64,
    raw: Option<Raw>,
    /// Why its data cannot be placed.
    unsupported: Option<String>,
}

/// A TDMS file.
pub(crate) struct TdmsSource {
    file: FileBytes,
    objects: Vec<Object>,
    channels: Vec<Channel>,
    /// Object of each channel.
    of: Vec<usize>,
    start: Option<i64>,
    /// Properties of groups by their name, and of the file.
    above: HashMap<Option<String>, BTreeMap<String, Property>>,
    faults: Vec<String>,
}

fn torn(at: u64) -> Problem {
    Problem::at_byte(at, "a segment's metadata end early")
}

/// Objects by path, in the order of their first mention.
#[derive(Default)]
struct Objects {
    all: Vec<(String, Object)>,
    places: HashMap<String, usize>,
}

impl Objects {
    fn place(&mut self, path: &str) -> usize {
        if let Some(&place) = self.places.get(path) {
            return place;
        }
        let place = self.all.len();
        self.places.insert(path.to_owned(), place);
        self.all.push((path.to_owned(), Object::default()));
        place
    }
}

impl TdmsSource {
    pub(crate) fn open(file: FileBytes) -> Result<Self, Problem> {
        let mut objects = Objects::default();
        let mut faults = Vec::new();
        // The objects of the present segment in order, and whether they have data in it.
        let mut active: Vec<(usize, bool)> = Vec::new();
        let mut at = 0;
        while at + 28 <= file.length() {
            match segment(&file, at, &mut objects, &mut active, &mut faults) {
                Ok(next) => at = next,
                Err(problem) if at > 0 => {
                    faults.push(format!(
                        "{}: the segments from there are not read",
                        problem.in_words()
                    ));
                    at = file.length();
                }
                Err(problem) => return Err(problem),
            }
        }
        if at < file.length() {
            faults.push(format!(
                "byte {at}: {} bytes behind the last segment are not read",
                file.length() - at
            ));
        }
        let mut source = Self {
            file,
            objects: Vec::new(),
            channels: Vec::new(),
            of: Vec::new(),
            start: None,
            above: HashMap::new(),
            faults,
        };
        for (place, (path, object)) in objects.all.iter().enumerate() {
            let parts = parts(path);
            match parts.as_slice() {
                [group, name] => {
                    source.channels.push(channel(group, name, object));
                    source.of.push(place);
                }
                above => {
                    source
                        .above
                        .insert(above.first().cloned(), object.properties.clone());
                }
            }
            for key in ["wf_start_time", "DateTime", "datetime"] {
                if let Some(Property::Time(start)) = object.properties.get(key)
                    && *start != -EPOCH_S * 1_000_000_000
                {
                    source.start = Some(
                        source
                            .start
                            .map_or(*start, |before: i64| before.min(*start)),
                    );
                }
            }
        }
        source.objects = objects.all.into_iter().map(|(_, object)| object).collect();
        Ok(source)
    }

    /// A channel's scales: its own, or else its group's, or else the file's.
    fn scaling(&self, channel: usize) -> Result<Scaling, Problem> {
        let mut scaling = Scaling::of(&self.objects[self.of[channel]].properties)?;
        for above in [Some(&self.channels[channel].group), None] {
            if !scaling.is_none() {
                break;
            }
            if let Some(properties) = self.above.get(&above.cloned()) {
                scaling = Scaling::of(properties)?;
            }
        }
        Ok(scaling)
    }

    fn values(&self, object: &Object, scaler: Option<u32>) -> Result<Vec<f64>, Problem> {
        let Some(runs) = object.runs.get(&scaler) else {
            return Err(Problem::whole("it has no raw values"));
        };
        let mut values = Vec::new();
        let mut first_time = None;
        for run in runs {
            let size = run.size();
            if run.is_plain() {
                for chunk in 0..run.chunks {
                    let start = run.offset + chunk * run.chunk;
                    let kind = (run.number, run.big);
                    self.file.numbers(start, run.count, kind, &mut values)?;
                }
                continue;
            }
            // The runs of several chunks at once where they are small, a part of a run where it is large.
            let span = (run.count - 1) * run.stride + size;
            let together = if span > PIECE {
                1
            } else {
                (PIECE / run.chunk.max(1)).max(1)
            };
            let rows = if span > PIECE {
                (PIECE / run.stride.max(1)).max(1)
            } else {
                run.count
            };
            let mut chunk = 0;
            while chunk < run.chunks {
                let chunks = together.min(run.chunks - chunk);
                let mut row = 0;
                while row < run.count {
                    let now = rows.min(run.count - row);
                    let start = run.offset + chunk * run.chunk + row * run.stride;
                    let length = (chunks - 1) * run.chunk + (now - 1) * run.stride + size;
                    let bytes = self.file.exact(start, length)?;
                    for (c, k) in (0..chunks).flat_map(|c| (0..now).map(move |k| (c, k))) {
                        let from = usize::try_from(c * run.chunk + k * run.stride);
                        let cell = bytes.get(from.unwrap_or(usize::MAX)..).unwrap_or_default();
                        values.push(run.value(cell, &mut first_time));
                    }
                    row += now;
                }
                chunk += chunks;
            }
        }
        Ok(values)
    }
}

impl Run {
    /// Whether it is numbers one after the other, in pieces worth a fetch of their own.
    fn is_plain(&self) -> bool {
        !self.time
            && self.bit.is_none()
            && self.stride == self.size()
            && (self.chunks == 1 || self.count * self.stride > 1 << 14)
    }

    fn size(&self) -> u64 {
        if self.time {
            16
        } else {
            self.number.size() as u64
        }
    }

    fn value(&self, cell: &[u8], first_time: &mut Option<i64>) -> f64 {
        if self.time {
            let (seconds, fraction) = timestamp(cell, self.big);
            let first = *first_time.get_or_insert(seconds);
            let whole = seconds.wrapping_sub(first) as f64;
            return whole + fraction as f64 / 18_446_744_073_709_551_616.0;
        }
        let value = self.number.read(cell, self.big);
        match self.bit {
            Some(bit) => f64::from(u8::from((value as u64) >> bit & 1 == 1)),
            None => value,
        }
    }
}

/// Seconds since 1904 and their 2^-64 parts.
fn timestamp(bytes: &[u8], big: bool) -> (i64, u64) {
    let mut cursor = Cursor::new(bytes, big);
    if big {
        let seconds = cursor.i64().unwrap_or(0);
        (seconds, cursor.u64().unwrap_or(0))
    } else {
        let fraction = cursor.u64().unwrap_or(0);
        (cursor.i64().unwrap_or(0), fraction)
    }
}

fn channel(group: &str, name: &str, object: &Object) -> Channel {
    let text = |keys: [&str; 3]| {
        let found = keys
            .iter()
            .find_map(|key| match object.properties.get(*key) {
                Some(Property::Text(text)) => Some(text.trim().to_owned()),
                _ => None,
            });
        found.unwrap_or_default()
    };
    let mut kind = match object.raw {
        Some(Raw::Number(_) | Raw::Time | Raw::Scaled) => Kind::Numeric,
        Some(Raw::Bool) => Kind::Bool,
        Some(Raw::Text) => Kind::Text,
        Some(Raw::Other(_)) => Kind::Array,
        None => Kind::Numeric,
    };
    if object
        .layout
        .as_ref()
        .is_some_and(|layout| layout.scalers.iter().any(|scaler| scaler.bit.is_some()))
    {
        kind = Kind::Bool;
    }
    Channel {
        group: group.to_owned(),
        name: name.to_owned(),
        unit: if object.raw == Some(Raw::Time) {
            "s".to_owned()
        } else {
            text(["unit_string", "NI_UnitDescription", "unit"])
        },
        samples: object.samples,
        comment: text(["description", "NI_Description", "comment"]),
        kind,
        is_time: false,
    }
}

/// The parts of a path: `/'Group'/'Channel'`, a quote in a name doubled.
fn parts(path: &str) -> Vec<String> {
    let mut parts = Vec::new();
    let mut chars = path.chars().peekable();
    while let Some(c) = chars.next() {
        if c != '\'' {
            continue;
        }
        let mut part = String::new();
        while let Some(c) = chars.next() {
            if c == '\'' {
                if chars.peek() != Some(&'\'') {
                    break;
                }
                chars.next();
            }
            part.push(c);
        }
        parts.push(part);
    }
    parts
}

/// Goes through one segment; answers where the next one starts.
fn segment(
    file: &FileBytes,
    at: u64,
    objects: &mut Objects,
    active: &mut Vec<(usize, bool)>,
    faults: &mut Vec<String>,
) -> Result<u64, Problem> {
    let lead = file.exact(at, 28)?;
    if &lead[..4] != b"TDSm" {
        return Err(Problem::at_byte(at, "no segment starts here"));
    }
    let mut cursor = Cursor::new(&lead[4..], false);
    let contents = cursor.u32().unwrap_or(0);
    let big = contents & BIG_ENDIAN != 0;
    // The contents are little-endian always, what follows them is as they say.
    let mut cursor = Cursor::new(&lead[8..], big);
    let version = cursor.u32().unwrap_or(0);
    if !matches!(version, 4712 | 4713) {
        return Err(Problem::at_byte(
            at + 8,
            format!("TDMS version {version} is not supported"),
        ));
    }
    let (length, metadata) = (cursor.u64().unwrap_or(0), cursor.u64().unwrap_or(0));
    let body = at + 28;
    let announced = body.checked_add(length).filter(|_| length != u64::MAX);
    let open = announced.is_none_or(|end| end > file.length());
    let end = announced.unwrap_or(file.length()).min(file.length());
    if open {
        faults.push(format!("byte {at}: the last segment is cut off, or was never closed: what of it is whole is read"));
    }
    let data = body
        .checked_add(metadata)
        .filter(|&data| data <= end)
        .ok_or_else(|| torn(at))?;
    if contents & METADATA != 0 {
        if metadata > MOST_METADATA {
            return Err(Problem::at_byte(
                at,
                format!("metadata of {metadata} bytes are not supported"),
            ));
        }
        if contents & NEW_OBJECTS != 0 {
            active.clear();
        }
        let bytes = file.exact(body, metadata)?;
        objects_of(&bytes, big, body, objects, active)?;
    }
    if contents & RAW_DATA != 0 && end > data {
        place_data(at, contents, data, end, open, objects, active, faults)?;
    }
    Ok(end)
}

/// Reads a segment's metadata.
fn objects_of(
    bytes: &[u8],
    big: bool,
    body: u64,
    objects: &mut Objects,
    active: &mut Vec<(usize, bool)>,
) -> Result<(), Problem> {
    let mut cursor = Cursor::new(bytes, big);
    let torn = |cursor: &Cursor<'_>| torn(body + cursor.at() as u64);
    let count = cursor.u32().ok_or_else(|| torn(&cursor))?;
    for _ in 0..count {
        let path = text(&mut cursor).ok_or_else(|| torn(&cursor))?;
        let place = objects.place(&path);
        let index = cursor.u32().ok_or_else(|| torn(&cursor))?;
        let has_data = match index {
            0xffff_ffff => false,
            0 => {
                if objects.all[place].1.layout.is_none() {
                    return Err(Problem::at_byte(
                        body + cursor.at() as u64,
                        format!("{path}: laid out as before, but nothing was before"),
                    ));
                }
                true
            }
            0x0000_1269 | 0x0000_126a | 0x0000_1369 => {
                let DaqmxLayout { raw, layout } =
                    daqmx(&mut cursor, index != 0x0000_1269).ok_or_else(|| torn(&cursor))?;
                let object = &mut objects.all[place].1;
                object.raw = Some(raw);
                object.layout = match layout {
                    Ok(layout) => Some(layout),
                    // Matters only where data follow.
                    Err(problem) => {
                        object.unsupported = Some(problem.in_words());
                        None
                    }
                };
                true
            }
            _ => {
                let code = cursor.u32().ok_or_else(|| torn(&cursor))?;
                let dimension = cursor.u32().ok_or_else(|| torn(&cursor))?;
                let values = cursor.u64().ok_or_else(|| torn(&cursor))?;
                let raw = Raw::of(code).filter(|raw| *raw != Raw::Scaled);
                let raw = raw.ok_or_else(|| {
                    Problem::of(&path, format!("type {code:#x} is not supported"))
                })?;
                if dimension != 1 {
                    return Err(Problem::of(
                        &path,
                        format!("arrays of dimension {dimension} are not supported"),
                    ));
                }
                let text_bytes = if raw == Raw::Text {
                    cursor.u64().ok_or_else(|| torn(&cursor))?
                } else {
                    0
                };
                let object = &mut objects.all[place].1;
                if object.raw.is_some_and(|before| before != raw) {
                    return Err(Problem::of(&path, "its type changes between segments"));
                }
                object.raw = Some(raw);
                object.layout = Some(Layout {
                    raw,
                    values,
                    text_bytes,
                    scalers: Vec::new(),
                    widths: Vec::new(),
                });
                true
            }
        };
        match active.iter_mut().find(|(other, _)| *other == place) {
            Some((_, data)) => *data = has_data,
            None => active.push((place, has_data)),
        }
        let properties = cursor.u32().ok_or_else(|| torn(&cursor))?;
        for _ in 0..properties {
            let name = text(&mut cursor).ok_or_else(|| torn(&cursor))?;
            let code = cursor.u32().ok_or_else(|| torn(&cursor))?;
            let value = property(&mut cursor, code, big).ok_or_else(|| torn(&cursor))?;
            objects.all[place].1.properties.insert(name, value);
        }
    }
    Ok(())
}

fn text(cursor: &mut Cursor<'_>) -> Option<String> {
    let length = cursor.u32()?;
    let bytes = cursor.take(usize::try_from(length).ok()?)?;
    Some(String::from_utf8_lossy(bytes).into_owned())
}

fn property(cursor: &mut Cursor<'_>, code: u32, big: bool) -> Option<Property> {
    Some(match Raw::of(code)? {
        Raw::Number(number) => Property::Number(number.read(cursor.take(number.size())?, big)),
        Raw::Bool => Property::Number(f64::from(cursor.u8()?)),
        Raw::Text => Property::Text(text(cursor)?),
        Raw::Time => {
            let (seconds, fraction) = timestamp(cursor.take(16)?, big);
            let nanoseconds =
                (fraction as f64 / 18_446_744_073_709_551_616.0 * 1e6).round() as i64 * 1000;
            Property::Time(
                seconds
                    .saturating_sub(EPOCH_S)
                    .saturating_mul(1_000_000_000)
                    .saturating_add(nanoseconds),
            )
        }
        Raw::Other(bytes) => {
            cursor.take(usize::try_from(bytes).ok()?)?;
            Property::Number(f64::NAN)
        }
        Raw::Scaled => return None,
    })
}

/// The raw-data index of a DAQmx channel. The inner problem is one of its content, the outer `None` an end before its end.
fn daqmx(cursor: &mut Cursor<'_>, digital: bool) -> Option<DaqmxLayout> {
    let code = cursor.u32()?;
    let (dimension, values, count) = (cursor.u32()?, cursor.u64()?, cursor.u32()?);
    let mut problem =
        (dimension != 1).then(|| format!("arrays of dimension {dimension} are not supported"));
    let mut scalers = Vec::new();
    for _ in 0..count {
        let code = cursor.u32()?;
        let buffer = cursor.u32()?;
        let offset = u64::from(cursor.u32()?);
        if digital {
            cursor.u8()?;
        } else {
            cursor.u32()?;
        }
        let id = cursor.u32()?;
        // Numbered apart from the types of other channels.
        let number = match code {
            0 => Number::U8,
            1 => Number::I8,
            2 => Number::U16,
            3 => Number::I16,
            4 => Number::U32,
            5 => Number::I32,
            6 => Number::U64,
            7 => Number::I64,
            8 => Number::F32,
            9 | 0xffff_ffff => Number::F64,
            _ => {
                problem = Some(format!("DAQmx type {code} is not supported"));
                Number::U8
            }
        };
        scalers.push(Scaler {
            number,
            buffer: usize::try_from(buffer).ok()?,
            byte: if digital { offset / 8 } else { offset },
            bit: digital.then_some((offset % 8) as u32),
            time: code == 0xffff_ffff,
            id,
        });
    }
    let count = cursor.u32()?;
    let mut widths = Vec::new();
    for _ in 0..count {
        widths.push(u64::from(cursor.u32()?));
    }
    let raw = Raw::of(code).unwrap_or(Raw::Scaled);
    Some(DaqmxLayout {
        raw,
        layout: match problem {
            Some(reason) => Err(Problem::whole(reason)),
            None => Ok(Layout {
                raw,
                values,
                text_bytes: 0,
                scalers,
                widths,
            }),
        },
    })
}

struct DaqmxLayout {
    raw: Raw,
    layout: Result<Layout, Problem>,
}

/// Places the values of a segment's data: chunk after chunk, all alike, the last perhaps cut off.
#[expect(clippy::too_many_arguments, reason = "all of one segment")]
fn place_data(
    at: u64,
    contents: u32,
    data: u64,
    end: u64,
    open: bool,
    objects: &mut Objects,
    active: &[(usize, bool)],
    faults: &mut Vec<String>,
) -> Result<(), Problem> {
    let big = contents & BIG_ENDIAN != 0;
    for (place, _) in active.iter().filter(|(_, has_data)| *has_data) {
        if let Some((path, object)) = objects.all.get(*place)
            && let (None, Some(reason)) = (&object.layout, &object.unsupported)
        {
            return Err(Problem::of(path, reason.clone()));
        }
    }
    let layouts: Vec<(usize, Layout)> = active
        .iter()
        .filter(|(_, has_data)| *has_data)
        .filter_map(|&(place, _)| Some((place, objects.all.get(place)?.1.layout.clone()?)))
        .collect();
    let too_large = || Problem::at_byte(at, "a chunk is larger than any file");
    let has_daqmx =
        contents & DAQMX != 0 || layouts.iter().any(|(_, layout)| !layout.scalers.is_empty());
    // Bytes of each channel (or, where rows are interleaved, of each buffer) in a chunk.
    let bytes = |layout: &Layout| match layout.raw {
        Raw::Text => Some(layout.text_bytes),
        raw => layout.values.checked_mul(raw.size()),
    };
    let mut buffers: Vec<(u64, u64)> = Vec::new();
    let mut chunk: u64 = 0;
    if has_daqmx {
        if layouts.iter().any(|(_, layout)| layout.scalers.is_empty()) {
            return Err(Problem::at_byte(
                at,
                "DAQmx and other channels in one segment are not supported",
            ));
        }
        let widths = layouts
            .first()
            .map(|(_, layout)| layout.widths.clone())
            .unwrap_or_default();
        buffers = widths.iter().map(|&width| (0, width)).collect();
        for (_, layout) in &layouts {
            if layout.widths != widths {
                return Err(Problem::at_byte(
                    at,
                    "DAQmx channels of one segment tell different widths",
                ));
            }
            for scaler in &layout.scalers {
                let Some((rows, width)) = buffers.get_mut(scaler.buffer) else {
                    return Err(Problem::at_byte(
                        at,
                        "a DAQmx scaler names a buffer that is not there",
                    ));
                };
                if scaler.byte + scaler.size() > *width {
                    return Err(Problem::at_byte(at, "a DAQmx scaler lies outside its row"));
                }
                *rows = (*rows).max(layout.values);
            }
        }
        for (rows, width) in &buffers {
            chunk = rows
                .checked_mul(*width)
                .and_then(|bytes| bytes.checked_add(chunk))
                .ok_or_else(too_large)?;
        }
    } else {
        for (_, layout) in &layouts {
            chunk = bytes(layout)
                .and_then(|bytes| bytes.checked_add(chunk))
                .ok_or_else(too_large)?;
        }
    }
    if chunk == 0 {
        faults.push(format!(
            "byte {at}: {} bytes of data belong to no channel",
            end - data
        ));
        return Ok(());
    }
    let interleaved = contents & INTERLEAVED != 0 && !has_daqmx;
    let row: u64 = layouts.iter().map(|(_, layout)| layout.raw.size()).sum();
    if interleaved && layouts.iter().any(|(_, layout)| layout.raw == Raw::Text) {
        return Err(Problem::at_byte(at, "interleaved texts are not supported"));
    }
    let mut from = data;
    let rest = (end - data) % chunk;
    while from < end {
        // All whole chunks at once, then the rest.
        let chunks = ((end - from) / chunk).max(1);
        let there = chunk.min(end - from);
        if there < chunk && !open {
            faults.push(format!(
                "byte {from}: the last chunk of a segment has {rest} of {chunk} bytes"
            ));
        }
        let mut offset = from;
        let mut column = 0;
        if has_daqmx {
            for (buffer, (rows, width)) in buffers.iter().enumerate() {
                let whole = (rows * width).min((from + there).saturating_sub(offset));
                let whole_rows = whole.checked_div(*width).unwrap_or(0);
                for (place, layout) in &layouts {
                    let scaled = layout.raw == Raw::Scaled;
                    for scaler in layout
                        .scalers
                        .iter()
                        .filter(|scaler| scaler.buffer == buffer)
                    {
                        let count = layout.values.min(whole_rows);
                        let object = &mut objects.all[*place].1;
                        push(
                            object,
                            scaled.then_some(scaler.id),
                            Run {
                                offset: offset + scaler.byte,
                                count,
                                stride: *width,
                                number: scaler.number,
                                big,
                                bit: scaler.bit,
                                time: scaler.time,
                                chunks,
                                chunk,
                            },
                        );
                    }
                    if layout
                        .scalers
                        .first()
                        .is_some_and(|scaler| scaler.buffer == buffer)
                    {
                        objects.all[*place].1.samples += layout.values.min(whole_rows) * chunks;
                    }
                }
                offset += whole;
            }
        } else {
            for (place, layout) in &layouts {
                let size = layout.raw.size();
                let (start, stride, count) = if interleaved {
                    let rows = there.checked_div(row).unwrap_or(0);
                    (from + column, row, layout.values.min(rows))
                } else {
                    // A closed segment with too little data has less of each channel, an open one ends where it was cut off.
                    let count = if size == 0 {
                        layout.values
                    } else if there < chunk && !open {
                        share(layout.values, there, chunk)
                    } else {
                        let room = (from + there).saturating_sub(offset);
                        layout.values.min(room / size)
                    };
                    (offset, size, count)
                };
                column += size;
                let taken = if size == 0 {
                    bytes(layout).unwrap_or(0)
                } else {
                    count * size
                };
                offset = offset.saturating_add(taken);
                let object = &mut objects.all[*place].1;
                object.samples = object.samples.saturating_add(count.saturating_mul(chunks));
                let number = match layout.raw {
                    Raw::Number(number) => number,
                    Raw::Bool => Number::U8,
                    Raw::Time => Number::F64,
                    _ => continue,
                };
                push(
                    object,
                    None,
                    Run {
                        offset: start,
                        count,
                        stride,
                        number,
                        big,
                        bit: None,
                        time: layout.raw == Raw::Time,
                        chunks,
                        chunk,
                    },
                );
            }
        }
        from += there * chunks;
    }
    Ok(())
}

/// The part of `values` that `there` of `chunk` bytes hold.
fn share(values: u64, there: u64, chunk: u64) -> u64 {
    let share = u128::from(values) * u128::from(there) / u128::from(chunk.max(1));
    u64::try_from(share).unwrap_or(values)
}

/// Adds a run; one that goes on where the last of the same stride ended is one with it.
fn push(object: &mut Object, scaler: Option<u32>, run: Run) {
    if run.count == 0 {
        return;
    }
    let runs = object.runs.entry(scaler).or_default();
    if let Some(last) = runs.last_mut()
        && last.stride == run.stride
        && last.number == run.number
        && last.big == run.big
        && last.bit == run.bit
        && last.chunks == 1
        && run.chunks == 1
        && last.offset + last.count * last.stride == run.offset
    {
        last.count += run.count;
        return;
    }
    runs.push(run);
}

impl Source for TdmsSource {
    fn start_time(&self) -> Option<String> {
        self.start.map(|start| rfc3339(start, 0))
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let mut all = Vec::with_capacity(wanted.len());
        for &one in wanted {
            let listed = &self.channels[one];
            let of = |problem: Problem| Problem::of(listed.shown(), problem.in_words());
            if !listed.kind.is_number() {
                return Err(Problem::of(
                    listed.shown(),
                    format!("{}, not a number", listed.kind.word()),
                ));
            }
            let object = &self.objects[self.of[one]];
            let raw = |scaler| self.values(object, scaler);
            let values = if object.runs.is_empty() {
                Vec::new()
            } else {
                self.scaling(one).map_err(of)?.apply(&raw).map_err(of)?
            };
            if (values.len() as u64) < object.samples {
                return Err(Problem::of(
                    listed.shown(),
                    format!("{} of {} readings are there", values.len(), object.samples),
                ));
            }
            // A waveform has its time in its properties.
            let number = |key: &str| match object.properties.get(key) {
                Some(Property::Number(value)) => Some(*value),
                _ => None,
            };
            let time_s = number("wf_increment")
                .filter(|step| *step > 0.0 && step.is_finite())
                .map(|step| {
                    let offset = number("wf_start_offset").unwrap_or(0.0);
                    let late = match (object.properties.get("wf_start_time"), self.start) {
                        (Some(Property::Time(own)), Some(start))
                            if *own > -EPOCH_S * 1_000_000_000 =>
                        {
                            own.saturating_sub(start) as f64 * 1e-9
                        }
                        _ => 0.0,
                    };
                    Arc::new(
                        (0..values.len())
                            .map(|k| late + offset + k as f64 * step)
                            .collect(),
                    )
                });
            all.push(Series {
                time_s,
                values,
                invalid: None,
            });
        }
        Ok(all)
    }

    fn faults(&self) -> Vec<String> {
        self.faults.clone()
    }
}
