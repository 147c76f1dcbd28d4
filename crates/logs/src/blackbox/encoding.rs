//! How differences are written: variable bytes and groups that share a tag.

/// Bytes of a flight with a place; reading beyond the end gives none.
#[derive(Debug, Clone)]
pub struct Bytes<'a> {
    bytes: &'a [u8],
    /// Where the next byte is read.
    pub at: usize,
}

impl<'a> Bytes<'a> {
    /// Begin at a place.
    pub fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// The next byte, taken.
    pub fn byte(&mut self) -> Option<u8> {
        let found = self.bytes.get(self.at).copied()?;
        self.at += 1;
        Some(found)
    }

    /// The next byte, left where it is.
    pub fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Take letters up to a zero, and the zero; false where there is none within so many bytes.
    pub fn skip_text(&mut self, most: usize) -> bool {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(size) = rest.iter().take(most).position(|&byte| byte == 0) else { return false };
        let is_text = rest[..size].iter().all(|byte| (b' '..=b'~').contains(byte));
        self.at += if is_text { size + 1 } else { 0 };
        is_text
    }

    /// Take some bytes if they are these.
    pub fn take(&mut self, wanted: &[u8]) -> bool {
        let holds = self.bytes.get(self.at..).is_some_and(|rest| rest.starts_with(wanted));
        if holds {
            self.at += wanted.len();
        }
        holds
    }

    /// Seven bits a byte, least first, at most five bytes.
    pub fn unsigned(&mut self) -> Option<u32> {
        let mut value = 0u32;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// The same with the sign in the last bit.
    pub fn signed(&mut self) -> Option<i64> {
        let value = self.unsigned()?;
        Some(i64::from((value >> 1) as i32 ^ -((value & 1) as i32)))
    }

    fn little(&mut self, n_bytes: u32) -> Option<i64> {
        let mut value = 0u32;
        for place in 0..n_bytes {
            value |= u32::from(self.byte()?) << (8 * place);
        }
        Some(extended(value, 8 * n_bytes))
    }

    fn big16(&mut self) -> Option<i64> {
        let (high, low) = (self.byte()?, self.byte()?);
        Some(i64::from(i16::from_be_bytes([high, low])))
    }
}

/// A number of some bits with its sign.
fn extended(value: u32, bits: u32) -> i64 {
    let shift = 32 - bits;
    i64::from(((value << shift) as i32) >> shift)
}

/// One field alone, or fields that share a tag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Signed variable bytes.
    Signed,
    /// Unsigned variable bytes.
    Unsigned,
    /// Fourteen bits, negated.
    Negated14,
    /// A byte of flags, then those of up to eight fields that are not zero.
    Tag8,
    /// Three fields of 2, 4, 6 bits or whole bytes.
    Tag2Three,
    /// Four fields of 0, 4, 8 or 16 bits.
    Tag8Four,
    /// Nothing: zero.
    Nothing,
    /// Three fields of 2; 5, 5, 4; 8, 7, 7 bits or whole bytes.
    Tag2Variable,
}

impl Encoding {
    /// From the number in the header.
    pub fn from_number(number: i64) -> Option<Self> {
        Some(match number {
            0 => Self::Signed,
            1 => Self::Unsigned,
            3 => Self::Negated14,
            6 => Self::Tag8,
            7 => Self::Tag2Three,
            8 => Self::Tag8Four,
            9 => Self::Nothing,
            10 => Self::Tag2Variable,
            _ => return None,
        })
    }

    /// Most fields that one tag serves.
    pub fn group(self) -> usize {
        match self {
            Self::Tag8 => 8,
            Self::Tag8Four => 4,
            Self::Tag2Three | Self::Tag2Variable => 3,
            _ => 1,
        }
    }

    /// Read as many fields as stand together, into the first of `values`.
    pub fn read(
        self,
        bytes: &mut Bytes,
        count: usize,
        version: i64,
        values: &mut [i64; 8],
    ) -> Option<()> {
        match self {
            Self::Signed => values[0] = bytes.signed()?,
            Self::Unsigned => values[0] = i64::from(bytes.unsigned()?),
            Self::Negated14 => values[0] = -extended(bytes.unsigned()? & 0x3fff, 14),
            Self::Nothing => values[0] = 0,
            Self::Tag8 => tag8(bytes, count, values)?,
            Self::Tag8Four if version < 2 => four_by_bytes(bytes, values)?,
            Self::Tag8Four => four_by_nibbles(bytes, values)?,
            Self::Tag2Three => three(bytes, values)?,
            Self::Tag2Variable => three_variable(bytes, values)?,
        }
        Some(())
    }
}

fn tag8(bytes: &mut Bytes, count: usize, values: &mut [i64; 8]) -> Option<()> {
    if count == 1 {
        values[0] = bytes.signed()?;
        return Some(());
    }
    let mut flags = bytes.byte()?;
    for value in values.iter_mut().take(count) {
        *value = if flags & 1 == 1 { bytes.signed()? } else { 0 };
        flags >>= 1;
    }
    Some(())
}

fn three(bytes: &mut Bytes, values: &mut [i64; 8]) -> Option<()> {
    let lead = u32::from(bytes.byte()?);
    match lead >> 6 {
        0 => twos(lead, values),
        1 => {
            let next = u32::from(bytes.byte()?);
            let parts = [lead & 0xf, next >> 4, next & 0xf];
            set(values, parts.map(|part| extended(part, 4)));
        }
        2 => {
            let parts =
                [lead & 0x3f, u32::from(bytes.byte()?) & 0x3f, u32::from(bytes.byte()?) & 0x3f];
            set(values, parts.map(|part| extended(part, 6)));
        }
        _ => whole_bytes(lead, bytes, values)?,
    }
    Some(())
}

fn three_variable(bytes: &mut Bytes, values: &mut [i64; 8]) -> Option<()> {
    let lead = u32::from(bytes.byte()?);
    match lead >> 6 {
        0 => twos(lead, values),
        1 => {
            let all = lead << 8 | u32::from(bytes.byte()?);
            set(
                values,
                [
                    extended(all >> 9 & 0x1f, 5),
                    extended(all >> 4 & 0x1f, 5),
                    extended(all & 0xf, 4),
                ],
            );
        }
        2 => {
            let all = lead << 16 | u32::from(bytes.byte()?) << 8 | u32::from(bytes.byte()?);
            set(
                values,
                [
                    extended(all >> 14 & 0xff, 8),
                    extended(all >> 7 & 0x7f, 7),
                    extended(all & 0x7f, 7),
                ],
            );
        }
        _ => whole_bytes(lead, bytes, values)?,
    }
    Some(())
}

fn set(values: &mut [i64; 8], parts: [i64; 3]) {
    values[..3].copy_from_slice(&parts);
}

fn twos(lead: u32, values: &mut [i64; 8]) {
    set(values, [lead >> 4, lead >> 2, lead].map(|part| extended(part & 3, 2)));
}

/// Two bits a field say how many bytes follow, less one; the first field's are the lowest.
fn whole_bytes(lead: u32, bytes: &mut Bytes, values: &mut [i64; 8]) -> Option<()> {
    for (place, value) in values.iter_mut().take(3).enumerate() {
        *value = bytes.little((lead >> (2 * place) & 3) + 1)?;
    }
    Some(())
}

fn four_by_bytes(bytes: &mut Bytes, values: &mut [i64; 8]) -> Option<()> {
    let tags = bytes.byte()?;
    let mut place = 0;
    while place < 4 {
        match tags >> (2 * place) & 3 {
            0 => values[place] = 0,
            1 => {
                // Two fields share a byte; what the second's tag says is then passed over.
                let both = u32::from(bytes.byte()?);
                values[place] = extended(both & 0xf, 4);
                place += 1;
                if place < 4 {
                    values[place] = extended(both >> 4, 4);
                }
            }
            2 => values[place] = bytes.little(1)?,
            _ => values[place] = bytes.little(2)?,
        }
        place += 1;
    }
    Some(())
}

fn four_by_nibbles(bytes: &mut Bytes, values: &mut [i64; 8]) -> Option<()> {
    let tags = bytes.byte()?;
    // The half byte that the field before left over.
    let mut left: Option<u32> = None;
    for (place, value) in values.iter_mut().take(4).enumerate() {
        *value = match (tags >> (2 * place) & 3, left) {
            (0, _) => 0,
            (1, None) => {
                let byte = u32::from(bytes.byte()?);
                left = Some(byte & 0xf);
                extended(byte >> 4, 4)
            }
            (1, Some(nibble)) => {
                left = None;
                extended(nibble, 4)
            }
            (2, None) => bytes.little(1)?,
            (2, Some(nibble)) => {
                let byte = u32::from(bytes.byte()?);
                left = Some(byte & 0xf);
                extended(nibble << 4 | byte >> 4, 8)
            }
            (_, None) => bytes.big16()?,
            (_, Some(nibble)) => {
                let (first, second) = (u32::from(bytes.byte()?), u32::from(bytes.byte()?));
                left = Some(second & 0xf);
                extended(nibble << 12 | first << 4 | second >> 4, 16)
            }
        };
    }
    Some(())
}
