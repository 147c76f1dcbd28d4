//! Flight-log bytes to named columns with units, gaps and errors.
//!
//! Input is a byte slice from a stranger: nothing here may panic, loop without end, or reserve
//! memory in proportion to a number that the file merely claims.

pub mod blackbox;
pub mod dataflash;
pub mod delimited;
pub mod error;
pub mod mavlink;
pub mod places;
pub mod ulog;

pub use error::LogError;
