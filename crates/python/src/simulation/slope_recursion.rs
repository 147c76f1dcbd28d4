//! Face of `flightid_core::linear::slope_recursion`. (Python side:
//! identification/filter_error/innovations.py)

use flightid_core::linear::slope_recursion::{Slopes, slopes, slopes_anyhow};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor2, RowMajor3};

/// slope_recursion(transition: NDArray[np.float64], output: NDArray[np.float64], forced: NDArray[np.float64], direct: NDArray[np.float64], signals: NDArray[np.float64], *, anyhow: bool = False) -> NDArray[np.float64]
///
/// (n_samples, p, n_unknowns) of δe = G s − C δx, δx⁺ = A δx + F s: F (n_unknowns, n, q),
/// G (n_unknowns, p, q), signals s (q, n_samples). `anyhow`: of those that run away too, as far as
/// they are finite.
#[pyfunction]
#[pyo3(signature = (transition, output, forced, direct, signals, *, anyhow = false))]
fn slope_recursion<'py>(
    py: Python<'py>,
    transition: RowMajor2<'_, f64>,
    output: RowMajor2<'_, f64>,
    forced: RowMajor3<'_, f64>,
    direct: RowMajor3<'_, f64>,
    signals: RowMajor2<'_, f64>,
    anyhow: bool,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let ((p, n), (q, n_samples)) = (output.as_array().dim(), signals.as_array().dim());
    let count = forced.as_array().dim().0;
    let of = Slopes {
        transition: transition.as_slice()?,
        output: output.as_slice()?,
        forced: forced.as_slice()?,
        direct: direct.as_slice()?,
        sizes: [n, p, q],
        count,
    };
    let given = signals.as_slice()?;
    let run = if anyhow { slopes_anyhow } else { slopes };
    let found = py.detach(|| run(of, given, n_samples)).map_err(from_core)?;
    found.into_pyarray(py).reshape([n_samples, p, count])
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(slope_recursion, module)?)
}
