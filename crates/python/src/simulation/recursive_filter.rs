//! Face of `flightid_core::numerics::recursive_filter`. (Python side: recursive_filter.py)

use flightid_core::numerics::recursive_filter::filter_rows as filtered;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};

/// filter_rows(b: NDArray[np.float64], a: NDArray[np.float64], x: NDArray[np.float64], state: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// Rows (n_rows, n) through b/a, of one length and with a[0] = 1, from states (n_rows, order): the
/// rows that come out, and the states they leave.
#[pyfunction]
#[allow(clippy::type_complexity)]
fn filter_rows<'py>(
    py: Python<'py>,
    b: RowMajor1<'_, f64>,
    a: RowMajor1<'_, f64>,
    x: RowMajor2<'_, f64>,
    state: RowMajor2<'_, f64>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
    let (shape, held) = (x.as_array().dim(), state.as_array().dim());
    let (b, a, x) = (b.as_slice()?, a.as_slice()?, x.as_slice()?);
    let mut left = state.as_slice()?.to_vec();
    let made = py.detach(|| filtered(b, a, x, shape.1, &mut left)).map_err(from_core)?;
    let made = made.into_pyarray(py).reshape([shape.0, shape.1])?;
    Ok((made, left.into_pyarray(py).reshape([held.0, held.1])?))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(filter_rows, module)?)
}
