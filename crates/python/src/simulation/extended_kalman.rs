//! Face of `flightid_core::trajectories::extended_kalman`. (Python side:
//! identification/filter_error/extended_kalman.py)

use flightid_core::state_space::ode_model::OdeModel;
use flightid_core::trajectories::extended_kalman::{Belief, filter};
use flightid_core::trajectories::runge_kutta::Course;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::output_error::hold as named;
use crate::models::state_space::StateSpace;

type Found<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);
type Start<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>, Vec<usize>, Vec<usize>);

/// extended_filter(model: StateSpace, values: NDArray[np.float64], inputs: NDArray[np.float64], measured: NDArray[np.float64], sampling: tuple[float, str, int], start: tuple[NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int]], noise: tuple[NDArray[np.float64], NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
///
/// Innovations (n_samples, p), triangles of their covariances (n_samples, p, p) and predicted states
/// with constants (n_samples, size) on inputs (m, n_samples) and outputs (n_samples, p). Sampling is
/// sample time, hold and steps in a sample; a start is the mean of states, constants of inputs and of
/// outputs, its covariance, and which inputs and outputs have a constant; noise is the densities of
/// the process and the variances of the outputs.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn extended_filter<'py>(
    py: Python<'py>,
    model: &StateSpace,
    values: PyReadonlyArray1<'py, f64>,
    inputs: PyReadonlyArray2<'py, f64>,
    measured: PyReadonlyArray2<'py, f64>,
    sampling: (f64, String, usize),
    start: Start<'py>,
    noise: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
) -> PyResult<Found<'py>> {
    let (sample_s, hold, substeps) = (sampling.0, named(&sampling.1)?, sampling.2);
    let n_samples = inputs.as_array().ncols();
    let course = Course { inputs: inputs.as_slice()?, n_samples, sample_s, hold, substeps };
    let belief = Belief {
        state: start.0.as_slice()?,
        covariance: start.1.as_slice()?,
        shifted: &start.2,
        biased: &start.3,
        process: noise.0.as_slice()?,
        measurement: noise.1.as_slice()?,
    };
    let (values, measured, tape) = (values.as_slice()?, measured.as_slice()?, &model.tape);
    let (p, size) = (tape.n_outputs(), belief.state.len());
    let found = py
        .detach(|| filter(&OdeModel::new(tape)?, values, &course, measured, &belief))
        .map_err(from_core)?;
    Ok((
        found.innovations.into_pyarray(py).reshape([n_samples, p])?,
        found.triangles.into_pyarray(py).reshape([n_samples, p, p])?,
        found.states.into_pyarray(py).reshape([n_samples, size])?,
    ))
}

/// Add this area to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(extended_filter, module)?)
}
