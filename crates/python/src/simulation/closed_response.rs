//! Binding of responses with loops closed (Python side: `control/loops/response.py`).

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2, RowMajor3};
use flightid_core::linear::closed_response::{Around, closed_responses as closed};
use flightid_core::linear::discretisation::StateSpace;
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

type Core<'py> =
    (RowMajor2<'py, f64>, RowMajor2<'py, f64>, RowMajor2<'py, f64>, RowMajor2<'py, f64>);

/// closed_responses(core: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], delays_s: NDArray[np.float64], drivers: list[int], n_outside: int, seen: list[int], ports: NDArray[np.complex128], wanted: list[int], points: NDArray[np.complex128]) -> NDArray[np.complex128]
///
/// Wanted signals of x' = A x + B v, y = C x + D v by signals from outside, all that goes around
/// closed, shape (n_wanted, n_outside, n_points). Each column v is its driver, late: a signal from
/// outside, or, counted on from these, a seen signal that is no port's, or what a port gives. Ports
/// (n_given, n_reads, n_points) read the last of the seen signals.
#[pyfunction]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
fn closed_responses<'py>(
    py: Python<'py>,
    core: Core<'py>,
    delays_s: RowMajor1<'py, f64>,
    drivers: Vec<usize>,
    n_outside: usize,
    seen: Vec<usize>,
    ports: RowMajor3<'py, Complex64>,
    wanted: Vec<usize>,
    points: RowMajor1<'py, Complex64>,
) -> PyResult<Bound<'py, PyArray3<Complex64>>> {
    let (a, b, c, d) = &core;
    let (n, n_columns, n_outputs) = (a.shape()[0], drivers.len(), c.shape()[0]);
    let fits = a.shape() == [n, n]
        && b.shape() == [n, n_columns]
        && c.shape() == [n_outputs, n]
        && d.shape() == [n_outputs, n_columns];
    if !fits {
        return Err(PyValueError::new_err("matrices do not fit"));
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
    let around = Around {
        delays_s: delays_s.as_slice()?,
        n_outside,
        drivers: &drivers,
        seen: &seen,
        n_given: ports.shape()[0],
        n_reads: ports.shape()[1],
        ports: ports.as_slice()?,
        wanted: &wanted,
    };
    let found = py.detach(|| closed(&system, &around, s)).map_err(from_core)?;
    found.into_pyarray(py).reshape([wanted.len(), n_outside, s.len()])
}

/// Add this area to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(closed_responses, module)?)
}
