//! Delimited text to columns, as `record/formats/csv.py` asks for it.
//!
//! One pass over the text, a block at a time; columns that turn out to hold text below numbers are read
//! in a second one. Nothing is kept that the budget does not hold.

mod cell;
mod column;
mod date;
mod fault;
mod lines;
mod passes;
mod utf16;
mod windows;

pub use column::Column;
pub use fault::DelimitedError;
pub use passes::{Layout, read};
