//! Face of `flightid_core::linear::slope_products` and `input_products`. (Python side:
//! identification/subspace/prediction_errors.py, identification/subspace/predictor_columns.py)

use flightid_core::linear::input_products::InputColumns;
use flightid_core::linear::slope_products::{Predictor, Rows, products};
use flightid_core::linear::slope_recursion::Slopes;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2, RowMajor3};

/// Matrices of a predictor, and its state at the first sample.
type Run<'py> = (
    RowMajor2<'py, f64>,
    RowMajor2<'py, f64>,
    RowMajor2<'py, f64>,
    RowMajor2<'py, f64>,
    RowMajor1<'py, f64>,
);
/// What its slopes show of their states, and what drives them.
type Driven<'py> = (RowMajor2<'py, f64>, RowMajor3<'py, f64>, RowMajor3<'py, f64>);

fn square(py: Python<'_>, found: Vec<f64>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let width = found.len().isqrt();
    found.into_pyarray(py).reshape([width, width])
}

/// slope_products(predictor: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], slopes: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], signals: NDArray[np.float64], errors: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Products with each other of slopes by all unknowns, of errors (p, n_samples) and of rows (r, p,
/// n_kept). The predictor x⁺ = A x + F s, e = G s − C x is A, C, F, G and its first state; slopes
/// show C, and F and G of each unknown take its states, its errors and the first of its signals.
#[pyfunction]
fn slope_products<'py>(
    py: Python<'py>,
    predictor: Run<'_>,
    slopes: Driven<'_>,
    signals: RowMajor2<'_, f64>,
    errors: RowMajor2<'_, f64>,
    rows: RowMajor3<'_, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (p, n) = predictor.1.as_array().dim();
    let (count, _, driving) = slopes.1.as_array().dim();
    let of = Predictor {
        transition: predictor.0.as_slice()?,
        output: predictor.1.as_slice()?,
        forced: predictor.2.as_slice()?,
        direct: predictor.3.as_slice()?,
        start: predictor.4.as_slice()?,
        sizes: [n, p, signals.as_array().nrows()],
    };
    let by = Slopes {
        transition: of.transition,
        output: slopes.0.as_slice()?,
        forced: slopes.1.as_slice()?,
        direct: slopes.2.as_slice()?,
        sizes: [n, p, driving],
        count,
    };
    let rows = Rows { kept: rows.as_array().dim().2, values: rows.as_slice()? };
    let (signals, errors) = (signals.as_slice()?, errors.as_slice()?);
    let found = py.detach(|| products(of, by, signals, errors, rows)).map_err(from_core)?;
    square(py, found)
}

/// input_products(predictor: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], outputs: NDArray[np.float64], inputs: NDArray[np.float64], direct: bool, levels: bool, lasting: int) -> NDArray[np.float64]
///
/// Products with each other of what entries of B and D, a first state and levels add to the errors
/// of a predictor (transposed transition, C, K), and of the errors without these.
#[pyfunction]
fn input_products<'py>(
    py: Python<'py>,
    predictor: (RowMajor2<'_, f64>, RowMajor2<'_, f64>, RowMajor2<'_, f64>),
    outputs: RowMajor2<'_, f64>,
    inputs: RowMajor2<'_, f64>,
    direct: bool,
    levels: bool,
    lasting: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let ((p, n_samples), m) = (outputs.as_array().dim(), inputs.as_array().nrows());
    let of = InputColumns {
        turned: predictor.0.as_slice()?,
        output: predictor.1.as_slice()?,
        gain: predictor.2.as_slice()?,
        sizes: [predictor.0.as_array().nrows(), p, m],
        direct,
        levels,
        lasting,
    };
    let (outputs, inputs) = (outputs.as_slice()?, inputs.as_slice()?);
    let found = py.detach(|| of.products(outputs, inputs, n_samples)).map_err(from_core)?;
    square(py, found)
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(input_products, module)?)?;
    module.add_function(wrap_pyfunction!(slope_products, module)?)
}
