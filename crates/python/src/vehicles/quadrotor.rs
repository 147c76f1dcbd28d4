//! Binding of the simulated quadrotor (Python side: `vehicles/quadrotor.py`). Parameter groups come as
//! mappings from field name to value.

use crate::error::from_core;
use crate::group::{item, read};
use crate::row_major::{RowMajor1, RowMajor2};
use crate::vehicles::autopilot_controllers::pid_gains;
use flightid_core::autopilots::ardupilot_mixer::Mixer;
use flightid_core::autopilots::ardupilot_mode::{AttitudeGains, SidRun};
use flightid_core::vehicles::quadrotor::{Gust, N_STATES, Quadrotor};
use flightid_core::vehicles::quadrotor_flight::{Autopilot, COLUMNS, Plan, Sensors, fly};
use flightid_core::vehicles::turbulence::Turbulence;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

fn vehicle(m: &Bound<'_, PyDict>) -> PyResult<Quadrotor> {
    Ok(read!(
        m,
        Quadrotor {
            mass_kg,
            inertia_kg_m2,
            arm_m,
            rotor_height_m,
            maximum_thrust_n,
            thrust_expo,
            torque_per_thrust_m,
            thrust_per_speed_n_s2,
            rotor_inertia_kg_m2,
            motor_lag_s,
            motor_delay_s,
            axial_damping_n_s_m,
            in_plane_drag_n_s_m,
            on_rig,
            rig_inertia_kg_m2,
            rig_friction_n_m_s,
        }
    ))
}

fn autopilot(m: &Bound<'_, PyDict>) -> PyResult<Autopilot> {
    let rates: Vec<Bound<'_, PyDict>> = item(m, "rate")?.extract()?;
    let [roll, pitch, yaw] = rates.as_slice() else {
        return Err(PyValueError::new_err("rate needs three controllers"));
    };
    Ok(Autopilot {
        loop_rate_hz: item(m, "loop_rate_hz")?.extract()?,
        gyro_filter_hz: item(m, "gyro_filter_hz")?.extract()?,
        rate: [pid_gains(roll)?, pid_gains(pitch)?, pid_gains(yaw)?],
        attitude: read!(m, AttitudeGains { angle_p, acceleration_rad_s2 }),
        mixer: read!(
            m,
            Mixer {
                thrust_expo,
                spin_min,
                spin_max,
                pwm_min_us,
                pwm_max_us,
                pwm_step_us,
                voltage_ratio,
            }
        ),
    })
}

/// quadrotor_columns() -> list[str]
///
/// Names of the columns of `fly_quadrotor`.
#[pyfunction]
fn quadrotor_columns() -> Vec<&'static str> {
    COLUMNS.split_whitespace().collect()
}

/// fly_quadrotor(vehicle: dict[str, Any], autopilot: dict[str, Any], sensors: dict[str, Any], turbulence: dict[str, Any], pilot: NDArray[np.float64], runs: list[dict[str, Any]], log_every: int, seed: int) -> NDArray[np.float64]
///
/// Log rows of a simulated flight, (n_rows, n_columns); pilot inputs are (3, n_loops).
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn fly_quadrotor<'py>(
    py: Python<'py>,
    vehicle: &Bound<'py, PyDict>,
    autopilot: &Bound<'py, PyDict>,
    sensors: &Bound<'py, PyDict>,
    turbulence: &Bound<'py, PyDict>,
    pilot: RowMajor2<'py, f64>,
    runs: Vec<Bound<'py, PyDict>>,
    log_every: usize,
    seed: u64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (vehicle, autopilot) = (self::vehicle(vehicle)?, self::autopilot(autopilot)?);
    let sensors = read!(
        sensors,
        Sensors {
            gyro_noise_rad_s,
            gyro_bias_rad_s,
            accelerometer_noise_m_s2,
            accelerometer_bias_m_s2,
        }
    );
    let turbulence =
        read!(turbulence, Turbulence { velocity_m_s, velocity_time_s, rate_rad_s, rate_time_s });
    let runs = runs
        .iter()
        .map(|run| {
            Ok(read!(
                run,
                SidRun {
                    axis,
                    start_s,
                    magnitude,
                    start_hz,
                    stop_hz,
                    fade_in_s,
                    record_s,
                    fade_out_s,
                    leave_s,
                }
            ))
        })
        .collect::<PyResult<Vec<SidRun>>>()?;
    let plan = Plan { pilot: pilot.as_slice()?, runs: &runs, log_every, seed };
    let rows =
        py.detach(|| fly(&vehicle, &autopilot, &sensors, &turbulence, &plan)).map_err(from_core)?;
    let width = COLUMNS.split_whitespace().count();
    let array = Array2::from_shape_vec((rows.len() / width, width), rows)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// quadrotor_derivative(vehicle: dict[str, Any], state: NDArray[np.float64], thrust_n: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Time derivative of the 17 states for four thrust commands in still air.
#[pyfunction]
fn quadrotor_derivative<'py>(
    py: Python<'py>,
    vehicle: &Bound<'py, PyDict>,
    state: RowMajor1<'py, f64>,
    thrust_n: RowMajor1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let vehicle = self::vehicle(vehicle)?;
    let (x, command): ([f64; N_STATES], [f64; 4]) =
        (state.as_slice()?.try_into()?, thrust_n.as_slice()?.try_into()?);
    Ok(vehicle.derivative(&x, command, &Gust::default()).to_vec().into_pyarray(py))
}

/// quadrotor_trajectory(vehicle: dict[str, Any], state: NDArray[np.float64], thrust_n: NDArray[np.float64], step_s: float, n_steps: int) -> NDArray[np.float64]
///
/// States (n_steps + 1, 17) under constant thrust commands in still air.
#[pyfunction]
fn quadrotor_trajectory<'py>(
    py: Python<'py>,
    vehicle: &Bound<'py, PyDict>,
    state: RowMajor1<'py, f64>,
    thrust_n: RowMajor1<'py, f64>,
    step_s: f64,
    n_steps: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let vehicle = self::vehicle(vehicle)?;
    let mut x: [f64; N_STATES] = state.as_slice()?.try_into()?;
    let command: [f64; 4] = thrust_n.as_slice()?.try_into()?;
    let mut rows = x.to_vec();
    for _ in 0..n_steps {
        vehicle.step(&mut x, command, &Gust::default(), step_s);
        rows.extend(x);
    }
    let array = Array2::from_shape_vec((n_steps + 1, N_STATES), rows)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(quadrotor_columns, module)?)?;
    module.add_function(wrap_pyfunction!(fly_quadrotor, module)?)?;
    module.add_function(wrap_pyfunction!(quadrotor_derivative, module)?)?;
    module.add_function(wrap_pyfunction!(quadrotor_trajectory, module)?)?;
    Ok(())
}
