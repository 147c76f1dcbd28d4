//! `flightid._native`: check, release the interpreter lock, call, convert. No arithmetic here.
//!
//! The first line of each function's doc is its Python signature with types; `tools/stubs.py` builds
//! `_native.pyi` from those lines and a contract test compares them with what PyO3 really accepts.

use pyo3::prelude::*;

pub mod autopilots;
pub mod chirp;
pub mod closed_loop;
pub mod dataflash;
pub mod equation_records;
pub mod error;
pub mod expression;
pub mod file_bytes;
pub mod frequency_fit;
pub mod group;
pub mod interrupt;
pub mod kinematics;
pub mod least_squares;
pub mod linear_recursion;
pub mod linear_simulation;
pub mod lookup_table;
pub mod loop_simulation;
pub mod narx;
pub mod nonlinear_simulation;
pub mod output_error;
pub mod polynomial;
pub mod quadrotor;
pub mod state_space;
pub mod transfer;
pub mod twin_rotor;
pub mod ulog;

/// version() -> str
///
/// Version of the native half.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Native half of flightid. Private: use the names of `flightid` instead.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(version, module)?)?;
    autopilots::register(module)?;
    chirp::register(module)?;
    kinematics::register(module)?;
    linear_recursion::register(module)?;
    linear_simulation::register(module)?;
    closed_loop::register(module)?;
    lookup_table::register(module)?;
    loop_simulation::register(module)?;
    dataflash::register(module)?;
    ulog::register(module)?;
    quadrotor::register(module)?;
    equation_records::register(module)?;
    expression::register(module)?;
    least_squares::register(module)?;
    narx::register(module)?;
    polynomial::register(module)?;
    nonlinear_simulation::register(module)?;
    transfer::register(module)?;
    twin_rotor::register(module)?;
    state_space::register(module)?;
    Ok(())
}
