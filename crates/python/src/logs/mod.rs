//! Log files: bytes to columns.

pub mod dataflash;
pub mod ulog;
