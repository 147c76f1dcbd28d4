//! Face of `flightid_core::fits::levenberg_marquardt` for residuals written in Python.
//! (Python side: identification/regression/rounds.py)

use flightid_core::CoreError;
use flightid_core::fits::least_squares::{Minimum, Options, Problem, Progress};
use flightid_core::fits::levenberg_marquardt::minimise;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};

/// x, cost, residuals, Jacobian, iterations, name of the termination.
pub type Ending<'py> = (
    Bound<'py, PyArray1<f64>>,
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    usize,
    &'static str,
);

/// Where a minimisation ended, as Python values.
///
/// # Errors
/// NumPy's own.
pub fn ending<'py>(py: Python<'py>, found: Minimum) -> PyResult<Ending<'py>> {
    let shape = [found.residuals.len(), found.x.len()];
    Ok((
        found.x.into_pyarray(py),
        found.cost,
        found.residuals.into_pyarray(py),
        found.jacobian.into_pyarray(py).reshape(shape)?,
        found.iterations,
        found.termination.name(),
    ))
}

struct Callback<'a, 'py> {
    py: Python<'py>,
    residuals: &'a Bound<'py, PyAny>,
    jacobian: &'a Bound<'py, PyAny>,
    n_parameters: usize,
    n_residuals: usize,
    raised: Option<PyErr>,
}

const RAISED: CoreError = CoreError::NotFinite { what: "a callback that raised", index: 0 };

impl<'py> Callback<'_, 'py> {
    fn keep(&mut self, error: PyErr) -> CoreError {
        self.raised = Some(error);
        RAISED
    }

    /// A search shortens its steps where a point has no value: what raised is not asked again.
    fn ready(&self) -> Result<(), CoreError> {
        if self.raised.is_none() { Ok(()) } else { Err(RAISED) }
    }

    fn copy(&mut self, call: PyResult<Vec<f64>>, target: &mut [f64]) -> Result<(), CoreError> {
        let values = call.map_err(|error| self.keep(error))?;
        if values.len() != target.len() {
            let (found, needed) = (values.len(), target.len());
            let wrong = CoreError::Shape { what: "values of a callback", found, needed };
            return Err(self.keep(from_core(wrong)));
        }
        target.copy_from_slice(&values);
        Ok(())
    }
}

impl Problem for Callback<'_, '_> {
    fn n_parameters(&self) -> usize {
        self.n_parameters
    }

    fn n_residuals(&self) -> usize {
        self.n_residuals
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) -> Result<(), CoreError> {
        self.ready()?;
        let x = PyArray1::from_slice(self.py, x);
        let call = self.residuals.call1((x,)).and_then(|result| {
            let result: RowMajor1<'_, f64> = result.extract()?;
            Ok(result.to_vec()?)
        });
        self.copy(call, residuals)
    }

    fn jacobian(&mut self, x: &[f64], jacobian: &mut [f64]) -> Result<(), CoreError> {
        self.ready()?;
        let x = PyArray1::from_slice(self.py, x);
        let call = self.jacobian.call1((x,)).and_then(|result| {
            let result: RowMajor2<'_, f64> = result.extract()?;
            Ok(result.to_vec()?)
        });
        self.copy(call, jacobian)
    }
}

/// least_squares(residuals: Callable[[NDArray[np.float64]], NDArray[np.float64]], jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]], start: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64], n_residuals: int, maximum_iterations: int, stop: Callable[[float], bool] | None = None) -> tuple[NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64], int, str]
///
/// Bounded Levenberg–Marquardt on callables: x, cost, residuals, Jacobian, iterations, termination.
/// `stop` is asked after each step with the least cost so far.
#[pyfunction]
#[pyo3(signature = (residuals, jacobian, start, lower, upper, n_residuals, maximum_iterations, stop=None))]
#[allow(clippy::too_many_arguments)]
fn least_squares<'py>(
    py: Python<'py>,
    residuals: &Bound<'py, PyAny>,
    jacobian: &Bound<'py, PyAny>,
    start: RowMajor1<'_, f64>,
    lower: RowMajor1<'_, f64>,
    upper: RowMajor1<'_, f64>,
    n_residuals: usize,
    maximum_iterations: usize,
    stop: Option<&Bound<'py, PyAny>>,
) -> PyResult<Ending<'py>> {
    let start = start.as_slice()?;
    let (n_parameters, raised) = (start.len(), None);
    let mut problem = Callback { py, residuals, jacobian, n_parameters, n_residuals, raised };
    let options = Options { maximum_iterations, ..Options::default() };
    let mut signal = None;
    let ask = |cost: f64| {
        py.check_signals()?;
        stop.map_or(Ok(true), |stop| Ok(!stop.call1((cost,))?.is_truthy()?))
    };
    let proceed = &mut |at: &Progress| {
        ask(at.cost).unwrap_or_else(|error| {
            signal = Some(error);
            false
        })
    };
    let (lower, upper) = (lower.as_slice()?, upper.as_slice()?);
    let found = minimise(&mut problem, start, lower, upper, &options, proceed);
    if let Some(error) = signal.or(problem.raised) {
        return Err(error);
    }
    ending(py, found.map_err(from_core)?)
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(least_squares, module)?)
}
