//! Blackbox logs of Betaflight, INAV, Cleanflight and Baseflight (`.bbl`, `.bfl`, `.TXT`).
//!
//! A text header says the names of the fields, how each is predicted from frames before it and how
//! the difference is written; binary frames follow. One file may hold several flights, one header
//! each. Reference: Betaflight `src/main/blackbox/blackbox.c`, `blackbox_encoding.c`.

pub mod decode;
mod encoding;
mod frame_layout;
pub mod header;
mod predictor;

pub use decode::{Blackbox, Event, FrameTable, Skipped};
pub use header::{Header, flights};
