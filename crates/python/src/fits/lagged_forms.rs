//! Face of `flightid_core::numerics::lagged_forms`. (Python side: uncertainty/fitted_directions.py)

use flightid_core::CoreError;
use flightid_core::numerics::lagged_forms::lagged_sums as summed;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::RowMajor2;

/// lagged_sums(earlier: NDArray[np.float64], later: NDArray[np.float64], n_lags: int) -> NDArray[np.float64]
///
/// Sums over a record of p(t)ᵀ q(t + k) for rows p of `earlier` (n, m), q of `later` (n, m) and lags k
/// from zero on.
#[pyfunction]
fn lagged_sums<'py>(
    py: Python<'py>,
    earlier: RowMajor2<'_, f64>,
    later: RowMajor2<'_, f64>,
    n_lags: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let width = earlier.as_array().ncols();
    let (found, needed) = (later.as_array().ncols(), width);
    if found != needed {
        return Err(from_core(CoreError::Shape { what: "numbers of a row", found, needed }));
    }
    let (earlier, later) = (earlier.as_slice()?, later.as_slice()?);
    Ok(py.detach(|| summed(earlier, later, width, n_lags)).into_pyarray(py))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(lagged_sums, module)?)
}
