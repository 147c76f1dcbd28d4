//! A DataFlash log as an index of its messages.

use super::declared_units::declare;
use super::message_table::Table;
use super::scan::{Found, Skipped, scan};
use crate::error::LogError;

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
        let Found { mut tables, skipped } = scan(bytes.as_ref());
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
        declare(bytes.as_ref(), &mut tables);
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
