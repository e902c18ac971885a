//! Results as tables: what their JSON says, one row a record, for those who keep results in Parquet.

use std::io::{self, Write};

use muslip_formats::{Cells, ColumnKind, ParquetTable};
use serde_json::{Map, Value, json};

/// One row: values by the name of their column. Objects within are columns of their own, under `outer.inner`; lists are their JSON.
pub type Record = Map<String, Value>;

/// Writes records as a Parquet table. Columns stand in the order in which they first appear; `whole` is kept beside the table as it is, under
/// the key `muslip.json`.
///
/// # Errors
/// What the sink answers; [`io::ErrorKind::Unsupported`] in a build without Parquet.
pub fn write<W: Write + Send>(sink: W, records: &[Record], whole: &Value) -> io::Result<W> {
    let rows: Vec<Record> = records.iter().map(flat).collect();
    let mut names: Vec<&str> = Vec::new();
    for name in rows.iter().flat_map(Record::keys) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let columns: Vec<(&str, ColumnKind)> = names
        .iter()
        .map(|&name| (name, kind_of(rows.iter().filter_map(|row| row.get(name)))))
        .collect();
    let mut table = ParquetTable::new(sink, &columns)?;
    table.note("muslip.json", &whole.to_string());
    let stored: Vec<Stored> = columns
        .iter()
        .map(|&(name, kind)| Stored::of(kind, rows.iter().map(|row| row.get(name))))
        .collect();
    let cells: Vec<Cells<'_>> = stored.iter().map(Stored::cells).collect();
    table.rows(&cells)?;
    table.finish()
}

/// One row of a single result: its JSON, and what it is of.
#[must_use]
pub fn of_result(recording: &str, result: &Value) -> Record {
    let mut record = Record::new();
    record.insert("recording".to_owned(), json!(recording));
    if let Value::Object(members) = result {
        record.extend(members.clone());
    }
    record
}

/// A diagnosis as `diagnosis.json` has it, one row an entry of its lists: `part` is the list's name there, the verdict stands in every row.
#[must_use]
pub fn of_diagnosis(whole: &Value) -> Vec<Record> {
    let mut records = Vec::new();
    let row = |part: &str, name: Option<(&str, &str)>, entry: &Value| {
        let mut record = Record::new();
        record.insert("verdict".to_owned(), whole["verdict"].clone());
        record.insert("part".to_owned(), json!(part));
        if let Some((key, name)) = name {
            record.insert(key.to_owned(), json!(name));
        }
        if let Value::Object(members) = entry {
            record.extend(members.clone());
        }
        record
    };
    for (part, content) in whole.as_object().into_iter().flatten() {
        match (part.as_str(), content) {
            ("mechanisms", Value::Array(mechanisms)) => {
                for mechanism in mechanisms {
                    let mut of_mechanism = row(part, None, mechanism);
                    let parameters = of_mechanism.remove("parameters");
                    records.push(of_mechanism);
                    let id = mechanism["id"].as_str().unwrap_or_default();
                    for parameter in parameters.iter().filter_map(Value::as_array).flatten() {
                        records.push(row("parameters", Some(("id", id)), parameter));
                    }
                }
            }
            (_, Value::Array(entries)) => {
                records.extend(entries.iter().map(|entry| row(part, None, entry)));
            }
            ("noise", Value::Object(channels)) => {
                let named = channels.iter();
                records
                    .extend(named.map(|(name, entry)| row(part, Some(("channel", name)), entry)));
            }
            (_, Value::Object(named)) => {
                let named = named.iter();
                records.extend(named.map(|(name, entry)| row(part, Some(("name", name)), entry)));
            }
            _ => {}
        }
    }
    records
}

/// Objects within as columns of their own.
fn flat(record: &Record) -> Record {
    fn put(out: &mut Record, name: &str, value: &Value) {
        match value {
            Value::Object(members) => {
                for (inner, value) in members {
                    put(out, &format!("{name}.{inner}"), value);
                }
            }
            Value::Array(_) => {
                out.insert(name.to_owned(), json!(value.to_string()));
            }
            _ => {
                out.insert(name.to_owned(), value.clone());
            }
        }
    }
    let mut out = Record::new();
    for (name, value) in record {
        put(&mut out, name, value);
    }
    out
}

/// Numbers or truths where all that is there is one, else text.
fn kind_of<'a>(values: impl Iterator<Item = &'a Value>) -> ColumnKind {
    let mut kind = None;
    for value in values {
        let own = match value {
            Value::Null => continue,
            Value::Number(_) => ColumnKind::Numbers,
            Value::Bool(_) => ColumnKind::Truths,
            _ => ColumnKind::Texts,
        };
        if *kind.get_or_insert(own) != own {
            return ColumnKind::Texts;
        }
    }
    kind.unwrap_or(ColumnKind::Numbers)
}

/// A column's cells.
enum Stored {
    Numbers(Vec<f64>),
    Texts(Vec<Option<String>>),
    Truths(Vec<Option<bool>>),
}

impl Stored {
    fn of<'a>(kind: ColumnKind, values: impl Iterator<Item = Option<&'a Value>>) -> Self {
        let text = |value: &Value| match value {
            Value::Null => None,
            Value::String(text) => Some(text.clone()),
            other => Some(other.to_string()),
        };
        match kind {
            ColumnKind::Numbers => Self::Numbers(
                values
                    .map(|value| value.and_then(Value::as_f64).unwrap_or(f64::NAN))
                    .collect(),
            ),
            ColumnKind::Texts => Self::Texts(values.map(|value| value.and_then(text)).collect()),
            ColumnKind::Truths => {
                Self::Truths(values.map(|value| value.and_then(Value::as_bool)).collect())
            }
        }
    }

    fn cells(&self) -> Cells<'_> {
        match self {
            Self::Numbers(numbers) => Cells::Numbers(numbers),
            Self::Texts(texts) => Cells::Texts(texts),
            Self::Truths(truths) => Cells::Truths(truths),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_within_are_columns_and_lists_are_their_json() {
        let record = of_result(
            "run.csv",
            &json!({"peak": {"value": 0.9, "std": null}, "read": ["a", "b"], "ok": true}),
        );
        let flat = flat(&record);
        let names: Vec<&str> = flat.keys().map(String::as_str).collect();
        assert_eq!(names, ["recording", "peak.value", "peak.std", "read", "ok"]);
        assert_eq!(flat["read"], json!("[\"a\",\"b\"]"));
        assert_eq!(
            kind_of([&json!(1), &Value::Null].into_iter()),
            ColumnKind::Numbers
        );
        assert_eq!(
            kind_of([&json!(1), &json!("x")].into_iter()),
            ColumnKind::Texts
        );
        assert_eq!(kind_of([&json!(true)].into_iter()), ColumnKind::Truths);
    }
}
