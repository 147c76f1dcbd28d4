//! One cell as a number, to the last bit.

/// Powers of ten that doubles hold exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
const LARGEST_EXACT: u64 = 1 << 53;
const NOTHING: [&[u8]; 12] = [
    b"", b"NA", b"N/A", b"n/a", b"#N/A", b"NULL", b"null", b"NaN", b"nan", b"-NaN", b"-nan", b"NAN",
];

/// A decimal number at the beginning of `text` that ends at a delimiter or line end, and its length.
///
/// None where it is anything else, or where its digits are too many to be read in one go.
pub fn plain_number(text: &[u8], delimiter: u8, point: &mut Option<u8>) -> Option<(f64, usize)> {
    // A comma that parts cells is no point, and one point is known: nothing is left to find out.
    if delimiter == b',' || *point == Some(b'.') {
        return pointed(text, delimiter);
    }
    let is_negative = text[0] == b'-';
    let mut at = usize::from(is_negative);
    let (mut digits, mut n_digits, mut n_decimals) = (0_u64, 0_usize, 0_usize);
    let mut mark = None;
    loop {
        let byte = *text.get(at)?;
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
            n_digits += 1;
            n_decimals += usize::from(mark.is_some());
        } else if byte == delimiter || byte == b'\n' || byte == b'\r' {
            break;
        } else if mark.is_none() && (byte == b'.' || byte == b',') && allows(*point, byte) {
            mark = Some(byte);
        } else {
            return None;
        }
        at += 1;
    }
    if n_digits == 0 || n_digits > 19 {
        return None;
    }
    *point = point.or(mark);
    let value = if digits <= LARGEST_EXACT && n_decimals < POWERS.len() {
        // Both are exact, so one division rounds once (Clinger, PLDI 1990).
        digits as f64 / POWERS[n_decimals]
    } else {
        return parsed(&text[..at], mark).map(|value| (value, at));
    };
    Some((if is_negative { -value } else { value }, at))
}

/// A number with a decimal point or none, with an exponent or none.
fn pointed(text: &[u8], delimiter: u8) -> Option<(f64, usize)> {
    let first = text[usize::from(text[0] == b'-')..].first()?;
    if !(first.is_ascii_digit() || *first == b'.') {
        return None; // a sign more, and words such as inf: cells that are looked at in full
    }
    let (value, length) = fast_float2::parse_partial(text).ok()?;
    let end = *text.get(length)?;
    (end == delimiter || end == b'\n' || end == b'\r').then_some((value, length))
}

/// Whether a mark may be the decimal point of a file that has used `point`.
fn allows(point: Option<u8>, mark: u8) -> bool {
    point.is_none_or(|known| known == mark)
}

/// A cell as a number: NaN where it is empty or says so, None where it is no number.
pub fn number(cell: &[u8], delimiter: u8, point: &mut Option<u8>) -> Option<f64> {
    let text = cell.trim_ascii();
    if NOTHING.contains(&text) {
        return Some(f64::NAN);
    }
    match text {
        b"true" | b"True" | b"TRUE" => return Some(1.0),
        b"false" | b"False" | b"FALSE" => return Some(0.0),
        _ => {}
    }
    let mut marks = text.iter().filter(|&&byte| byte == b'.' || byte == b',');
    let mark = marks.next().copied();
    let is_known =
        mark.is_none_or(|mark| allows(*point, mark) && (mark == b'.' || delimiter != b','));
    if !is_known || marks.next().is_some() {
        return None;
    }
    let value = parsed(text, mark)?;
    *point = point.or(mark);
    Some(value)
}

fn parsed(text: &[u8], mark: Option<u8>) -> Option<f64> {
    let text = std::str::from_utf8(text).ok()?;
    if mark == Some(b',') { text.replace(',', ".").parse().ok() } else { text.parse().ok() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_are_those_of_the_standard_library(value: f64, decimals in 0_usize..20) {
            for text in [format!("{value}"), format!("{value:.decimals$}"), format!("{value:e}")] {
                let told: f64 = text.parse().unwrap();
                let line = format!("{text}\n");
                for (delimiter, mut point) in [(b',', None), (b';', None), (b';', Some(b'.'))] {
                    let read = match plain_number(line.as_bytes(), delimiter, &mut point) {
                        Some((read, length)) => { prop_assert_eq!(length, text.len()); read }
                        None => number(text.as_bytes(), delimiter, &mut point).unwrap(),
                    };
                    prop_assert!(read == told || read.is_nan() && told.is_nan(), "{} {}", text, read);
                }
            }
        }
    }

    #[test]
    fn what_only_begins_as_a_number_is_none_in_one_go() {
        for text in ["1e", "1.2.3", "1,2", "+1", "inf", "nan", "-", ".", "--1", "1 ", "0x1"] {
            for point in [None, Some(b'.')] {
                let line = format!("{text}\n");
                let read = plain_number(line.as_bytes(), b';', &mut point.clone());
                let comma = text == "1,2" && point.is_none();
                assert_eq!(read, comma.then_some((1.2, 3)), "{text}");
            }
        }
        assert_eq!(plain_number(b"1,2\n", b',', &mut None), Some((1.0, 1)));
        assert_eq!(plain_number(b"12", b',', &mut None), None, "no end in sight");
    }

    #[test]
    fn a_comma_is_a_point_where_it_stands_between_no_cells() {
        let mut point = None;
        assert_eq!(number(b" 1,5e1 ", b';', &mut point), Some(15.0));
        assert_eq!(number(b"1.5", b';', &mut point), None);
        assert_eq!(number(b"1,5", b',', &mut None), None);
        assert_eq!(number(b"1.234,5", b';', &mut None), None);
    }
}
