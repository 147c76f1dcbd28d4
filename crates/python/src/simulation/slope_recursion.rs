//! Face of `flightid_core::linear::slope_recursion`. (Python side:
//! identification/filter_error/innovations.py)

use flightid_core::linear::slope_recursion::{Slopes, slopes};
use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor2, RowMajor3};

fn rows(of: &RowMajor2<'_, f64>) -> Vec<f64> {
    of.as_array().iter().copied().collect()
}

fn blocks(of: &RowMajor3<'_, f64>) -> Vec<f64> {
    of.as_array().iter().copied().collect()
}

/// slope_recursion(transition: NDArray[np.float64], output: NDArray[np.float64], forced: NDArray[np.float64], direct: NDArray[np.float64], signals: NDArray[np.float64], brief: Sequence[bool] = (), until: int = 0) -> NDArray[np.float64]
///
/// (n_samples, p, n_unknowns) of δe = G s − C δx, δx⁺ = A δx + F s: F (n_unknowns, n, q),
/// G (n_unknowns, p, q), signals s (q, n_samples). Of `brief` unknowns nothing is left after
/// `until` samples: they are zeros from some sample after it on.
#[pyfunction]
#[pyo3(signature = (transition, output, forced, direct, signals, brief = vec![], until = 0))]
#[expect(clippy::too_many_arguments, reason = "a system's own matrices, then what is brief of it")]
fn slope_recursion<'py>(
    py: Python<'py>,
    transition: RowMajor2<'_, f64>,
    output: RowMajor2<'_, f64>,
    forced: RowMajor3<'_, f64>,
    direct: RowMajor3<'_, f64>,
    signals: RowMajor2<'_, f64>,
    brief: Vec<bool>,
    until: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let ((p, n), (q, n_samples)) = (output.as_array().dim(), signals.as_array().dim());
    let count = forced.as_array().dim().0;
    // Any order of memory: transposed signals are common here.
    let (transition, output, signals) = (rows(&transition), rows(&output), rows(&signals));
    let (forced, direct) = (blocks(&forced), blocks(&direct));
    let of = Slopes {
        transition: &transition,
        output: &output,
        forced: &forced,
        direct: &direct,
        sizes: [n, p, q],
        count,
        brief: &brief,
        until,
    };
    let given = &signals;
    let found = py.detach(|| slopes(of, given, n_samples)).map_err(from_core)?;
    found.into_pyarray(py).reshape([n_samples, p, count])
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(slope_recursion, module)?)
}
