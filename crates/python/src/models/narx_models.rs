//! Binding of term selection and NARX runs.
//! (Python side: models/narx/model.py, identification/narx/fit.py)

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};
use flightid_core::CoreError;
use flightid_core::black_box::candidates::Candidates;
use flightid_core::black_box::local_regularisation::{Regularisation, select_regularised};
use flightid_core::black_box::narx_prediction::{Lag, Monomial, Narx};
use flightid_core::black_box::radial_basis::{Kernel, Radial};
use flightid_core::black_box::stop_rule::Stop;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

type Path<'py> = (
    Vec<usize>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    usize,
);

fn of_name(name: &str, penalty: f64) -> Result<Regularisation, CoreError> {
    match name {
        "none" => Ok(Regularisation::Uniform(0.0)),
        "uniform" => Ok(Regularisation::Uniform(penalty)),
        "local" => Ok(Regularisation::Local(penalty)),
        _ => Err(CoreError::UnknownName { name: name.to_owned() }),
    }
}

fn stop_rule(name: &str, goal: f64) -> Result<Stop, CoreError> {
    match name {
        "sse" => Ok(Stop::SumOfSquares(goal)),
        "err" => Ok(Stop::ErrorReduction(goal)),
        "terms" => Ok(Stop::Terms),
        "press" => Ok(Stop::Press),
        "aic" => Ok(Stop::Akaike),
        "aicc" => Ok(Stop::AkaikeCorrected),
        "bic" => Ok(Stop::Bayes),
        _ => Err(CoreError::UnknownName { name: name.to_owned() }),
    }
}

/// select_terms(target: NDArray[np.float64], columns: NDArray[np.float64], regressors: NDArray[np.float64], centres: NDArray[np.float64], kernel: str, beta: float, keep: bool, forced: int, stop: str, goal: float, maximum_terms: int, regularisation: str = 'none', penalty: float = 0.0) -> tuple[list[int], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int]
///
/// Orthogonal least squares over given columns, then radial functions at the centres (all kept in
/// single precision, or computed at each reading): terms, error reduction, sums of squares, leave-one-out mean squares;
/// weights, penalties and flat triangular factor of the kept terms; number of collinear candidates.
#[pyfunction]
#[pyo3(signature = (target, columns, regressors, centres, kernel, beta, keep, forced, stop, goal, maximum_terms, regularisation="none", penalty=0.0))]
#[allow(clippy::too_many_arguments)]
fn select_terms<'py>(
    py: Python<'py>,
    target: RowMajor1<'py, f64>,
    columns: RowMajor2<'py, f64>,
    regressors: RowMajor2<'py, f64>,
    centres: RowMajor2<'py, f64>,
    kernel: &str,
    beta: f64,
    keep: bool,
    forced: usize,
    stop: &str,
    goal: f64,
    maximum_terms: usize,
    regularisation: &str,
    penalty: f64,
) -> PyResult<Path<'py>> {
    let dimension = regressors.as_array().ncols();
    let (y, columns) = (target.as_slice()?, columns.as_slice()?);
    let (regressors, centres) = (regressors.as_slice()?, centres.as_slice()?);
    let found = py
        .detach(|| {
            let radial = if centres.is_empty() {
                None
            } else {
                let kernel = Kernel::from_name(kernel)?;
                Some((Radial::new(kernel, beta, centres, dimension)?, regressors))
            };
            let candidates = Candidates { columns, radial, rounded: keep, n_samples: y.len() };
            let (rule, penalties) = (stop_rule(stop, goal)?, of_name(regularisation, penalty)?);
            select_regularised(&candidates, y, forced, penalties, rule, maximum_terms)
        })
        .map_err(from_core)?;
    Ok((
        found.terms,
        found.error_reduction.into_pyarray(py),
        found.sum_of_squares.into_pyarray(py),
        found.press.into_pyarray(py),
        found.weights.into_pyarray(py),
        found.penalties.into_pyarray(py),
        found.factor.into_pyarray(py),
        found.collinear,
    ))
}

/// run_narx(measured: NDArray[np.float64], inputs: NDArray[np.float64], lags: list[tuple[int, int]], monomials: list[tuple[float, list[tuple[int, int]]]], centres: NDArray[np.float64], radial_weights: NDArray[np.float64], kernel: str, beta: float, bounds: tuple[float, float], horizon: int) -> tuple[NDArray[np.float64], int, int | None]
///
/// Prediction of a NARX model, `horizon` samples ahead (0: free run); samples that initialise it;
/// first sample at which the guard held it.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn run_narx<'py>(
    py: Python<'py>,
    measured: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    lags: Vec<(usize, usize)>,
    monomials: Vec<(f64, Vec<(usize, i32)>)>,
    centres: RowMajor2<'py, f64>,
    radial_weights: RowMajor1<'py, f64>,
    kernel: &str,
    beta: f64,
    bounds: (f64, f64),
    horizon: usize,
) -> PyResult<(Bound<'py, PyArray1<f64>>, usize, Option<usize>)> {
    let (measured, inputs) = (measured.as_slice()?, inputs.as_slice()?);
    let (centres, radial_weights) = (centres.as_slice()?, radial_weights.as_slice()?);
    let found = py
        .detach(|| {
            let radial = Radial::new(Kernel::from_name(kernel)?, beta, centres, lags.len())?;
            let lags = lags.iter().map(|&(channel, lag)| Lag { channel, lag }).collect();
            let monomials = monomials
                .into_iter()
                .map(|(weight, factors)| Monomial { weight, factors })
                .collect();
            let model = Narx { lags, monomials, radial, radial_weights, bounds };
            match horizon {
                0 => model.free_run(measured, inputs),
                steps => model.ahead(measured, inputs, steps),
            }
        })
        .map_err(from_core)?;
    Ok((found.output.into_pyarray(py), found.start, found.diverged_at))
}

/// Add this area to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(select_terms, module)?)?;
    module.add_function(wrap_pyfunction!(run_narx, module)?)
}
