//! One message type of a DataFlash log: its layout and where its rows lie.

use super::format::{Field, Layout};
use crate::places::Places;

/// Rows of one message type, as places in the file.
#[derive(Debug, Clone)]
pub struct Table {
    pub(super) layout: Layout,
    /// Place of each row in the file, header included.
    pub(super) offsets: Places,
}

impl Table {
    /// Name of the message, without trailing zeros.
    pub fn name(&self) -> &str {
        &self.layout.name
    }

    /// Number in the header of its messages.
    pub fn type_id(&self) -> u8 {
        self.layout.type_id
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.offsets.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.offsets.is_empty()
    }

    /// Place of each row in the file, header included.
    pub fn offsets(&self) -> &Places {
        &self.offsets
    }

    /// Bytes of a row, header included.
    pub fn row_size(&self) -> usize {
        self.layout.size
    }

    /// Fields in the file's order.
    pub fn fields(&self) -> &[Field] {
        &self.layout.fields
    }

    /// Place of a field in `fields`.
    pub fn position(&self, field: &str) -> Option<usize> {
        self.layout.fields.iter().position(|f| f.name == field)
    }
}
