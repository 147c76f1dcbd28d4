//! Layout of a message type: what one `FMT` row says, checked against itself.

/// First byte of every message.
pub const HEADER_1: u8 = 0xA3;
/// Second byte of every message.
pub const HEADER_2: u8 = 0x95;
/// Bytes before the payload.
pub const HEADER_SIZE: usize = 3;

/// Type number of `FMT`, the only layout that is known before reading.
pub const FMT_TYPE: u8 = 128;
/// Size of a `FMT` message with its header.
pub const FMT_SIZE: usize = 89;

/// How a field is stored: one character of a format string.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `b`
    I8,
    /// `B`, `M` (flight mode)
    U8,
    /// `h`
    I16,
    /// `H`
    U16,
    /// `i`
    I32,
    /// `I`
    U32,
    /// `q`
    I64,
    /// `Q`
    U64,
    /// `g`, IEEE half precision
    F16,
    /// `f`
    F32,
    /// `d`
    F64,
    /// `c`, int16 in hundredths
    CentiI16,
    /// `C`, uint16 in hundredths
    CentiU16,
    /// `e`, int32 in hundredths
    CentiI32,
    /// `E`, uint32 in hundredths
    CentiU32,
    /// `L`, latitude or longitude, int32 in 1e-7 degrees
    Degrees7,
    /// `a`, int16\[32\]
    Array,
    /// `n`, `N`, `Z`: text of this many bytes
    Text(usize),
}

impl Kind {
    fn from_char(code: u8) -> Option<Self> {
        Some(match code {
            b'b' => Self::I8,
            b'B' | b'M' => Self::U8,
            b'h' => Self::I16,
            b'H' => Self::U16,
            b'i' => Self::I32,
            b'I' => Self::U32,
            b'q' => Self::I64,
            b'Q' => Self::U64,
            b'g' => Self::F16,
            b'f' => Self::F32,
            b'd' => Self::F64,
            b'c' => Self::CentiI16,
            b'C' => Self::CentiU16,
            b'e' => Self::CentiI32,
            b'E' => Self::CentiU32,
            b'L' => Self::Degrees7,
            b'a' => Self::Array,
            b'n' => Self::Text(4),
            b'N' => Self::Text(16),
            b'Z' => Self::Text(64),
            _ => return None,
        })
    }

    /// Bytes of the field.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 | Self::CentiI16 | Self::CentiU16 => 2,
            Self::I32
            | Self::U32
            | Self::F32
            | Self::CentiI32
            | Self::CentiU32
            | Self::Degrees7 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Array => 64,
            Self::Text(size) => size,
        }
    }

    /// Numbers in one row of the field; 0 for text.
    pub fn width(self) -> usize {
        match self {
            Self::Array => 32,
            Self::Text(_) => 0,
            _ => 1,
        }
    }

    /// The scale that the storage itself implies, whatever `FMTU` says.
    pub fn own_scale(self) -> Option<Scale> {
        match self {
            Self::CentiI16 | Self::CentiU16 | Self::CentiI32 | Self::CentiU32 => {
                Some(Scale::Divide(100.0))
            }
            Self::Degrees7 => Some(Scale::Divide(1e7)),
            _ => None,
        }
    }
}

/// From stored to physical number. Decimal fractions divide: `5 / 100` rounds once, `5 * 0.01` twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// Stored as it is.
    One,
    /// Stored number times this.
    Multiply(f64),
    /// Stored number over this.
    Divide(f64),
}

impl Scale {
    /// Scale of a multiplier of the `MULT` table; 0 ("-") and non-finite ones mean no scale.
    pub fn from_multiplier(multiplier: f64) -> Self {
        // The log holds the float32 nearest to a decimal multiplier, widened: seven digits restore it.
        let decimal = format!("{multiplier:.6e}").parse::<f64>().unwrap_or(1.0);
        if !decimal.is_finite() || decimal == 0.0 || decimal == 1.0 {
            return Self::One;
        }
        let inverse = (1.0 / decimal).round();
        if decimal.abs() < 1.0 && (inverse * decimal - 1.0).abs() < 1e-9 {
            return Self::Divide(inverse);
        }
        Self::Multiply(decimal)
    }

    /// Apply to one number.
    #[inline]
    pub fn apply(self, stored: f64) -> f64 {
        match self {
            Self::One => stored,
            Self::Multiply(factor) => stored * factor,
            Self::Divide(divisor) => stored / divisor,
        }
    }

    /// The factor as one number.
    pub fn factor(self) -> f64 {
        self.apply(1.0)
    }
}

/// A field of a message type.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Label.
    pub name: String,
    /// Character of the format string.
    pub code: char,
    /// Storage.
    pub kind: Kind,
    /// Bytes from the first header byte.
    pub offset: usize,
    /// Stored to physical number.
    pub scale: Scale,
    /// Unit of the physical number as the log spells it; empty where it declares none.
    pub unit: String,
    /// Whether `FMTU` marks it as the instance number.
    pub is_instance: bool,
}

/// What a `FMT` row says of a type.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Number in the header.
    pub type_id: u8,
    /// Name, without trailing zeros.
    pub name: String,
    /// Size of the message with its header.
    pub size: usize,
    /// Fields in order.
    pub fields: Vec<Field>,
}

/// A `FMT` row: the type it defines, the size it claims, and its layout if it does not contradict
/// itself (a character nobody knows, or a size that is not the sum of its fields).
pub struct Definition {
    /// Type that is defined.
    pub type_id: u8,
    /// Size with header that is claimed.
    pub size: usize,
    /// The layout.
    pub layout: Option<Layout>,
}

impl Layout {
    /// The layout of `FMT` itself.
    pub fn of_fmt() -> Self {
        let fields = fields(b"BBnNZ", "Type,Length,Name,Format,Columns").unwrap_or_default();
        Self { type_id: FMT_TYPE, name: "FMT".to_owned(), size: FMT_SIZE, fields }
    }

    /// Same size, same fields stored the same way: rows of both may stand in one table.
    pub fn agrees_with(&self, other: &Self) -> bool {
        self.name == other.name
            && self.size == other.size
            && self.fields.len() == other.fields.len()
            && self
                .fields
                .iter()
                .zip(&other.fields)
                .all(|(a, b)| a.name == b.name && a.code == b.code)
    }

    /// The field that holds the stamp; its scale takes it to seconds.
    pub fn stamp(&self) -> Option<&Field> {
        self.fields.iter().find(|field| stamp_scale(&field.name, field.kind).is_some())
    }
}

/// Stamps are known by their name: logs without units have them too.
fn stamp_scale(name: &str, kind: Kind) -> Option<Scale> {
    match (name, kind.width()) {
        ("TimeUS", 1) => Some(Scale::Divide(1e6)),
        ("TimeMS", 1) => Some(Scale::Divide(1e3)),
        _ => None,
    }
}

/// The scale that holds whatever `FMTU` says, where there is one.
pub fn fixed_scale(name: &str, kind: Kind) -> Option<Scale> {
    kind.own_scale().or_else(|| stamp_scale(name, kind))
}

/// Read a `FMT` message (header included, `FMT_SIZE` bytes).
pub fn definition(message: &[u8]) -> Option<Definition> {
    let type_id = *message.get(3)?;
    let size = usize::from(*message.get(4)?);
    let name = text(message.get(5..9)?);
    let format = terminated(message.get(9..25)?);
    let columns = text(message.get(25..FMT_SIZE)?);
    let layout = fields(format, &columns)
        .filter(|_| {
            let payload: usize =
                format.iter().filter_map(|&code| Kind::from_char(code)).map(Kind::size).sum();
            !name.is_empty() && payload + HEADER_SIZE == size
        })
        .map(|fields| Layout { type_id, name, size, fields });
    Some(Definition { type_id, size, layout })
}

/// Fields of a format string; a character without a label is stored but has no name, so it is
/// left out, as is a label without a character.
fn fields(format: &[u8], columns: &str) -> Option<Vec<Field>> {
    let mut offset = HEADER_SIZE;
    let mut labels = columns.split(',');
    let mut found = Vec::with_capacity(format.len());
    for &code in format {
        let kind = Kind::from_char(code)?;
        if let Some(label) = labels.next().map(str::trim).filter(|label| !label.is_empty()) {
            found.push(Field {
                name: label.to_owned(),
                code: char::from(code),
                kind,
                offset,
                scale: fixed_scale(label, kind).unwrap_or(Scale::One),
                unit: if stamp_scale(label, kind).is_some() { "s" } else { "" }.to_owned(),
                is_instance: false,
            });
        }
        offset += kind.size();
    }
    Some(found)
}

/// Bytes before the first zero.
pub fn terminated(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    bytes.get(..end).unwrap_or(bytes)
}

/// Text before the first zero: UTF-8, or else one character a byte (ISO 8859-1).
pub fn text(bytes: &[u8]) -> String {
    let bytes = terminated(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    }
}
