//! Face of `flightid_core::fits::levenberg_marquardt` for residuals written in Python.
//! (Python side: identification/regression/rounds.py, identification/joint/estimator_inside.py)

use std::sync::{Arc, Mutex};

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
    // No rows where the problem made the triangle itself.
    let rows = match found.jacobian.is_empty() {
        true if !found.x.is_empty() => 0,
        _ => found.residuals.len(),
    };
    let shape = [rows, found.x.len()];
    Ok((
        found.x.into_pyarray(py),
        found.cost,
        found.residuals.into_pyarray(py),
        found.jacobian.into_pyarray(py).reshape(shape)?,
        found.iterations,
        found.termination.name(),
    ))
}

/// Residuals, their Jacobian and how many there are, as Python hands them over.
pub type WrittenResiduals<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, usize);

/// Residuals written in Python, on whatever thread a search runs.
#[derive(Clone)]
pub struct Callback {
    residuals: Arc<Py<PyAny>>,
    jacobian: Arc<Py<PyAny>>,
    triangle: Option<Arc<Py<PyAny>>>,
    n_parameters: usize,
    n_residuals: usize,
    raised: Arc<Mutex<Option<PyErr>>>,
}

const RAISED: CoreError = CoreError::NotFinite { what: "a callback that raised", index: 0 };

impl Callback {
    /// Of so many variables.
    pub fn new(
        (residuals, jacobian, n_residuals): WrittenResiduals<'_>,
        n_parameters: usize,
    ) -> Self {
        let (residuals, jacobian) = (Arc::new(residuals.unbind()), Arc::new(jacobian.unbind()));
        let triangle = None;
        Self { residuals, jacobian, triangle, n_parameters, n_residuals, raised: Arc::default() }
    }

    /// The same with what may make the triangle of Jacobian and residuals without them.
    #[must_use]
    pub fn with_triangle(self, triangle: Option<Bound<'_, PyAny>>) -> Self {
        Self { triangle: triangle.map(|each| Arc::new(each.unbind())), ..self }
    }

    /// What the residuals or their Jacobian raised.
    pub fn raised(&self) -> Option<PyErr> {
        self.raised.lock().ok().and_then(|mut kept| kept.take())
    }

    fn keep(&self, error: PyErr) -> CoreError {
        if let Ok(mut kept) = self.raised.lock() {
            kept.get_or_insert(error);
        }
        RAISED
    }

    /// A search shortens its steps where a point has no value: what raised is not asked again.
    fn ready(&self) -> Result<(), CoreError> {
        match self.raised.lock() {
            Ok(kept) if kept.is_none() => Ok(()),
            _ => Err(RAISED),
        }
    }

    fn copy(&self, call: PyResult<Vec<f64>>, target: &mut [f64]) -> Result<(), CoreError> {
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

impl Problem for Callback {
    fn n_parameters(&self) -> usize {
        self.n_parameters
    }

    fn n_residuals(&self) -> usize {
        self.n_residuals
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) -> Result<(), CoreError> {
        self.ready()?;
        let call = Python::attach(|py| {
            let result = self.residuals.bind(py).call1((PyArray1::from_slice(py, x),))?;
            let result: RowMajor1<'_, f64> = result.extract()?;
            Ok(result.to_vec()?)
        });
        self.copy(call, residuals)
    }

    fn jacobian(&mut self, x: &[f64], jacobian: &mut [f64]) -> Result<(), CoreError> {
        self.ready()?;
        let call = Python::attach(|py| {
            let result = self.jacobian.bind(py).call1((PyArray1::from_slice(py, x),))?;
            let result: RowMajor2<'_, f64> = result.extract()?;
            Ok(result.to_vec()?)
        });
        self.copy(call, jacobian)
    }

    fn triangle(&mut self, x: &[f64], triangle: &mut [f64]) -> Result<bool, CoreError> {
        self.ready()?;
        let Some(written) = self.triangle.clone() else { return Ok(false) };
        let call = Python::attach(|py| {
            let result = written.bind(py).call1((PyArray1::from_slice(py, x),))?;
            // By rows in Python, by columns here: it comes transposed.
            let result: Option<RowMajor2<'_, f64>> = result.extract()?;
            result.map(|columns| Ok(columns.to_vec()?)).transpose()
        });
        match call.transpose() {
            None => Ok(false),
            Some(found) => self.copy(found, triangle).map(|()| true),
        }
    }
}

/// least_squares(residuals: Callable[[NDArray[np.float64]], NDArray[np.float64]], jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]], start: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64], n_residuals: int, maximum_iterations: int, stop: Callable[[float], bool] | None = None, triangle: Callable[[NDArray[np.float64]], NDArray[np.float64] | None] | None = None) -> tuple[NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64], int, str]
///
/// Bounded Levenberg–Marquardt on callables: x, cost, residuals, Jacobian, iterations, termination.
/// `stop` is asked after each step with the least cost so far. `triangle` may give that of Jacobian
/// and residuals, a column of it a row, or None where the Jacobian is to be taken.
#[pyfunction]
#[pyo3(signature = (residuals, jacobian, start, lower, upper, n_residuals, maximum_iterations, stop=None, triangle=None))]
#[allow(clippy::too_many_arguments)]
fn least_squares<'py>(
    py: Python<'py>,
    residuals: Bound<'py, PyAny>,
    jacobian: Bound<'py, PyAny>,
    start: RowMajor1<'_, f64>,
    lower: RowMajor1<'_, f64>,
    upper: RowMajor1<'_, f64>,
    n_residuals: usize,
    maximum_iterations: usize,
    stop: Option<&Bound<'py, PyAny>>,
    triangle: Option<Bound<'py, PyAny>>,
) -> PyResult<Ending<'py>> {
    let start = start.as_slice()?;
    let written = (residuals, jacobian, n_residuals);
    let mut problem = Callback::new(written, start.len()).with_triangle(triangle);
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
    if let Some(error) = signal.or(problem.raised()) {
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
