//! Units, multipliers and instance fields, declared by the rows of `UNIT`, `MULT` and `FMTU`.
//!
//! They may stand anywhere in a log, so they are applied after the scan. Logs from before 2018 have
//! none of them; their fields keep the scale of their storage and no unit.

use std::collections::HashMap;

use super::format::{Kind, Scale, fixed_scale, terminated, text};
use super::message_table::Table;

/// Character of `FMTU` that marks the instance field.
const INSTANCE: u8 = b'#';

/// Give each field its unit, scale and instance mark.
pub fn declare(bytes: &[u8], tables: &mut [Table]) {
    let units: HashMap<u8, String> = rows(bytes, tables, "UNIT", ["Id", "Label"])
        .map(|[id, label]| (first(id), text(label)))
        .collect();
    let scales: HashMap<u8, Scale> = rows(bytes, tables, "MULT", ["Id", "Mult"])
        .filter_map(|[id, multiplier]| {
            let multiplier = f64::from_le_bytes(*multiplier.first_chunk::<8>()?);
            Some((first(id), Scale::from_multiplier(multiplier)))
        })
        .collect();
    let columns = ["FmtType", "UnitIds", "MultIds"];
    let declared: Vec<(u8, Vec<u8>, Vec<u8>)> = rows(bytes, tables, "FMTU", columns)
        .map(|[id, units, multipliers]| {
            let (units, multipliers) = (terminated(units), terminated(multipliers));
            (first(id), units.to_vec(), multipliers.to_vec())
        })
        .collect();
    for (type_id, unit_ids, multiplier_ids) in declared {
        for table in tables.iter_mut().filter(|t| t.type_id() == type_id) {
            for (index, field) in table.layout.fields.iter_mut().enumerate() {
                let unit_id = unit_ids.get(index).copied().unwrap_or(b'-');
                field.is_instance = unit_id == INSTANCE;
                if let Some(unit) = units.get(&unit_id).filter(|unit| !unit.is_empty()) {
                    field.unit.clone_from(unit);
                }
                let declared = multiplier_ids.get(index).and_then(|id| scales.get(id));
                // The storage's own scale holds even where FMTU says otherwise: old firmware
                // declared "1" for hundredths.
                if let (None, Some(scale)) = (fixed_scale(&field.name, field.kind), declared) {
                    field.scale = *scale;
                }
            }
        }
    }
}

fn first(bytes: &[u8]) -> u8 {
    bytes.first().copied().unwrap_or_default()
}

/// The bytes of some fields in each row of the first table of a name that has them all.
fn rows<'a, const N: usize>(
    bytes: &'a [u8],
    tables: &[Table],
    name: &str,
    fields: [&str; N],
) -> impl Iterator<Item = [&'a [u8]; N]> {
    let mut spans = [(0, 0); N];
    let mut offsets: Vec<usize> = Vec::new();
    for table in tables.iter().filter(|table| table.name() == name) {
        let found: Vec<(usize, Kind)> = fields
            .iter()
            .filter_map(|field| {
                let field = &table.layout.fields[table.position(field)?];
                Some((field.offset, field.kind))
            })
            .collect();
        if found.len() == N && offsets.is_empty() {
            for (span, (offset, kind)) in spans.iter_mut().zip(found) {
                *span = (offset, kind.size());
            }
            offsets = table.offsets.iter().collect();
        }
    }
    offsets.into_iter().map(move |at| {
        spans.map(|(offset, size)| bytes.get(at + offset..at + offset + size).unwrap_or_default())
    })
}
