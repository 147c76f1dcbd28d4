//! Log files: bytes to columns.

pub mod dataflash;
pub mod delimited;
pub mod ulog;
