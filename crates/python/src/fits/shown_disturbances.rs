//! Face of `flightid_core::output_error::shown_disturbances`. (Python side:
//! identification/output_error/disturbed_states.py)

use flightid_core::linear::discretisation::StateSpace;
use flightid_core::output_error::shown_disturbances::{Residuals, chance};
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};

type Matrix<'py> = RowMajor2<'py, f64>;
/// A, disturbances by column, C and what outputs feel of disturbances at once.
type System<'py> = (Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>);
/// Frequencies, residuals, their powers.
type Seen<'py> = (RowMajor1<'py, f64>, RowMajor2<'py, Complex64>, Matrix<'py>);
/// Filters, turn, sample time.
type Whitening<'py> = (Matrix<'py>, Matrix<'py>, f64);

fn with<R>(
    py: Python<'_>,
    (a, b, c, d): &System<'_>,
    (omega, told, power): &Seen<'_>,
    (filters, turned, step_s): &Whitening<'_>,
    work: impl FnOnce(&StateSpace<'_>, &Residuals<'_>, usize) -> R + Send,
) -> PyResult<R>
where
    R: Send,
{
    let (n_outputs, n_ways) = (c.as_array().nrows(), b.as_array().ncols());
    let delays_s = vec![0.0; n_ways];
    let system = StateSpace {
        a: a.as_slice()?,
        b: b.as_slice()?,
        c: c.as_slice()?,
        d: d.as_slice()?,
        delays_s: &delays_s,
        n_outputs,
    };
    let residuals = Residuals {
        omega: omega.as_slice()?,
        told: told.as_slice()?,
        power: power.as_slice()?,
        filters: filters.as_slice()?,
        turned: turned.as_slice()?,
        step_s: *step_s,
    };
    Ok(py.detach(|| work(&system, &residuals, n_ways)))
}

/// disturbance_scores(system: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], seen: tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64]], whitening: tuple[NDArray[np.float64], NDArray[np.float64], float], memories_s: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]
///
/// Scores of disturbances with each memory, memory by memory, and their variances by chance. `system`
/// is A, disturbances by column, C and what outputs feel at once; `seen` the frequencies (rad/s), the
/// whitened residuals (n_outputs, n_omega) and their powers; `whitening` the filters' taps, the turn
/// of outputs, and the sample time.
#[pyfunction]
#[allow(clippy::type_complexity)]
fn disturbance_scores<'py>(
    py: Python<'py>,
    system: System<'_>,
    seen: Seen<'_>,
    whitening: Whitening<'_>,
    memories_s: RowMajor1<'_, f64>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
    let memories = memories_s.as_slice()?;
    let found = with(py, &system, &seen, &whitening, |system, residuals, n_ways| {
        residuals.scores(system, n_ways, memories)
    })?;
    let found = found.map_err(from_core)?;
    Ok((found.score.into_pyarray(py), found.variance.into_pyarray(py)))
}

/// disturbance_sizes(system: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], seen: tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64]], whitening: tuple[NDArray[np.float64], NDArray[np.float64], float], memories_s: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Squared weights (n_ways, n_outputs, n_omega) of disturbances, each with a memory of its own.
#[pyfunction]
fn disturbance_sizes<'py>(
    py: Python<'py>,
    system: System<'_>,
    seen: Seen<'_>,
    whitening: Whitening<'_>,
    memories_s: RowMajor1<'_, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (memories, n_outputs) = (memories_s.as_slice()?, system.2.as_array().nrows());
    let shape = [memories.len(), n_outputs, seen.0.as_slice()?.len()];
    let found = with(py, &system, &seen, &whitening, |system, residuals, _| {
        residuals.sizes(system, memories)
    })?;
    found.map_err(from_core)?.into_pyarray(py).reshape(shape)
}

/// disturbance_chance(score: float, sizes: NDArray[np.float64]) -> float
///
/// Chance of so large a score where outputs move by themselves; sizes (n_outputs, n_omega).
#[pyfunction]
fn disturbance_chance(py: Python<'_>, score: f64, sizes: RowMajor2<'_, f64>) -> PyResult<f64> {
    let (n_outputs, sizes) = (sizes.as_array().nrows(), sizes.as_slice()?);
    Ok(py.detach(|| chance(score, sizes, n_outputs)))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(disturbance_scores, module)?)?;
    module.add_function(wrap_pyfunction!(disturbance_sizes, module)?)?;
    module.add_function(wrap_pyfunction!(disturbance_chance, module)?)
}
