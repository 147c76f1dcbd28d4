//! The text that begins a flight: settings, and the fields of each kind of frame.

use crate::error::LogError;

/// First line of every flight.
pub const PRODUCT: &[u8] = b"H Product:Blackbox flight data recorder";
const LONGEST_LINE: usize = 16 * 1024;
/// Bytes that the allocator takes beside the texts of a line.
const OVERHEAD: usize = 32;

/// Where each flight of a file begins and ends.
pub fn flights(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut starts = Vec::new();
    let mut from = 0;
    while let Some(found) = bytes.get(from..).and_then(|rest| find(rest, PRODUCT)) {
        let start = from + found;
        if start == 0 || bytes[start - 1] != b' ' {
            starts.push(start);
        }
        from = start + PRODUCT.len();
    }
    let stops = starts.iter().skip(1).copied().chain([bytes.len()]);
    starts.iter().copied().zip(stops).collect()
}

/// First place of some bytes, by jumping from one first byte to the next.
fn find(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    let (&first, _) = wanted.split_first()?;
    let mut from = 0;
    loop {
        let found = bytes.get(from..)?.iter().position(|&byte| byte == first)?;
        let start = from + found;
        if bytes[start..].starts_with(wanted) {
            return Some(start);
        }
        from = start + 1;
    }
}

/// Lines of the header in order, names apart from values.
#[derive(Debug, Clone, Default)]
pub struct Header {
    /// Name and value of each line.
    pub lines: Vec<(String, String)>,
    /// Bytes that the header takes in the file.
    pub size: usize,
    /// Bytes that its lines take in memory.
    pub held: usize,
}

impl Header {
    /// Read the lines that begin a flight.
    ///
    /// # Errors
    /// Bytes that begin no flight; bytes and lines of more than `budget` bytes.
    pub fn read(bytes: &[u8], budget: usize) -> Result<Self, LogError> {
        if !bytes.starts_with(PRODUCT) {
            return Err(LogError::NotALog {
                expected: "blackbox",
                found: format!("first bytes {:02x?}", &bytes[..bytes.len().min(8)]),
            });
        }
        let mut header = Self::default();
        while let Some(line) = line_at(&bytes[header.size..]) {
            header.size += line.len() + 1;
            let text = String::from_utf8_lossy(&line[2..]);
            if let Some((name, value)) = text.split_once(':') {
                header.lines.push((name.trim().to_string(), value.trim().to_string()));
                // A list that grows is there twice while it does; Python takes a second copy.
                header.held += 2 * (2 * size_of::<(String, String)>() + line.len() + OVERHEAD);
                let taken = bytes.len() + header.held;
                if taken > budget {
                    return Err(LogError::TooLarge { bytes: taken });
                }
            }
        }
        Ok(header)
    }

    /// Value of the last line of a name.
    pub fn value(&self, name: &str) -> Option<&str> {
        self.lines.iter().rev().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// First number of a value; none where it is no number.
    pub fn number(&self, name: &str) -> Option<i64> {
        self.numbers(name).first().copied().flatten()
    }

    /// Numbers of a value with commas; none where one of them is no number.
    pub fn numbers(&self, name: &str) -> Vec<Option<i64>> {
        let parts = self.value(name).map(|value| value.split(','));
        parts.into_iter().flatten().map(|part| part.trim().parse().ok()).collect()
    }
}

/// The header line at the beginning of some bytes, without its end; none where there is none.
fn line_at(bytes: &[u8]) -> Option<&[u8]> {
    if !bytes.starts_with(b"H ") {
        return None;
    }
    let window = &bytes[..bytes.len().min(LONGEST_LINE)];
    let line = &window[..window.iter().position(|&byte| byte == b'\n')?];
    // A frame of a home position begins with H too; it is no text.
    let is_text = |&byte: &u8| byte == b'\t' || byte == b'\r' || byte >= 0x20;
    line.iter().all(is_text).then_some(line)
}
