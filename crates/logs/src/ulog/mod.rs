//! PX4 ULog: bytes to an index of what the log holds (Python side: `logs/ulog/reader.py`).
//!
//! The record walk is our own. The crate `px4-ulog` 0.6.1, which the tests use as a cross-check, stops
//! for good at the first record that it cannot read, keeps no place to resume from, and panics on a
//! parameter whose key length exceeds the record, so nothing can be built around it that a stranger's
//! damaged file would not bring down. Here every record is judged before it is believed
//! (`framing.rs`); after damage the walk resumes at the next record that can be vouched for, and
//! every byte range that was not read is listed with its reason.
//!
//! Memory: an offset of eight bytes for each sample, and entries in proportion to their records.

pub mod entry;
pub mod framing;
mod log_index;
pub mod message_format;
mod sample_columns;
pub mod scalar;

pub use log_index::{Skipped, Stamped, Table, Ulog};
