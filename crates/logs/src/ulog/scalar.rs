//! Scalar types of ULog: names, sizes, and time stamps of any width.

/// Scalar types of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Primitive {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Bool,
    Char,
}

impl Primitive {
    /// The type that a name such as `uint8_t` stands for.
    pub fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "int8_t" => Self::I8,
            "uint8_t" => Self::U8,
            "int16_t" => Self::I16,
            "uint16_t" => Self::U16,
            "int32_t" => Self::I32,
            "uint32_t" => Self::U32,
            "int64_t" => Self::I64,
            "uint64_t" => Self::U64,
            "float" => Self::F32,
            "double" => Self::F64,
            "bool" => Self::Bool,
            "char" => Self::Char,
            _ => return None,
        })
    }

    /// Bytes of one value.
    pub const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 | Self::Bool | Self::Char => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Name in the format's own spelling.
    pub const fn name(self) -> &'static str {
        match self {
            Self::I8 => "int8_t",
            Self::U8 => "uint8_t",
            Self::I16 => "int16_t",
            Self::U16 => "uint16_t",
            Self::I32 => "int32_t",
            Self::U32 => "uint32_t",
            Self::I64 => "int64_t",
            Self::U64 => "uint64_t",
            Self::F32 => "float",
            Self::F64 => "double",
            Self::Bool => "bool",
            Self::Char => "char",
        }
    }

    /// The little-endian unsigned value in `bytes`, for time stamps; none for other types.
    pub fn unsigned(self, bytes: &[u8]) -> Option<u64> {
        match self {
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => {
                let mut wide = [0_u8; 8];
                wide.get_mut(..self.size())?.copy_from_slice(bytes.get(..self.size())?);
                Some(u64::from_le_bytes(wide))
            }
            _ => None,
        }
    }
}
