//! Numerics of flightid.
//!
//! Conventions, for every module: slices in, owned values out; SI units and radians; matrices are
//! row-major; spectra are one-sided; frequencies are in rad/s; random numbers come from a seed that
//! is an argument; results have the same bits for any number of threads. Nothing here knows Python,
//! files, channel names or printing.

pub mod chirp;
pub mod error;
pub mod linear_simulation;
pub mod matrix_exponential;

pub use error::CoreError;
