//! `--parquet`: what `--json` prints, as a table.

use std::io::Write as _;
use std::path::Path;

use muslip_analysis::records::{self, Record};
use muslip_recordings::output::{OutputError, OutputFile};
use serde_json::Value;

use super::failure::Failure;

/// Writes records as Parquet, whole or not at all; `whole` is the JSON that they are from.
pub(super) fn write_records(path: &Path, records: &[Record], whole: &Value) -> Result<(), Failure> {
    let fail = |error| OutputError::new(path, error);
    let sink = OutputFile::create(path)?;
    let mut sink = records::write(sink, records, whole).map_err(fail)?;
    sink.flush().map_err(fail)?;
    Ok(sink.commit()?)
}
