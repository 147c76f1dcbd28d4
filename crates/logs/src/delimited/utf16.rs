//! UTF-16 with its mark, read as UTF-8.

use std::io::{Error, ErrorKind, Read, Result};

const BLOCK: usize = 1 << 16;

/// A reader of UTF-8 over one of UTF-16.
pub struct Utf16<R> {
    source: R,
    is_big: Option<bool>,
    /// Bytes that are not made into letters yet: half a unit, or half a pair.
    left: Vec<u8>,
    made: Vec<u8>,
    given: usize,
}

impl<R: Read> Utf16<R> {
    pub fn new(source: R) -> Self {
        Self { source, is_big: None, left: Vec::new(), made: Vec::new(), given: 0 }
    }

    /// Make letters of the next block; false at the end.
    fn refill(&mut self) -> Result<bool> {
        let held = self.left.len();
        let mut block = std::mem::take(&mut self.left);
        block.resize(held + BLOCK, 0);
        let count = self.source.read(&mut block[held..])?;
        block.truncate(held + count);
        if count == 0 {
            let whole = block.is_empty();
            return if whole { Ok(false) } else { Err(Error::from(ErrorKind::InvalidData)) };
        }
        let mut units: Vec<[u8; 2]> = block.chunks_exact(2).map(|two| [two[0], two[1]]).collect();
        self.left = block[units.len() * 2..].to_vec();
        let mut from = 0;
        if self.is_big.is_none() && !units.is_empty() {
            self.is_big = Some(units[0] == [0xFE, 0xFF]);
            from = 1;
        }
        let is_big = self.is_big.unwrap_or(false);
        let unit = |two: &[u8; 2]| {
            if is_big { u16::from_be_bytes(*two) } else { u16::from_le_bytes(*two) }
        };
        if let Some(last) = units.last().filter(|two| (0xD800..0xDC00).contains(&unit(two))) {
            self.left.splice(0..0, *last);
            units.pop();
        }
        self.made.clear();
        self.given = 0;
        for letter in char::decode_utf16(units.iter().skip(from).map(unit)) {
            let letter = letter.map_err(|_| Error::from(ErrorKind::InvalidData))?;
            self.made.extend_from_slice(letter.encode_utf8(&mut [0; 4]).as_bytes());
        }
        Ok(true)
    }
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, target: &mut [u8]) -> Result<usize> {
        while self.given == self.made.len() {
            if !self.refill()? {
                return Ok(0);
            }
        }
        let count = target.len().min(self.made.len() - self.given);
        target[..count].copy_from_slice(&self.made[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}
