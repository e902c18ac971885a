//! Units as they are spelled in the field, and what one of them is in SI.

use std::f64::consts::PI;

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// m/s.
    Speed,
    /// rad/s.
    AngularSpeed,
    /// 1/s; a tone ring's becomes rad/s by its teeth.
    Frequency,
    /// N.
    Force,
    /// Pa.
    Pressure,
    /// N m.
    Torque,
    /// m/s².
    Acceleration,
    /// s.
    Time,
    /// K is the SI unit; °C is kept as such, because nobody wants a tyre at 353.15.
    Temperature,
    /// 1.
    Ratio,
    /// %: of what must be said.
    Percent,
    /// m.
    Length,
}

impl Quantity {
    /// The SI unit's usual spelling; °C for temperatures.
    #[must_use]
    pub fn si(self) -> &'static str {
        match self {
            Self::Speed => "m/s",
            Self::AngularSpeed => "rad/s",
            Self::Frequency => "Hz",
            Self::Force => "N",
            Self::Pressure => "Pa",
            Self::Torque => "N·m",
            Self::Acceleration => "m/s²",
            Self::Time => "s",
            Self::Temperature => "°C",
            Self::Ratio => "1",
            Self::Percent => "%",
            Self::Length => "m",
        }
    }
}

/// A unit: SI value = factor * reading + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// What it measures.
    pub quantity: Quantity,
    /// SI units in one of it.
    pub factor: f64,
    /// SI value of its zero.
    pub offset: f64,
}

/// Standard gravity, m/s² (CGPM 1901).
const G: f64 = 9.806_65;
/// Newtons in a pound-force: the avoirdupois pound of 0.45359237 kg (1959) under standard gravity.
const LBF: f64 = 0.453_592_37 * G;
/// Metres in a foot (1959).
const FOOT: f64 = 0.304_8;
/// Metres in an inch (1959).
const INCH: f64 = 0.025_4;

/// Spellings without blanks, dots of multiplication and letter case, and what they are. Where case tells units apart (mPa and MPa, ms and Ms)
/// [`of`] looks first.
const TABLE: &[(&[&str], Quantity, f64)] = &[
    (
        &[
            "m/s",
            "mps",
            "ms^-1",
            "ms-1",
            "meter/sec",
            "m/sec",
            "metre/s",
        ],
        Quantity::Speed,
        1.0,
    ),
    (
        &[
            "km/h", "kmh", "kph", "km/hr", "kmph", "kmh-1", "kmh^-1", "km/std",
        ],
        Quantity::Speed,
        1.0 / 3.6,
    ),
    (
        &["mph", "mi/h", "mile/h", "miles/h"],
        Quantity::Speed,
        1609.344 / 3600.0,
    ),
    (
        &["kn", "knot", "knots", "kt", "kts"],
        Quantity::Speed,
        1852.0 / 3600.0,
    ),
    (&["ft/s", "fps"], Quantity::Speed, FOOT),
    (&["mm/s"], Quantity::Speed, 1e-3),
    (
        &[
            "rad/s",
            "rads",
            "rad/sec",
            "rads^-1",
            "rads-1",
            "rad/second",
        ],
        Quantity::AngularSpeed,
        1.0,
    ),
    (
        &[
            "1/min", "rpm", "r/min", "min^-1", "min-1", "u/min", "rev/min", "tr/min", "t/min",
            "upm", "/min", "revs/min",
        ],
        Quantity::AngularSpeed,
        PI / 30.0,
    ),
    (
        &[
            "deg/s", "°/s", "degree/s", "dps", "degs^-1", "grad/s", "deg/sec",
        ],
        Quantity::AngularSpeed,
        PI / 180.0,
    ),
    (
        &["rps", "rev/s", "u/s", "tr/s"],
        Quantity::AngularSpeed,
        2.0 * PI,
    ),
    (&["hz", "1/s", "s^-1", "s-1"], Quantity::Frequency, 1.0),
    (&["khz"], Quantity::Frequency, 1e3),
    (&["n", "newton", "newtons"], Quantity::Force, 1.0),
    (&["dan"], Quantity::Force, 10.0),
    (&["lbf", "lbs", "lb"], Quantity::Force, LBF),
    (&["klbf", "kip"], Quantity::Force, 1e3 * LBF),
    (&["kgf", "kp"], Quantity::Force, G),
    (&["pa", "n/m2", "n/m^2", "pascal"], Quantity::Pressure, 1.0),
    (&["hpa", "mbar"], Quantity::Pressure, 100.0),
    (&["kpa"], Quantity::Pressure, 1e3),
    (&["mpa", "n/mm2", "n/mm^2"], Quantity::Pressure, 1e6),
    (&["bar", "bars", "bara", "barg"], Quantity::Pressure, 1e5),
    (
        &["psi", "lbf/in2", "lbf/in^2", "psig", "psia"],
        Quantity::Pressure,
        LBF / (INCH * INCH),
    ),
    (&["nm", "newtonmeter", "n-m"], Quantity::Torque, 1.0),
    (&["knm", "kn-m"], Quantity::Torque, 1e3),
    (&["dnm"], Quantity::Torque, 0.1),
    (
        &[
            "lbfft", "lbf-ft", "ft-lb", "ftlb", "ft-lbf", "ftlbf", "lb-ft", "lbft",
        ],
        Quantity::Torque,
        LBF * FOOT,
    ),
    (
        &["lbfin", "lbf-in", "in-lb", "inlb", "in-lbf", "inlbf"],
        Quantity::Torque,
        LBF * INCH,
    ),
    (&["kgfm", "kgf-m", "kgm"], Quantity::Torque, G),
    (
        &[
            "m/s2", "m/s^2", "m/s/s", "ms^-2", "ms-2", "m/sec^2", "m/sec2",
        ],
        Quantity::Acceleration,
        1.0,
    ),
    (&["g", "gn", "g0"], Quantity::Acceleration, G),
    (
        &[
            "s", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden", "secondes", "秒",
        ],
        Quantity::Time,
        1.0,
    ),
    (
        &["ms", "msec", "millisecond", "milliseconds", "ミリ秒"],
        Quantity::Time,
        1e-3,
    ),
    (
        &["us", "μs", "usec", "microsecond", "microseconds"],
        Quantity::Time,
        1e-6,
    ),
    (
        &["ns", "nsec", "nanosecond", "nanoseconds"],
        Quantity::Time,
        1e-9,
    ),
    (&["min", "minute", "minutes"], Quantity::Time, 60.0),
    (&["h", "hr", "hour", "hours"], Quantity::Time, 3600.0),
    (
        &["°c", "degc", "celsius", "c", "℃", "gradc", "deg_c"],
        Quantity::Temperature,
        1.0,
    ),
    (
        &["1", "-", "–", "ratio", "none", "ul", "[-]", "unitless"],
        Quantity::Ratio,
        1.0,
    ),
    (
        &["%", "percent", "pct", "prozent", "%slip"],
        Quantity::Percent,
        0.01,
    ),
    (&["m", "meter", "metre", "meters"], Quantity::Length, 1.0),
    (&["mm"], Quantity::Length, 1e-3),
    (&["cm"], Quantity::Length, 1e-2),
    (&["km"], Quantity::Length, 1e3),
    (&["in", "inch", "\""], Quantity::Length, INCH),
    (&["ft", "feet", "foot"], Quantity::Length, FOOT),
];

/// A unit by its spelling: blanks, brackets and signs of multiplication do not count, and letter case only where it tells units apart.
///
/// `kN` is a kilonewton and `kn` a knot; `mPa` and `Ms` are not taken for their namesakes.
#[must_use]
pub fn of(spelling: &str) -> Option<Unit> {
    let text = bare(spelling);
    let linear = |quantity, factor| {
        Some(Unit {
            quantity,
            factor,
            offset: 0.0,
        })
    };
    match text {
        "kN" | "KN" => return linear(Quantity::Force, 1e3),
        "MN" => return linear(Quantity::Force, 1e6),
        "mN" => return linear(Quantity::Force, 1e-3),
        "mPa" => return linear(Quantity::Pressure, 1e-3),
        "mNm" | "mN.m" | "mN·m" => return linear(Quantity::Torque, 1e-3),
        "nm" | "Ms" | "MS" | "Mm" | "G" => return None,
        "K" | "k" | "kelvin" | "Kelvin" => {
            return Some(Unit {
                quantity: Quantity::Temperature,
                factor: 1.0,
                offset: -273.15,
            });
        }
        "°F" | "degF" | "F" | "℉" | "fahrenheit" | "Fahrenheit" | "deg_F" => {
            return Some(Unit {
                quantity: Quantity::Temperature,
                factor: 5.0 / 9.0,
                offset: -160.0 / 9.0,
            });
        }
        _ => {}
    }
    let plain: String = text
        .chars()
        .filter(|c| !c.is_whitespace() && !matches!(c, '·' | '*' | '⋅' | '∙' | '.' | '×'))
        .map(|c| match c {
            '²' => '2',
            '⁻' | '−' => '-',
            '¹' => '1',
            'µ' => 'μ',
            '₀' => '0',
            '％' => '%',
            '／' => '/',
            'º' | '˚' => '°',
            other => other,
        })
        .flat_map(char::to_lowercase)
        .collect();
    let (_, quantity, factor) = TABLE
        .iter()
        .find(|(spellings, ..)| spellings.contains(&plain.as_str()))?;
    linear(*quantity, *factor)
}

/// A spelling without blanks and brackets around it.
#[must_use]
pub fn bare(spelling: &str) -> &str {
    let text = spelling.trim();
    for (open, close) in [
        ('[', ']'),
        ('(', ')'),
        ('<', '>'),
        ('{', '}'),
        ('［', '］'),
        ('（', '）'),
    ] {
        let inner = text
            .strip_prefix(open)
            .and_then(|text| text.strip_suffix(close));
        if let Some(inner) = inner {
            return inner.trim();
        }
    }
    text
}

/// A header parted into name and unit: `v [km/h]`, `v (km/h)`, `v / km/h`, `v in km/h`. Words in round brackets that are no unit stay in the name.
#[must_use]
pub fn part(header: &str) -> (String, String) {
    let text = header.trim();
    let parted = |name: &str, unit: &str| (name.trim().to_owned(), bare(unit).to_owned());
    for (open, close, any) in [
        ('[', ']', true),
        ('［', '］', true),
        ('(', ')', false),
        ('（', '）', false),
        ('<', '>', false),
        ('{', '}', false),
    ] {
        if let Some((name, unit)) = text
            .strip_suffix(close)
            .and_then(|rest| rest.rsplit_once(open))
            && !name.trim().is_empty()
            && (any || of(unit).is_some())
        {
            return parted(name, unit);
        }
    }
    for separator in [" / ", " in ", " en ", ", "] {
        if let Some((name, unit)) = text.split_once(separator)
            && !name.trim().is_empty()
            && of(unit).is_some()
        {
            return parted(name, unit);
        }
    }
    (text.to_owned(), String::new())
}

/// Whether the cells of a row are units: each is one, in brackets, or empty, and at least half are known ones.
#[must_use]
pub fn is_unit_row(cells: &[String]) -> bool {
    let filled: Vec<&str> = cells
        .iter()
        .map(|cell| cell.trim())
        .filter(|cell| !cell.is_empty())
        .collect();
    let bracketed = |cell: &str| cell.starts_with('[') && cell.ends_with(']');
    let known = filled.iter().filter(|cell| of(cell).is_some()).count();
    let fitting = filled
        .iter()
        .filter(|cell| of(cell).is_some() || bracketed(cell) || cell.chars().count() <= 8)
        .count();
    !filled.is_empty() && known * 2 >= filled.len() && fitting == filled.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn si(value: f64, unit: &str) -> f64 {
        let unit = of(unit).unwrap();
        unit.factor * value + unit.offset
    }

    #[test]
    fn every_unit_of_the_contract_is_known_with_its_size() {
        for (value, unit, expected) in [
            (1.0, "m/s", 1.0),
            (36.0, "km/h", 10.0),
            (1.0, "mph", 0.44704),
            (1.0, "kn", 1852.0 / 3600.0),
            (1.0, "rad/s", 1.0),
            (60.0, "1/min", 2.0 * PI),
            (60.0, "rpm", 2.0 * PI),
            (1.0, "Hz", 1.0),
            (180.0, "deg/s", PI),
            (1.0, "N", 1.0),
            (1.0, "kN", 1000.0),
            (1.0, "lbf", 4.448_221_615_260_5),
            (1.0, "kgf", 9.80665),
            (1.0, "Pa", 1.0),
            (1.0, "kPa", 1e3),
            (1.0, "MPa", 1e6),
            (1.0, "bar", 1e5),
            (1.0, "psi", 6_894.757_293_168_361),
            (1.0, "N·m", 1.0),
            (1.0, "Nm", 1.0),
            (1.0, "kNm", 1e3),
            (1.0, "lbf·ft", 1.355_817_948_331_400_4),
            (1.0, "m/s²", 1.0),
            (1.0, "g", 9.80665),
            (1.0, "ms", 1e-3),
            (1.0, "µs", 1e-6),
            (20.0, "°C", 20.0),
            (293.15, "K", 20.0),
            (68.0, "°F", 20.0),
            (1.0, "1", 1.0),
            (50.0, "%", 0.5),
            (1.0, "–", 1.0),
            (1.0, "mm", 1e-3),
            (1.0, "km", 1e3),
        ] {
            let got = si(value, unit);
            assert!(
                (got - expected).abs() <= 1e-13 * expected.abs().max(1.0),
                "{value} {unit}: {got}"
            );
        }
    }

    #[test]
    fn case_tells_knots_from_kilonewtons() {
        assert_eq!(of("kN").unwrap().quantity, Quantity::Force);
        assert_eq!(of("kn").unwrap().quantity, Quantity::Speed);
        assert_eq!(of("KM/H").unwrap().quantity, Quantity::Speed);
        assert!(of("furlong").is_none() && of("").is_none() && of("Ms").is_none());
    }

    #[test]
    fn headers_part_into_name_and_unit() {
        for (header, name, unit) in [
            ("v [km/h]", "v", "km/h"),
            ("v(km/h)", "v", "km/h"),
            ("speed (left)", "speed (left)", ""),
            ("n / rpm", "n", "rpm"),
            ("v in km/h", "v", "km/h"),
            ("[s]", "[s]", ""),
            ("x [counts]", "x", "counts"),
        ] {
            assert_eq!(part(header), (name.to_owned(), unit.to_owned()));
        }
    }
}
