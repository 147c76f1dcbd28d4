//! Face of `flightid_core::output_error::nonlinear_output_error`. (Python side:
//! identification/output_error/equation_records.py)

use flightid_core::output_error::model_on_records::Wanted;
use flightid_core::output_error::nonlinear_output_error::{EquationTrajectories, Passage};
use flightid_core::output_error::record_data::RecordData;
use flightid_core::output_error::record_data::RecordInputs;
use flightid_core::state_space::ode_model::OdeModel;
use flightid_core::trajectories::shooting::Plan;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::frequency_fit::{Beside, WhitenedResponses};
use crate::fits::least_squares::WrittenResiduals;
use crate::fits::output_error::{
    Flown, NoiseArguments, Own, SearchArguments, driven, fit, hold as named, record_data, run,
};
use crate::models::state_space::StateSpace;
use crate::row_major::{RowMajor1, RowMajor2};

/// Cuts, conditions at the ends, how many of them at the end, guesses of the nodes.
type Segments<'py> = (Vec<usize>, RowMajor2<'py, f64>, usize, RowMajor2<'py, f64>);

/// __init__(self, model: StateSpace, substeps: Sequence[int], segments: Sequence[tuple[Sequence[int], NDArray[np.float64], int, NDArray[np.float64]]]) -> None
///
/// A model's equations on records: Runge-Kutta steps in a sample interval and segments of each. A
/// record without cuts and without conditions at its end is run whole from its initial state.
#[pyclass(frozen, module = "flightid._native")]
struct EquationRecords {
    model: Py<StateSpace>,
    ode: OdeModel,
    substeps: Vec<usize>,
    plans: Vec<Plan>,
}

impl EquationRecords {
    fn on(
        &self,
        places: std::ops::Range<usize>,
        values: &[f64],
        free: &[usize],
        records: &[Flown<'_>],
        hold: &str,
    ) -> PyResult<EquationTrajectories> {
        let known = self.substeps.iter().zip(&self.plans).skip(places.start);
        let passages = driven(records)?
            .into_iter()
            .zip(known)
            .map(|(driven, (&substeps, plan)): (RecordInputs, _)| Passage {
                driven,
                substeps,
                plan: plan.clone(),
            })
            .collect();
        let ode = self.ode.clone();
        EquationTrajectories::new(ode, values, free, named(hold)?, passages).map_err(from_core)
    }
}

#[pymethods]
impl EquationRecords {
    #[new]
    fn new(
        model: Py<StateSpace>,
        substeps: Vec<usize>,
        segments: Vec<Segments<'_>>,
    ) -> PyResult<Self> {
        let plans = segments
            .into_iter()
            .map(|(cuts, ends, n_growing, guesses)| {
                let (ends, guesses) = (ends.as_slice()?.to_vec(), guesses.as_slice()?.to_vec());
                Ok(Plan { cuts, ends, n_growing, guesses })
            })
            .collect::<PyResult<_>>()?;
        let ode = OdeModel::new(&model.get().tape).map_err(from_core)?;
        Ok(Self { model, ode, substeps, plans })
    }

    /// fit_records(self, values: NDArray[np.float64], free: Sequence[int], records: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], float]], own: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]]], hold: str, noise: tuple[bool, float, float], search: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int], responses: tuple[Sequence[tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]], Sequence[tuple[int, int, NDArray[np.float64]]]] | None = ..., written: tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], Callable[[NDArray[np.float64]], NDArray[np.float64]], int] | None = ...) -> list[tuple[NDArray[np.float64], float, NDArray[np.float64], list[NDArray[np.float64]], list[list[bool]], int, str] | str]
    ///
    /// As `StateSpace.fit_records`.
    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (values, free, records, own, hold, noise, search, responses = None, written = None))]
    fn fit_records<'py>(
        &self,
        py: Python<'py>,
        values: RowMajor1<'py, f64>,
        free: Vec<usize>,
        records: Vec<Flown<'py>>,
        own: Vec<Own<'py>>,
        hold: &str,
        noise: NoiseArguments,
        search: SearchArguments<'py>,
        responses: Option<WhitenedResponses<'py>>,
        written: Option<WrittenResiduals<'py>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let places = 0..records.len();
        let model = self.on(places, values.as_slice()?, &free, &records, hold)?;
        let beside = responses.map(Beside::new).transpose()?;
        let beside = self.model.get().on(beside.as_ref(), values.as_slice()?, &free)?;
        fit(py, &model, &record_data(&records, own)?, noise, beside.as_ref(), written, search)
    }

    /// run_record(self, place: int, values: NDArray[np.float64], free: Sequence[int], record: tuple[NDArray[np.float64], NDArray[np.float64], float], own: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]], hold: str, with_slopes: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]
    ///
    /// As `StateSpace.run_record`, for the record at a place.
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn run_record<'py>(
        &self,
        py: Python<'py>,
        place: usize,
        values: RowMajor1<'py, f64>,
        free: Vec<usize>,
        record: Flown<'py>,
        own: Own<'py>,
        hold: &str,
        with_slopes: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
        let (values, records) = (values.as_slice()?, [record]);
        let model = self.on(place..place + 1, values, &free, &records, hold)?;
        let theta: Vec<f64> = free.iter().map(|&index| values[index]).collect();
        run(py, &model, &record_data(&records, vec![own])?, 0, &theta, with_slopes)
    }

    /// start_of_record(self, place: int, values: NDArray[np.float64], free: Sequence[int], record: tuple[NDArray[np.float64], NDArray[np.float64], float], own: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int], Sequence[int], Sequence[tuple[float, float]]], hold: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]
    ///
    /// State at the first sample, and its derivatives by the free values, the record's free initial
    /// numbers and its free shifts, shape (n_states, columns).
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn start_of_record<'py>(
        &self,
        py: Python<'py>,
        place: usize,
        values: RowMajor1<'py, f64>,
        free: Vec<usize>,
        record: Flown<'py>,
        own: Own<'py>,
        hold: &str,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)> {
        let (values, records) = (values.as_slice()?, [record]);
        let model = self.on(place..place + 1, values, &free, &records, hold)?;
        let theta: Vec<f64> = free.iter().map(|&index| values[index]).collect();
        let data = record_data(&records, vec![own])?;
        let RecordData { initial, shift, free_initial, free_shift, .. } = &data[0];
        let wanted = Wanted { theta: true, initial: free_initial, shift: free_shift };
        let (state, slopes) = model.start(0, &theta, initial, shift, &wanted).map_err(from_core)?;
        let shape = [state.len(), slopes.len() / state.len().max(1)];
        Ok((state.into_pyarray(py), slopes.into_pyarray(py).reshape(shape)?))
    }
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<EquationRecords>()
}
