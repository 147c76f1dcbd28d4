//! A text to its columns.

use std::io::Read;

use super::column::{Column, Growing};
use super::fault::DelimitedError;
use super::lines::{self, Blocks};
use super::utf16::Utf16;

/// What a number takes on its way into a record, bytes.
const VALUE_BYTES: usize = 24;

/// What is known of a file before its rows are read.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// Lines above the first row of numbers.
    pub skipped_lines: usize,
    /// Cells of a row.
    pub n_columns: usize,
    /// Between cells.
    pub delimiter: u8,
    /// UTF-16 with its mark, else UTF-8.
    pub is_utf16: bool,
    /// Bytes that all columns may take.
    pub budget: usize,
}

/// Columns of a text.
///
/// `open` gives the text from its beginning, once or twice.
///
/// # Errors
/// See [`DelimitedError`].
pub fn read<R: Read>(
    open: impl Fn() -> std::io::Result<R>,
    layout: &Layout,
) -> Result<Vec<Column>, DelimitedError> {
    if layout.n_columns == 0 {
        return Ok(Vec::new());
    }
    let mut columns: Vec<Growing> = (0..layout.n_columns).map(|_| Growing::default()).collect();
    pass(open()?, layout, &mut columns)?;
    if columns.iter().any(Growing::wants_text) {
        columns.iter_mut().for_each(Growing::begin_again);
        pass(open()?, layout, &mut columns)?;
    }
    Ok(columns.into_iter().map(Growing::finished).collect())
}

fn pass(source: impl Read, layout: &Layout, columns: &mut [Growing]) -> Result<(), DelimitedError> {
    if layout.is_utf16 {
        all_rows(Utf16::new(source), layout, columns)
    } else {
        all_rows(source, layout, columns)
    }
}

fn all_rows(
    source: impl Read,
    layout: &Layout,
    columns: &mut [Growing],
) -> Result<(), DelimitedError> {
    let mut blocks = Blocks::new(source);
    let (mut line, mut n_rows, mut point) = (1, 0, None);
    while let Some(block) = blocks.next_block(line)? {
        let mut at = 0;
        while at < block.len() {
            if line <= layout.skipped_lines {
                at = lines::line_end(block, at);
                line += 1;
                continue;
            }
            let next = lines::row(block, at, layout.delimiter, columns, &mut point);
            let (end, is_row) = next.map_err(|fault| fault.at(line, layout.n_columns))?;
            at = end;
            line += 1;
            n_rows += usize::from(is_row);
        }
        let texts: usize = columns.iter().map(Growing::text_bytes).sum();
        let bytes = n_rows * layout.n_columns * VALUE_BYTES + texts;
        if bytes > layout.budget {
            return Err(DelimitedError::TooLarge { bytes });
        }
    }
    Ok(())
}
