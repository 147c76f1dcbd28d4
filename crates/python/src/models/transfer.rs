//! Face of `flightid_core::frequency_domain::transfer` and `frequency_fit`. (Python side:
//! models/transfer/model.py)

use std::collections::BTreeMap;

use flightid_core::frequency_domain::response_model::ResponseModel;
use flightid_core::frequency_domain::transfer::{
    FreeTransfer, ResponseText, TransferFunctions as Functions,
};
use flightid_core::output_error::transfer_family::TransferFamily;
use num_complex::Complex64;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::frequency_fit::{
    Beside, Response, Run, Search, WhitenedResponses, log_gradients, measured, responses, search,
};
use crate::fits::least_squares::WrittenResiduals;
use crate::fits::output_error::{
    self, Flown, NoiseArguments, OnRecord, Own, SearchArguments, linear, record_data,
};
use crate::row_major::{RowMajor1, RowMajor2};

type Text = (String, Vec<String>, Vec<String>, String);
type Numbers = (f64, Vec<Vec<f64>>, Vec<Vec<f64>>, f64);

/// __init__(self, responses: Sequence[tuple[str, Sequence[str], Sequence[str], str]], names: Sequence[str], definitions: dict[str, str], pairs: Sequence[tuple[int, int]]) -> None
///
/// Transfer functions (gain, numerator factors, denominator factors, delay) of the same names, and
/// the places of output and input of each.
#[pyclass(frozen, module = "flightid._native")]
struct TransferFunctions {
    functions: Functions,
    pairs: Vec<(usize, usize)>,
}

#[pymethods]
impl TransferFunctions {
    #[new]
    fn new(
        responses: Vec<Text>,
        names: Vec<String>,
        definitions: BTreeMap<String, String>,
        pairs: Vec<(usize, usize)>,
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
        Ok(Self { functions, pairs })
    }

    /// factored(self, values: NDArray[np.float64]) -> list[tuple[float, list[list[float]], list[list[float]], float]]
    ///
    /// Gain, numerator and denominator factors (ascending powers of s) and delay of each response.
    fn factored(&self, values: RowMajor1<'_, f64>) -> PyResult<Vec<Numbers>> {
        let found = self.functions.factored(values.as_slice()?).map_err(from_core)?;
        Ok(found.into_iter().map(|f| (f.gain, f.numerator, f.denominator, f.delay)).collect())
    }

    /// response(self, values: NDArray[np.float64], omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]
    ///
    /// H(jω) of each response, shape (n_responses, n_freqs).
    fn response<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        omega_rad_s: RowMajor1<'_, f64>,
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
        values: RowMajor1<'_, f64>,
        free: Vec<usize>,
        omega_rad_s: RowMajor1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
        let values = values.as_slice()?;
        let mut model = FreeTransfer::new(&self.functions, values, &free).map_err(from_core)?;
        let start: Vec<f64> = free.iter().map(|&index| values[index]).collect();
        model.prepare(&start, true).map_err(from_core)?;
        log_gradients(py, &model, omega_rad_s.as_slice()?)
    }

    /// fit(self, values: NDArray[np.float64], free: Sequence[int], data: Sequence[tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]], whitening: Sequence[tuple[int, int, NDArray[np.float64]]], starts: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64], maximum_iterations: int, last_slopes: bool = ...) -> list[tuple[NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64], int, str] | str]
    ///
    /// Minimum from each start (x, cost, residuals, Jacobian, iterations, termination), or the words
    /// of the error that stopped it. Data are (omega, response, weight of dB, weight of degrees), the
    /// weights as square roots; without whitening runs the cost is that of decibels and degrees. Where
    /// the last slopes are not asked for, an end after the most steps has neither residuals nor Jacobian.
    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (values, free, data, whitening, starts, lower, upper, maximum_iterations, last_slopes = true))]
    fn fit<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        free: Vec<usize>,
        data: Vec<Response<'_>>,
        whitening: Vec<Run<'_>>,
        starts: RowMajor2<'py, f64>,
        lower: RowMajor1<'py, f64>,
        upper: RowMajor1<'py, f64>,
        maximum_iterations: usize,
        last_slopes: bool,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let model =
            FreeTransfer::new(&self.functions, values.as_slice()?, &free).map_err(from_core)?;
        let wanted = Search { starts, lower, upper, maximum_iterations, last_slopes };
        search(py, model, &measured(data)?, whitening, &wanted)
    }

    /// fit_records(self, values: NDArray[np.float64], free: Sequence[int], records: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], float]], own: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]]], hold: str, noise: tuple[bool, float, float], search: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int], responses: tuple[Sequence[tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]], Sequence[tuple[int, int, NDArray[np.float64]]]] | None = ..., written: tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], Callable[[NDArray[np.float64]], NDArray[np.float64]], int] | None = ...) -> list[tuple[NDArray[np.float64], float, NDArray[np.float64], list[NDArray[np.float64]], list[list[bool]], int, str] | str]
    ///
    /// Output error from each start (θ, objective, noise covariance, each record's own numbers and
    /// whether they are determined, iterations, termination), or the words of the error that stopped
    /// it. A record is (inputs, outputs, sample time); its own numbers are (initial state, input
    /// shifts, output biases, free entries of each); noise is (full, limit of the loss, consistency);
    /// a search is (starts, lower, upper, most steps). Responses (data, whitening runs) add the sum of
    /// their whitened squares; so do residuals written in Python (residuals, Jacobian, how many).
    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (values, free, records, own, hold, noise, search, responses = None, written = None))]
    fn fit_records<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        free: Vec<usize>,
        records: Vec<Flown<'_>>,
        own: Vec<Own<'_>>,
        hold: &str,
        noise: NoiseArguments,
        search: SearchArguments<'py>,
        responses: Option<WhitenedResponses<'py>>,
        written: Option<WrittenResiduals<'py>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let family = TransferFamily::new(&self.functions, &self.pairs, values.as_slice()?, &free);
        let trajectories = linear(family, &records, hold)?;
        let beside = responses.map(Beside::new).transpose()?;
        let model = FreeTransfer::new(&self.functions, values.as_slice()?, &free);
        let model = model.map_err(from_core)?;
        let beside = beside.as_ref().map(|data| data.fit(model)).transpose()?;
        let data = record_data(&records, own)?;
        output_error::fit(py, &trajectories, &data, noise, beside.as_ref(), written, search)
    }

    /// run_record(self, values: NDArray[np.float64], free: Sequence[int], record: tuple[NDArray[np.float64], NDArray[np.float64], float], own: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]], hold: str, with_slopes: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]
    ///
    /// Outputs (n_outputs, n_samples) without bias and, if asked, their derivatives by θ, free
    /// initial states, free shifts and free biases (n_outputs, n_samples, columns).
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn run_record<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        free: Vec<usize>,
        record: Flown<'_>,
        own: Own<'_>,
        hold: &str,
        with_slopes: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
        let values = values.as_slice()?;
        let family = TransferFamily::new(&self.functions, &self.pairs, values, &free);
        let on = OnRecord::new(family, (values, &free), (record, own), hold)?;
        output_error::run(py, &on.trajectories, &on.data, 0, &on.theta, with_slopes)
    }

    /// slope_products(self, values: NDArray[np.float64], free: Sequence[int], record: tuple[NDArray[np.float64], NDArray[np.float64], float], own: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]], hold: str, left: NDArray[np.float64] | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]
    ///
    /// Residuals (n_outputs, n_samples), those of the run where none are given, and products of all
    /// columns that `run_record` gives, residuals last, of each output (n_outputs, k + 1, k + 1).
    #[allow(clippy::too_many_arguments)]
    fn slope_products<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        free: Vec<usize>,
        record: Flown<'_>,
        own: Own<'_>,
        hold: &str,
        left: Option<RowMajor2<'py, f64>>,
    ) -> PyResult<output_error::Summed<'py>> {
        let values = values.as_slice()?;
        let family = TransferFamily::new(&self.functions, &self.pairs, values, &free);
        let on = OnRecord::new(family, (values, &free), (record, own), hold)?;
        output_error::slope_products(py, &on.trajectories, &on.data[0], &on.theta, left)
    }

    /// slope_step(self, values: NDArray[np.float64], free: Sequence[int], record: tuple[NDArray[np.float64], NDArray[np.float64], float], own: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]], hold: str, left: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]
    ///
    /// What a step of all columns that `run_record` gives leaves of residuals, to first order.
    #[allow(clippy::too_many_arguments)]
    fn slope_step<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        free: Vec<usize>,
        record: Flown<'_>,
        own: Own<'_>,
        hold: &str,
        left: RowMajor2<'py, f64>,
        step: RowMajor1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let values = values.as_slice()?;
        let family = TransferFamily::new(&self.functions, &self.pairs, values, &free);
        let on = OnRecord::new(family, (values, &free), (record, own), hold)?;
        output_error::slope_step(py, &on.trajectories, &on.data[0], &on.theta, left, step)
    }
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<TransferFunctions>()
}
