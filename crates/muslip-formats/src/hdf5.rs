//! HDF5 and MAT v7.3, by `hdf5-reader`, and h5py's filter LZF.
//!
//! A vector of numbers is a channel in the group of its path; of a table (compound type) each field of numbers is one. The columns of a matrix that is
//! taller than wide are channels of their own (in MAT v7.3, whose matrices lie transposed, its rows). The unit is the attribute `unit` or `units`.

use hdf5_reader::error::Error;
use hdf5_reader::group::Group;
use hdf5_reader::{
    Attribute, ByteOrder, Dataset, Datatype, FileStorage, FilterRegistry, Hdf5File, OpenOptions,
};
use std::sync::Arc;

use crate::MOST_BYTES;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::format::Format;
use crate::lzf;
use crate::number::Number;
use crate::source::{Channel, Kind, Series, Source};

/// Groups within groups that are followed.
const DEEPEST: usize = 32;
/// Most channels of a file.
const MOST_CHANNELS: usize = 100_000;
/// Columns of a matrix that are listed one by one.
const MOST_COLUMNS: u64 = 256;

/// Which numbers of a data set a channel is.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    number: Number,
    big: bool,
    /// First byte, bytes from one reading to the next, and readings.
    offset: u64,
    stride: u64,
    count: u64,
}

/// An HDF5 file.
pub(crate) struct Hdf5Source {
    file: Hdf5File,
    channels: Vec<Channel>,
    parts: Vec<Option<(String, Part)>>,
    faults: Vec<String>,
    matlab: bool,
    /// The data set read last, for channels that lie in one.
    last: Option<(String, Vec<u8>)>,
}

fn problem(error: Error) -> Problem {
    Problem::whole(error.to_string())
}

/// The library's filters, and h5py's own.
fn filters(limit: usize) -> FilterRegistry {
    let mut filters = FilterRegistry::new();
    let unpack = move |_: &_, packed: &[u8], _| {
        let damaged = || Error::DecompressionError("LZF: damaged, or over 1 GiB".to_owned());
        lzf::unpacked(packed, limit).ok_or_else(damaged)
    };
    filters.register(lzf::FILTER, Box::new(unpack));
    filters
}

impl Hdf5Source {
    pub(crate) fn open(bytes: &FileBytes, format: Format) -> Result<Self, Problem> {
        let storage = FileStorage::from_file(bytes.file().try_clone()?).map_err(problem)?;
        let limit = usize::try_from(MOST_BYTES).unwrap_or(usize::MAX);
        let options = OpenOptions::default()
            .with_max_read_bytes(limit)
            .with_max_chunk_bytes(limit)
            .with_filter_registry(filters(limit));
        let file =
            Hdf5File::from_storage_with_options(Arc::new(storage), options).map_err(problem)?;
        let root = file.root_group().map_err(problem)?;
        let mut source = Self {
            file,
            channels: Vec::new(),
            parts: Vec::new(),
            faults: Vec::new(),
            matlab: format == Format::Mat73,
            last: None,
        };
        source.group(&root, "", 0);
        if source.channels.is_empty() && !source.faults.is_empty() {
            return Err(Problem::whole(source.faults.remove(0)));
        }
        Ok(source)
    }

    fn group(&mut self, group: &Group, path: &str, depth: usize) {
        if depth > DEEPEST || self.channels.len() > MOST_CHANNELS {
            self.faults.push(format!("{path}: not followed further"));
            return;
        }
        let shown = if path.is_empty() { "/" } else { path };
        let (groups, sets) = match group.members() {
            Ok(members) => members,
            // One member that cannot be opened must not hide the others.
            Err(_) => match group.member_names() {
                Ok((groups, sets)) => (
                    groups
                        .iter()
                        .filter_map(|name| group.group(name).ok())
                        .collect(),
                    sets.iter()
                        .filter_map(|name| match group.dataset(name) {
                            Ok(set) => Some(set),
                            Err(error) => {
                                self.faults.push(format!("{path}/{name}: {error}"));
                                None
                            }
                        })
                        .collect(),
                ),
                Err(error) => {
                    self.faults.push(format!("{shown}: {error}"));
                    return;
                }
            },
        };
        for set in &sets {
            // MATLAB keeps what its objects refer to there.
            self.set(set, path);
        }
        for inner in &groups {
            let name = inner.name();
            if self.matlab && (name == "#refs#" || name == "#subsystem#") {
                continue;
            }
            self.group(inner, &format!("{path}/{name}"), depth + 1);
        }
    }

    fn set(&mut self, set: &Dataset, path: &str) {
        let name = set.name().rsplit('/').next().unwrap_or_default().to_owned();
        let full = format!("{path}/{name}");
        let attributes = set.attributes();
        let text = |names: &[&str]| {
            let mut found = attributes.iter().filter(|attribute| {
                names
                    .iter()
                    .any(|name| attribute.name.eq_ignore_ascii_case(name))
            });
            found.find_map(text_of).unwrap_or_default()
        };
        let class = if self.matlab {
            text(&["MATLAB_class"])
        } else {
            String::new()
        };
        let base = Channel {
            group: path.trim_start_matches('/').to_owned(),
            name,
            unit: text(&["unit", "units"]),
            samples: 0,
            comment: text(&["description", "long_name", "comment"]),
            kind: Kind::Numeric,
            is_time: false,
        };
        let shape = set.shape().to_vec();
        let count = shape
            .iter()
            .try_fold(1_u64, |product, &size| product.checked_mul(size))
            .unwrap_or(u64::MAX);
        let other = |kind: Kind, comment: &str| Channel {
            samples: count,
            kind,
            comment: if comment.is_empty() {
                base.comment.clone()
            } else {
                comment.to_owned()
            },
            ..base.clone()
        };
        if matches!(class.as_str(), "char") {
            self.add(other(Kind::Text, ""), None);
            return;
        }
        if matches!(
            class.as_str(),
            "table"
                | "timetable"
                | "string"
                | "datetime"
                | "duration"
                | "categorical"
                | "cell"
                | "function_handle"
        ) {
            self.add(
                other(
                    Kind::Array,
                    &format!("a MATLAB {class}: export its columns"),
                ),
                None,
            );
            return;
        }
        if let Datatype::Compound { size, fields } = set.dtype() {
            for field in fields {
                let part = number_of(&field.datatype)
                    .map(|(number, big, kind)| (number, big, kind, u64::from(field.byte_offset)));
                let mut channel = other(Kind::Array, "");
                channel.group = full.trim_start_matches('/').to_owned();
                channel.name = field.name.clone();
                let part = part.map(|(number, big, kind, offset)| {
                    channel.kind = kind;
                    let part = Part {
                        number,
                        big,
                        offset,
                        stride: u64::from(*size),
                        count,
                    };
                    (full.clone(), part)
                });
                if part.is_none()
                    && matches!(
                        field.datatype,
                        Datatype::String { .. } | Datatype::VarLen { .. }
                    )
                {
                    channel.kind = Kind::Text;
                }
                self.add(channel, part);
            }
            return;
        }
        let Some((number, big, kind)) = number_of(set.dtype()) else {
            let text = matches!(
                set.dtype(),
                Datatype::String { .. } | Datatype::VarLen { .. }
            );
            self.add(other(if text { Kind::Text } else { Kind::Array }, ""), None);
            return;
        };
        let kind = if class == "logical" { Kind::Bool } else { kind };
        let size = number.size() as u64;
        let long: Vec<u64> = shape.iter().copied().filter(|&size| size != 1).collect();
        let part = |offset: u64, stride: u64, count: u64| Part {
            number,
            big,
            offset,
            stride,
            count,
        };
        match long.as_slice() {
            [] | [_] => self.add(other(kind, ""), Some((full, part(0, size, count)))),
            // MATLAB's matrices are stored by columns, so HDF5 sees them turned.
            &[columns, rows] if self.matlab && rows > columns && columns <= MOST_COLUMNS => {
                for column in 0..columns {
                    let mut channel = other(kind, "");
                    channel.name = format!("{}(:,{})", channel.name, column + 1);
                    channel.samples = rows;
                    self.add(
                        channel,
                        Some((full.clone(), part(column * rows * size, size, rows))),
                    );
                }
            }
            &[rows, columns] if !self.matlab && rows > columns && columns <= MOST_COLUMNS => {
                for column in 0..columns {
                    let mut channel = other(kind, "");
                    channel.name = format!("{}[:,{column}]", channel.name);
                    channel.samples = rows;
                    self.add(
                        channel,
                        Some((full.clone(), part(column * size, columns * size, rows))),
                    );
                }
            }
            _ => self.add(other(Kind::Array, ""), None),
        }
    }

    fn add(&mut self, channel: Channel, part: Option<(String, Part)>) {
        self.channels.push(channel);
        self.parts.push(part);
    }
}

/// The text of an attribute, of fixed or variable length.
fn text_of(attribute: &Attribute) -> Option<String> {
    let text = attribute
        .decoded_strings
        .as_ref()
        .and_then(|texts| texts.first().cloned());
    let text = text.or_else(|| attribute.read_string().ok())?;
    let text = text.trim_end_matches('\0').trim().to_owned();
    (!text.is_empty()).then_some(text)
}

fn number_of(kind: &Datatype) -> Option<(Number, bool, Kind)> {
    let is_big = |order: &ByteOrder| matches!(order, ByteOrder::BigEndian);
    Some(match kind {
        Datatype::FixedPoint {
            size,
            signed,
            byte_order,
        } => {
            let number = match (size, signed) {
                (1, true) => Number::I8,
                (2, true) => Number::I16,
                (4, true) => Number::I32,
                (8, true) => Number::I64,
                (1, false) => Number::U8,
                (2, false) => Number::U16,
                (4, false) => Number::U32,
                (8, false) => Number::U64,
                _ => return None,
            };
            (number, is_big(byte_order), Kind::Numeric)
        }
        Datatype::FloatingPoint {
            size: 4,
            byte_order,
        } => (Number::F32, is_big(byte_order), Kind::Numeric),
        Datatype::FloatingPoint {
            size: 8,
            byte_order,
        } => (Number::F64, is_big(byte_order), Kind::Numeric),
        Datatype::Enum { base, members } => {
            let (number, big, _) = number_of(base)?;
            // h5py writes truths this way.
            let bool = members.len() == 2
                && members
                    .iter()
                    .all(|member| matches!(member.name.as_str(), "FALSE" | "TRUE"));
            (number, big, if bool { Kind::Bool } else { Kind::Enum })
        }
        _ => return None,
    })
}

impl Source for Hdf5Source {
    fn start_time(&self) -> Option<String> {
        None
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let mut all = Vec::with_capacity(wanted.len());
        for &one in wanted {
            let listed = &self.channels[one];
            let of = |problem: Problem| Problem::of(listed.shown(), problem.in_words());
            let Some((path, part)) = self.parts.get(one).cloned().flatten() else {
                return Err(Problem::of(
                    listed.shown(),
                    format!(
                        "{} {}, not a vector of numbers",
                        listed.kind.word(),
                        listed.comment
                    ),
                ));
            };
            let bytes = match self.last.take() {
                Some((which, bytes)) if which == path => bytes,
                _ => {
                    let set = self.file.dataset(&path).map_err(problem).map_err(of)?;
                    set.read_raw_bytes().map_err(problem).map_err(of)?
                }
            };
            let size = part.number.size();
            let stride = usize::try_from(part.stride).unwrap_or(usize::MAX).max(1);
            let from = usize::try_from(part.offset).unwrap_or(usize::MAX);
            let cells = bytes.get(from..).unwrap_or_default();
            let values: Vec<f64> = cells
                .chunks(stride)
                .filter(|cell| cell.len() >= size)
                .take(usize::try_from(part.count).unwrap_or(usize::MAX))
                .map(|cell| part.number.read(cell, part.big))
                .collect();
            if values.len() as u64 != part.count {
                return Err(Problem::of(
                    listed.shown(),
                    format!("{} of {} readings are there", values.len(), part.count),
                ));
            }
            self.last = Some((path, bytes));
            all.push(Series {
                time_s: None,
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
