//! Face of `flightid_core::linear::drift_errors`. (Python side:
//! identification/output_error/sensor_noise.py)

use flightid_core::linear::drift_errors::{GainSearch, drift_errors as search};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::RowMajor1;

/// drift_errors(samples: NDArray[np.float64], lengths: list[int], drift: tuple[float, float], skip: int, settings: tuple[int, float, list[float]]) -> NDArray[np.float64]
///
/// Errors one sample ahead of all records, each without its first `skip` samples. `drift` is its
/// pole and the first gain; `settings` the most steps, the gain that ends it and shares of a step.
#[pyfunction]
fn drift_errors<'py>(
    py: Python<'py>,
    samples: RowMajor1<'_, f64>,
    lengths: Vec<usize>,
    drift: (f64, f64),
    skip: usize,
    settings: (usize, f64, Vec<f64>),
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (samples, (steps, settled, shares)) = (samples.as_slice()?, settings);
    let how = GainSearch { skip, steps, shares: &shares, settled };
    let found = py.detach(|| search(samples, &lengths, drift.0, drift.1, &how));
    Ok(found.map_err(from_core)?.into_pyarray(py))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(drift_errors, module)?)
}
