//! `flightid._native`: check, release the interpreter lock, call, convert. No arithmetic here.
//!
//! The first line of each function's doc is its Python signature with types; `tools/stubs.py` builds
//! `_native.pyi` from those lines and a contract test compares them with what PyO3 really accepts.

use pyo3::prelude::*;

pub mod error;
pub mod file_bytes;
pub mod fits;
pub mod group;
pub mod interrupt;
pub mod logs;
pub mod models;
pub mod row_major;
pub mod series;
pub mod simulation;
#[cfg(unix)]
pub mod taken_pages;
pub mod vehicles;

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
    vehicles::autopilot_controllers::register(module)?;
    vehicles::ardupilot_chirp::register(module)?;
    vehicles::kinematics::register(module)?;
    simulation::closed_response::register(module)?;
    simulation::drift_errors::register(module)?;
    simulation::extended_kalman::register(module)?;
    simulation::linear_recursion::register(module)?;
    simulation::predictor_products::register(module)?;
    simulation::recursive_filter::register(module)?;
    simulation::slope_recursion::register(module)?;
    simulation::linear_simulation::register(module)?;
    simulation::vehicle_loop::register(module)?;
    models::lookup_table::register(module)?;
    simulation::loop_simulation::register(module)?;
    logs::dataflash::register(module)?;
    logs::delimited::register(module)?;
    logs::ulog::register(module)?;
    logs::blackbox::register(module)?;
    logs::mavlink::register(module)?;
    vehicles::quadrotor::register(module)?;
    models::equation_records::register(module)?;
    models::expression::register(module)?;
    fits::lagged_forms::register(module)?;
    fits::least_squares::register(module)?;
    fits::shown_disturbances::register(module)?;
    models::narx_models::register(module)?;
    models::polynomial_models::register(module)?;
    models::rational_bins::register(module)?;
    simulation::nonlinear_simulation::register(module)?;
    models::transfer::register(module)?;
    vehicles::twin_rotor::register(module)?;
    models::state_space::register(module)?;
    series::register(module)?;
    Ok(())
}
