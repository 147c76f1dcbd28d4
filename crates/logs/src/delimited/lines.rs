//! Blocks of whole lines, and the cells of one line.

use std::borrow::Cow;
use std::io::Read;

use super::cell;
use super::column::Growing;
use super::fault::{DelimitedError, Fault};

/// Longest line, bytes.
const LONGEST_LINE: usize = 1 << 20;
const BLOCK: usize = 1 << 20;
/// Held at first: most texts are short.
const FIRST: usize = 1 << 14;

/// A text in blocks that end where lines end.
pub struct Blocks<R> {
    source: R,
    held: Vec<u8>,
    /// Bytes of `held` that were handed out, and that hold text.
    given: usize,
    filled: usize,
    is_ended: bool,
}

impl<R: Read> Blocks<R> {
    pub fn new(source: R) -> Self {
        Self { source, held: vec![0; FIRST], given: 0, filled: 0, is_ended: false }
    }

    /// The next whole lines, the last one with a line end even where the text has none.
    pub fn next_block(&mut self, line: usize) -> Result<Option<&[u8]>, DelimitedError> {
        self.held.copy_within(self.given..self.filled, 0);
        self.filled -= self.given;
        self.given = 0;
        while !self.is_ended && self.filled < LONGEST_LINE + BLOCK {
            if self.filled == self.held.len() {
                self.held.resize((2 * self.filled).min(LONGEST_LINE + BLOCK), 0);
            }
            match self.source.read(&mut self.held[self.filled..]) {
                Ok(0) => self.is_ended = true,
                Ok(count) => self.filled += count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == std::io::ErrorKind::InvalidData => {
                    return Err(DelimitedError::NotText { line });
                }
                Err(error) => return Err(error.into()),
            }
        }
        if self.filled == 0 {
            return Ok(None);
        }
        if self.is_ended && !is_end(self.held[self.filled - 1]) {
            self.held.truncate(self.filled);
            self.held.push(b'\n');
            self.filled += 1;
        }
        // A carriage return that ends the block may have its line feed in the next one.
        let text = &self.held[..self.filled - 1];
        let near = |byte| text.iter().rposition(|&each| each == byte);
        let is_near = |place: &usize| self.filled - place <= LONGEST_LINE;
        let last = near(b'\n').filter(is_near).or_else(|| near(b'\r').filter(is_near));
        self.given = match last {
            _ if self.is_ended => self.filled,
            Some(place) => place + 1,
            None => return Err(DelimitedError::LongLine { line, most: LONGEST_LINE }),
        };
        Ok(Some(&self.held[..self.given]))
    }
}

fn is_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

/// Where the line after the one at `at` begins.
pub fn line_end(block: &[u8], at: usize) -> usize {
    let end = block[at..].iter().position(|&byte| is_end(byte));
    end.map_or(block.len(), |length| after(block, at + length))
}

fn after(block: &[u8], end: usize) -> usize {
    let is_pair = block[end] == b'\r' && block.get(end + 1) == Some(&b'\n');
    end + if is_pair { 2 } else { 1 }
}

/// Read one line into the columns; where the next begins, and whether this one held cells.
pub fn row(
    block: &[u8],
    mut at: usize,
    delimiter: u8,
    columns: &mut [Growing],
    point: &mut Option<u8>,
) -> Result<(usize, bool), Fault> {
    if is_end(block[at]) {
        return Ok((after(block, at), false));
    }
    let last = columns.len() - 1;
    for (place, column) in columns.iter_mut().enumerate() {
        let plain = if column.takes_numbers() {
            cell::plain_number(&block[at..], delimiter, point)
        } else {
            None
        };
        let end = if let Some((value, length)) = plain {
            column.number(value);
            at + length
        } else {
            let (content, end) = bounded(block, at, delimiter)?;
            column.cell(&content, delimiter, point)?;
            end
        };
        match (is_end(block[end]), place == last) {
            (true, true) => return Ok((after(block, end), true)),
            (true, false) => return Err(Fault::Cells(place + 1)),
            (false, true) => return Err(Fault::MoreCells),
            (false, false) => at = end + 1,
        }
    }
    Ok((at, true))
}

/// Content of a cell without its quotes, and where it ends: at a delimiter or a line end.
fn bounded(block: &[u8], at: usize, delimiter: u8) -> Result<(Cow<'_, [u8]>, usize), Fault> {
    let is_stop = |byte: u8| byte == delimiter || is_end(byte);
    if block[at] != b'"' {
        let length = block[at..].iter().position(|&byte| is_stop(byte));
        let end = at + length.ok_or(Fault::NotText)?;
        return Ok((Cow::Borrowed(&block[at..end]), end));
    }
    let (mut content, mut from) = (Vec::new(), at + 1);
    loop {
        let length = block[from..].iter().position(|&byte| byte == b'"' || is_end(byte));
        let stop = from + length.ok_or(Fault::OpenQuote)?;
        content.extend_from_slice(&block[from..stop]);
        match (block[stop], block.get(stop + 1)) {
            (b'"', Some(b'"')) => {
                content.push(b'"');
                from = stop + 2;
            }
            (b'"', Some(&next)) if is_stop(next) => return Ok((Cow::Owned(content), stop + 1)),
            _ => return Err(Fault::OpenQuote),
        }
    }
}
