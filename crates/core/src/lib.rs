//! Numerics of flightid.
//!
//! Conventions, for every module: slices in, owned values out; SI units and radians; matrices are
//! row-major; spectra are one-sided; frequencies are in rad/s; random numbers come from a seed that
//! is an argument; results have the same bits for any number of threads. Nothing here knows Python,
//! files, channel names or printing.
//!
//! Rooms, left to right; each uses those before it, never one after it:
//!
//! - `numerics`: Linear algebra, dual numbers and random numbers: no flight, no models.
//! - `language`: Formulas of model files: their grammar, tables, and polynomials in s.
//! - `tape`: Formulas flattened to tapes of operations, their derivatives, and tapes ready to run.
//! - `state_space`: State-space models as equations, compiled: derivatives, samples, listings.
//! - `linear`: Linear systems in time: exact hold discretisation, simulation and recursions.
//! - `fits`: Least squares with bounds: the problem, its solver, and problems joined.
//! - `frequency_domain`: Models as frequency responses, and their fit to measured ones.
//! - `trajectories`: Differential equations integrated in time, sensitivities, shooting, loops.
//! - `output_error`: Output error: models on records, the records' own numbers, weights and sums.
//! - `black_box`: Polynomial models and NARX: predictors, fits, scans of orders, choice of terms.
//! - `autopilots`: Controllers and filters of ArduPilot and PX4, as their firmware computes them.
//! - `vehicles`: Simulated vehicles in gusts, with sensors, autopilots and pilots.

pub mod autopilots;
pub mod black_box;
pub mod error;
pub mod fits;
pub mod frequency_domain;
pub mod language;
pub mod linear;
pub mod numerics;
pub mod output_error;
pub mod state_space;
pub mod tape;
pub mod trajectories;
pub mod vehicles;

pub use error::CoreError;
