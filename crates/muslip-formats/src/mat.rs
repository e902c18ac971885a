//! MAT v4 and v5 to v7, from MathWorks' public text "MAT-File Format".
//!
//! A variable that is a vector of numbers is a channel; fields of structures are channels in the group of their structure; the columns of a matrix
//! that is taller than wide are channels of their own, `name(:,2)`. Sparse matrices, cells, objects and tables are listed as what they are and not
//! read.

use std::io::{Read, Seek, SeekFrom};

use flate2::read::ZlibDecoder;

use crate::MOST_BYTES;
use crate::cursor::Cursor;
use crate::error::Problem;
use crate::file_bytes::FileBytes;
use crate::number::Number;
use crate::source::{Channel, Kind, Series, Source};

/// Bytes in which the description of a matrix of numbers stands.
const HEAD_BYTES: u64 = 1 << 12;
/// Structures within structures that are followed.
const DEEPEST: usize = 16;
/// Columns of a matrix that are listed one by one.
const MOST_COLUMNS: u64 = 256;
/// Most channels of a file.
const MOST_CHANNELS: usize = 100_000;

/// Where the numbers of a channel are.
#[derive(Debug, Clone, PartialEq)]
struct Numbers {
    /// Variable of the file that they are in.
    variable: usize,
    /// Byte in the variable's unpacked body.
    offset: u64,
    count: u64,
    number: Number,
    big: bool,
}

/// A variable's place in the file.
#[derive(Debug, Clone, Copy)]
struct Body {
    offset: u64,
    bytes: u64,
    packed: bool,
}

/// How a variable begins.
struct Start {
    bytes: Vec<u8>,
    /// Whether these are all its bytes.
    is_whole: bool,
}

impl Start {
    /// Whether it is a matrix of numbers, which is told by its class: then all that is not numbers stands at its start.
    fn is_numbers(&self, big: bool, packed: bool) -> bool {
        let mut cursor = Cursor::new(&self.bytes, big);
        if packed && tag(&mut cursor).is_none() {
            return false;
        }
        let flags = element(&mut cursor).and_then(|(_, flags)| Cursor::new(flags, big).u32());
        flags.is_some_and(|flags| (6..=15).contains(&(flags & 0xff)))
    }
}

/// A MAT file.
pub(crate) struct MatSource {
    file: FileBytes,
    bodies: Vec<Body>,
    channels: Vec<Channel>,
    numbers: Vec<Option<Numbers>>,
    faults: Vec<String>,
    /// The variable that was unpacked last: channels of one structure are read one after the other.
    unpacked: Option<(usize, Vec<u8>)>,
}

impl MatSource {
    pub(crate) fn open(file: FileBytes) -> Result<Self, Problem> {
        let head = file.up_to(0, 128)?;
        let mut source = Self {
            file,
            bodies: Vec::new(),
            channels: Vec::new(),
            numbers: Vec::new(),
            faults: Vec::new(),
            unpacked: None,
        };
        match head.get(124..128) {
            Some([0 | 1, 0..=2, b'I', b'M']) => source.five(false)?,
            Some([0..=2, 0 | 1, b'M', b'I']) => source.five(true)?,
            _ => source.four()?,
        }
        if source.channels.is_empty() && !source.faults.is_empty() {
            return Err(Problem::whole(source.faults.remove(0)));
        }
        Ok(source)
    }

    fn add(&mut self, channel: Channel, numbers: Option<Numbers>) {
        if self.channels.len() < MOST_CHANNELS {
            self.channels.push(channel);
            self.numbers.push(numbers);
        } else if self.channels.len() == MOST_CHANNELS && self.faults.len() < 1000 {
            self.faults.push(format!(
                "more than {MOST_CHANNELS} variables: the others are not listed"
            ));
        }
    }

    /// Lists a matrix: a vector, the columns of a tall matrix, or an array.
    fn list(&mut self, group: &str, name: &str, shape: (u64, u64), kind: Kind, numbers: Numbers) {
        let channel = |name: String, samples: u64, kind: Kind| Channel {
            group: group.to_owned(),
            name,
            unit: String::new(),
            samples,
            comment: String::new(),
            kind,
            is_time: false,
        };
        let (rows, columns) = shape;
        if rows == 1 || columns == 1 {
            self.add(channel(name.to_owned(), numbers.count, kind), Some(numbers));
        } else if rows > columns && (1..=MOST_COLUMNS).contains(&columns) {
            for column in 0..columns {
                let part = Numbers {
                    offset: numbers.offset + column * rows * numbers.number.size() as u64,
                    count: rows,
                    ..numbers.clone()
                };
                self.add(
                    channel(format!("{name}(:,{})", column + 1), rows, kind),
                    Some(part),
                );
            }
        } else {
            self.add(
                channel(name.to_owned(), rows.saturating_mul(columns), Kind::Array),
                None,
            );
        }
    }

    fn unread(&mut self, group: &str, name: &str, samples: u64, kind: Kind, what: &str) {
        self.add(
            Channel {
                group: group.to_owned(),
                name: name.to_owned(),
                unit: String::new(),
                samples,
                comment: what.to_owned(),
                kind,
                is_time: false,
            },
            None,
        );
    }

    /// Version 4: a header of five numbers, a name and a matrix, again and again.
    fn four(&mut self) -> Result<(), Problem> {
        let mut at = 0;
        while at < self.file.length() {
            let Ok(head) = self.file.exact(at, 20) else {
                self.faults
                    .push(format!("byte {at}: a variable is cut off"));
                break;
            };
            let big = Cursor::new(&head, false)
                .u32()
                .is_none_or(|kind| kind > 5000);
            let mut cursor = Cursor::new(&head, big);
            let words: [u32; 5] = std::array::from_fn(|_| cursor.u32().unwrap_or(u32::MAX));
            let [kind, rows, columns, complex, name_bytes] = words;
            let number = match kind / 10 % 10 {
                0 => Number::F64,
                1 => Number::F32,
                2 => Number::I32,
                3 => Number::I16,
                4 => Number::U16,
                5 => Number::U8,
                other => {
                    return Err(Problem::at_byte(
                        at,
                        format!("MAT v4 precision {other} is not known"),
                    ));
                }
            };
            // 0 and 1 say the order of bytes; 2 to 4 are VAX and Cray.
            if kind / 1000 > 1 || name_bytes > 4096 || complex > 1 {
                return Err(Problem::at_byte(at, "no MAT v4 variable starts here"));
            }
            let name = self.file.exact(at + 20, u64::from(name_bytes));
            let count = u64::from(rows) * u64::from(columns);
            let bytes = count.checked_mul(number.size() as u64);
            let offset = at + 20 + u64::from(name_bytes);
            let end = bytes.and_then(|bytes| {
                bytes
                    .checked_mul(1 + u64::from(complex))?
                    .checked_add(offset)
            });
            let (Ok(name), Some(bytes), Some(end)) =
                (name, bytes, end.filter(|&end| end <= self.file.length()))
            else {
                self.faults
                    .push(format!("byte {at}: a variable is cut off"));
                break;
            };
            let name: String = name
                .iter()
                .take_while(|&&byte| byte != 0)
                .map(|&byte| char::from(byte))
                .collect();
            let variable = self.bodies.len();
            self.bodies.push(Body {
                offset,
                bytes,
                packed: false,
            });
            let numbers = Numbers {
                variable,
                offset: 0,
                count,
                number,
                big,
            };
            match (kind % 10, complex) {
                (0, 0) => self.list(
                    "",
                    &name,
                    (u64::from(rows), u64::from(columns)),
                    Kind::Numeric,
                    numbers,
                ),
                (0, _) => self.unread("", &name, count, Kind::Array, "complex"),
                (1, _) => self.unread("", &name, count, Kind::Text, ""),
                _ => self.unread("", &name, count, Kind::Array, "sparse"),
            }
            at = end;
        }
        Ok(())
    }

    /// Version 5: elements of a type, a length and a body, most of them packed.
    fn five(&mut self, big: bool) -> Result<(), Problem> {
        let mut at = 128;
        while at + 8 <= self.file.length() {
            let head = self.file.exact(at, 8)?;
            let mut cursor = Cursor::new(&head, big);
            let (kind, bytes) = (
                cursor.u32().unwrap_or(0),
                u64::from(cursor.u32().unwrap_or(0)),
            );
            let (kind, bytes, body) = if kind >> 16 != 0 {
                (kind & 0xffff, u64::from(kind >> 16), at + 4)
            } else {
                (kind, bytes, at + 8)
            };
            let there = self.file.length() - body.min(self.file.length());
            if bytes > there {
                self.faults
                    .push(format!("byte {at}: a variable of {bytes} bytes is cut off"));
                break;
            }
            if kind == 14 || kind == 15 {
                let variable = self.bodies.len();
                self.bodies.push(Body {
                    offset: body,
                    bytes,
                    packed: kind == 15,
                });
                match self.start_of(variable, big) {
                    Ok(start) => {
                        let outcome = self.variable(&start, variable, big, kind == 15);
                        if let Err(problem) = outcome {
                            self.faults.push(format!(
                                "byte {at}: a variable is damaged: {}",
                                problem.in_words()
                            ));
                        }
                    }
                    Err(problem) => self
                        .faults
                        .push(format!("byte {at}: {}", problem.in_words())),
                }
            } else {
                self.faults.push(format!(
                    "byte {at}: an element of type {kind} is not a variable"
                ));
            }
            // Packed elements are not padded, others to multiples of eight.
            at = body + bytes;
            if kind != 15 {
                at = at.next_multiple_of(8);
            }
        }
        Ok(())
    }

    /// The first bytes of a variable, or all of them where its fields lie anywhere in it.
    fn start_of(&mut self, variable: usize, big: bool) -> Result<Start, Problem> {
        let Some(body) = self.bodies.get(variable).copied() else {
            return Err(Problem::whole("no such variable"));
        };
        let head = self.up_to(body, HEAD_BYTES)?;
        let is_whole = (head.len() as u64) < HEAD_BYTES;
        let start = Start {
            bytes: head,
            is_whole,
        };
        if is_whole || start.is_numbers(big, body.packed) {
            return Ok(start);
        }
        let bytes = self.body(variable)?;
        self.unpacked = Some((variable, bytes.clone()));
        Ok(Start {
            bytes,
            is_whole: true,
        })
    }

    /// The unpacked bytes of a variable.
    fn body(&mut self, variable: usize) -> Result<Vec<u8>, Problem> {
        if let Some((which, bytes)) = self.unpacked.take()
            && which == variable
        {
            return Ok(bytes);
        }
        let Some(body) = self.bodies.get(variable).copied() else {
            return Err(Problem::whole("no such variable"));
        };
        let unpacked = self.up_to(body, MOST_BYTES + 1)?;
        if body.packed && unpacked.len() as u64 > MOST_BYTES {
            return Err(Problem::at_byte(
                body.offset,
                format!("a variable unpacks to over {MOST_BYTES} bytes"),
            ));
        }
        Ok(unpacked)
    }

    /// The unpacked bytes of a variable, so many at most.
    fn up_to(&self, body: Body, most: u64) -> Result<Vec<u8>, Problem> {
        if !body.packed {
            return self.file.exact(body.offset, body.bytes.min(most));
        }
        let mut file = self.file.file();
        file.seek(SeekFrom::Start(body.offset))?;
        let mut unpacked = Vec::new();
        let mut decoder = ZlibDecoder::new(file.take(body.bytes)).take(most);
        match decoder.read_to_end(&mut unpacked) {
            Ok(_) => Ok(unpacked),
            Err(error) => Err(Problem::at_byte(
                body.offset,
                format!("a packed variable is damaged: {error}"),
            )),
        }
    }

    /// Lists what a top-level variable holds. A packed one has its own tag first.
    fn variable(
        &mut self,
        start: &Start,
        variable: usize,
        big: bool,
        tagged: bool,
    ) -> Result<(), Problem> {
        let mut cursor = Cursor::new(&start.bytes, big);
        let announced = self.bodies.get(variable).map_or(0, |body| body.bytes);
        if tagged {
            let (kind, length) = tag(&mut cursor).ok_or_else(short)?;
            if kind != 14 {
                return Err(Problem::whole(format!("a packed element of type {kind}")));
            }
            let there = cursor.left() as u64;
            if start.is_whole && length > there {
                return Err(short());
            }
            let body = cursor.take(length.min(there) as usize).ok_or_else(short)?;
            // The body follows its tag of eight bytes.
            let beyond = length - body.len() as u64;
            return self.matrix(body, beyond, 8, variable, big, "", None, 0);
        }
        let beyond = announced - announced.min(start.bytes.len() as u64);
        self.matrix(&start.bytes, beyond, 0, variable, big, "", None, 0)
    }

    /// Lists a matrix, which lies `base` bytes into its variable; `beyond` of its bytes were not fetched.
    #[expect(
        clippy::too_many_arguments,
        reason = "the place of a matrix, and its name where a structure gives it"
    )]
    fn matrix(
        &mut self,
        bytes: &[u8],
        beyond: u64,
        base: u64,
        variable: usize,
        big: bool,
        group: &str,
        given: Option<&str>,
        depth: usize,
    ) -> Result<(), Problem> {
        if bytes.is_empty() {
            // An empty field.
            return Ok(());
        }
        let mut cursor = Cursor::new(bytes, big);
        let (_, flags) = element(&mut cursor).ok_or_else(short)?;
        let mut words = Cursor::new(flags, big);
        let flags = words.u32().ok_or_else(short)?;
        let (class, complex, logical) = (flags & 0xff, flags & 0x800 != 0, flags & 0x200 != 0);
        // Objects of classes have another order: their name, the system of their class, and that class.
        if class == 17 {
            let mut text = || element(&mut cursor).map(|(_, text)| String::from_utf8_lossy(text));
            let own = text().filter(|name| !name.is_empty());
            let (_, kind) = (text(), text());
            let kind = kind.as_deref().unwrap_or("object");
            self.unread(
                group,
                given.unwrap_or(own.as_deref().unwrap_or("object")),
                0,
                Kind::Array,
                &format!("a MATLAB {kind}: export its columns"),
            );
            return Ok(());
        }
        let (_, shape) = element(&mut cursor).ok_or_else(short)?;
        let mut words = Cursor::new(shape, big);
        let shape: Vec<u64> = std::iter::from_fn(|| words.i32())
            .map(|size| u64::try_from(size).unwrap_or(0))
            .collect();
        let (_, name) = element(&mut cursor).ok_or_else(short)?;
        let own: String = String::from_utf8_lossy(name).into_owned();
        let name = given.map_or(own, str::to_owned);
        let count = shape
            .iter()
            .try_fold(1_u64, |product, &size| product.checked_mul(size))
            .unwrap_or(u64::MAX);
        match class {
            2 => {
                return self.structure(
                    &mut cursor,
                    base,
                    variable,
                    big,
                    group,
                    &name,
                    count,
                    depth,
                );
            }
            6..=15 => {}
            1 => {
                self.unread(group, &name, count, Kind::Array, "a cell array");
                return Ok(());
            }
            4 => {
                self.unread(group, &name, count, Kind::Text, "");
                return Ok(());
            }
            5 => {
                self.unread(group, &name, count, Kind::Array, "sparse");
                return Ok(());
            }
            other => {
                self.unread(
                    group,
                    &name,
                    count,
                    Kind::Array,
                    if other == 3 {
                        "an object"
                    } else {
                        "of a class that is not known"
                    },
                );
                return Ok(());
            }
        }
        if complex {
            self.unread(group, &name, count, Kind::Array, "complex");
            return Ok(());
        }
        let ends_early = || Problem::of(&name, "its numbers end early");
        let (kind, length) = tag(&mut cursor).ok_or_else(ends_early)?;
        // Right behind the tag, whether that is small or not.
        let offset = cursor.at() as u64;
        if length > cursor.left() as u64 + beyond {
            return Err(ends_early());
        }
        // Numbers lie in the smallest type that holds them, whatever the class.
        let number = match kind {
            1 => Number::I8,
            2 => Number::U8,
            3 => Number::I16,
            4 => Number::U16,
            5 => Number::I32,
            6 => Number::U32,
            7 => Number::F32,
            9 => Number::F64,
            12 => Number::I64,
            13 => Number::U64,
            other => return Err(Problem::of(&name, format!("numbers of type {other}"))),
        };
        if count.checked_mul(number.size() as u64) != Some(length) {
            return Err(Problem::of(
                &name,
                format!("{length} bytes hold no {count} numbers"),
            ));
        }
        let rows = shape.first().copied().unwrap_or(0);
        let columns = shape.iter().skip(1).product();
        let kind = if logical { Kind::Bool } else { Kind::Numeric };
        let numbers = Numbers {
            variable,
            offset: base + offset,
            count,
            number,
            big,
        };
        self.list(group, &name, (rows, columns), kind, numbers);
        Ok(())
    }

    /// Lists the fields of a structure.
    #[expect(
        clippy::too_many_arguments,
        reason = "the place of a structure, and its name"
    )]
    fn structure(
        &mut self,
        cursor: &mut Cursor<'_>,
        base: u64,
        variable: usize,
        big: bool,
        group: &str,
        name: &str,
        count: u64,
        depth: usize,
    ) -> Result<(), Problem> {
        let (_, width) = element(cursor).ok_or_else(short)?;
        let width = Cursor::new(width, big)
            .u32()
            .and_then(|width| usize::try_from(width).ok())
            .filter(|&width| width > 0);
        let (_, names) = element(cursor).ok_or_else(short)?;
        let width = width.ok_or_else(short)?;
        let fields: Vec<String> = names
            .chunks(width)
            .map(|name| {
                String::from_utf8_lossy(name.split(|&byte| byte == 0).next().unwrap_or_default())
                    .into_owned()
            })
            .collect();
        if depth >= DEEPEST {
            self.unread(group, name, count, Kind::Array, "nested too deeply");
            return Ok(());
        }
        let inner = if group.is_empty() {
            name.to_owned()
        } else {
            format!("{group}.{name}")
        };
        for index in 0..count {
            for field in &fields {
                if cursor.left() < 8 {
                    return Err(Problem::of(&inner, "its fields end early"));
                }
                let at = cursor.at();
                let (_, body) =
                    element(cursor).ok_or_else(|| Problem::of(&inner, "its fields end early"))?;
                let group = if count == 1 {
                    inner.clone()
                } else {
                    format!("{inner}({})", index + 1)
                };
                self.matrix(
                    body,
                    0,
                    base + at as u64 + 8,
                    variable,
                    big,
                    &group,
                    Some(field),
                    depth + 1,
                )?;
            }
        }
        Ok(())
    }
}

fn short() -> Problem {
    Problem::whole("it ends early")
}

/// The tag of the next element: its type, and how many bytes its body has right behind the tag.
fn tag(cursor: &mut Cursor<'_>) -> Option<(u32, u64)> {
    let first = cursor.u32()?;
    if first >> 16 != 0 {
        return Some((first & 0xffff, u64::from(first >> 16)));
    }
    Some((first, u64::from(cursor.u32()?)))
}

/// The next element: its type and its body. Moves to the element after it.
fn element<'a>(cursor: &mut Cursor<'a>) -> Option<(u32, &'a [u8])> {
    let first = cursor.u32()?;
    if first >> 16 != 0 {
        let bytes = cursor.take(4)?;
        return Some((first & 0xffff, bytes.get(..(first >> 16) as usize)?));
    }
    let length = usize::try_from(cursor.u32()?).ok()?;
    let body = cursor.take(length)?;
    let padding = length.next_multiple_of(8) - length;
    // The last element may lack its padding.
    cursor.take(padding.min(cursor.left()))?;
    Some((first, body))
}

impl Source for MatSource {
    fn start_time(&self) -> Option<String> {
        None
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn read(&mut self, wanted: &[usize]) -> Result<Vec<Series>, Problem> {
        let mut all = Vec::with_capacity(wanted.len());
        for &one in wanted {
            let Some(numbers) = self.numbers.get(one).cloned().flatten() else {
                let channel = &self.channels[one];
                return Err(Problem::of(
                    channel.shown(),
                    format!(
                        "{} {}, not a vector of numbers",
                        channel.kind.word(),
                        channel.comment
                    ),
                ));
            };
            let ends_early = Problem::of(self.channels[one].shown(), "its numbers end early");
            let mut values = Vec::new();
            let kind = (numbers.number, numbers.big);
            if let Some(body) = self
                .bodies
                .get(numbers.variable)
                .filter(|body| !body.packed)
            {
                let length = numbers.count.checked_mul(numbers.number.size() as u64);
                let end = length.and_then(|length| length.checked_add(numbers.offset));
                if end.is_none_or(|end| end > body.bytes) {
                    return Err(ends_early);
                }
                let offset = body.offset + numbers.offset;
                self.file
                    .numbers(offset, numbers.count, kind, &mut values)?;
                all.push(Series {
                    values,
                    ..Series::default()
                });
                continue;
            }
            let bytes = self.body(numbers.variable)?;
            let from = usize::try_from(numbers.offset).unwrap_or(usize::MAX);
            let length = usize::try_from(numbers.count)
                .unwrap_or(usize::MAX)
                .saturating_mul(numbers.number.size());
            let cells = from.checked_add(length).and_then(|to| bytes.get(from..to));
            let Some(cells) = cells else {
                return Err(ends_early);
            };
            numbers.number.extend(cells, numbers.big, &mut values);
            self.unpacked = Some((numbers.variable, bytes));
            all.push(Series {
                values,
                ..Series::default()
            });
        }
        Ok(all)
    }

    fn faults(&self) -> Vec<String> {
        self.faults.clone()
    }
}
