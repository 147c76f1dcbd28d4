//! Face of `flightid_core::numerics::lagged_forms`. (Python side: uncertainty/fitted_directions.py)

use flightid_core::numerics::lagged_forms::lags_of_form as summed;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::row_major::RowMajor2;

/// lags_of_form(columns: NDArray[np.float64], form: NDArray[np.float64], n_lags: int) -> NDArray[np.float64]
///
/// Sums over a record of q(t)ᵀ M q(t + k) for rows q of columns (n, m), M (m, m) and lags k from zero
/// on.
#[pyfunction]
fn lags_of_form<'py>(
    py: Python<'py>,
    columns: RowMajor2<'_, f64>,
    form: RowMajor2<'_, f64>,
    n_lags: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let width = columns.as_array().ncols();
    let (columns, form) = (columns.as_slice()?, form.as_slice()?);
    Ok(py.detach(|| summed(columns, width, form, n_lags)).into_pyarray(py))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(lags_of_form, module)?)
}
