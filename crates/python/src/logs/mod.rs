//! Log files: bytes to columns.

pub mod blackbox;
pub mod dataflash;
pub mod delimited;
pub mod mavlink;
pub mod ulog;
