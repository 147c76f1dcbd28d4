//! Binding of the simulated twin-rotor rig (Python side: `vehicles/twin_rotor.py`). Parameter groups
//! come as mappings from field name to value.

use crate::error::from_core;
use crate::group::read;
use crate::row_major::{RowMajor1, RowMajor2};
use flightid_core::vehicles::twin_rotor::{Draught, Encoders, N_STATES, Run, TwinRotor};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

fn rig(m: &Bound<'_, PyDict>) -> PyResult<TwinRotor> {
    Ok(read!(
        m,
        TwinRotor {
            inertia_kg_m2,
            thrust_square_n_m,
            thrust_linear_n_m,
            gravity_moment_n_m,
            rest_angle_rad,
            centrifugal_kg_m2,
            viscous_friction_n_m_s,
            coulomb_friction_n_m,
            cable_stiffness_n_m,
            gyroscopic_s,
            reaction_gain,
            reaction_lead_s,
            reaction_lag_s,
            motor_gain_per_v,
            motor_lag_s,
            maximum_voltage_v,
            yaw_locked,
        }
    ))
}

/// run_twin_rotor(rig: dict[str, Any], encoders: dict[str, Any], draught: dict[str, Any], start: NDArray[np.float64], voltages_v: NDArray[np.float64], sample_time_s: float, substeps: int, seed: int) -> NDArray[np.float64]
///
/// Measured pitch, measured yaw, pitch and yaw, (4, n), under held voltages (2, n).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn run_twin_rotor<'py>(
    py: Python<'py>,
    rig: &Bound<'py, PyDict>,
    encoders: &Bound<'py, PyDict>,
    draught: &Bound<'py, PyDict>,
    start: RowMajor1<'py, f64>,
    voltages_v: RowMajor2<'py, f64>,
    sample_time_s: f64,
    substeps: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rig = self::rig(rig)?;
    let encoders = read!(encoders, Encoders { step_rad, noise_rad });
    let draught = read!(draught, Draught { moment_n_m, time_s });
    let start: [f64; N_STATES] = start.as_slice()?.try_into()?;
    let n = voltages_v.as_array().ncols();
    let run = Run { voltages_v: voltages_v.as_slice()?, sample_time_s, substeps, seed };
    let rows = py.detach(|| rig.run(start, &encoders, &draught, &run)).map_err(from_core)?;
    let array = Array2::from_shape_vec((4, n), rows)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// twin_rotor_derivative(rig: dict[str, Any], state: NDArray[np.float64], voltage_v: NDArray[np.float64], disturbance_n_m: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Time derivative of the 7 states under two voltages and two disturbing moments.
#[pyfunction]
fn twin_rotor_derivative<'py>(
    py: Python<'py>,
    rig: &Bound<'py, PyDict>,
    state: RowMajor1<'py, f64>,
    voltage_v: RowMajor1<'py, f64>,
    disturbance_n_m: RowMajor1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let rig = self::rig(rig)?;
    let x: [f64; N_STATES] = state.as_slice()?.try_into()?;
    let (u, d) = (voltage_v.as_slice()?.try_into()?, disturbance_n_m.as_slice()?.try_into()?);
    Ok(rig.derivative(&x, u, d).to_vec().into_pyarray(py))
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(run_twin_rotor, module)?)?;
    module.add_function(wrap_pyfunction!(twin_rotor_derivative, module)?)?;
    Ok(())
}
