//! Binding of the polynomial predictor and its fits.
//! (Python side: models/polynomial/model.py, identification/prediction_error/fit.py)

use crate::error::from_core;
use crate::interrupt;
use crate::row_major::{RowMajor1, RowMajor2};
use flightid_core::CoreError;
use flightid_core::black_box::order_scan::{Scan, scan};
use flightid_core::black_box::polynomial_fit::{Before, PredictionError, fit_from, regress};
use flightid_core::black_box::polynomial_orders::Orders;
use flightid_core::black_box::polynomial_predictor::Samples;
use flightid_core::fits::least_squares::{Minimum, Options};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

/// Degrees of A, coefficients of each B, degrees of C, D and each F (or of one of all inputs), delays.
type OrderTuple = (usize, Vec<usize>, usize, usize, Vec<usize>, Vec<usize>);

fn orders_of((a, b, c, d, f, delays): OrderTuple) -> Orders {
    Orders { a, b, c, d, f, delays }
}

/// Records as slices of channels that lie end to end.
///
/// # Errors
/// `ShapeError` where the lengths do not add up to the samples.
pub fn split<'a>(
    output: &'a [f64],
    inputs: &'a [f64],
    n_inputs: usize,
    lengths: &[usize],
) -> Result<Vec<Samples<'a>>, CoreError> {
    let total: usize = lengths.iter().sum();
    for (what, found, needed) in
        [("samples", output.len(), total), ("samples of inputs", inputs.len(), total * n_inputs)]
    {
        if found != needed {
            return Err(CoreError::Shape { what, found, needed });
        }
    }
    let mut first = 0;
    Ok(lengths
        .iter()
        .map(|&length| {
            let span = first..first + length;
            first += length;
            let inputs = (0..n_inputs).map(|i| &inputs[i * total..][span.clone()]).collect();
            Samples { output: &output[span], inputs }
        })
        .collect())
}

fn before(word: &str, memory: Vec<Vec<f64>>) -> Result<Before, CoreError> {
    match word {
        "rest" => Ok(Before::Rest),
        "unknown" => Ok(Before::Unknown),
        "given" => Ok(Before::Given(memory)),
        _ => Err(CoreError::UnknownName { name: word.to_owned() }),
    }
}

type Regression<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, usize, Option<usize>);

/// polynomial_regression(output: NDArray[np.float64], inputs: NDArray[np.float64], lengths: list[int], orders: tuple[int, list[int], int, int, list[int], list[int]], skip: int, levels: bool) -> tuple[NDArray[np.float64], NDArray[np.float64], int, int | None]
///
/// Least squares of A y = B u + e: coefficients, triangle of [regressors | output] by columns, rows,
/// first coefficient that the data cannot tell from those before it. With `levels` a constant of each
/// record is fitted beside, and counts as a row less.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn polynomial_regression<'py>(
    py: Python<'py>,
    output: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    lengths: Vec<usize>,
    orders: OrderTuple,
    skip: usize,
    levels: bool,
) -> PyResult<Regression<'py>> {
    let n_inputs = inputs.as_array().nrows();
    let (output, inputs) = (output.as_slice()?, inputs.as_slice()?);
    let found = py
        .detach(|| {
            let records = split(output, inputs, n_inputs, &lengths)?;
            let orders = orders_of(orders);
            let mut problem = PredictionError::new(orders, records, Before::Rest, skip, false)?;
            problem.levels = levels;
            regress(&mut problem)
        })
        .map_err(from_core)?;
    let (theta, triangle) = (found.theta.into_pyarray(py), found.triangle.into_pyarray(py));
    let constants = if levels { lengths.len() } else { 0 };
    Ok((theta, triangle, found.n_rows.saturating_sub(constants), found.dependent))
}

type End<'py> = (Bound<'py, PyArray1<f64>>, f64, Bound<'py, PyArray1<f64>>, usize, &'static str);

/// polynomial_fit(output: NDArray[np.float64], inputs: NDArray[np.float64], lengths: list[int], orders: tuple[int, list[int], int, int, list[int], list[int]], starts: NDArray[np.float64], before: str, memory: list[list[float]], levels: bool, skip: int, stable: bool, maximum_iterations: int) -> list[tuple[NDArray[np.float64], float, NDArray[np.float64], int, str] | str]
///
/// Prediction-error minimum from each start: coefficients, sum of squares, triangle of the Jacobian
/// by columns, iterations, termination; or the words of the error that stopped it.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn polynomial_fit<'py>(
    py: Python<'py>,
    output: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    lengths: Vec<usize>,
    orders: OrderTuple,
    starts: RowMajor2<'py, f64>,
    before: &str,
    memory: Vec<Vec<f64>>,
    levels: bool,
    skip: usize,
    stable: bool,
    maximum_iterations: usize,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let n_inputs = inputs.as_array().nrows();
    let width = starts.as_array().ncols().max(1);
    let starts: Vec<Vec<f64>> =
        starts.as_slice()?.chunks_exact(width).map(<[f64]>::to_vec).collect();
    let (output, inputs) = (output.as_slice()?, inputs.as_slice()?);
    let known = self::before(before, memory).map_err(from_core)?;
    let records = split(output, inputs, n_inputs, &lengths).map_err(from_core)?;
    let mut problem =
        PredictionError::new(orders_of(orders), records, known, skip, stable).map_err(from_core)?;
    problem.levels = levels;
    let options = Options { maximum_iterations, ..Options::default() };
    let found = interrupt::run_beside(py, |stop| fit_from(&problem, &starts, &options, stop))?;
    found.into_iter().map(|each| end(py, each)).collect()
}

fn end<'py>(py: Python<'py>, found: Result<Minimum, CoreError>) -> PyResult<Bound<'py, PyAny>> {
    match found {
        Ok(minimum) => {
            let values: End<'py> = (
                minimum.x.into_pyarray(py),
                minimum.cost,
                minimum.triangle.into_pyarray(py),
                minimum.iterations,
                minimum.termination.name(),
            );
            Ok(values.into_pyobject(py)?.into_any())
        }
        Err(error @ CoreError::Shape { .. }) => Err(from_core(error)),
        Err(error) => Ok(error.to_string().into_pyobject(py)?.into_any()),
    }
}

/// polynomial_errors(output: NDArray[np.float64], inputs: NDArray[np.float64], lengths: list[int], orders: tuple[int, list[int], int, int, list[int], list[int]], theta: NDArray[np.float64], before: str, memory: list[list[float]], levels: bool) -> tuple[NDArray[np.float64], list[float]]
///
/// One-step prediction errors of all records, end to end, and the constant that D (A y - B/F u) of each
/// record has: zero where none was fitted.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn polynomial_errors<'py>(
    py: Python<'py>,
    output: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    lengths: Vec<usize>,
    orders: OrderTuple,
    theta: RowMajor1<'py, f64>,
    before: &str,
    memory: Vec<Vec<f64>>,
    levels: bool,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Vec<f64>)> {
    let n_inputs = inputs.as_array().nrows();
    let (output, inputs, theta) = (output.as_slice()?, inputs.as_slice()?, theta.as_slice()?);
    let known = self::before(before, memory).map_err(from_core)?;
    let found = py
        .detach(|| {
            let records = split(output, inputs, n_inputs, &lengths)?;
            let mut problem = PredictionError::new(orders_of(orders), records, known, 0, false)?;
            problem.levels = levels;
            Ok(problem.runs(theta)?.0)
        })
        .map_err(from_core)?;
    let constants = found.iter().map(|run| 0.0 - run.level).collect();
    let errors: Vec<f64> = found.into_iter().flat_map(|run| run.error).collect();
    Ok((errors.into_pyarray(py), constants))
}

type Scanned<'py> = (Bound<'py, PyArray1<f64>>, f64, usize, bool);

/// scan_polynomials(output: NDArray[np.float64], inputs: NDArray[np.float64], lengths: list[int], orders: list[tuple[int, list[int], int, int, list[int], list[int]]], long: int, maximum_iterations: int, levels: bool) -> list[tuple[NDArray[np.float64], float, int, bool] | None]
///
/// Each ARX or ARMAX structure: coefficients, sum of squared prediction errors, iterations, converged;
/// None where its regressors are collinear.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn scan_polynomials<'py>(
    py: Python<'py>,
    output: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    lengths: Vec<usize>,
    orders: Vec<OrderTuple>,
    long: usize,
    maximum_iterations: usize,
    levels: bool,
) -> PyResult<Vec<Option<Scanned<'py>>>> {
    let n_inputs = inputs.as_array().nrows();
    let (output, inputs) = (output.as_slice()?, inputs.as_slice()?);
    let work = Scan {
        records: split(output, inputs, n_inputs, &lengths).map_err(from_core)?,
        candidates: orders.into_iter().map(orders_of).collect(),
        long,
        maximum_iterations,
        levels,
    };
    let found = interrupt::run_beside(py, |stop| scan(&work, stop))?.map_err(from_core)?;
    Ok(found
        .into_iter()
        .map(|each| each.map(|s| (s.theta.into_pyarray(py), s.squares, s.iterations, s.converged)))
        .collect())
}

/// polynomial_memory(orders: tuple[int, list[int], int, int, list[int], list[int]]) -> tuple[list[int], int]
///
/// How many values stand for the past of a record: through each F, and through the noise model.
#[pyfunction]
fn polynomial_memory(orders: OrderTuple) -> (Vec<usize>, usize) {
    orders_of(orders).memory()
}

/// Add this area to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(polynomial_regression, module)?)?;
    module.add_function(wrap_pyfunction!(polynomial_fit, module)?)?;
    module.add_function(wrap_pyfunction!(scan_polynomials, module)?)?;
    module.add_function(wrap_pyfunction!(polynomial_memory, module)?)?;
    module.add_function(wrap_pyfunction!(polynomial_errors, module)?)
}
