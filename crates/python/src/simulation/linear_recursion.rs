//! Face of `flightid_core::linear::linear_recursion`. (Python side:
//! identification/filter_error/fit.py)

use flightid_core::linear::linear_recursion::{recurse, recurse_anyhow};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor2, RowMajor3};

/// linear_recursion(transition: NDArray[np.float64], forcing: NDArray[np.float64], initial: NDArray[np.float64], anyhow: bool = False) -> NDArray[np.float64]
///
/// States (n_runs, n_samples, n) of x(k+1) = A x(k) + f(k), forced by (n_runs, n_samples, n) from
/// (n_runs, n). One that runs away is refused, or handed over `anyhow`, as far as it is finite.
#[pyfunction]
#[pyo3(signature = (transition, forcing, initial, anyhow = false))]
fn linear_recursion<'py>(
    py: Python<'py>,
    transition: RowMajor2<'_, f64>,
    forcing: RowMajor3<'_, f64>,
    initial: RowMajor2<'_, f64>,
    anyhow: bool,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let shape = forcing.as_array().dim();
    let (a, f, x0) = (transition.as_slice()?, forcing.as_slice()?, initial.as_slice()?);
    let run = if anyhow { recurse_anyhow } else { recurse };
    let states = py.detach(|| run(a, f, x0, shape.1)).map_err(from_core)?;
    states.into_pyarray(py).reshape([shape.0, shape.1, shape.2])
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(linear_recursion, module)?)
}
