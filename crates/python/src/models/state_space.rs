//! Face of `flightid_core::state_space::model_tape` and `frequency_domain::state_space_response`.
//! (Python side: models/state_space/model.py)

use std::collections::BTreeMap;

use flightid_core::frequency_domain::frequency_fit::FrequencyFit;
use flightid_core::frequency_domain::response_model::ResponseModel;
use flightid_core::frequency_domain::state_space_response::FreeStateSpace;
use flightid_core::output_error::state_space_family::StateSpaceFamily;
use flightid_core::state_space::model_samples::sample;
use flightid_core::state_space::model_tape::{ModelTape, ModelText};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::frequency_fit::{
    Beside, Response, Run, Search, WhitenedResponses, log_gradients, measured, responses, search,
};
use crate::fits::least_squares::WrittenResiduals;
use crate::fits::output_error::{
    self, Flown, NoiseArguments, OnRecord, Own, SearchArguments, linear, record_data,
};
use crate::models::lookup_table::{LookupTable, shared};
use crate::row_major::{RowMajor1, RowMajor2};

/// __init__(self, states: Sequence[str], inputs: Sequence[str], equations: Sequence[tuple[str, str]], outputs: Sequence[str], delays: Sequence[str], names: Sequence[str], definitions: dict[str, str], pairs: Sequence[tuple[int, int]], point: Sequence[float], tables: dict[str, LookupTable] = ...) -> None
///
/// A state-space model: left and right side of each equation, formulas of outputs and of the delay
/// of each input, and the (output, input) pairs whose responses are asked for, at the point ẋ, x, u.
#[pyclass(frozen, module = "flightid._native")]
pub(crate) struct StateSpace {
    pub(crate) tape: ModelTape,
    pairs: Vec<(usize, usize)>,
    point: Vec<f64>,
}

impl StateSpace {
    /// The model on responses, where there are any.
    ///
    /// # Errors
    /// Where they do not belong together.
    pub(crate) fn on<'a>(
        &'a self,
        data: Option<&'a Beside>,
        values: &[f64],
        free: &[usize],
    ) -> PyResult<Option<FrequencyFit<'a, FreeStateSpace<'a>>>> {
        let made = |data: &'a Beside| {
            let (tape, point) = (&self.tape, &self.point);
            let model = FreeStateSpace::new(tape, &self.pairs, point, values, free, data.omega());
            data.fit(model.map_err(from_core)?)
        };
        data.map(made).transpose()
    }

    fn prepared(
        &self,
        values: &[f64],
        free: &[usize],
        omega: &[f64],
        with_gradient: bool,
    ) -> PyResult<FreeStateSpace<'_>> {
        let omega = omega.iter().copied();
        let mut model =
            FreeStateSpace::new(&self.tape, &self.pairs, &self.point, values, free, omega)
                .map_err(from_core)?;
        let start: Vec<f64> = free.iter().map(|&index| values[index]).collect();
        model.prepare(&start, with_gradient).map_err(from_core)?;
        Ok(model)
    }
}

#[pymethods]
impl StateSpace {
    #[new]
    #[pyo3(signature = (states, inputs, equations, outputs, delays, names, definitions, pairs, point, tables = BTreeMap::new()))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        states: Vec<String>,
        inputs: Vec<String>,
        equations: Vec<(String, String)>,
        outputs: Vec<String>,
        delays: Vec<String>,
        names: Vec<String>,
        definitions: BTreeMap<String, String>,
        pairs: Vec<(usize, usize)>,
        point: Vec<f64>,
        tables: BTreeMap<String, Py<LookupTable>>,
    ) -> PyResult<Self> {
        let parameters = names;
        let tables = shared(tables);
        let text = ModelText {
            states,
            inputs,
            equations,
            outputs,
            delays,
            parameters,
            definitions,
            tables,
        };
        Ok(Self { tape: ModelTape::new(&text).map_err(from_core)?, pairs, point })
    }

    /// linearise(self, values: NDArray[np.float64], point: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]
    ///
    /// Residuals, outputs and delays at a point ẋ, x, u, and the derivatives of residuals and
    /// outputs, shape (n_states + n_outputs, 2 n_states + n_inputs).
    #[allow(clippy::type_complexity)]
    fn linearise<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        point: RowMajor1<'_, f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)> {
        let found =
            self.tape.linearise(point.as_slice()?, values.as_slice()?).map_err(from_core)?;
        let shape = [self.tape.height(), self.tape.width()];
        Ok((found.values.into_pyarray(py), found.slopes.into_pyarray(py).reshape(shape)?))
    }

    /// sensitivities(self, values: NDArray[np.float64], point: NDArray[np.float64], free: Sequence[int]) -> NDArray[np.float64]
    ///
    /// Exact derivatives of what `linearise` returns second, by some of the values, shape (n_free,
    /// n_states + n_outputs, 2 n_states + n_inputs).
    fn sensitivities<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        point: RowMajor1<'_, f64>,
        free: Vec<usize>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (height, width) = (self.tape.height(), self.tape.width());
        let found = self
            .tape
            .sensitivities(point.as_slice()?, values.as_slice()?, &free)
            .map_err(from_core)?;
        let mut dense = vec![0.0; free.len() * height * width];
        for each in found {
            dense[(each.parameter * height + each.row) * width + each.column] = each.value;
        }
        dense.into_pyarray(py).reshape([free.len(), height, width])
    }

    /// curvatures(self, values: NDArray[np.float64], point: NDArray[np.float64], free: Sequence[int]) -> tuple[NDArray[np.int64], NDArray[np.float64]]
    ///
    /// Exact second derivatives, by pairs of values, of what `linearise` returns second and of the
    /// delays: places (row, column, first, second; delays are the last rows, column 0) and values.
    #[allow(clippy::type_complexity)]
    fn curvatures<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        point: RowMajor1<'_, f64>,
        free: Vec<usize>,
    ) -> PyResult<(Bound<'py, PyArray2<i64>>, Bound<'py, PyArray1<f64>>)> {
        let found = self
            .tape
            .curvatures(point.as_slice()?, values.as_slice()?, &free)
            .map_err(from_core)?;
        let places: Vec<i64> = found
            .iter()
            .flat_map(|each| [each.row, each.column, each.first, each.second])
            .map(|place| place as i64)
            .collect();
        let numbers: Vec<f64> = found.iter().map(|each| each.value).collect();
        Ok((places.into_pyarray(py).reshape([found.len(), 4])?, numbers.into_pyarray(py)))
    }

    /// sample(self, values: NDArray[np.float64], points: NDArray[np.float64], directions: Sequence[int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]
    ///
    /// Residuals and outputs at points ẋ, x, u, shape (n_samples, 2 n_states + n_inputs), and their
    /// derivatives, shape (n_samples, n_states + n_outputs, n_directions); a direction is a place
    /// among the entries of a point and the values.
    #[allow(clippy::type_complexity)]
    fn sample<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        points: RowMajor2<'_, f64>,
        directions: Vec<usize>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
        let count = points.as_array().nrows();
        let (points, values) = (points.as_slice()?, values.as_slice()?);
        let found =
            py.detach(|| sample(&self.tape, points, values, &directions)).map_err(from_core)?;
        let shape = [count, self.tape.height(), directions.len()];
        Ok((
            found.values.into_pyarray(py).reshape([shape[0], shape[1]])?,
            found.slopes.into_pyarray(py).reshape(shape)?,
        ))
    }

    /// response(self, values: NDArray[np.float64], omega_rad_s: NDArray[np.float64]) -> NDArray[np.complex128]
    ///
    /// H(jω) of each pair, shape (n_responses, n_freqs).
    fn response<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'_, f64>,
        omega_rad_s: RowMajor1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
        let omega = omega_rad_s.as_slice()?;
        responses(py, &self.prepared(values.as_slice()?, &[], omega, false)?, omega)
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
        let omega = omega_rad_s.as_slice()?;
        log_gradients(py, &self.prepared(values.as_slice()?, &free, omega, true)?, omega)
    }

    /// fit(self, values: NDArray[np.float64], free: Sequence[int], data: Sequence[tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]], whitening: Sequence[tuple[int, int, NDArray[np.float64]]], starts: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64], maximum_iterations: int, last_slopes: bool = ...) -> list[tuple[NDArray[np.float64], float, NDArray[np.float64], NDArray[np.float64], int, str] | str]
    ///
    /// As `TransferFunctions.fit`.
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
        let data = measured(data)?;
        let omega = data.iter().flat_map(|each| each.omega.iter().copied());
        let values = values.as_slice()?;
        let model = FreeStateSpace::new(&self.tape, &self.pairs, &self.point, values, &free, omega)
            .map_err(from_core)?;
        let wanted = Search { starts, lower, upper, maximum_iterations, last_slopes };
        search(py, model, &data, whitening, &wanted)
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
        let family = StateSpaceFamily::new(&self.tape, &self.point, values.as_slice()?, &free);
        let trajectories = linear(family, &records, hold)?;
        let beside = responses.map(Beside::new).transpose()?;
        let beside = self.on(beside.as_ref(), values.as_slice()?, &free)?;
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
        let family = StateSpaceFamily::new(&self.tape, &self.point, values, &free);
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
        let family = StateSpaceFamily::new(&self.tape, &self.point, values, &free);
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
        let family = StateSpaceFamily::new(&self.tape, &self.point, values, &free);
        let on = OnRecord::new(family, (values, &free), (record, own), hold)?;
        output_error::slope_step(py, &on.trajectories, &on.data[0], &on.theta, left, step)
    }
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<StateSpace>()
}
