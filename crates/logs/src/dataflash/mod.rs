//! ArduPilot DataFlash logs (Python side: `logs/dataflash/reader.py`).
//!
//! A log is a row of messages: `A3 95 type payload`, where the payload's layout by type is itself
//! logged in `FMT` messages. There is no checksum and no length in the header, so a message is
//! believed only where the next header is found where it should be; see `scan`.

mod column;
mod declared_units;
mod describe;
mod format;
mod log_index;
mod message_table;
pub mod printed;
mod scan;
mod silence;

pub use describe::Stamps;
pub use format::{Field, Kind, Scale};
pub use log_index::Dataflash;
pub use message_table::Table;
pub use scan::{SkipReason, Skipped};
