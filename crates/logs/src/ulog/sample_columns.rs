//! Columns of a ULog table: samples gathered from their places in the file to 64-bit floats.

use std::borrow::Cow;
use std::collections::HashMap;

use super::log_index::{Table, Ulog};
use super::message_format::Column;
use super::scalar::Primitive;
use crate::error::LogError;

/// Rows gathered for all columns before the next ones: their bytes stay in the first-level cache.
const BLOCK: usize = 256;

impl Ulog {
    /// Values of the named columns of an instance, or of all instances in file order. Integers
    /// beyond 2^53 are rounded.
    pub fn gather(
        &self,
        bytes: &[u8],
        message: &str,
        instance: Option<u8>,
        names: &[String],
    ) -> Result<Vec<Vec<f64>>, LogError> {
        let offsets = self.offsets(message, instance)?;
        let columns = self.formats.columns(message);
        let by_name: HashMap<&str, &Column> =
            columns.iter().map(|column| (column.name.as_str(), column)).collect();
        let wanted = names
            .iter()
            .map(|name| by_name.get(name.as_str()).ok_or_else(|| missing_field(name, &columns)))
            .collect::<Result<Vec<_>, _>>()?;
        let mut values: Vec<Vec<f64>> =
            wanted.iter().map(|_| Vec::with_capacity(offsets.len())).collect();
        for block in offsets.chunks(BLOCK) {
            for (column, values) in wanted.iter().zip(&mut values) {
                gather_block(bytes, block, column, values)?;
            }
        }
        Ok(values)
    }

    fn offsets(&self, message: &str, instance: Option<u8>) -> Result<Cow<'_, [u64]>, LogError> {
        let chosen: Vec<&Table> = self
            .tables
            .iter()
            .filter(|table| &*table.name == message)
            .filter(|table| instance.is_none_or(|instance| table.instance == instance))
            .collect();
        match chosen.as_slice() {
            [] => Err(LogError::Missing {
                what: "message",
                name: instance.map_or(message.to_string(), |i| format!("{message} instance {i}")),
                available: shortened(self.tables.iter().map(|table| &*table.name)),
            }),
            [table] => Ok(Cow::Borrowed(&table.offsets)),
            several => {
                let mut all: Vec<u64> =
                    several.iter().flat_map(|table| table.offsets.iter().copied()).collect();
                all.sort_unstable();
                Ok(Cow::Owned(all))
            }
        }
    }
}

fn missing_field(name: &str, columns: &[Column]) -> LogError {
    LogError::Missing {
        what: "field",
        name: name.to_string(),
        available: shortened(columns.iter().map(|column| column.name.as_str())),
    }
}

fn shortened<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const SHOWN: usize = 12;
    let mut shown: Vec<&str> = names.take(SHOWN + 1).collect();
    if shown.len() > SHOWN {
        shown[SHOWN] = "…";
    }
    shown.join(", ")
}

fn gather_block(
    bytes: &[u8],
    offsets: &[u64],
    column: &Column,
    values: &mut Vec<f64>,
) -> Result<(), LogError> {
    let at = column.offset;
    match column.primitive {
        // Characters and truth values as PX4's own tools give them: signed bytes.
        Primitive::I8 | Primitive::Bool | Primitive::Char => {
            push(bytes, offsets, at, values, |b: [u8; 1]| f64::from(i8::from_le_bytes(b)))
        }
        Primitive::U8 => push(bytes, offsets, at, values, |b: [u8; 1]| f64::from(b[0])),
        Primitive::I16 => push(bytes, offsets, at, values, |b| f64::from(i16::from_le_bytes(b))),
        Primitive::U16 => push(bytes, offsets, at, values, |b| f64::from(u16::from_le_bytes(b))),
        Primitive::I32 => push(bytes, offsets, at, values, |b| f64::from(i32::from_le_bytes(b))),
        Primitive::U32 => push(bytes, offsets, at, values, |b| f64::from(u32::from_le_bytes(b))),
        Primitive::F32 => push(bytes, offsets, at, values, |b| f64::from(f32::from_le_bytes(b))),
        Primitive::I64 => push(bytes, offsets, at, values, |b| i64::from_le_bytes(b) as f64),
        Primitive::U64 => push(bytes, offsets, at, values, |b| u64::from_le_bytes(b) as f64),
        Primitive::F64 => push(bytes, offsets, at, values, f64::from_le_bytes),
    }
}

fn push<const N: usize>(
    bytes: &[u8],
    offsets: &[u64],
    at: usize,
    values: &mut Vec<f64>,
    convert: impl Fn([u8; N]) -> f64,
) -> Result<(), LogError> {
    for &offset in offsets {
        let raw = bytes
            .get(offset as usize + at..)
            .and_then(|rest| rest.first_chunk::<N>())
            .ok_or(LogError::Changed { at: offset })?;
        values.push(convert(*raw));
    }
    Ok(())
}
