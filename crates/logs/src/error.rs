//! The one error type of the log readers.

use thiserror::Error;

/// Why a log, or a column of it, cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LogError {
    /// The bytes are not a log of the expected kind.
    #[error("not a {expected} log: {found}")]
    NotALog {
        /// The format that was tried.
        expected: &'static str,
        /// What the first bytes hold.
        found: String,
    },
    /// A message type, instance or field that the log does not hold.
    #[error("the log holds no {what} named {name:?}; it holds {available}")]
    Missing {
        /// Message, instance or field.
        what: &'static str,
        /// The name that was asked for.
        name: String,
        /// The names that exist, shortened.
        available: String,
    },
    /// A log of the right kind that asks for something this reader cannot do.
    #[error("{what} cannot be read")]
    Unsupported {
        /// What it asks for.
        what: String,
    },
    /// What the log holds takes more than its reader was allowed.
    #[error("what the log holds takes {bytes} bytes and more")]
    TooLarge {
        /// Where it was met.
        bytes: usize,
    },
    /// The bytes are not those that were indexed.
    #[error("the log changed while it was read: no sample at byte {at}")]
    Changed {
        /// Where a sample was.
        at: u64,
    },
}
