//! Face of `flightid_core::frequency_domain::frequency_fit` for every kind of model. (Python side:
//! identification/frequency_domain/fit.py)

use flightid_core::CoreError;
use flightid_core::fits::least_squares::{Minimum, Options};
use flightid_core::frequency_domain::frequency_fit::{
    Cost, FrequencyFit, Measured, Whitening, minimise_from,
};
use flightid_core::frequency_domain::response_model::ResponseModel;
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::least_squares::{Ending, ending};
use crate::interrupt;
use crate::row_major::{RowMajor1, RowMajor2};

/// Frequencies, response, square roots of the weights of decibels and degrees.
pub type Response<'py> =
    (RowMajor1<'py, f64>, RowMajor1<'py, Complex64>, RowMajor1<'py, f64>, RowMajor1<'py, f64>);
/// First response, number of responses and matrix of a whitening.
pub type Run<'py> = (usize, usize, RowMajor2<'py, f64>);

/// Starts, bounds and limit of a search.
pub struct Search<'py> {
    /// Rows are starts.
    pub starts: RowMajor2<'py, f64>,
    /// Lower bounds.
    pub lower: RowMajor1<'py, f64>,
    /// Upper bounds.
    pub upper: RowMajor1<'py, f64>,
    /// Most steps of each start.
    pub maximum_iterations: usize,
    /// Whether the slopes where the last of them leads are asked for.
    pub last_slopes: bool,
}

/// Measured responses, copied out of NumPy.
///
/// # Errors
/// NumPy's own.
pub fn measured(data: Vec<Response<'_>>) -> PyResult<Vec<Measured>> {
    data.into_iter()
        .map(|(omega, response, weight_db, weight_deg)| {
            Ok(Measured {
                omega: omega.as_slice()?.to_vec(),
                response: response.as_slice()?.to_vec(),
                weight_db: weight_db.as_slice()?.to_vec(),
                weight_deg: weight_deg.as_slice()?.to_vec(),
            })
        })
        .collect()
}

fn whitenings(runs: Vec<Run<'_>>) -> PyResult<Vec<Whitening>> {
    let copied = |(first, count, matrix): Run<'_>| {
        Ok(Whitening { first, count, matrix: matrix.as_slice()?.to_vec() })
    };
    runs.into_iter().map(copied).collect()
}

/// Responses that are fitted together with records: data, and the whitening of their errors.
pub type WhitenedResponses<'py> = (Vec<Response<'py>>, Vec<Run<'py>>);

/// The same, copied out of NumPy.
pub struct Beside {
    data: Vec<Measured>,
    cost: Cost,
}

impl Beside {
    /// Copy.
    ///
    /// # Errors
    /// NumPy's own.
    pub fn new((data, runs): WhitenedResponses<'_>) -> PyResult<Self> {
        Ok(Self { data: measured(data)?, cost: Cost::Whitened(whitenings(runs)?) })
    }

    /// Frequencies of all responses.
    pub fn omega(&self) -> impl Iterator<Item = f64> + '_ {
        self.data.iter().flat_map(|each| each.omega.iter().copied())
    }

    /// A model on these responses.
    ///
    /// # Errors
    /// Where they do not belong together.
    pub fn fit<M: ResponseModel>(&self, model: M) -> PyResult<FrequencyFit<'_, M>> {
        FrequencyFit::new(model, &self.data, &self.cost).map_err(from_core)
    }
}

/// H(jω) of each response of a prepared model, shape (n_responses, n_freqs).
///
/// # Errors
/// NumPy's own.
pub fn responses<'py>(
    py: Python<'py>,
    model: &impl ResponseModel,
    omega: &[f64],
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    let n = model.n_responses();
    let mut result = vec![Complex64::default(); n * omega.len()];
    for (index, row) in result.chunks_exact_mut(omega.len().max(1)).enumerate() {
        model.responses(index, omega, row, None);
    }
    result.into_pyarray(py).reshape([n, omega.len()])
}

/// Derivative of log H of a model prepared with gradient, shape (n_responses, n_freqs, n_free).
///
/// # Errors
/// NumPy's own.
pub fn log_gradients<'py>(
    py: Python<'py>,
    model: &impl ResponseModel,
    omega: &[f64],
) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
    let (n, n_free) = (model.n_responses(), model.n_free());
    let mut result = vec![Complex64::default(); n * omega.len() * n_free];
    let mut values = vec![Complex64::default(); omega.len()];
    for (index, rows) in result.chunks_exact_mut((omega.len() * n_free).max(1)).enumerate() {
        model.responses(index, omega, &mut values, Some(rows));
    }
    result.into_pyarray(py).reshape([n, omega.len(), n_free])
}

/// Minimum from each start, or the words of the error that stopped it.
///
/// # Errors
/// Where data, weights and model do not belong together, or the user interrupts.
pub fn search<'py>(
    py: Python<'py>,
    model: impl ResponseModel + Clone + Send + Sync,
    data: &[Measured],
    whitening: Vec<Run<'_>>,
    search: &Search<'py>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let runs = whitenings(whitening)?;
    let cost = if runs.is_empty() { Cost::DecibelPhase } else { Cost::Whitened(runs) };
    let width = model.n_free().max(1);
    let fit = FrequencyFit::new(model, data, &cost).map_err(from_core)?;
    let starts: Vec<_> =
        search.starts.as_slice()?.chunks_exact(width).map(<[f64]>::to_vec).collect();
    let (lower, upper) = (search.lower.as_slice()?, search.upper.as_slice()?);
    let options = Options {
        maximum_iterations: search.maximum_iterations,
        last_slopes: search.last_slopes,
        ..Options::default()
    };
    let work =
        |stop: interrupt::Stop<'_>| minimise_from(&fit, &starts, lower, upper, &options, stop);
    let found = if starts.len() == 1 {
        interrupt::run_here(py, work)?
    } else {
        interrupt::run_beside(py, work)?
    };
    found.into_iter().map(|each| outcome(py, each)).collect()
}

fn outcome<'py>(py: Python<'py>, found: Result<Minimum, CoreError>) -> PyResult<Bound<'py, PyAny>> {
    match found {
        Ok(minimum) => {
            let values: Ending<'py> = ending(py, minimum)?;
            Ok(values.into_pyobject(py)?.into_any())
        }
        // A wrong shape is the caller's fault; anything else belongs to this start alone.
        Err(error @ (CoreError::Shape { .. } | CoreError::Range { .. })) => Err(from_core(error)),
        Err(error) => Ok(error.to_string().into_pyobject(py)?.into_any()),
    }
}
