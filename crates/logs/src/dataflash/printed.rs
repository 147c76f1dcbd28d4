//! Text logs of ArduPilot (`.log`): back to the bytes that they were printed from (Python side:
//! `logs/dataflash/printed.py`).
//!
//! Each line is a message with its name and its numbers, those stored in hundredths and latitudes
//! already divided. The binary form is made again, so that one reader serves both.

use std::collections::HashMap;

use crate::error::LogError;

use super::format::{
    FMT_SIZE, FMT_TYPE, HEADER_1, HEADER_2, Kind, Layout, Scale, definition, terminated,
};

/// What the first line of a text log begins with.
pub const FIRST: &[u8] = b"FMT,";
/// Bytes made for a byte of text: a text field of 64 bytes may be printed as one letter.
const GROWTH: usize = 16;

/// Messages in their binary form, and lines that are none.
#[derive(Debug, Clone, Default)]
pub struct Binary {
    /// The log.
    pub bytes: Vec<u8>,
    /// Lines that were left out.
    pub bad_lines: usize,
}

/// Turn a text log into a binary one.
///
/// # Errors
/// The text, the log and a copy of it take more than `budget` bytes.
pub fn to_binary(text: &[u8], budget: usize) -> Result<Binary, LogError> {
    let mut made = Binary::default();
    let most = text.len().saturating_mul(GROWTH).saturating_add(FMT_SIZE);
    let mut layouts: HashMap<Vec<u8>, Layout> = HashMap::new();
    for line in text.split(|&byte| byte == b'\n') {
        let line = line.trim_ascii();
        if line.is_empty() {
            continue;
        }
        let (name, rest) = cut(line);
        let kept = made.bytes.len();
        let written = if name == b"FMT" {
            format_row(rest, &mut made.bytes, &mut layouts)
        } else {
            layouts.get(name).and_then(|layout| row(layout, rest, &mut made.bytes))
        };
        if written.is_none() || made.bytes.len() > most {
            made.bytes.truncate(kept);
            made.bad_lines += 1;
        }
        let bytes = text.len() + 2 * made.bytes.len();
        if bytes > budget {
            return Err(LogError::TooLarge { bytes });
        }
    }
    Ok(made)
}

/// The part before the first comma, and the part after it.
fn cut(line: &[u8]) -> (&[u8], &[u8]) {
    let end = line.iter().position(|&byte| byte == b',').unwrap_or(line.len());
    (line[..end].trim_ascii(), line.get(end + 1..).unwrap_or(b"").trim_ascii())
}

fn header(type_id: u8, out: &mut Vec<u8>) {
    out.extend([HEADER_1, HEADER_2, type_id]);
}

/// `FMT, type, length, name, format, labels`, which defines a message.
fn format_row(
    rest: &[u8],
    out: &mut Vec<u8>,
    layouts: &mut HashMap<Vec<u8>, Layout>,
) -> Option<()> {
    let (type_id, rest) = cut(rest);
    let (size, rest) = cut(rest);
    let (name, rest) = cut(rest);
    let (format, labels) = cut(rest);
    let start = out.len();
    header(FMT_TYPE, out);
    out.push(whole(type_id)?.try_into().ok()?);
    out.push(whole(size)?.try_into().ok()?);
    // Old tools print a space after each comma of the labels.
    let labels: Vec<u8> = labels.iter().copied().filter(|&byte| byte != b' ').collect();
    for (part, width) in [(name, 4), (format, 16), (labels.as_slice(), 64)] {
        padded(part, width, out);
    }
    let layout = definition(out.get(start..)?)?.layout?;
    let gapless = layout.fields.len() == terminated(format).len();
    gapless.then(|| layouts.insert(name.to_vec(), layout)).map(|_| ())
}

fn row(layout: &Layout, mut rest: &[u8], out: &mut Vec<u8>) -> Option<()> {
    header(layout.type_id, out);
    for (place, field) in layout.fields.iter().enumerate() {
        let last = place + 1 == layout.fields.len();
        // A text at the end may hold commas.
        let (part, after) =
            if last && matches!(field.kind, Kind::Text(_)) { (rest, &b""[..]) } else { cut(rest) };
        value(field.kind, field.code, part, out)?;
        rest = after;
    }
    rest.is_empty().then_some(())
}

fn value(kind: Kind, code: char, part: &[u8], out: &mut Vec<u8>) -> Option<()> {
    match kind {
        Kind::Text(width) => padded(part, width, out),
        Kind::F32 => out.extend((real(part)? as f32).to_le_bytes()),
        Kind::F64 => out.extend(real(part)?.to_le_bytes()),
        // Half precision and arrays are printed by no tool that writes text.
        Kind::F16 | Kind::Array => return None,
        // Modes are printed by name.
        Kind::U8 if code == 'M' => out.push(whole(part).map_or(u8::MAX, |mode| mode as u8)),
        _ => {
            let stored = match kind.own_scale() {
                Some(Scale::Divide(divisor)) => (real(part)? * divisor).round() as i128,
                _ => whole(part)?,
            };
            let (least, most) = range(kind);
            let within = (least..=most).contains(&stored);
            let bytes = stored.to_le_bytes();
            out.extend(within.then(|| &bytes[..kind.size()])?);
        }
    }
    Some(())
}

/// Least and most that a whole number of so many bytes holds, of either sign: tools print both.
fn range(kind: Kind) -> (i128, i128) {
    let bits = 8 * kind.size() as u32;
    (-(1 << (bits - 1)), (1 << bits) - 1)
}

fn padded(part: &[u8], width: usize, out: &mut Vec<u8>) {
    let kept = &part[..part.len().min(width)];
    out.extend(kept);
    out.resize(out.len() + width - kept.len(), 0);
}

fn real(part: &[u8]) -> Option<f64> {
    std::str::from_utf8(part).ok()?.parse().ok()
}

fn whole(part: &[u8]) -> Option<i128> {
    let text = std::str::from_utf8(part).ok()?;
    text.parse().ok().or_else(|| {
        let number: f64 = text.parse().ok()?;
        (number.fract() == 0.0 && number.abs() < 9e15).then_some(number as i128)
    })
}
