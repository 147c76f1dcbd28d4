//! Columns of a ULog table: samples gathered from their places in the file to 64-bit floats.

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
        let chosen = self.chosen(message, instance)?;
        let columns = self.formats.columns(message);
        let by_name: HashMap<&str, &Column> =
            columns.iter().map(|column| (column.name.as_str(), column)).collect();
        let wanted = names
            .iter()
            .map(|name| by_name.get(name.as_str()).ok_or_else(|| missing_field(name, &columns)))
            .collect::<Result<Vec<_>, _>>()?;
        let rows = chosen.iter().map(|table| table.offsets.len()).sum();
        let mut values: Vec<Vec<f64>> = wanted.iter().map(|_| Vec::with_capacity(rows)).collect();
        let mut offsets = in_file_order(&chosen);
        let mut block: Vec<usize> = Vec::with_capacity(BLOCK);
        loop {
            block.clear();
            block.extend(offsets.by_ref().take(BLOCK));
            if block.is_empty() {
                return Ok(values);
            }
            for (column, values) in wanted.iter().zip(&mut values) {
                gather_block(bytes, &block, column, values)?;
            }
        }
    }

    /// Tables of one instance of a message, or of all.
    fn chosen(&self, message: &str, instance: Option<u8>) -> Result<Vec<&Table>, LogError> {
        let named = self.tables.iter().filter(|table| &*table.name == message);
        let chosen: Vec<&Table> =
            named.filter(|table| instance.is_none_or(|number| table.instance == number)).collect();
        if chosen.is_empty() {
            return Err(LogError::Missing {
                what: "message",
                name: instance.map_or(message.to_string(), |i| format!("{message} instance {i}")),
                available: shortened(self.tables.iter().map(|table| &*table.name)),
            });
        }
        Ok(chosen)
    }
}

/// Places of the samples of some tables, merged: of one, or of the few instances of a message.
fn in_file_order(tables: &[&Table]) -> impl Iterator<Item = usize> {
    let mut parts: Vec<_> = tables.iter().map(|table| table.offsets.iter().peekable()).collect();
    std::iter::from_fn(move || {
        let ahead = parts.iter_mut().filter_map(|part| part.peek().copied().map(|at| (at, part)));
        ahead.min_by_key(|(at, _)| *at)?.1.next()
    })
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
    offsets: &[usize],
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
    offsets: &[usize],
    at: usize,
    values: &mut Vec<f64>,
    convert: impl Fn([u8; N]) -> f64,
) -> Result<(), LogError> {
    for &offset in offsets {
        let raw = bytes
            .get(offset + at..)
            .and_then(|rest| rest.first_chunk::<N>())
            .ok_or(LogError::Changed { at: offset as u64 })?;
        values.push(convert(*raw));
    }
    Ok(())
}
