//! Face of `flightid_core::numerics::lagged_forms` and `lagged_rows`, and of
//! `flightid_core::linear::noise_answers`. (Python side: uncertainty/fitted_directions.py,
//! uncertainty/lagged_products.py, uncertainty/feedback_power.py)

use flightid_core::CoreError;
use flightid_core::linear::noise_answers::noise_answers as answers;
use flightid_core::numerics::lagged_forms::lags_of_form as summed;
use flightid_core::numerics::lagged_rows;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::RowMajor2;

/// lags_of_form(own: NDArray[np.float64], shared: NDArray[np.float64], form: NDArray[np.float64], n_lags: int) -> NDArray[np.float64]
///
/// Sums over a record of q(t)ᵀ M q(t + k) for lags k from zero on, where rows q are those of `own` (n, a)
/// and `shared` (n, b) side by side, and M is `form` (a + b, a + b), symmetric.
#[pyfunction]
fn lags_of_form<'py>(
    py: Python<'py>,
    own: RowMajor2<'_, f64>,
    shared: RowMajor2<'_, f64>,
    form: RowMajor2<'_, f64>,
    n_lags: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let widths = (own.as_array().ncols(), shared.as_array().ncols());
    let parts = [(own.as_slice()?, widths.0), (shared.as_slice()?, widths.1)];
    let form = form.as_slice()?;
    let found = py.detach(|| summed(parts, form, n_lags)).map_err(from_core)?;
    Ok(found.into_pyarray(py))
}

/// products_at_lags(now: NDArray[np.float64], past: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Σ a(t) b(t − k) of rows a of `now` (p, n) and b of `past` (q, n + longest), which begin `longest`
/// samples earlier, for lags from zero on: (longest + 1, q, p).
#[pyfunction]
fn products_at_lags<'py>(
    py: Python<'py>,
    now: RowMajor2<'_, f64>,
    past: RowMajor2<'_, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let ((p, n), (q, needed)) = (now.as_array().dim(), past.as_array().dim());
    let Some(longest) = needed.checked_sub(n) else {
        return Err(from_core(CoreError::Shape {
            what: "samples of the past",
            found: needed,
            needed: n,
        }));
    };
    let (now, past) = (now.as_slice()?, past.as_slice()?);
    let found = py.detach(|| lagged_rows::lagged_products(now, past, n, longest));
    found.into_pyarray(py).reshape([longest + 1, q, p])
}

/// left_of_neighbours(rows: NDArray[np.float64], past: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]
///
/// a(t) − Σ w(a, k, b) b(t + k) of rows a of `rows` (p, n) and b of `past` (q, n + m − 1); weights
/// (p, m q) are by k, then b.
#[pyfunction]
fn left_of_neighbours<'py>(
    py: Python<'py>,
    rows: RowMajor2<'_, f64>,
    past: RowMajor2<'_, f64>,
    weights: RowMajor2<'_, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let ((p, n), (q, length)) = (rows.as_array().dim(), past.as_array().dim());
    let (m, needed) = ((length + 1).saturating_sub(n), weights.as_array().dim());
    if needed != (p, m * q) {
        let found = needed.0 * needed.1;
        return Err(from_core(CoreError::Shape { what: "weights", found, needed: p * m * q }));
    }
    let (rows, past, weights) = (rows.as_slice()?, past.as_slice()?, weights.as_slice()?);
    let left = py.detach(|| lagged_rows::left_of_neighbours(rows, past, weights, n, m));
    left.into_pyarray(py).reshape([p, n])
}

/// noise_answers(weights: NDArray[np.float64], start: NDArray[np.float64], count: int, largest: float) -> NDArray[np.float64]
///
/// Outputs that past outputs alone move on, (count, n, n) by sample, output and noise: `weights`
/// (n, order n) are by lag from one on, then past output, `start` (n, n) is the first sample. What passes
/// `largest` stops there.
#[pyfunction]
fn noise_answers<'py>(
    py: Python<'py>,
    weights: RowMajor2<'_, f64>,
    start: RowMajor2<'_, f64>,
    count: usize,
    largest: f64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let ((n, width), square) = (weights.as_array().dim(), start.as_array().dim());
    if square != (n, n) || n == 0 || width % n != 0 {
        let (found, needed) = (square.0 * square.1, n * n);
        return Err(from_core(CoreError::Shape { what: "outputs of a start", found, needed }));
    }
    let (weights, start) = (weights.as_slice()?, start.as_slice()?);
    let found = py.detach(|| answers(weights, start, n, count, largest));
    found.into_pyarray(py).reshape([count, n, n])
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(lags_of_form, module)?)?;
    module.add_function(wrap_pyfunction!(noise_answers, module)?)?;
    module.add_function(wrap_pyfunction!(left_of_neighbours, module)?)?;
    module.add_function(wrap_pyfunction!(products_at_lags, module)?)
}
