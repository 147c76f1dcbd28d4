//! ArduPilot DataFlash logs (Python side: `logs/dataflash/reader.py`).
//!
//! A log is a row of messages: `A3 95 type payload`, where the payload's layout by type is itself
//! logged in `FMT` messages. There is no checksum and no length in the header, so a message is
//! believed only where the next header is found where it should be; see `scan`.

mod column;
mod describe;
mod format;
mod scan;
mod units;

pub use describe::Stamps;
pub use format::{Field, Kind, Scale};
pub use scan::{SkipReason, Skipped};

use crate::LogError;
use format::Layout;

/// First byte of every message.
pub const HEADER_1: u8 = 0xA3;
/// Second byte of every message.
pub const HEADER_2: u8 = 0x95;
/// Bytes before the payload.
pub const HEADER_SIZE: usize = 3;

/// Rows of one message type, as places in the file.
#[derive(Debug, Clone)]
pub struct Table {
    layout: Layout,
    offsets: Vec<usize>,
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

/// An indexed log: which bytes are which message. Columns are read from it on demand.
///
/// `B` owns the bytes. Memory beyond them is one offset a message found; no number that the file
/// merely claims decides on an allocation.
#[derive(Debug, Clone)]
pub struct Dataflash<B> {
    bytes: B,
    tables: Vec<Table>,
    skipped: Vec<Skipped>,
}

impl<B: AsRef<[u8]>> Dataflash<B> {
    /// Index a log in one pass.
    ///
    /// # Errors
    /// `NotALog` where no message is found.
    pub fn open(bytes: B) -> Result<Self, LogError> {
        let scan::Found { mut tables, skipped } = scan::scan(bytes.as_ref());
        if tables.iter().all(Table::is_empty) {
            let first: Vec<String> =
                bytes.as_ref().iter().take(8).map(|byte| format!("{byte:02x}")).collect();
            return Err(LogError::NotALog {
                expected: "DataFlash",
                found: format!(
                    "{} bytes without one message, first {}",
                    bytes.as_ref().len(),
                    first.join(" ")
                ),
            });
        }
        units::declare(bytes.as_ref(), &mut tables);
        Ok(Self { bytes, tables, skipped })
    }

    /// Message types in the order of their definitions, also those without rows.
    pub fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// Byte ranges that are in no message, in file order.
    pub fn skipped(&self) -> &[Skipped] {
        &self.skipped
    }

    /// The table of this name that holds the most rows (a log may define a name twice).
    ///
    /// # Errors
    /// `Missing` where there is none.
    pub fn table(&self, name: &str) -> Result<&Table, LogError> {
        self.tables
            .iter()
            .filter(|table| table.name() == name)
            .max_by_key(|table| table.len())
            .ok_or_else(|| {
                let names: Vec<&str> = self.tables.iter().map(Table::name).take(20).collect();
                LogError::Missing {
                    what: "message",
                    name: name.to_owned(),
                    available: names.join(", "),
                }
            })
    }

    /// What owns the bytes.
    pub fn source(&self) -> &B {
        &self.bytes
    }

    /// The raw bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.as_ref()
    }
}
