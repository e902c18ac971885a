//! The map of channels: a file of its own, or tables of the rig file.

use std::path::Path;

use muslip_formats::map::Map;

use crate::input_error::{InputError, InputProblem};
use crate::toml_file;

/// Reads and checks a map.
///
/// # Errors
/// [`InputError`] with line and column: the file is missing, not UTF-8, not TOML, has a key that a map does not have, or a value that cannot be
/// meant.
pub fn read(path: &Path) -> Result<Map, InputError> {
    parse(path, &toml_file::bytes_of(path)?)
}

/// Checks the text of a map; `path` is only named in errors.
///
/// # Errors
/// As [`read`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Map, InputError> {
    let text = toml_file::text_of(path, bytes)?;
    let map: Map = toml_file::parsed(path, text)?;
    map.check()
        .map_err(|reason| InputError::whole_file(path, InputProblem::Toml(reason)))?;
    Ok(map)
}

/// The map in a rig file; `None` where it has none.
///
/// # Errors
/// As [`read`].
pub fn of_rig(path: &Path) -> Result<Option<Map>, InputError> {
    Ok(in_use(read(path)?))
}

/// A map, where it says anything.
#[must_use]
pub fn in_use(map: Map) -> Option<Map> {
    let empty = map.channels.is_empty() && map.time == muslip_formats::map::Time::default();
    (!empty).then_some(map)
}

/// The map that recordings are read by: a file of its own, or else the rig file's.
///
/// # Errors
/// As [`read`].
pub fn chosen(map: Option<&Path>, rig: Option<&Path>) -> Result<Option<Map>, InputError> {
    match (map, rig) {
        (Some(map), _) => read(map).map(Some),
        (None, Some(rig)) => of_rig(rig),
        (None, None) => Ok(None),
    }
}
