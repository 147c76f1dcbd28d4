//! Face of `flightid_core::transfer` and `frequency_fit`. (Python side: models/transfer.py)

use std::collections::BTreeMap;

use flightid_core::frequency_fit::ResponseModel;
use flightid_core::transfer::{FreeTransfer, ResponseText, TransferFunctions as Functions};
use num_complex::Complex64;
use numpy::{PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::frequency_fit::{Response, Run, Search, log_gradients, measured, responses, search};

type Text = (String, Vec<String>, Vec<String>, String);
type Numbers = (f64, Vec<Vec<f64>>, Vec<Vec<f64>>, f64);

/// __init__(self, responses: Sequence[tuple[str, Sequence[str], Sequence[str], str]], names: Sequence[str], definitions: dict[str, str]) -> None
///
/// Transfer functions (gain, numerator factors, denominator factors, delay) of the same names.
#[pyclass(frozen, module = "flightid._native")]
struct TransferFunctions {
    functions: Functions,
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
        responses(py, &model, omega_rad_s.as_slice()?)
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
        log_gradients(py, &model, omega_rad_s.as_slice()?)
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
        starts: PyReadonlyArray2<'py, f64>,
        lower: PyReadonlyArray1<'py, f64>,
        upper: PyReadonlyArray1<'py, f64>,
        maximum_iterations: usize,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let model =
            FreeTransfer::new(&self.functions, values.as_slice()?, &free).map_err(from_core)?;
        let wanted = Search { starts, lower, upper, maximum_iterations };
        search(py, model, &measured(data)?, whitening, &wanted)
    }
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<TransferFunctions>()
}
