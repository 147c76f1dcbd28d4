//! Dates of ISO 8601: 2024-05-01, 2024-05-01T10:00:00.25Z, 2024-05-01 10:00+02:00.

const SECOND: i64 = 1_000_000_000;

/// ns since 1970 (UTC where no zone is told); None where it is no date of the years 1678 to 2261.
pub fn nanoseconds(cell: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(cell).ok()?.trim();
    let (day, rest) = text.split_at_checked(10)?;
    let mut parts = day.split('-');
    let (year, month, date) =
        (whole(parts.next()?, 4)?, whole(parts.next()?, 2)?, whole(parts.next()?, 2)?);
    let is_day = (1678..=2261).contains(&year) && (1..=12).contains(&month);
    if !is_day || !(1..=days_of(year, month)).contains(&date) {
        return None;
    }
    let seconds = if rest.is_empty() { 0 } else { time_of_day(rest)? };
    Some(days_since_1970(year, month, date) * 86_400 * SECOND + seconds)
}

/// Seconds from the first stamp; NaN where nothing stands.
pub fn seconds(stamps: &[i64]) -> Vec<f64> {
    let first = stamps.first().copied().unwrap_or(0);
    let of = |&stamp: &i64| {
        if stamp == i64::MIN || first == i64::MIN {
            f64::NAN
        } else {
            // Exact in integers; a double of seconds since 1970 would round to 0.2 µs. Stamps further
            // apart than 292 years, such as a clock that was not set, take more than 64 bits.
            (i128::from(stamp) - i128::from(first)) as f64 / SECOND as f64
        }
    };
    stamps.iter().map(of).collect()
}

fn whole(text: &str, length: usize) -> Option<i64> {
    let is_digits = text.len() == length && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_digits { text.parse().ok() } else { None }
}

/// ns of `T10:00`, `T10:00:00`, `T10:00:00.25`, with or without a zone.
fn time_of_day(text: &str) -> Option<i64> {
    let text = text.strip_prefix(['T', ' '])?;
    let (clock, zone) = match text.find(['Z', '+', '-']) {
        Some(place) => (&text[..place], zone_minutes(&text[place..])?),
        None => (text, 0),
    };
    let mut parts = clock.splitn(3, ':');
    let (hour, minute) = (whole(parts.next()?, 2)?, whole(parts.next()?, 2)?);
    let (second, fraction) = parts.next().map_or(Some((0, 0)), second_of)?;
    if hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    Some(((hour * 60 + minute - zone) * 60 + second) * SECOND + fraction)
}

fn second_of(text: &str) -> Option<(i64, i64)> {
    let (second, fraction) = text.split_once(['.', ',']).unwrap_or((text, ""));
    if fraction.len() > 9 {
        return None;
    }
    let padded = format!("{fraction:0<9}");
    Some((whole(second, 2)?, whole(&padded, 9)?))
}

fn zone_minutes(text: &str) -> Option<i64> {
    if text == "Z" {
        return Some(0);
    }
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let digits = text[1..].replacen(':', "", 1);
    let (hours, minutes) = digits.split_at_checked(2)?;
    let minutes = if minutes.is_empty() { 0 } else { whole(minutes, 2)? };
    Some(sign * (whole(hours, 2)? * 60 + minutes))
}

fn days_of(year: i64, month: i64) -> i64 {
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    match month {
        2 => 28 + i64::from(is_leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days of the Gregorian calendar since 1970-01-01 (Hinnant, "chrono-compatible low-level date algorithms").
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = year - i64::from(month <= 2);
    let (era, of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        assert_eq!(nanoseconds(b"1970-01-01"), Some(0));
        assert_eq!(nanoseconds(b"2024-02-29T00:00:01Z"), Some(1_709_164_801 * SECOND));
        assert_eq!(nanoseconds(b"2000-03-01 02:00+02:00"), Some(951_868_800 * SECOND));
        assert_eq!(nanoseconds(b"1969-12-31T23:59:59.75"), Some(-SECOND / 4));
        for text in [
            "2023-02-29",
            "2024-13-01",
            "2024-05-01T25:00",
            "2024-05-01x",
            "01.05.2024",
            "1234-01-01",
        ] {
            assert_eq!(nanoseconds(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn stamps_may_be_centuries_apart() {
        let stamps =
            ["1700-01-01", "2100-01-01T00:00:00.5"].map(|text| nanoseconds(text.as_bytes()));
        // 400 years of the Gregorian calendar are 146,097 days.
        assert_eq!(seconds(&stamps.map(Option::unwrap)), [0.0, 146_097.0 * 86_400.0 + 0.5]);
    }
}
