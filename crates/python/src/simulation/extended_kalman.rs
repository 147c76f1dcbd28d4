//! Face of `flightid_core::trajectories::extended_kalman`. (Python side:
//! identification/filter_error/extended_kalman.py)

use flightid_core::trajectories::extended_kalman::{
    Belief, Constants, Filtered, Whitened, filter, slopes,
};
use flightid_core::trajectories::runge_kutta::Course;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::fits::output_error::hold as named;
use crate::interrupt::run_beside;
use crate::models::state_space::StateSpace;
use crate::row_major::{RowMajor1, RowMajor2, RowMajor3};

type Matrix<'py> = Bound<'py, PyArray2<f64>>;
type Found<'py> = (
    (Matrix<'py>, Bound<'py, PyArray3<f64>>, Matrix<'py>),
    (Matrix<'py>, Bound<'py, PyArray1<f64>>),
);
type FoundWithSlopes<'py> = (Found<'py>, (Matrix<'py>, Matrix<'py>));
type Start<'py> = (RowMajor1<'py, f64>, RowMajor2<'py, f64>, Vec<usize>, Vec<usize>);
type Ahead<'py> =
    (RowMajor2<'py, f64>, RowMajor3<'py, f64>, RowMajor2<'py, f64>, RowMajor2<'py, f64>);

/// extended_filter(model: StateSpace, values: NDArray[np.float64], inputs: NDArray[np.float64], measured: NDArray[np.float64], sampling: tuple[float, str, int], start: tuple[NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int]], noise: tuple[NDArray[np.float64], NDArray[np.float64]]) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]
///
/// Innovations (n_samples, p), triangles of their covariances (n_samples, p, p) and predicted states
/// with constants (n_samples, size) on inputs (m, n_samples) and outputs (n_samples, p); then the
/// whitened innovations (n_samples, p) and the mean logarithms of the triangles' diagonals (p).
/// Sampling is sample time, hold and steps in a sample; a start is the mean of states, constants of
/// inputs and of outputs, its covariance, and which inputs and outputs have a constant; noise is the
/// densities of the process and the variances of the outputs.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn extended_filter<'py>(
    py: Python<'py>,
    model: &StateSpace,
    values: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    measured: RowMajor2<'py, f64>,
    sampling: (f64, String, usize),
    start: Start<'py>,
    noise: (RowMajor1<'py, f64>, RowMajor1<'py, f64>),
) -> PyResult<Found<'py>> {
    let (sample_s, hold, substeps) = (sampling.0, named(&sampling.1)?, sampling.2);
    let n_samples = inputs.as_array().ncols();
    let course = Course { inputs: inputs.as_slice()?, n_samples, sample_s, hold, substeps };
    let (belief, constants) = (belief(&values, &start, &noise)?, constants(&start));
    let (measured, tape) = (measured.as_slice()?, &model.tape);
    let (p, size) = (tape.n_outputs(), belief.state.len());
    let (found, white) =
        py.detach(|| filter(tape, &course, measured, &belief, &constants)).map_err(from_core)?;
    shaped(py, (found, white), (n_samples, p, size))
}

/// extended_filter_slopes(model: StateSpace, values: NDArray[np.float64], inputs: NDArray[np.float64], measured: NDArray[np.float64], sampling: tuple[float, str, int], start: tuple[NDArray[np.float64], NDArray[np.float64], Sequence[int], Sequence[int]], noise: tuple[NDArray[np.float64], NDArray[np.float64]], ahead: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]) -> tuple[tuple[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]], tuple[NDArray[np.float64], NDArray[np.float64]]]
///
/// What `extended_filter` finds, and exact derivatives of the whitened innovations (n_samples p, k)
/// and of the mean logarithms (p, k) along k directions: how values (k, n), the covariance of the
/// start (k, size, size), densities (k, n_states) and variances (k, p) change.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn extended_filter_slopes<'py>(
    py: Python<'py>,
    model: &StateSpace,
    values: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    measured: RowMajor2<'py, f64>,
    sampling: (f64, String, usize),
    start: Start<'py>,
    noise: (RowMajor1<'py, f64>, RowMajor1<'py, f64>),
    ahead: Ahead<'py>,
) -> PyResult<FoundWithSlopes<'py>> {
    let (sample_s, hold, substeps) = (sampling.0, named(&sampling.1)?, sampling.2);
    let n_samples = inputs.as_array().ncols();
    let course = Course { inputs: inputs.as_slice()?, n_samples, sample_s, hold, substeps };
    let (belief, constants) = (belief(&values, &start, &noise)?, constants(&start));
    let (measured, tape) = (measured.as_slice()?, &model.tape);
    let parts =
        [ahead.0.as_slice()?, ahead.1.as_slice()?, ahead.2.as_slice()?, ahead.3.as_slice()?];
    let (count, still) = (ahead.0.as_array().nrows(), vec![0.0; belief.state.len()]);
    let row = |part: usize, k: usize| {
        let width = parts[part].len() / count;
        &parts[part][k * width..][..width]
    };
    let direction = |k: usize| Belief {
        parameters: row(0, k),
        state: &still,
        covariance: row(1, k),
        process: row(2, k),
        measurement: row(3, k),
    };
    let directions: Vec<Belief<'_>> = (0..count).map(direction).collect();
    let work = |stop: crate::interrupt::Stop<'_>| {
        slopes(tape, &course, measured, &belief, &constants, &directions, stop)
    };
    let (found, white, ahead) = run_beside(py, work)?.map_err(from_core)?;
    let p = tape.n_outputs();
    Ok((
        shaped(py, (found, white), (n_samples, p, belief.state.len()))?,
        (
            ahead.white.into_pyarray(py).reshape([n_samples * p, count])?,
            ahead.logs.into_pyarray(py).reshape([p, count])?,
        ),
    ))
}

fn shaped<'py>(
    py: Python<'py>,
    (found, white): (Filtered, Whitened<f64>),
    (n_samples, p, size): (usize, usize, usize),
) -> PyResult<Found<'py>> {
    Ok((
        (
            found.innovations.into_pyarray(py).reshape([n_samples, p])?,
            found.triangles.into_pyarray(py).reshape([n_samples, p, p])?,
            found.states.into_pyarray(py).reshape([n_samples, size])?,
        ),
        (white.white.into_pyarray(py).reshape([n_samples, p])?, white.logs.into_pyarray(py)),
    ))
}

fn belief<'a>(
    values: &'a RowMajor1<'_, f64>,
    start: &'a Start<'_>,
    noise: &'a (RowMajor1<'_, f64>, RowMajor1<'_, f64>),
) -> PyResult<Belief<'a>> {
    Ok(Belief {
        parameters: values.as_slice()?,
        state: start.0.as_slice()?,
        covariance: start.1.as_slice()?,
        process: noise.0.as_slice()?,
        measurement: noise.1.as_slice()?,
    })
}

fn constants<'a>(start: &'a Start<'_>) -> Constants<'a> {
    Constants { shifted: &start.2, biased: &start.3 }
}

/// Add this area to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(extended_filter, module)?)?;
    module.add_function(wrap_pyfunction!(extended_filter_slopes, module)?)
}
