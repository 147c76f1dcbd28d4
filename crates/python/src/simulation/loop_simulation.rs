//! Binding of the simulation of loops (Python side: `control/loops/simulation.py`).

use crate::error::from_core;
use crate::models::state_space::StateSpace;
use crate::row_major::{RowMajor1, RowMajor2};
use crate::simulation::linear_simulation::matrix;
use crate::simulation::vehicle_loop::{Matrices, system};
use flightid_core::linear::discretisation::Hold;
use flightid_core::linear::linear_simulation::Discrete;
use flightid_core::trajectories::equation_step::EquationStep;
use flightid_core::trajectories::loop_simulation::{
    Element, Equations, Kept, Port, Recursion, simulate,
};
use numpy::PyArray2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Kind, places of signals and of rows, steps from sample to sample, numbers.
type Given<'py> = (String, Vec<usize>, Vec<usize>, usize, RowMajor1<'py, f64>);
/// Model, values of its parameters, trim of inputs and of outputs, initial state, substeps, which
/// inputs are held.
type Moving<'py> =
    (PyRef<'py, StateSpace>, RowMajor1<'py, f64>, Vec<f64>, Vec<f64>, Vec<f64>, usize, Vec<bool>);

fn element(
    kind: &str,
    every: usize,
    numbers: &[f64],
    sizes: (usize, usize),
    models: &[Moving<'_>],
    step_s: f64,
) -> PyResult<Element> {
    match (kind, numbers) {
        ("through", _) => Ok(Element::Through),
        ("limits", &[low, high]) => Ok(Element::Limits { low, high }),
        ("rate", &[most]) => Ok(Element::RateLimit { most }),
        ("hold", _) => Ok(Element::Hold { every }),
        ("recursion", numbers) => recursion(every, numbers, sizes),
        ("equations", _) => match models.get(every) {
            Some(model) => equations(model, step_s),
            None => Err(PyValueError::new_err("there is no such model")),
        },
        _ => Err(PyValueError::new_err(format!("there is no element {kind:?} with such numbers"))),
    }
}

/// A, B, C, D and the state one after the other: n² + n (m + p + 1) + p m numbers.
fn recursion(every: usize, numbers: &[f64], (m, p): (usize, usize)) -> PyResult<Element> {
    let size = |n: usize| n * n + n * (m + p + 1) + p * m;
    let Some(n) = (0..=numbers.len()).find(|&n| size(n) >= numbers.len()) else {
        return Err(PyValueError::new_err("numbers of a recursion do not fit"));
    };
    if size(n) != numbers.len() {
        return Err(PyValueError::new_err("numbers of a recursion do not fit"));
    }
    let mut rest = numbers;
    let mut take = |count: usize| {
        let (first, later) = rest.split_at(count);
        rest = later;
        first.to_vec()
    };
    let (a, b, c, d) = (take(n * n), take(n * m), take(p * n), take(p * m));
    Ok(Element::Recursion(Recursion { every, a, b, c, d, state: take(n) }))
}

fn equations(model: &Moving<'_>, step_s: f64) -> PyResult<Element> {
    let (native, values, trim_inputs, trim_outputs, state, substeps, held) = model;
    let step = EquationStep::new(&native.tape, values.as_slice()?, step_s, *substeps)
        .map_err(from_core)?;
    Ok(Element::Equations(Box::new(Equations {
        step,
        held: held.clone(),
        trim_inputs: trim_inputs.clone(),
        trim_outputs: trim_outputs.clone(),
        state: state.clone(),
        before: trim_inputs.clone(),
        next: state.clone(),
    })))
}

/// simulate_loops(core: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], first_order_hold: Sequence[bool], rows: NDArray[np.float64], initial_state: NDArray[np.float64], ports: Sequence[tuple[str, Sequence[int], Sequence[int], int, NDArray[np.float64]]], models: Sequence[tuple[StateSpace, NDArray[np.float64], Sequence[float], Sequence[float], Sequence[float], int, Sequence[bool]]], kept: Sequence[int], every: int, step_s: float) -> NDArray[np.float64]
///
/// Kept signals (n_kept, n_samples) of linear blocks driven by rows (n_rows, 1 + n_steps) and ports.
#[pyfunction]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
fn simulate_loops<'py>(
    py: Python<'py>,
    core: Matrices<'py>,
    first_order_hold: Vec<bool>,
    rows: RowMajor2<'py, f64>,
    initial_state: RowMajor1<'py, f64>,
    ports: Vec<Given<'py>>,
    models: Vec<Moving<'py>>,
    kept: Vec<usize>,
    every: usize,
    step_s: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let linear = system(&core)?;
    let holds: Vec<Hold> = first_order_hold
        .iter()
        .map(|&first| if first { Hold::First } else { Hold::Zero })
        .collect();
    let mut elements = ports
        .iter()
        .map(|(kind, reads, driven, every, numbers)| {
            let sizes = (reads.len(), driven.len());
            let element = element(kind, *every, numbers.as_slice()?, sizes, &models, step_s)?;
            Ok(Port { element, reads: reads.clone(), rows: driven.clone() })
        })
        .collect::<PyResult<Vec<_>>>()?;
    let n_steps = rows.as_array().ncols().saturating_sub(1);
    let mut filled = rows.as_slice()?.to_vec();
    let start = initial_state.as_slice()?;
    let found = py
        .detach(|| {
            let core = Discrete::with_holds(&linear, step_s, &holds)?;
            let kept = Kept { signals: &kept, every };
            simulate(&core, &mut elements, &mut filled, n_steps, start, kept)
        })
        .map_err(from_core)?;
    let columns = n_steps.div_ceil(every.max(1));
    matrix(py, found, kept.len(), columns)
}

/// Add this area to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(simulate_loops, module)?)
}
