//! The map: which channel is which column of a recording. A file of its own, or tables of the rig file.

use std::collections::BTreeMap;

use serde::Deserialize;

/// How a channel is brought onto the raster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// On the line between its neighbours.
    #[default]
    Linear,
    /// The reading before.
    Hold,
}

impl Method {
    /// The map's word for it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Hold => "hold",
        }
    }
}

/// One name or several, of which the first that is there counts.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Names {
    /// One name or glob.
    One(String),
    /// Several.
    Several(Vec<String>),
}

impl Names {
    /// The names in order.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        match self {
            Self::One(name) => std::slice::from_ref(name).iter(),
            Self::Several(names) => names.iter(),
        }
        .map(String::as_str)
    }
}

/// What the map says of one column.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Channel: its exact name, or a glob with `*` and `?`; or a list of them. Where it is left out, the column's name.
    #[serde(default)]
    pub name: Option<Names>,
    /// Group, where names repeat: exact, or a glob.
    #[serde(default)]
    pub group: Option<String>,
    /// Unit of the readings, in place of the file's.
    #[serde(default)]
    pub unit: Option<String>,
    /// value = scale * reading + offset, after the unit.
    #[serde(default = "one")]
    pub scale: f64,
    /// See `scale`; in the column's SI unit.
    #[serde(default)]
    pub offset: f64,
    /// How late the channel reports, in s.
    #[serde(default)]
    pub delay_s: f64,
    /// How it is brought onto the raster.
    #[serde(default)]
    pub method: Method,
    /// Teeth of a tone ring, for readings in Hz.
    #[serde(default)]
    pub teeth: Option<f64>,
    /// What 100 % are, in the column's SI unit.
    #[serde(default)]
    pub percent_of: Option<f64>,
}

fn one() -> f64 {
    1.0
}

impl Entry {
    /// An entry that takes the channel of this name as it is.
    #[must_use]
    pub fn named(name: &str) -> Self {
        Self {
            name: Some(Names::One(name.to_owned())),
            group: None,
            unit: None,
            scale: 1.0,
            offset: 0.0,
            delay_s: 0.0,
            method: Method::Linear,
            teeth: None,
            percent_of: None,
        }
    }
}

/// Whose times are kept.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// The column whose times are kept.
    #[serde(default)]
    pub raster: Option<String>,
    /// Rows a second, instead.
    #[serde(default)]
    pub rate_hz: Option<f64>,
}

/// A map; tables of other names, such as the rig file's, are left alone.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct Map {
    /// Columns by their name.
    #[serde(default)]
    pub channels: BTreeMap<String, Entry>,
    /// The raster.
    #[serde(default)]
    pub time: Time,
}

impl Map {
    /// What of the map cannot be meant, with its key.
    ///
    /// # Errors
    /// A line with the key and the reason.
    pub fn check(&self) -> Result<(), String> {
        for (column, entry) in &self.channels {
            let key = |name: &str| format!("channels.{column}.{name}");
            let finite = [
                ("scale", entry.scale),
                ("offset", entry.offset),
                ("delay_s", entry.delay_s),
            ];
            for (name, value) in finite {
                if !value.is_finite() {
                    return Err(format!("{} = {value}: must be finite", key(name)));
                }
            }
            if entry.scale == 0.0 {
                return Err(format!(
                    "{} = 0: nothing would be left of the channel",
                    key("scale")
                ));
            }
            for (name, value) in [("teeth", entry.teeth), ("percent_of", entry.percent_of)] {
                if value.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
                    return Err(format!("{}: must be finite and positive", key(name)));
                }
            }
            if entry
                .name
                .as_ref()
                .is_some_and(|names| names.iter().next().is_none())
            {
                return Err(format!("{}: no name in the list", key("name")));
            }
        }
        if self
            .time
            .rate_hz
            .is_some_and(|rate| !(rate.is_finite() && rate > 0.0))
        {
            return Err("time.rate_hz: must be finite and positive".to_owned());
        }
        if self.time.rate_hz.is_some() && self.time.raster.is_some() {
            return Err("time: raster and rate_hz exclude each other".to_owned());
        }
        if let Some(raster) = &self.time.raster
            && !self.channels.is_empty()
            && !self.channels.contains_key(raster)
        {
            return Err(format!(
                "time.raster = {raster:?}: the map has no such column"
            ));
        }
        Ok(())
    }

    /// The map as TOML, with what is at its default left out.
    #[must_use]
    pub fn to_toml(&self) -> String {
        use std::fmt::Write as _;
        let mut text = String::new();
        let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
        let key = |text: &str| {
            let bare = !text.is_empty()
                && text
                    .bytes()
                    .all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-'));
            if bare { text.to_owned() } else { quoted(text) }
        };
        for (column, entry) in &self.channels {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "[channels.{}]", key(column));
            match &entry.name {
                Some(Names::One(name)) => {
                    let _ = writeln!(text, "name = {}", quoted(name));
                }
                Some(Names::Several(names)) => {
                    let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
                    let _ = writeln!(text, "name = [{}]", names.join(", "));
                }
                None => {}
            }
            for (name, value) in [("group", &entry.group), ("unit", &entry.unit)] {
                if let Some(value) = value {
                    let _ = writeln!(text, "{name} = {}", quoted(value));
                }
            }
            for (name, value, default) in [
                ("scale", entry.scale, 1.0),
                ("offset", entry.offset, 0.0),
                ("delay_s", entry.delay_s, 0.0),
            ] {
                if value != default {
                    let _ = writeln!(text, "{name} = {value:?}");
                }
            }
            for (name, value) in [("teeth", entry.teeth), ("percent_of", entry.percent_of)] {
                if let Some(value) = value {
                    let _ = writeln!(text, "{name} = {value:?}");
                }
            }
            if entry.method != Method::Linear {
                let _ = writeln!(text, "method = \"{}\"", entry.method.word());
            }
            text.push('\n');
        }
        if let Some(raster) = &self.time.raster {
            let _ = writeln!(text, "[time]\nraster = {}", quoted(raster));
        }
        if let Some(rate) = self.time.rate_hz {
            let _ = writeln!(text, "[time]\nrate_hz = {rate:?}");
        }
        text
    }
}

/// Whether a name fits a glob with `*` (any characters) and `?` (one). An exact name fits itself whatever is in it.
#[must_use]
pub fn fits(glob: &str, name: &str) -> bool {
    if glob == name {
        return true;
    }
    let (glob, name): (Vec<char>, Vec<char>) = (glob.chars().collect(), name.chars().collect());
    let (mut g, mut n) = (0, 0);
    // Where to go on after the last star, should what follows it not fit here.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        match glob.get(g) {
            Some('*') => {
                star = Some((g + 1, n));
                g += 1;
            }
            Some(&c) if c == '?' || c == name[n] => {
                g += 1;
                n += 1;
            }
            _ => match star {
                Some((after, from)) => {
                    g = after;
                    n = from + 1;
                    star = Some((after, from + 1));
                }
                None => return false,
            },
        }
    }
    glob[g..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn globs_fit() {
        for (glob, name, expected) in [
            ("n*FL", "nWheelFL", true),
            ("n?heel*", "nWheelFL", true),
            ("a[1]", "a[1]", true),
            ("*", "", true),
            ("a*b*c", "a1b2b3c", true),
            ("a*b", "a1c", false),
            ("?", "", false),
        ] {
            assert_eq!(fits(glob, name), expected, "{glob} {name}");
        }
    }

    #[test]
    fn a_map_is_written_as_it_is_read() {
        let text = "[channels.\"a b\"]\nname = [\"x\", \"y z\"]\ngroup = \"2\"\nunit = \"Hz\"\nscale = -0.1\nteeth = 48.0\nmethod = \"hold\"\n\n[time]\nrate_hz = 100.0\n";
        let map: Map = toml::from_str(text).unwrap();
        assert_eq!(map.to_toml(), text);
        assert_eq!(map.check(), Ok(()));
        assert!(toml::from_str::<Map>("[channels.x]\nnmae = \"y\"\n").is_err());
    }
}
