//! Delimited text from a stranger: columns of one length, the same ones however the bytes arrive, and
//! every number the one that the standard library reads in its cell.
#![no_main]

use std::io::{Read, Result};

use flightid_logs::delimited::{Column, Layout, read};
use libfuzzer_sys::fuzz_target;

const BUDGET: usize = 1 << 20;

/// Hands out few bytes at a time.
struct Drops<'a>(&'a [u8], usize);

impl Read for Drops<'_> {
    fn read(&mut self, target: &mut [u8]) -> Result<usize> {
        let count = self.1.min(self.0.len()).min(target.len());
        target[..count].copy_from_slice(&self.0[..count]);
        self.0 = &self.0[count..];
        Ok(count)
    }
}

/// NaN equals itself.
fn same(one: &Column, other: &Column) -> bool {
    match (one, other) {
        (Column::Numbers(one), Column::Numbers(other)) => {
            one.iter().map(|value| value.to_bits()).eq(other.iter().map(|value| value.to_bits()))
        }
        _ => one == other,
    }
}

/// Numbers of unquoted cells are read by another library, to the last bit.
fn numbers_are_those_of_the_standard_library(text: &[u8], layout: &Layout, columns: &[Column]) {
    let Some(text) = std::str::from_utf8(text).ok().filter(|text| !text.contains('"')) else {
        return;
    };
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let lines = text.split('\n').skip(layout.skipped_lines).filter(|line| !line.is_empty());
    for (row, line) in lines.enumerate() {
        for (cell, column) in line.split(char::from(layout.delimiter)).zip(columns) {
            if let (Column::Numbers(read), Ok(told)) = (column, cell.trim_ascii().parse::<f64>()) {
                let is_same = read[row].to_bits() == told.to_bits();
                assert!(is_same || read[row].is_nan() && told.is_nan(), "{cell:?} {}", read[row]);
            }
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((&[chosen, lines], text)) = data.split_first_chunk() else {
        return;
    };
    let layout = Layout {
        skipped_lines: usize::from(lines % 4),
        n_columns: usize::from(chosen % 8),
        delimiter: b",;\t"[usize::from(chosen / 8 % 3)],
        is_utf16: text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff"),
        budget: BUDGET,
    };
    let whole = read(|| Ok(text), &layout);
    let size = (1 + usize::from(lines / 4)).max(text.len() / 64);
    let drops = read(|| Ok(Drops(text, size)), &layout);
    let (Ok(columns), Ok(again)) = (&whole, &drops) else {
        assert_eq!(whole.is_ok(), drops.is_ok());
        return;
    };
    assert_eq!(columns.len(), layout.n_columns);
    if !layout.is_utf16 {
        numbers_are_those_of_the_standard_library(text, &layout, columns);
    }
    assert!(columns.iter().zip(again).all(|(one, other)| same(one, other)));
    let rows = columns.iter().map(|column| match column {
        Column::Numbers(values) => values.len(),
        Column::Texts { codes, texts } => {
            assert!(codes.iter().all(|&code| (code as usize) < texts.len()));
            codes.len()
        }
    });
    let lengths: Vec<usize> = rows.collect();
    assert!(lengths.windows(2).all(|pair| pair[0] == pair[1]), "{lengths:?}");
});
