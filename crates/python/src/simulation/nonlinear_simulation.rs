//! Binding of simulation by Runge–Kutta steps (Python side: `simulation/nonlinear.py`).

use flightid_core::linear::discretisation::Hold;
use flightid_core::state_space::ode_model::OdeModel;
use flightid_core::trajectories::runge_kutta::{Course, Setting};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::models::state_space::StateSpace;
use crate::row_major::{RowMajor1, RowMajor2};

type States<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// simulate_equations(model: StateSpace, values: NDArray[np.float64], inputs: NDArray[np.float64], initial_state: NDArray[np.float64], sample_time_s: float, first_order_hold: bool, substeps: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// States (n, n_samples) and outputs (p, n_samples) of a model over sampled inputs (m, n_samples).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn simulate_equations<'py>(
    py: Python<'py>,
    model: &StateSpace,
    values: RowMajor1<'py, f64>,
    inputs: RowMajor2<'py, f64>,
    initial_state: RowMajor1<'py, f64>,
    sample_time_s: f64,
    first_order_hold: bool,
    substeps: usize,
) -> PyResult<States<'py>> {
    let n_samples = inputs.as_array().ncols();
    let hold = if first_order_hold { Hold::First } else { Hold::Zero };
    let (values, inputs, initial) =
        (values.as_slice()?, inputs.as_slice()?, initial_state.as_slice()?);
    let course = Course { inputs, n_samples, sample_s: sample_time_s, hold, substeps };
    let tape = &model.tape;
    let (states, outputs) = py
        .detach(|| {
            let ode = OdeModel::new(tape)?;
            let mut setting = Setting::default();
            setting.prepare(&ode, values, &course)?;
            setting.simulate(&ode, initial)
        })
        .map_err(from_core)?;
    let (n, p) = (initial.len(), tape.n_outputs());
    Ok((
        states.into_pyarray(py).reshape([n, n_samples])?,
        outputs.into_pyarray(py).reshape([p, n_samples])?,
    ))
}

type Lines = Vec<(String, f64, Vec<usize>)>;
type Places = (Vec<usize>, Vec<(usize, usize, usize)>, Vec<usize>, Vec<usize>);

/// list_equations(model: StateSpace) -> tuple[list[tuple[str, float, list[int]]], tuple[list[int], list[tuple[int, int, int]], list[int], list[int]]]
///
/// A model as a list of operations (kind, number, arguments; arguments are places of earlier lines,
/// an input's its place in ẋ, x, u and the values), and the lines of residuals, factors of ẋ in them
/// (row, column, line), outputs and delays.
#[pyfunction]
fn list_equations(model: &StateSpace) -> PyResult<(Lines, Places)> {
    let found = model.tape.listing().map_err(from_core)?;
    let lines = found.lines.into_iter().map(|line| (line.kind, line.number, line.arguments));
    Ok((lines.collect(), (found.residuals, found.mass, found.outputs, found.delays)))
}

/// Add this area to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(simulate_equations, module)?)?;
    module.add_function(wrap_pyfunction!(list_equations, module)?)
}
