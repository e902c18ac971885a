//! Which channel is which column: by the map, or guessed from names and units.

use crate::error::Problem;
use crate::map::{Entry, Map, fits};
use crate::source::Channel;
use crate::units::{self, Quantity};

/// The column of time.
pub const TIME: &str = "time_s";

/// A column of the contract, with the names that the field has for it.
#[derive(Debug, Clone, Copy)]
pub struct Role {
    /// The column's header.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Whether an estimate cannot do without it.
    pub required: bool,
    /// Names that mean nothing else, folded as by [`fold`]; they count also as a part of a longer name.
    strong: &'static [&'static str],
    /// Words that mean it where they stand by themselves between separators: symbols of ISO 8855, TYDEX and of practice.
    words: &'static [&'static str],
    /// Names that may mean it: taken where nothing better is there.
    weak: &'static [&'static str],
}

/// The contract's columns. Names: English, German, French, Japanese; symbols of ISO 8855 (F_X, F_Z, v_X, omega_W), TYDEX (FX, FZW, LONGVEL, WHROTSPD)
/// and of ASAM/AUTOSAR application interfaces (VehSpd, WhlSpd, BrkTq, BrkP).
pub const ROLES: [Role; 7] = [
    Role {
        name: TIME,
        quantity: Quantity::Time,
        required: true,
        strong: &[
            "timestamp",
            "zeitstempel",
            "horodatage",
            "elapsedtime",
            "messzeit",
            "時間",
            "時刻",
        ],
        words: &["time", "t", "zeit", "temps", "timestamps", "tempo"],
        weak: &["datetime", "date"],
    },
    Role {
        name: "wheel_speed_rad_s",
        quantity: Quantity::AngularSpeed,
        required: true,
        strong: &[
            "wheelspeed",
            "wheelspd",
            "whlspd",
            "whlspeed",
            "wheelrpm",
            "whlrpm",
            "wheelangularvelocity",
            "wheelangularspeed",
            "wheelrotationalspeed",
            "wheelrotspeed",
            "wheelrotspd",
            "whrotspd",
            "wheelomega",
            "omegawheel",
            "wheelrotation",
            "nwheel",
            "nwhl",
            "tyrespeed",
            "tirespeed",
            "tyrerpm",
            "tirerpm",
            "raddrehzahl",
            "drehzahlrad",
            "raddrehgeschwindigkeit",
            "radwinkelgeschwindigkeit",
            "winkelgeschwindigkeitrad",
            "radgeschwindigkeit",
            "omegarad",
            "vitesseroue",
            "vitessederoue",
            "vitesserotationroue",
            "vitessederotationroue",
            "vitesseangulaireroue",
            "regimeroue",
            "vroue",
            "nroue",
            "車輪速",
            "車輪回転",
            "車輪角速度",
            "輪速",
            "ホイール速度",
            "ホイール回転",
            "タイヤ回転",
            "ホイール角速度",
        ],
        words: &["omegaw", "nrad", "omega", "nr"],
        weak: &[
            "rpm",
            "drehzahl",
            "wheel",
            "rad",
            "roue",
            "回転数",
            "回転速度",
            "角速度",
        ],
    },
    Role {
        name: "vehicle_speed_m_s",
        quantity: Quantity::Speed,
        required: true,
        strong: &[
            "vehiclespeed",
            "vehiclespd",
            "vehspeed",
            "vehspd",
            "vehiclevelocity",
            "vehvelocity",
            "roadspeed",
            "groundspeed",
            "gpsspeed",
            "speedgps",
            "speedoverground",
            "carspeed",
            "drumspeed",
            "beltspeed",
            "longvel",
            "longitudinalvelocity",
            "longitudinalspeed",
            "fahrzeuggeschwindigkeit",
            "fzggeschwindigkeit",
            "fahrgeschwindigkeit",
            "vfzg",
            "vfahrzeug",
            "gpsgeschwindigkeit",
            "trommelgeschwindigkeit",
            "bandgeschwindigkeit",
            "vitessevehicule",
            "vitesseduvehicule",
            "vitessegps",
            "vveh",
            "vvehicle",
            "vehv",
            "車速",
            "車両速度",
            "車体速度",
            "対地速度",
            "走行速度",
        ],
        words: &["vx", "vgps", "vref"],
        weak: &[
            "speed",
            "velocity",
            "geschwindigkeit",
            "vitesse",
            "v",
            "速度",
        ],
    },
    Role {
        name: "drag_force_n",
        quantity: Quantity::Force,
        required: true,
        strong: &[
            "dragforce",
            "brakeforce",
            "brakingforce",
            "longitudinalforce",
            "longforce",
            "forcelongitudinal",
            "tractiveforce",
            "bremskraft",
            "längskraft",
            "laengskraft",
            "umfangskraft",
            "zugkraft",
            "effortlongitudinal",
            "forcelongitudinale",
            "forcefreinage",
            "forcedefreinage",
            "effortfreinage",
            "effortdefreinage",
            "制動力",
            "前後力",
            "ブレーキ力",
            "抗力",
            "前後方向力",
        ],
        words: &[
            "fx", "fxw", "forcex", "xforce", "fdrag", "fbrake", "flong", "drag",
        ],
        weak: &["fxwheel"],
    },
    Role {
        name: "normal_force_n",
        quantity: Quantity::Force,
        required: true,
        strong: &[
            "normalforce",
            "verticalforce",
            "verticalload",
            "normalload",
            "wheelload",
            "tireload",
            "tyreload",
            "whlload",
            "normalkraft",
            "radlast",
            "aufstandskraft",
            "vertikalkraft",
            "vertikallast",
            "radaufstandskraft",
            "forcenormale",
            "forceverticale",
            "chargeverticale",
            "effortvertical",
            "effortnormal",
            "chargeroue",
            "chargealaroue",
            "垂直荷重",
            "接地荷重",
            "輪荷重",
            "法線力",
            "垂直力",
            "上下力",
            "輪重",
        ],
        words: &["fz", "fzw", "forcez", "zforce", "fnormal", "fvert", "fn"],
        weak: &["load", "last", "charge", "荷重"],
    },
    Role {
        name: "brake_torque_nm",
        quantity: Quantity::Torque,
        required: false,
        strong: &[
            "braketorque",
            "brakingtorque",
            "brakemoment",
            "braketrq",
            "brktq",
            "brktrq",
            "tqbrake",
            "trqbrake",
            "bremsmoment",
            "mbrems",
            "couplefrein",
            "couplefreinage",
            "coupledefreinage",
            "couplefreins",
            "ブレーキトルク",
            "制動トルク",
            "制動モーメント",
        ],
        words: &["mbrake", "tbrake", "my"],
        weak: &["torque", "moment", "couple", "トルク"],
    },
    Role {
        name: "brake_pressure_pa",
        quantity: Quantity::Pressure,
        required: false,
        strong: &[
            "brakepressure",
            "brakepress",
            "brakelinepressure",
            "brakeprs",
            "brkp",
            "brkprs",
            "pbrake",
            "caliperpressure",
            "wheelcylinderpressure",
            "bremsdruck",
            "pbrems",
            "radbremsdruck",
            "pressionfrein",
            "pressionfreinage",
            "pressiondefreinage",
            "pressiondefrein",
            "ブレーキ圧",
            "ブレーキ液圧",
            "制動圧",
            "液圧",
            "ブレーキ油圧",
        ],
        words: &[],
        weak: &["pressure", "druck", "pression", "圧力"],
    },
];

/// The contract's column of a name.
#[must_use]
pub fn role(name: &str) -> Option<&'static Role> {
    ROLES.iter().find(|role| role.name == name)
}

/// A channel as a column.
#[derive(Debug, Clone, PartialEq)]
pub struct Assigned {
    /// The column's header.
    pub column: String,
    /// The channel's place in its file.
    pub channel: usize,
    /// How it is read.
    pub entry: Entry,
}

/// A column of the contract that no channel became.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// The column's header.
    pub column: &'static str,
    /// Why, with the candidates and the key of a map that would choose.
    pub reason: String,
    /// Whether several channels may be it: then nothing is read of the file before one is chosen.
    pub ambiguous: bool,
}

/// What the map, or the guess, made of a file's channels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Roles {
    /// Columns and their channels; without the time of formats that have none of their own.
    pub assigned: Vec<Assigned>,
    /// The column of time, where the map names it or a guess found one; times of other groups may be others.
    pub time: Option<Assigned>,
    /// Columns of the contract that no channel became, and why.
    pub refused: Vec<Refused>,
    /// Whether it is a guess.
    pub guessed: bool,
}

impl Roles {
    /// The first column, required or not, that several channels may be. The time is not among them: which one counts is asked by group, where a
    /// channel has none of its own.
    #[must_use]
    pub fn ambiguous(&self) -> Option<&Refused> {
        let mut refused = self.refused.iter();
        refused.find(|one| one.ambiguous && one.column != TIME)
    }

    /// The column that a channel became.
    #[must_use]
    pub fn of_channel(&self, channel: usize) -> Option<&str> {
        let all = self.assigned.iter().chain(&self.time);
        all.filter(|one| one.channel == channel)
            .map(|one| one.column.as_str())
            .next()
    }

    /// The roles as a map that finds the same channels again.
    #[must_use]
    pub fn as_map(&self, channels: &[Channel], time: &crate::map::Time) -> Map {
        let mut map = Map {
            time: time.clone(),
            ..Map::default()
        };
        for one in self.assigned.iter().chain(&self.time) {
            let Some(channel) = channels.get(one.channel) else {
                continue;
            };
            let mut entry = one.entry.clone();
            entry.name = Some(crate::map::Names::One(channel.name.clone()));
            let repeats = channels
                .iter()
                .filter(|other| other.name == channel.name)
                .count()
                > 1;
            if repeats && entry.group.is_none() {
                entry.group = Some(channel.group.clone());
            }
            if entry.unit.is_none() && !channel.unit.is_empty() {
                entry.unit = Some(channel.unit.clone());
            }
            map.channels.insert(one.column.clone(), entry);
        }
        map
    }
}

/// Finds the channels of a map's columns.
///
/// # Errors
/// [`Problem`] where a name is not there, fits several channels, or is text; it lists the candidates.
pub fn by_map(channels: &[Channel], map: &Map) -> Result<Roles, Problem> {
    let mut roles = Roles::default();
    for (column, entry) in &map.channels {
        let channel = find(channels, column, entry)?;
        let assigned = Assigned {
            column: column.clone(),
            channel,
            entry: entry.clone(),
        };
        if column == TIME {
            roles.time = Some(assigned);
        } else {
            roles.assigned.push(assigned);
        }
    }
    // As recordings are written: the contract's columns in its order, then the others.
    roles.assigned.sort_by_key(|one| {
        ROLES
            .iter()
            .position(|role| role.name == one.column)
            .unwrap_or(ROLES.len())
    });
    if roles.time.is_none() {
        roles.time = guess_of(channels, &ROLES[0]).ok();
    }
    for role in &ROLES[1..] {
        if !map.channels.contains_key(role.name) {
            roles.refused.push(Refused {
                column: role.name,
                reason: format!(
                    "required column {} is missing: the map has no [channels.{}]",
                    role.name, role.name
                ),
                ambiguous: false,
            });
        }
    }
    Ok(roles)
}

fn find(channels: &[Channel], column: &str, entry: &Entry) -> Result<usize, Problem> {
    let own = crate::map::Names::One(column.to_owned());
    let names = entry.name.as_ref().unwrap_or(&own);
    let in_group = |channel: &Channel| {
        entry
            .group
            .as_ref()
            .is_none_or(|group| fits(group, &channel.group))
    };
    for name in names.iter() {
        let exact: Vec<usize> = (0..channels.len())
            .filter(|&k| channels[k].name == name && in_group(&channels[k]))
            .collect();
        let fitting = if exact.is_empty() {
            (0..channels.len())
                .filter(|&k| fits(name, &channels[k].name) && in_group(&channels[k]))
                .collect()
        } else {
            exact
        };
        match fitting.as_slice() {
            [] => {}
            [one] if channels[*one].kind.is_number() => return Ok(*one),
            [one] => {
                return Err(Problem::whole(format!(
                    "{column}: {} is {}, not a number",
                    channels[*one].shown(),
                    channels[*one].kind.word()
                )));
            }
            several => {
                return Err(Problem::whole(format!(
                    "{column}: {name:?} fits {}: give the exact name, or the group",
                    list(channels, several)
                )));
            }
        }
    }
    let wanted: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
    let group = entry
        .group
        .as_ref()
        .map_or(String::new(), |group| format!(" in group {group:?}"));
    let numeric: Vec<usize> = (0..channels.len())
        .filter(|&k| channels[k].kind.is_number() && !channels[k].is_time)
        .collect();
    Err(Problem::whole(format!(
        "{column}: no channel {}{group}; there are {}",
        wanted.join(" or "),
        list(channels, &numeric)
    )))
}

/// Channels in a message, not more than fit a line.
fn list(channels: &[Channel], which: &[usize]) -> String {
    const MOST: usize = 12;
    let mut shown: Vec<String> = which
        .iter()
        .take(MOST)
        .filter_map(|&k| channels.get(k))
        .map(Channel::shown)
        .collect();
    if which.len() > MOST {
        shown.push(format!("{} more", which.len() - MOST));
    }
    if shown.is_empty() {
        return "none".to_owned();
    }
    shown.join(", ")
}

/// Guesses the columns from names and units. What cannot be told apart is refused, with the candidates; it is never chosen by its order.
#[must_use]
pub fn guess(channels: &[Channel]) -> Roles {
    let mut roles = Roles {
        guessed: true,
        ..Roles::default()
    };
    for role in &ROLES {
        match guess_of(channels, role) {
            Ok(assigned) if role.name == TIME => roles.time = Some(assigned),
            Ok(assigned) => roles.assigned.push(assigned),
            Err(refused) => roles.refused.push(refused),
        }
    }
    roles
}

fn guess_of(channels: &[Channel], role: &'static Role) -> Result<Assigned, Refused> {
    let refused = |reason: String, ambiguous: bool| Refused {
        column: role.name,
        reason,
        ambiguous,
    };
    let scored: Vec<(u8, usize)> = channels
        .iter()
        .enumerate()
        .filter(|(_, channel)| channel.kind.is_number() && (role.name == TIME || !channel.is_time))
        .filter_map(|(k, channel)| Some((score(channel, role)?, k)))
        .collect();
    let fits_unit = |k: usize| may_be(&channels[k], role);
    let best = scored
        .iter()
        .filter(|&&(_, k)| fits_unit(k))
        .map(|&(score, _)| score)
        .max();
    let Some(best) = best else {
        let named: Vec<usize> = scored.iter().map(|&(_, k)| k).collect();
        let by_unit: Vec<usize> = (0..channels.len())
            .filter(|&k| {
                channels[k].kind.is_number()
                    && units::of(&channels[k].unit)
                        .is_some_and(|unit| unit.quantity == role.quantity)
            })
            .collect();
        let reason = match (named.as_slice(), by_unit.as_slice()) {
            ([], []) => format!(
                "required column {} is missing: no channel's name or unit says it is one; name it in a map, [channels.{}]",
                role.name, role.name
            ),
            ([], by_unit) => format!(
                "required column {} is missing: no channel's name says it is one; by their unit it may be {}; name it in a map, [channels.{}]",
                role.name,
                list(channels, by_unit),
                role.name
            ),
            (named, _) => format!(
                "required column {} is missing: {} by name, but not in a unit of {}; name it in a map, [channels.{}]",
                role.name,
                list(channels, named),
                role.quantity.si(),
                role.name
            ),
        };
        return Err(refused(reason, false));
    };
    let fitting: Vec<usize> = scored
        .iter()
        .filter(|&&(score, k)| score == best && fits_unit(k))
        .map(|&(_, k)| k)
        .collect();
    // Times of several groups are each their own group's; those of one group are candidates.
    let same_group = fitting
        .windows(2)
        .all(|pair| channels[pair[0]].group == channels[pair[1]].group);
    match fitting.as_slice() {
        [one] => Ok(Assigned {
            column: role.name.to_owned(),
            channel: *one,
            entry: Entry::named(&channels[*one].name),
        }),
        [first, ..] if role.name == TIME && !same_group => Ok(Assigned {
            column: role.name.to_owned(),
            channel: *first,
            entry: Entry::named(&channels[*first].name),
        }),
        several => {
            let left_out = if role.required {
                ""
            } else {
                ", or leave the column out of it"
            };
            let reason = format!(
                "column {} may be {}: choose in a map, [channels.{}]{left_out}",
                role.name,
                list(channels, several),
                role.name
            );
            Err(refused(reason, true))
        }
    }
}

/// How well a name says that a channel is a role: 5 its very header, 4 a name, 3 a name within a longer one, 2 a symbol among its words, 1 perhaps.
fn score(channel: &Channel, role: &Role) -> Option<u8> {
    let own = named(&channel.name, role)?;
    // What says another role more clearly is that one: a wheel's speed is no vehicle's.
    let other = ROLES
        .iter()
        .filter(|other| other.name != role.name)
        .filter_map(|other| named(&channel.name, other))
        .max();
    (other.is_none_or(|other| own >= other)).then_some(own)
}

fn named(name: &str, role: &Role) -> Option<u8> {
    if name == role.name {
        return Some(5);
    }
    let folded = fold(name);
    if role.strong.contains(&folded.as_str()) {
        return Some(4);
    }
    if role.strong.iter().any(|alias| folded.contains(alias)) {
        return Some(3);
    }
    let words = words(name);
    if role.words.contains(&folded.as_str())
        || words
            .iter()
            .any(|word| word.len() > 1 && role.words.contains(&word.as_str()))
    {
        return Some(2);
    }
    // F_X and v_X are one symbol in two words.
    let joined = |pair: &[String]| {
        pair[0].chars().count() == 1 && role.words.contains(&pair.concat().as_str())
    };
    if words.windows(2).any(joined) {
        return Some(2);
    }
    let weak = role.weak.contains(&folded.as_str())
        || words
            .iter()
            .any(|word| word.chars().count() > 1 && role.weak.contains(&word.as_str()))
        || role
            .weak
            .iter()
            .any(|alias| !alias.is_ascii() && folded.contains(alias));
    weak.then_some(1)
}

/// Whether the unit allows it: one of the role's quantity, or none (which is told when the channel is read).
fn may_be(channel: &Channel, role: &Role) -> bool {
    match units::of(&channel.unit) {
        Some(unit) => {
            unit.quantity == role.quantity
                || unit.quantity == Quantity::Percent
                || (unit.quantity == Quantity::Frequency && role.quantity == Quantity::AngularSpeed)
        }
        None => true,
    }
}

/// A name without case, accents and separators: `Vitesse véhicule` is `vitessevehicule`.
#[must_use]
pub fn fold(name: &str) -> String {
    name.chars()
        .filter(|c| c.is_alphanumeric() || *c == 'ー')
        .flat_map(char::to_lowercase)
        .map(|c| match c {
            'é' | 'è' | 'ê' | 'ë' => 'e',
            'à' | 'â' => 'a',
            'î' | 'ï' => 'i',
            'ô' => 'o',
            'û' | 'ù' => 'u',
            'ç' => 'c',
            'ω' => 'w',
            other => other,
        })
        .collect()
}

/// The words of a name: parted by separators, and where a small letter or a digit meets a capital.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        let starts = c.is_uppercase() && (before.is_lowercase() || before.is_ascii_digit());
        if !c.is_alphanumeric() || starts {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.push_str(&fold(&c.to_string()));
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Kind;

    fn channel(name: &str, unit: &str) -> Channel {
        Channel {
            group: String::new(),
            name: name.into(),
            unit: unit.into(),
            samples: 1,
            comment: String::new(),
            kind: Kind::Numeric,
            is_time: false,
        }
    }

    fn guessed(channels: &[(&str, &str)]) -> Vec<String> {
        let channels: Vec<Channel> = channels
            .iter()
            .map(|(name, unit)| channel(name, unit))
            .collect();
        let roles = guess(&channels);
        ROLES
            .iter()
            .map(|role| {
                let all = roles.assigned.iter().chain(&roles.time);
                let found = all.clone().find(|one| one.column == role.name);
                found.map_or(String::new(), |one| channels[one.channel].name.clone())
            })
            .collect()
    }

    #[test]
    fn names_of_four_languages_and_two_standards_are_known() {
        for names in [
            [
                ("Time", "s"),
                ("WheelSpeed_FL", "rpm"),
                ("VehicleSpeed", "km/h"),
                ("Brake_Force", "kN"),
                ("Wheel Load", "kN"),
                ("BrakeTorque", "Nm"),
                ("Brake Pressure", "bar"),
            ],
            [
                ("Zeit", "s"),
                ("Raddrehzahl VL", "1/min"),
                ("Geschwindigkeit", "km/h"),
                ("Längskraft", "N"),
                ("Radlast", "N"),
                ("Bremsmoment", "Nm"),
                ("Bremsdruck", "bar"),
            ],
            [
                ("Temps", "s"),
                ("Vitesse de rotation roue", "tr/min"),
                ("Vitesse véhicule", "km/h"),
                ("Effort longitudinal", "daN"),
                ("Charge verticale", "daN"),
                ("Couple de freinage", "Nm"),
                ("Pression frein", "bar"),
            ],
            [
                ("時間", "s"),
                ("車輪回転数", "rpm"),
                ("車速", "km/h"),
                ("制動力", "N"),
                ("垂直荷重", "N"),
                ("ブレーキトルク", "Nm"),
                ("ブレーキ液圧", "MPa"),
            ],
            [
                ("t", "s"),
                ("omega_W", "rad/s"),
                ("v_X", "m/s"),
                ("F_X", "N"),
                ("F_Z", "N"),
                ("M_brake", "Nm"),
                ("p_brake", "bar"),
            ],
            [
                ("TIME", "s"),
                ("WHROTSPD", "1/s"),
                ("LONGVEL", "m/s"),
                ("FX", "N"),
                ("FZW", "N"),
                ("BrkTq", "Nm"),
                ("BrkP", "kPa"),
            ],
        ] {
            assert_eq!(guessed(&names), names.map(|(name, _)| name.to_owned()));
        }
    }

    #[test]
    fn equals_are_refused_with_their_names() {
        let channels = ["nWheelFL", "nWheelFR"].map(|name| channel(name, "1/min"));
        let roles = guess(&channels);
        let refused = roles.ambiguous().unwrap();
        assert_eq!(refused.column, "wheel_speed_rad_s");
        assert!(
            refused
                .reason
                .contains("nWheelFL [1/min], nWheelFR [1/min]"),
            "{refused:?}"
        );
        // One that no estimate needs is no less refused.
        let channels = ["pBrakeFL", "pBrakeFR"].map(|name| channel(name, "bar"));
        let roles = guess(&channels);
        let refused = roles.ambiguous().unwrap();
        assert_eq!(refused.column, "brake_pressure_pa");
        assert!(refused.reason.contains("or leave"), "{refused:?}");
        // A time of each group is no ambiguity.
        let mut times = [channel("Time", "s"), channel("Time", "s")];
        times[1].group = "2".to_owned();
        assert_eq!(guess(&times).ambiguous(), None);
    }

    #[test]
    fn a_unit_of_another_quantity_is_no_candidate_but_told() {
        let roles = guess(&[channel("WheelSpeed", "km/h")]);
        let told = roles
            .refused
            .iter()
            .find(|refused| refused.column == "wheel_speed_rad_s")
            .unwrap();
        assert!(
            told.reason.contains("WheelSpeed [km/h]") && !told.ambiguous,
            "{told:?}"
        );
        assert_eq!(guessed(&[("speed", "km/h"), ("n", "rpm")])[2], "speed");
        // A temperature is none of them.
        assert!(
            guessed(&[("T_tread", "°C"), ("Temperature", "°C")])
                .iter()
                .all(String::is_empty)
        );
    }

    #[test]
    fn a_map_takes_the_first_name_that_is_there() {
        let mut channels = vec![
            channel("a", "N"),
            channel("b1", "N"),
            channel("b2", "N"),
            channel("a", "N"),
        ];
        channels[3].group = "2".into();
        let map = |text: &str| toml::from_str::<Map>(text).unwrap();
        let found =
            |text: &str| by_map(&channels, &map(text)).map(|roles| roles.assigned[0].channel);
        assert_eq!(found("[channels.x]\nname = [\"none\", \"b2\"]"), Ok(2));
        assert_eq!(found("[channels.x]\nname = \"a\"\ngroup = \"2\""), Ok(3));
        assert_eq!(found("[channels.a]\ngroup = \"\""), Ok(0));
        let told = found("[channels.x]\nname = \"b*\"").unwrap_err().reason;
        assert!(told.contains("b1 [N], b2 [N]"), "{told}");
        let told = found("[channels.x]\nname = \"c\"").unwrap_err().reason;
        assert!(told.contains("no channel \"c\"; there are a [N]"), "{told}");
    }
}
