//! Binding of kinematic reconstruction (Python side: `conditioning/kinematics.py`).

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};
use flightid_core::trajectories::kinematics::{COLUMNS, N, reconstruct};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3};
use pyo3::prelude::*;

type Paths<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// reconstruct_kinematics(inputs: NDArray[np.float64], initial: NDArray[np.float64], sample_time_s: float, gravity: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// States (n, 6) and their sensitivities (n, 6, 18) from inputs (2 n - 1, 6) at half steps.
#[pyfunction]
fn reconstruct_kinematics<'py>(
    py: Python<'py>,
    inputs: RowMajor2<'py, f64>,
    initial: RowMajor1<'py, f64>,
    sample_time_s: f64,
    gravity: f64,
) -> PyResult<Paths<'py>> {
    let (u, x0) = (inputs.as_slice()?, initial.as_slice()?);
    let found = py.detach(|| reconstruct(u, x0, sample_time_s, gravity)).map_err(from_core)?;
    let n = found.states.len() / N;
    let failed = |error: numpy::ndarray::ShapeError| {
        pyo3::exceptions::PyRuntimeError::new_err(error.to_string())
    };
    let states = Array2::from_shape_vec((n, N), found.states).map_err(failed)?;
    let slopes = Array3::from_shape_vec((n, N, COLUMNS), found.sensitivities).map_err(failed)?;
    Ok((states.into_pyarray(py), slopes.into_pyarray(py)))
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(reconstruct_kinematics, module)?)?;
    Ok(())
}
