//! What a file holds: the work of `muslip channels`.

use std::path::Path;

use muslip_formats::listing::{Listed, listed};
use muslip_formats::map::Map;
use muslip_formats::roles::{self, Roles};
use muslip_formats::{Format, SourceFile};
use muslip_recordings::input_error::InputError;
use serde_json::json;

/// The channels of a file.
#[derive(Debug, Clone)]
pub struct Listing {
    /// The file's format.
    pub format: Format,
    /// Start of the measurement in RFC 3339.
    pub start_time: Option<String>,
    /// The channels, in the file's order.
    pub channels: Vec<Listed>,
    /// What the map or the guess makes of them.
    pub roles: Roles,
    /// The roles as a map to go on from.
    pub map: Map,
    /// What of the map cannot be found, then what of the file is damaged; one line each.
    pub faults: Vec<String>,
}

/// Lists the channels of a file; what a map or a guess cannot find concerns other jobs, and is only listed. `progress` receives the share
/// done.
///
/// # Errors
/// [`InputError`] where nothing of the file can be read.
pub fn listing(
    path: &Path,
    map: Option<&Map>,
    progress: &mut dyn FnMut(f64),
) -> Result<Listing, InputError> {
    let mut file = SourceFile::open(path).map_err(InputError::from)?;
    let mut faults = Vec::new();
    let roles = match map.map(|map| roles::by_map(file.channels(), map)) {
        Some(Ok(roles)) => roles,
        Some(Err(problem)) => {
            faults.push(problem.in_words());
            Roles::default()
        }
        None => roles::guess(file.channels()),
    };
    let (channels, told) = listed(&mut file, &roles, progress);
    faults.splice(0..0, told);
    let time = map.map(|map| map.time.clone()).unwrap_or_default();
    Ok(Listing {
        format: file.format(),
        start_time: file.start_time(),
        channels,
        map: roles.as_map(file.channels(), &time),
        roles,
        faults,
    })
}

impl Listing {
    /// The listing as the contract's JSON object, `muslip.channels/1`.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        json!({
            "schema": "muslip.channels/1",
            "format": self.format.word(),
            "start_time": self.start_time,
            "channels": self.channels.iter().map(as_json).collect::<Vec<_>>(),
            "faults": self.faults,
        })
    }
}

fn as_json(one: &Listed) -> serde_json::Value {
    let channel = &one.channel;
    let mut value = json!({
        "group": channel.group,
        "name": channel.name,
        "unit": channel.unit,
        "samples": one.samples,
        "first_s": one.first_s,
        "last_s": one.last_s,
        "rate_hz": one.rate_hz,
        "invalid": one.invalid,
        "comment": channel.comment,
        "kind": channel.kind.word(),
    });
    if let (Some(role), Some(object)) = (&one.role, value.as_object_mut()) {
        object.insert("role".into(), json!(role));
    }
    value
}
