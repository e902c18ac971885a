//! Dates and times as text.

/// Days from 1970-01-01 to a date of the Gregorian calendar (Hinnant, "chrono-compatible low-level date algorithms").
#[cfg(feature = "csv")]
fn days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let of_era = year - era * 400;
    let of_year = (153 * (if month > 2 { month - 3 } else { month + 9 }) + 2) / 5 + day - 1;
    era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468
}

/// RFC 3339 of nanoseconds since 1970 in UTC, at an offset in minutes from it.
#[cfg(any(feature = "mdf", feature = "tdms"))]
pub(crate) fn rfc3339(nanoseconds: i64, offset_min: i64) -> String {
    const DAY: i64 = 86_400;
    let local = nanoseconds
        .div_euclid(1_000_000_000)
        .saturating_add(offset_min * 60);
    let (day, second) = (local.div_euclid(DAY), local.rem_euclid(DAY));
    // The inverse of `days`, by the same author.
    let shifted = day + 719_468;
    let era = shifted.div_euclid(146_097);
    let of_era = shifted.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let moved = (5 * of_year + 2) / 153;
    let date = of_year - (153 * moved + 2) / 5 + 1;
    let month = if moved < 10 { moved + 3 } else { moved - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    let fraction = nanoseconds.rem_euclid(1_000_000_000);
    let fraction = if fraction % 1_000_000 == 0 {
        format!("{:03}", fraction / 1_000_000)
    } else if fraction % 1_000 == 0 {
        format!("{:06}", fraction / 1_000)
    } else {
        format!("{fraction:09}")
    };
    let zone = if offset_min == 0 {
        "Z".to_owned()
    } else {
        let sign = if offset_min < 0 { '-' } else { '+' };
        let offset = offset_min.abs();
        format!("{sign}{:02}:{:02}", offset / 60, offset % 60)
    };
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{date:02}T{hour:02}:{minute:02}:{second:02}.{fraction}{zone}")
}

/// A time stamp in s: of the day where it is `hh:mm:ss`, since 1970 where it has a date, whole seconds apart from their fraction so that
/// differences keep their digits.
#[cfg(feature = "csv")]
pub(crate) fn stamp(text: &str) -> Option<(i64, f64)> {
    let text = text.trim().trim_end_matches('Z');
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (Some(date), time.trim()),
        None => (None, text),
    };
    let day = match date {
        Some(date) => date_days(date)?,
        None => 0,
    };
    // A zone behind the time is the same for a whole file.
    let time = time.split_once('+').map_or(time, |(time, _)| time);
    let mut parts = time.split(':');
    let hour: i64 = whole(parts.next()?)?;
    let minute: i64 = whole(parts.next()?)?;
    let second = parts.next()?.replace(',', ".");
    if parts.next().is_some() || hour > 24 || minute > 59 {
        return None;
    }
    let (second, fraction) = match second.split_once('.') {
        Some((second, digits)) if digits.bytes().all(|b| b.is_ascii_digit()) => {
            (whole(second)?, format!("0.{digits}").parse().ok()?)
        }
        Some(_) => return None,
        None => (whole(&second)?, 0.0),
    };
    Some((day * 86_400 + hour * 3600 + minute * 60 + second, fraction))
}

#[cfg(feature = "csv")]
fn whole(digits: &str) -> Option<i64> {
    let fits = (1..=4).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
    if fits { digits.parse().ok() } else { None }
}

/// `2026-03-04`, `2026/03/04` or `04.03.2026`; a date that may be read in two ways is none.
#[cfg(feature = "csv")]
fn date_days(text: &str) -> Option<i64> {
    let separator = ['-', '/', '.'].into_iter().find(|&c| text.contains(c))?;
    let mut parts = text.split(separator);
    let parts = [parts.next()?, parts.next()?, parts.next()?];
    let (year, month, day) = match (parts[0].len(), separator, parts[2].len()) {
        (4, ..) => (parts[0], parts[1], parts[2]),
        (_, '.', 4) => (parts[2], parts[1], parts[0]),
        _ => return None,
    };
    let (year, month, day) = (whole(year)?, whole(month)?, whole(day)?);
    ((1..=12).contains(&month) && (1..=31).contains(&day)).then(|| days(year, month, day))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(feature = "csv")]
    #[test]
    fn stamps_are_seconds_and_what_is_none_is_refused() {
        assert_eq!(stamp("1970-01-02T00:00:01.5Z"), Some((86_401, 0.5)));
        assert_eq!(stamp("04.03.2026 09:15:00,25"), Some((1_772_615_700, 0.25)));
        assert_eq!(stamp("09:15:00"), Some((33_300, 0.0)));
        for none in [
            "",
            "12",
            "1.5",
            "12:30",
            "03/04/2026 09:15:00",
            "a:b:c",
            "-1:00:00",
        ] {
            assert_eq!(stamp(none), None, "{none}");
        }
    }

    #[cfg(any(feature = "mdf", feature = "tdms"))]
    #[test]
    fn a_start_is_written_with_its_zone() {
        assert_eq!(
            rfc3339(1_772_615_700_250_000_000, 60),
            "2026-03-04T10:15:00.250+01:00"
        );
        assert_eq!(rfc3339(0, 0), "1970-01-01T00:00:00.000Z");
        assert_eq!(rfc3339(-1, -90), "1969-12-31T22:29:59.999999999-01:30");
    }
}
