//! Binding of linear simulation (Python side: `simulation/simulate.py`).

use crate::error::from_core;
use crate::fits::output_error::hold as named;
use crate::row_major::{RowMajor1, RowMajor2, RowMajor3};
use flightid_core::error::CoreError;
use flightid_core::linear::discretisation::discretise;
use flightid_core::linear::discretisation::{Hold, StateSpace};
use flightid_core::linear::linear_outputs::outputs;
use flightid_core::linear::linear_response::responses;
use flightid_core::linear::linear_simulation::Discrete;
use flightid_core::numerics::matrix_exponential::exponential;
use num_complex::Complex64;
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

pub(crate) type States<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

pub(crate) fn matrix<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    rows: usize,
    columns: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let array = Array2::from_shape_vec((rows, columns), values)
        .map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// Matrices and delays as they were given, which the core checks.
pub(crate) fn system_of<'a>(
    a: &'a RowMajor2<'_, f64>,
    b: &'a RowMajor2<'_, f64>,
    c: &'a RowMajor2<'_, f64>,
    d: &'a RowMajor2<'_, f64>,
    delays_s: &'a RowMajor1<'_, f64>,
) -> PyResult<StateSpace<'a>> {
    Ok(StateSpace {
        a: a.as_slice()?,
        b: b.as_slice()?,
        c: c.as_slice()?,
        d: d.as_slice()?,
        delays_s: delays_s.as_slice()?,
        n_outputs: c.as_array().nrows(),
    })
}

fn between_samples(first_order_hold: bool) -> Hold {
    if first_order_hold { Hold::First } else { Hold::Zero }
}

/// simulate_linear(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64], delays_s: NDArray[np.float64], inputs: NDArray[np.float64], initial_state: NDArray[np.float64], sample_time_s: float, first_order_hold: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// States (n, n_samples) and outputs (p, n_samples) of a linear system over sampled inputs.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn simulate_linear<'py>(
    py: Python<'py>,
    a: RowMajor2<'py, f64>,
    b: RowMajor2<'py, f64>,
    c: RowMajor2<'py, f64>,
    d: RowMajor2<'py, f64>,
    delays_s: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    initial_state: RowMajor1<'py, f64>,
    sample_time_s: f64,
    first_order_hold: bool,
) -> PyResult<States<'py>> {
    let system = system_of(&a, &b, &c, &d, &delays_s)?;
    let (n_outputs, n_samples) = (system.n_outputs, inputs.as_array().ncols());
    let (u, x0) = (inputs.as_slice()?, initial_state.as_slice()?);
    let hold = between_samples(first_order_hold);
    let (states, outputs) = py
        .detach(|| Discrete::new(&system, sample_time_s, hold)?.run(u, n_samples, x0))
        .map_err(from_core)?;
    Ok((matrix(py, states, x0.len(), n_samples)?, matrix(py, outputs, n_outputs, n_samples)?))
}

/// linear_outputs(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64], delays_s: NDArray[np.float64], inputs: NDArray[np.float64], initial_state: NDArray[np.float64], sample_time_s: float, first_order_hold: bool, every: int) -> NDArray[np.float64]
///
/// Outputs alone of such simulations, at every so many samples from the first on: inputs of some runs
/// of one length, (n_runs, m, n_samples), to (n_runs, p, ⌈n_samples / every⌉).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn linear_outputs<'py>(
    py: Python<'py>,
    a: RowMajor2<'py, f64>,
    b: RowMajor2<'py, f64>,
    c: RowMajor2<'py, f64>,
    d: RowMajor2<'py, f64>,
    delays_s: RowMajor1<'py, f64>,
    inputs: RowMajor3<'py, f64>,
    initial_state: RowMajor1<'py, f64>,
    sample_time_s: f64,
    first_order_hold: bool,
    every: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let system = system_of(&a, &b, &c, &d, &delays_s)?;
    let (n_outputs, (n_runs, m, n_samples)) = (system.n_outputs, inputs.as_array().dim());
    let (u, x0) = (inputs.as_slice()?, initial_state.as_slice()?);
    let hold = between_samples(first_order_hold);
    let found = py
        .detach(|| {
            let (sampled, _) = discretise(&system, &[], sample_time_s, hold)?;
            let run = |u| outputs(&sampled, (system.c, n_outputs), u, n_samples, x0, every);
            let runs = (0..n_runs).map(|k| run(&u[k * m * n_samples..(k + 1) * m * n_samples]));
            runs.collect::<Result<Vec<_>, CoreError>>()
        })
        .map_err(from_core)?;
    let shape = (n_runs, n_outputs, n_samples.div_ceil(every.max(1)));
    let array = Array3::from_shape_vec(shape, found.concat())
        .map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// linear_response(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64], points: NDArray[np.complex128]) -> NDArray[np.complex128]
///
/// C (sI − A)⁻¹ B + D at points s, shape (p, m, n_points).
#[pyfunction]
fn linear_response<'py>(
    py: Python<'py>,
    a: RowMajor2<'py, f64>,
    b: RowMajor2<'py, f64>,
    c: RowMajor2<'py, f64>,
    d: RowMajor2<'py, f64>,
    points: RowMajor1<'py, Complex64>,
) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
    let &[n_outputs, n_inputs] = d.shape() else { return Err(odd_shape()) };
    let n = a.shape()[0];
    if a.shape() != [n, n] || b.shape() != [n, n_inputs] || c.shape() != [n_outputs, n] {
        return Err(odd_shape());
    }
    let system = StateSpace {
        a: a.as_slice()?,
        b: b.as_slice()?,
        c: c.as_slice()?,
        d: d.as_slice()?,
        delays_s: &[],
        n_outputs,
    };
    let s = points.as_slice()?;
    let found = py.detach(|| responses(&system, n_inputs, s)).map_err(from_core)?;
    found.into_pyarray(py).reshape([n_outputs, n_inputs, s.len()])
}

type Taps<'py> = Vec<(usize, isize, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)>;

/// discretise_linear(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64], delays_s: NDArray[np.float64], sample_time_s: float, first_order_hold: bool) -> tuple[NDArray[np.float64], list[tuple[int, int, NDArray[np.float64], NDArray[np.float64]]]]
///
/// Φ (n, n) and taps of x⁺ = Φ x + Σ state · u, y = C x + Σ output · u with u = input[k + ahead]:
/// each (input, ahead, state (n,), output (p,)).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn discretise_linear<'py>(
    py: Python<'py>,
    a: RowMajor2<'py, f64>,
    b: RowMajor2<'py, f64>,
    c: RowMajor2<'py, f64>,
    d: RowMajor2<'py, f64>,
    delays_s: RowMajor1<'py, f64>,
    sample_time_s: f64,
    first_order_hold: bool,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Taps<'py>)> {
    let n = a.as_array().nrows();
    let system = system_of(&a, &b, &c, &d, &delays_s)?;
    let hold = between_samples(first_order_hold);
    let (found, _) = discretise(&system, &[], sample_time_s, hold).map_err(from_core)?;
    let taps = found
        .taps
        .into_iter()
        .map(|tap| (tap.input, tap.ahead, tap.state.into_pyarray(py), tap.output.into_pyarray(py)));
    Ok((matrix(py, found.transition, n, n)?, taps.collect()))
}

type Matrices<'py> = (
    RowMajor3<'py, f64>,
    RowMajor3<'py, f64>,
    RowMajor3<'py, f64>,
    RowMajor3<'py, f64>,
    RowMajor2<'py, f64>,
);
type Jets<'py> = (Bound<'py, PyArray3<f64>>, Vec<(usize, isize)>, Bound<'py, PyArray3<f64>>);

/// discretise_directions(matrices: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], sample_time_s: float, hold: str) -> tuple[NDArray[np.float64], list[tuple[int, int]], NDArray[np.float64]]
///
/// Φ and weights of taps as `discretise_linear` gives them, and their derivatives. First index of
/// A, B, C, D and delays: the system, then its derivatives by each direction. Result: (1 + k, n, n),
/// (input, ahead) of each tap, and weights (1 + k, n_taps, n + p) of states, then outputs.
#[pyfunction]
fn discretise_directions<'py>(
    py: Python<'py>,
    matrices: Matrices<'py>,
    sample_time_s: f64,
    hold: &str,
) -> PyResult<Jets<'py>> {
    let (a, b, c, d, delays) = &matrices;
    let whole = [a.as_slice()?, b.as_slice()?, c.as_slice()?, d.as_slice()?, delays.as_slice()?];
    let &[count, n, _] = a.shape() else { return Err(odd_shape()) };
    let n_outputs = c.shape()[1];
    let each = whole.map(|part| part.len() / count.max(1));
    if count == 0 || b.shape()[0] != count || c.shape()[0] != count || d.shape()[0] != count {
        return Err(odd_shape());
    }
    let system = |k: usize| {
        let part = |j: usize| &whole[j][k * each[j]..(k + 1) * each[j]];
        let (a, b, c, d, delays_s) = (part(0), part(1), part(2), part(3), part(4));
        StateSpace { a, b, c, d, delays_s, n_outputs }
    };
    let slopes: Vec<_> = (1..count).map(system).collect();
    let hold = named(hold)?;
    let (found, derived) =
        py.detach(|| discretise(&system(0), &slopes, sample_time_s, hold)).map_err(from_core)?;
    let places: Vec<_> = found.taps.iter().map(|tap| (tap.input, tap.ahead)).collect();
    let (mut transitions, mut weights) = (Vec::new(), Vec::new());
    for each in std::iter::once(&found).chain(&derived) {
        transitions.extend(&each.transition);
        each.taps.iter().for_each(|tap| weights.extend(tap.state.iter().chain(&tap.output)));
    }
    let size = [count, places.len(), n + n_outputs];
    Ok((
        transitions.into_pyarray(py).reshape([count, n, n])?,
        places,
        weights.into_pyarray(py).reshape(size)?,
    ))
}

fn odd_shape() -> PyErr {
    pyo3::exceptions::PyValueError::new_err("one of each matrix for each direction")
}

/// matrix_exponential(matrix: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Exponential of a square matrix.
#[pyfunction]
fn matrix_exponential<'py>(
    py: Python<'py>,
    matrix: RowMajor2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let n = matrix.as_array().nrows();
    let result = exponential(matrix.as_slice()?, n).map_err(from_core)?;
    self::matrix(py, result, n, n)
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(simulate_linear, module)?)?;
    module.add_function(wrap_pyfunction!(linear_outputs, module)?)?;
    module.add_function(wrap_pyfunction!(discretise_linear, module)?)?;
    module.add_function(wrap_pyfunction!(discretise_directions, module)?)?;
    module.add_function(wrap_pyfunction!(linear_response, module)?)?;
    module.add_function(wrap_pyfunction!(matrix_exponential, module)?)?;
    Ok(())
}
