//! Binding of closed-loop simulation (Python side: `vehicles/vehicle_loop.py`).

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};
use crate::simulation::linear_simulation::{States, matrix, system_of};
use flightid_core::linear::discretisation::{Hold, StateSpace};
use flightid_core::linear::linear_simulation::Discrete;
use flightid_core::vehicles::vehicle_loop::{ClosedLoop, Disturbance};
use pyo3::prelude::*;

/// A, B, C, D and the delay of each input, s.
pub(crate) type Matrices<'py> = (
    RowMajor2<'py, f64>,
    RowMajor2<'py, f64>,
    RowMajor2<'py, f64>,
    RowMajor2<'py, f64>,
    RowMajor1<'py, f64>,
);

pub(crate) fn system<'a>(matrices: &'a Matrices<'_>) -> PyResult<StateSpace<'a>> {
    let (a, b, c, d, delays_s) = matrices;
    system_of(a, b, c, d, delays_s)
}

/// fly_closed_loop(vehicle: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], controller: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], watched: Sequence[int], driven: Sequence[int], added: NDArray[np.float64], disturbances: Sequence[tuple[float, float]], noise: Sequence[float], sample_time_s: float, first_order_hold: bool, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// Inputs (m, n_samples) and noisy outputs (p, n_samples) of a linear vehicle under a controller.
#[pyfunction]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
fn fly_closed_loop<'py>(
    py: Python<'py>,
    vehicle: Matrices<'py>,
    controller: Matrices<'py>,
    watched: Vec<usize>,
    driven: Vec<usize>,
    added: RowMajor2<'py, f64>,
    disturbances: Vec<(f64, f64)>,
    noise: Vec<f64>,
    sample_time_s: f64,
    first_order_hold: bool,
    seed: u64,
) -> PyResult<States<'py>> {
    let (flown, flying) = (system(&vehicle)?, system(&controller)?);
    let (rows, n_samples) = added.as_array().dim();
    let added = added.as_slice()?;
    let hold = if first_order_hold { Hold::First } else { Hold::Zero };
    let processes: Vec<Disturbance> =
        disturbances.iter().map(|&(deviation, time_s)| Disturbance { deviation, time_s }).collect();
    let (inputs, outputs) = py
        .detach(|| {
            let plant = ClosedLoop {
                vehicle: &Discrete::new(&flown, sample_time_s, hold)?,
                controller: &Discrete::new(&flying, sample_time_s, hold)?,
                watched: &watched,
                driven: &driven,
                disturbances: &processes,
                noise: &noise,
            };
            plant.fly(added, n_samples, sample_time_s, seed)
        })
        .map_err(from_core)?;
    let n_outputs = flown.n_outputs;
    Ok((matrix(py, inputs, rows, n_samples)?, matrix(py, outputs, n_outputs, n_samples)?))
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(fly_closed_loop, module)?)?;
    Ok(())
}
