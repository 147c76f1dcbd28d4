//! Columns of a ULog table: samples gathered from their places in the file to 64-bit floats.

use crate::LogError;
use crate::ulog::{Table, Ulog};
use crate::ulog_format::{Column, Primitive};

/// Rows gathered for all columns before the next ones: their bytes stay in the first-level cache.
const BLOCK: usize = 256;

impl Ulog {
    /// Columns of a table, in the order of its payload.
    pub fn columns_of(&self, table: &Table) -> Vec<Column> {
        self.formats.columns(&table.name)
    }

    /// Table of a message's instance.
    pub fn table(&self, name: &str, instance: u8) -> Result<&Table, LogError> {
        self.tables
            .iter()
            .find(|table| &*table.name == name && table.instance == instance)
            .ok_or_else(|| LogError::Missing {
                what: "message",
                name: format!("{name} (instance {instance})"),
                available: shortened(self.tables.iter().map(|table| table.name.to_string())),
            })
    }

    /// Values of the named columns of a table; integers beyond 2^53 are rounded.
    pub fn gather(
        &self,
        bytes: &[u8],
        table: &Table,
        names: &[String],
    ) -> Result<Vec<Vec<f64>>, LogError> {
        let columns = self.columns_of(table);
        let wanted = names
            .iter()
            .map(|name| {
                columns.iter().find(|column| column.name == *name).ok_or_else(|| {
                    LogError::Missing {
                        what: "field",
                        name: name.clone(),
                        available: shortened(columns.iter().map(|column| column.name.clone())),
                    }
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut values: Vec<Vec<f64>> =
            wanted.iter().map(|_| Vec::with_capacity(table.offsets.len())).collect();
        for block in table.offsets.chunks(BLOCK) {
            for (column, values) in wanted.iter().zip(&mut values) {
                gather_block(bytes, block, column, values)?;
            }
        }
        Ok(values)
    }
}

fn shortened(names: impl Iterator<Item = String>) -> String {
    const SHOWN: usize = 12;
    let mut shown: Vec<String> = names.take(SHOWN + 1).collect();
    if shown.len() > SHOWN {
        shown[SHOWN] = "…".to_string();
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
