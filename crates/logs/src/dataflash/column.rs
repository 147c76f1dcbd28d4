//! Columns on demand: one field of one table, all rows or one instance, scaled to physical numbers.

use std::collections::BTreeSet;

use super::format::{Field, Kind, Scale, text};
use super::log_index::Dataflash;
use super::message_table::Table;

/// Numbers of an array field in one row.
const ARRAY_WIDTH: usize = 32;
/// Rows of which all columns are read before the next rows: few enough that their bytes are still
/// in the nearest cache for the last column, enough that a column's loop is worth its start.
pub(super) const BLOCK: usize = 256;

/// A little-endian number at the start of a slice; None where the slice is too short.
macro_rules! number {
    ($type:ty, $bytes:expr) => {
        $bytes.first_chunk::<{ size_of::<$type>() }>().map(|chunk| <$type>::from_le_bytes(*chunk))
    };
}

impl<B: AsRef<[u8]>> Dataflash<B> {
    /// Scaled numbers of a field, `Kind::width` a row; empty for text.
    ///
    /// `instance` keeps the rows whose instance field holds that number.
    pub fn numbers(&self, table: &Table, field: &Field, instance: Option<i64>) -> Vec<f64> {
        self.columns(table, &[field], instance).pop().unwrap_or_default()
    }

    /// Scaled numbers of several fields as by `numbers`, in one pass over the rows.
    pub fn columns(
        &self,
        table: &Table,
        fields: &[&Field],
        instance: Option<i64>,
    ) -> Vec<Vec<f64>> {
        let rows = self.rows(table, instance);
        let reserved = |field: &&Field| Vec::with_capacity(rows * field.kind.width());
        let mut columns: Vec<Vec<f64>> = fields.iter().map(reserved).collect();
        self.each_block(table, instance, |block| {
            for (column, field) in columns.iter_mut().zip(fields) {
                self.append(column, block, field);
            }
        });
        columns
    }

    /// Add the scaled numbers of some rows to a column.
    pub(super) fn append(&self, column: &mut Vec<f64>, places: &[usize], field: &Field) {
        let start = column.len();
        self.append_stored(column, places, field);
        let added = column.get_mut(start..).unwrap_or_default();
        match field.scale {
            Scale::One => {}
            Scale::Multiply(factor) => added.iter_mut().for_each(|value| *value *= factor),
            Scale::Divide(divisor) => added.iter_mut().for_each(|value| *value /= divisor),
        }
    }

    /// Stamps in seconds; None where the message has no stamp.
    pub fn stamps(&self, table: &Table, instance: Option<i64>) -> Option<Vec<f64>> {
        let field = table.layout.stamp()?;
        Some(self.numbers(table, field, instance))
    }

    /// Texts of a field; empty where it holds numbers.
    pub fn texts(&self, table: &Table, field: &Field, instance: Option<i64>) -> Vec<String> {
        let Kind::Text(size) = field.kind else {
            return Vec::new();
        };
        let bytes = self.bytes();
        self.places(table, instance)
            .map(|at| {
                let start = at + field.offset;
                text(bytes.get(start..start + size).unwrap_or_default())
            })
            .collect()
    }

    /// Bytes of a text field, its zeros included; empty where it holds numbers.
    pub fn blocks(&self, table: &Table, field: &Field) -> Vec<&[u8]> {
        let bytes = self.bytes();
        table
            .offsets
            .iter()
            .filter_map(|at| bytes.get(at + field.offset..at + field.offset + field.kind.size()))
            .collect()
    }

    /// Instance numbers that occur, in rising order; empty where the message has no instance field.
    pub fn instances(&self, table: &Table) -> Vec<i64> {
        let Some(field) = instance_field(table) else {
            return Vec::new();
        };
        if field.kind == Kind::U8 {
            let mut seen = [false; 256];
            for at in table.offsets.iter() {
                seen[usize::from(self.bytes().get(at + field.offset).copied().unwrap_or(0))] = true;
            }
            return (0..256).zip(seen).filter(|(_, seen)| *seen).map(|(id, _)| id).collect();
        }
        let found: BTreeSet<i64> = table.offsets.iter().map(|at| self.integer(at, field)).collect();
        found.into_iter().collect()
    }

    /// Number of rows of an instance, or of all.
    pub fn rows(&self, table: &Table, instance: Option<i64>) -> usize {
        match instance {
            None => table.len(),
            Some(_) => self.places(table, instance).count(),
        }
    }

    /// Places of the rows of one instance, or of all.
    pub(super) fn places(
        &self,
        table: &Table,
        instance: Option<i64>,
    ) -> impl Iterator<Item = usize> + Clone {
        let field = instance_field(table);
        table.offsets.iter().filter(move |&at| match (instance, field) {
            (None, _) => true,
            (Some(wanted), Some(field)) => self.integer(at, field) == wanted,
            (Some(_), None) => false,
        })
    }

    /// Do something with the places of `BLOCK` rows at a time.
    pub(super) fn each_block(
        &self,
        table: &Table,
        instance: Option<i64>,
        mut work: impl FnMut(&[usize]),
    ) {
        let mut block = Vec::with_capacity(BLOCK);
        for place in self.places(table, instance) {
            block.push(place);
            if block.len() == BLOCK {
                work(&block);
                block.clear();
            }
        }
        work(&block);
    }

    fn integer(&self, at: usize, field: &Field) -> i64 {
        let rest = self.bytes().get(at + field.offset..).unwrap_or_default();
        match field.kind {
            Kind::I8 => number!(i8, rest).map(i64::from),
            Kind::U8 => number!(u8, rest).map(i64::from),
            Kind::I16 => number!(i16, rest).map(i64::from),
            Kind::U16 => number!(u16, rest).map(i64::from),
            Kind::I32 => number!(i32, rest).map(i64::from),
            Kind::U32 => number!(u32, rest).map(i64::from),
            _ => None,
        }
        .unwrap_or_default()
    }

    /// Stored numbers as f64. The match stands outside the loop: each kind gets its own tight one.
    fn append_stored(&self, column: &mut Vec<f64>, places: &[usize], field: &Field) {
        let bytes = self.bytes();
        macro_rules! stored {
            ($type:ty, $convert:expr) => {{
                let convert = $convert;
                column.extend(places.iter().map(|at| {
                    let rest = bytes.get(at + field.offset..).unwrap_or_default();
                    convert(number!($type, rest).unwrap_or_default())
                }))
            }};
        }
        match field.kind {
            Kind::I8 => stored!(i8, f64::from),
            Kind::U8 => stored!(u8, f64::from),
            Kind::I16 | Kind::CentiI16 => stored!(i16, f64::from),
            Kind::U16 | Kind::CentiU16 => stored!(u16, f64::from),
            Kind::F16 => stored!(u16, half),
            Kind::I32 | Kind::CentiI32 | Kind::Degrees7 => stored!(i32, f64::from),
            Kind::U32 | Kind::CentiU32 => stored!(u32, f64::from),
            Kind::I64 => stored!(i64, |value| value as f64),
            Kind::U64 => stored!(u64, |value| value as f64),
            Kind::F32 => stored!(f32, f64::from),
            Kind::F64 => stored!(f64, |value| value),
            Kind::Array => append_arrays(column, bytes, places, field),
            Kind::Text(_) => {}
        }
    }
}

/// The field that `FMTU` marks, if it is an integer that can number instances.
fn instance_field(table: &Table) -> Option<&Field> {
    table.layout.fields.iter().find(|field| {
        field.is_instance
            && matches!(
                field.kind,
                Kind::I8 | Kind::U8 | Kind::I16 | Kind::U16 | Kind::I32 | Kind::U32
            )
    })
}

fn append_arrays(column: &mut Vec<f64>, bytes: &[u8], places: &[usize], field: &Field) {
    for at in places {
        let start = at + field.offset;
        let row = bytes.get(start..start + 2 * ARRAY_WIDTH).unwrap_or_default();
        column.extend(
            row.chunks_exact(2).map(|pair| f64::from(number!(i16, pair).unwrap_or_default())),
        );
    }
}

/// IEEE 754 half precision to double: exact.
fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let exponent = i32::from((bits >> 10) & 0x1F);
    let fraction = f64::from(bits & 0x03FF);
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::half;

    #[test]
    fn half_precision_matches_the_values_of_ieee_754() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x3C00, 1.0),
            (0xC000, -2.0),
            (0x7BFF, 65504.0),
            (0x0400, 6.103_515_625e-5),
            (0x0001, 5.960_464_477_539_063e-8),
            (0x3555, 0.333_251_953_125),
            (0x7C00, f64::INFINITY),
            (0xFC00, f64::NEG_INFINITY),
        ] {
            assert_eq!(half(bits), value, "{bits:04x}");
        }
        assert!(half(0x7E00).is_nan());
    }
}
