//! Face of `flightid_core::transfer` and `frequency_fit`. (Python side: models/transfer.py)

use std::collections::BTreeMap;

use flightid_core::CoreError;
use flightid_core::frequency_fit::{
    Cost, FrequencyFit, Measured, ResponseModel, Whitening, minimise_from,
};
use flightid_core::least_squares::Options;
use flightid_core::transfer::{FreeTransfer, ResponseText, TransferFunctions as Functions};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::interrupt;
use crate::least_squares::{Ending, ending};

type Text = (String, Vec<String>, Vec<String>, String);
type Numbers = (f64, Vec<Vec<f64>>, Vec<Vec<f64>>, f64);
type Response<'py> = (
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, Complex64>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
);
type Run<'py> = (usize, usize, PyReadonlyArray2<'py, f64>);

/// __init__(self, responses: Sequence[tuple[str, Sequence[str], Sequence[str], str]], names: Sequence[str], definitions: dict[str, str]) -> None
///
/// Transfer functions (gain, numerator factors, denominator factors, delay) of the same names.
#[pyclass(frozen, module = "flightid._native")]
struct TransferFunctions {
    functions: Functions,
}

fn measured(data: Vec<Response<'_>>) -> PyResult<Vec<Measured>> {
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

#[pymethods]
impl TransferFunctions {
    #[new]
    fn new(
        responses: Vec<Text>,
        names: Vec<String>,
        definitions: BTreeMap<String, String>,
    ) -> PyResult<Self> {
        let responses: Vec<_> = responses
            .into_iter()
            .map(|(gain, numerator, denominator, delay)| ResponseText {
                gain,
                numerator,
                denominator,
                delay,
            })
            .collect();
        let functions = Functions::new(&responses, &names, &definitions).map_err(from_core)?;
        Ok(Self { functions })
    }

    /// factored(self, values: NDArray[np.float64]) -> list[tuple[float, list[list[float]], list[list[float]], float]]
    ///
    /// Gain, numerator and denominator factors (ascending powers of s) and delay of each response.
    fn factored(&self, values: PyReadonlyArray1<'_, f64>) -> PyResult<Vec<Numbers>> {
        let found = self.functions.factored(values.as_slice()?).map_err(from_core)?;
        Ok(found.into_iter().map(|f| (f.gain, f.numerator, f.denominator, f.delay)).collect())
    }

    /// response(self, values: NDArray[np.float64], omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]
    ///
    /// H(jω) of each response, shape (n_responses, n_freqs).
    fn response<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray1<'_, f64>,
        omega_rad_s: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
        let mut model =
            FreeTransfer::new(&self.functions, values.as_slice()?, &[]).map_err(from_core)?;
        model.prepare(&[], false).map_err(from_core)?;
        let omega = omega_rad_s.as_slice()?;
        let n = self.functions.n_responses();
        let mut result = Vec::with_capacity(n * omega.len());
        for index in 0..n {
            result.extend(omega.iter().map(|&each| model.response(index, each, None)));
        }
        result.into_pyarray(py).reshape([n, omega.len()])
    }

    /// log_gradient(self, values: NDArray[np.float64], free: Sequence[int], omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]
    ///
    /// Derivative of log H, shape (n_responses, n_freqs, n_free).
    fn log_gradient<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray1<'_, f64>,
        free: Vec<usize>,
        omega_rad_s: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
        let values = values.as_slice()?;
        let mut model = FreeTransfer::new(&self.functions, values, &free).map_err(from_core)?;
        let start: Vec<f64> = free.iter().map(|&index| values[index]).collect();
        model.prepare(&start, true).map_err(from_core)?;
        let omega = omega_rad_s.as_slice()?;
        let n = self.functions.n_responses();
        let mut result = vec![Complex64::default(); n * omega.len() * free.len()];
        for (place, row) in result.chunks_exact_mut(free.len().max(1)).enumerate() {
            model.response(place / omega.len(), omega[place % omega.len()], Some(row));
        }
        result.into_pyarray(py).reshape([n, omega.len(), free.len()])
    }

    /// fit(self, values: NDArray[np.float64], free: Sequence[int], data: Sequence[tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]], whitening: Sequence[tuple[int, int, NDArray[np.float64]]], starts: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64], maximum_iterations: int) -> list[tuple[NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64], int, str] | str]
    ///
    /// Minimum from each start (x, cost, residuals, Jacobian, iterations, termination), or the words
    /// of the error that stopped it. Data are (omega, response, weight of dB, weight of degrees), the
    /// weights as square roots; without whitening runs the cost is that of decibels and degrees.
    #[allow(clippy::too_many_arguments)]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray1<'_, f64>,
        free: Vec<usize>,
        data: Vec<Response<'_>>,
        whitening: Vec<Run<'_>>,
        starts: PyReadonlyArray2<'_, f64>,
        lower: PyReadonlyArray1<'_, f64>,
        upper: PyReadonlyArray1<'_, f64>,
        maximum_iterations: usize,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let model =
            FreeTransfer::new(&self.functions, values.as_slice()?, &free).map_err(from_core)?;
        let data = measured(data)?;
        let runs = whitening
            .into_iter()
            .map(|(first, count, matrix)| {
                Ok(Whitening { first, count, matrix: matrix.as_slice()?.to_vec() })
            })
            .collect::<PyResult<Vec<_>>>()?;
        let cost = if runs.is_empty() { Cost::DecibelPhase } else { Cost::Whitened(runs) };
        let fit = FrequencyFit::new(model, &data, &cost).map_err(from_core)?;
        let width = free.len().max(1);
        let starts: Vec<_> = starts.as_slice()?.chunks_exact(width).map(<[f64]>::to_vec).collect();
        let (lower, upper) = (lower.as_slice()?, upper.as_slice()?);
        let options = Options { maximum_iterations, ..Options::default() };
        let work =
            |stop: interrupt::Stop<'_>| minimise_from(&fit, &starts, lower, upper, &options, stop);
        let found = if starts.len() == 1 {
            interrupt::run_here(py, work)?
        } else {
            interrupt::run_beside(py, work)?
        };
        found.into_iter().map(|each| outcome(py, each)).collect()
    }
}

fn outcome<'py>(
    py: Python<'py>,
    found: Result<flightid_core::least_squares::Minimum, CoreError>,
) -> PyResult<Bound<'py, PyAny>> {
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

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<TransferFunctions>()
}
