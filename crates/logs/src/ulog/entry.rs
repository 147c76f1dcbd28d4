//! Payloads of ULog that are not samples: typed keys with values, and logged text.

use super::scalar::Primitive;

/// Value of an information entry or parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A whole number of any width.
    Integer(i128),
    /// A number of type float or double.
    Real(f64),
    /// An array of characters; bytes that are not UTF-8 are replaced.
    Text(String),
    /// Any other array, as it lies in the file.
    Bytes(Vec<u8>),
}

/// A key with type and value, from an I, M, P or Q record.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Name without its type.
    pub name: String,
    /// What it is set to.
    pub value: Value,
}

/// Split `length key value` into type, name and value bytes.
fn split(payload: &[u8]) -> Option<(&str, &str, &[u8])> {
    let (&length, rest) = payload.split_first()?;
    let key = std::str::from_utf8(rest.get(..usize::from(length))?).ok()?;
    let value = rest.get(usize::from(length)..)?;
    let (type_text, name) = key.split_once(' ')?;
    let printable =
        |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_graphic());
    (printable(type_text) && printable(name)).then_some((type_text, name, value))
}

/// Bytes that a value of this type takes; none where the type is not one of the format's scalars.
fn declared_size(type_text: &str) -> Option<(Primitive, Option<usize>)> {
    match type_text.split_once('[') {
        None => Primitive::parse(type_text).map(|scalar| (scalar, None)),
        Some((base, rest)) => {
            let count = rest.strip_suffix(']')?.parse::<u16>().ok()?;
            Primitive::parse(base).map(|scalar| (scalar, Some(usize::from(count))))
        }
    }
}

/// Tell whether a payload is a typed key whose value has the declared size.
pub fn is_entry(payload: &[u8]) -> bool {
    split(payload).is_some_and(|(type_text, _, value)| {
        declared_size(type_text).is_some_and(|(scalar, count)| {
            scalar.size().saturating_mul(count.unwrap_or(1)) == value.len()
        })
    })
}

/// Tell whether a payload is a parameter: a key of type `float` or `int32_t` with its value.
pub fn is_parameter(payload: &[u8]) -> bool {
    split(payload).is_some_and(|(type_text, _, value)| {
        matches!(type_text, "float" | "int32_t") && value.len() == 4
    })
}

/// Read a typed key with its value.
pub fn read(payload: &[u8]) -> Option<Entry> {
    let (type_text, name, bytes) = split(payload)?;
    let (scalar, count) = declared_size(type_text)?;
    let value = match (scalar, count) {
        (Primitive::Char, _) => Value::Text(text(bytes)),
        (_, Some(_)) => Value::Bytes(bytes.to_vec()),
        (_, None) => scalar_value(scalar, bytes)?,
    };
    Some(Entry { name: name.to_string(), value })
}

fn scalar_value(scalar: Primitive, bytes: &[u8]) -> Option<Value> {
    let value = match scalar {
        Primitive::F32 => Value::Real(f64::from(f32::from_le_bytes(bytes.try_into().ok()?))),
        Primitive::F64 => Value::Real(f64::from_le_bytes(bytes.try_into().ok()?)),
        Primitive::I8 => Value::Integer(i8::from_le_bytes(bytes.try_into().ok()?).into()),
        Primitive::I16 => Value::Integer(i16::from_le_bytes(bytes.try_into().ok()?).into()),
        Primitive::I32 => Value::Integer(i32::from_le_bytes(bytes.try_into().ok()?).into()),
        Primitive::I64 => Value::Integer(i64::from_le_bytes(bytes.try_into().ok()?).into()),
        Primitive::Bool => Value::Integer((*bytes.first()?).into()),
        Primitive::Char => Value::Text(text(bytes)),
        Primitive::U8 | Primitive::U16 | Primitive::U32 | Primitive::U64 => {
            Value::Integer(scalar.unsigned(bytes)?.into())
        }
    };
    Some(value)
}

/// A logged line of text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Microseconds of the boot clock.
    pub stamp_us: u64,
    /// Severity as the log writes it: the character '0' (emergency) to '7' (debug).
    pub level: u8,
    /// Process or module number; none for plain lines.
    pub tag: Option<u16>,
    /// The line; bytes that are not UTF-8 are replaced.
    pub text: String,
}

impl Line {
    /// Read an L record (`tagged` false) or a C record.
    pub fn read(payload: &[u8], tagged: bool) -> Option<Self> {
        let (&level, rest) = payload.split_first()?;
        let (tag, rest) = if tagged {
            let (tag, rest) = rest.split_first_chunk::<2>()?;
            (Some(u16::from_le_bytes(*tag)), rest)
        } else {
            (None, rest)
        };
        let (stamp, line) = rest.split_first_chunk::<8>()?;
        Some(Self { stamp_us: u64::from_le_bytes(*stamp), level, tag, text: text(line) })
    }
}

/// Tell whether a payload could be a logged line of printable text. A search after damage looks at
/// the `first` bytes of the text only, so that it stays linear in the file.
pub fn is_line(payload: &[u8], tagged: bool, first: usize) -> bool {
    let head = if tagged { 11 } else { 9 };
    let level = payload.first().copied().unwrap_or(u8::MAX);
    let known = level.is_ascii_digit() && level < b'8' || level < 8;
    payload
        .get(head..)
        .is_some_and(|line| known && line.iter().take(first).all(|&byte| is_printable(byte)))
}

fn is_printable(byte: u8) -> bool {
    byte >= 0x80 || byte.is_ascii_graphic() || matches!(byte, b' ' | b'\t' | b'\n' | b'\r' | 0x1b)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_keep_type_name_and_value() {
        let entry = read(b"\x0cchar[3] name\x61\x62\x63").expect("an entry");
        assert_eq!((entry.name.as_str(), entry.value), ("name", Value::Text("abc".into())));
        let entry = read(b"\x09int32_t a\xff\xff\xff\xff").expect("an entry");
        assert_eq!(entry.value, Value::Integer(-1));
        let entry = read(b"\x0cuint64_t big\xff\xff\xff\xff\xff\xff\xff\xff").expect("an entry");
        assert_eq!(entry.value, Value::Integer(u64::MAX.into()));
        let entry = read(b"\x0cuint8_t[2] b\x01\x02").expect("an entry");
        assert_eq!(entry.value, Value::Bytes(vec![1, 2]));
    }

    #[test]
    fn entries_with_wrong_lengths_are_refused() {
        assert!(!is_entry(b""));
        assert!(!is_entry(b"\xffint32_t a"));
        assert!(!is_entry(b"\x09int32_t a\x01"));
        assert!(!is_entry(b"\x07int32_t\x01\x01\x01\x01"));
        assert!(!is_parameter(b"\x0achar[4] ab\x01\x01\x01\x01"));
        assert!(is_parameter(b"\x07float a\x00\x00\x80\x3f"));
    }

    #[test]
    fn lines_need_a_level_a_stamp_and_text() {
        let mut payload = vec![b'6'];
        payload.extend(7_u64.to_le_bytes());
        payload.extend(b"armed");
        assert!(is_line(&payload, false, 64));
        let line = Line::read(&payload, false).expect("a line");
        assert_eq!((line.stamp_us, line.text.as_str()), (7, "armed"));
        assert!(!is_line(&payload[..8], false, 64));
        payload.push(0);
        assert!(is_line(&payload, false, 5) && !is_line(&payload, false, 6));
    }
}
