//! Face of what is done to sampled series.
//! (Python side: uncertainty/residual_noise.py)

use flightid_core::frequency_domain::composite::{CompositeRule, composite as core_composite};
use flightid_core::numerics::levinson::weights as levinson;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::row_major::RowMajor1;

/// autoregression_weights(lags: NDArray[np.float64], n: int) -> tuple[NDArray[np.float64], bool]
///
/// Weights of the best autoregression of n samples by autocovariances from lag zero, and whether
/// these are an autocovariance.
#[pyfunction]
fn autoregression_weights<'py>(
    py: Python<'py>,
    lags: RowMajor1<'_, f64>,
    n: usize,
) -> PyResult<(Bound<'py, PyArray1<f64>>, bool)> {
    let (found, sound) = levinson(lags.as_slice()?, n as f64);
    Ok((found.into_pyarray(py), sound))
}

/// composite(start: NDArray[np.float64], target: NDArray[np.float64], scale: NDArray[np.float64], coherence_weight: float, steps: int, halvings: int, tolerance: float, rounding: float) -> NDArray[np.float64]
///
/// Scaled unknowns, one row after another, of the composites of windows at many places.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "arrays, then the rule's own fields")]
fn composite<'py>(
    py: Python<'py>,
    start: RowMajor1<'_, f64>,
    target: RowMajor1<'_, f64>,
    scale: RowMajor1<'_, f64>,
    coherence_weight: f64,
    steps: usize,
    halvings: usize,
    tolerance: f64,
    rounding: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let rule = CompositeRule { coherence_weight, steps, halvings, tolerance, rounding };
    let (start, target, scale) = (start.as_slice()?, target.as_slice()?, scale.as_slice()?);
    Ok(py.detach(|| core_composite(start, target, scale, rule)).into_pyarray(py))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(composite, module)?)?;
    module.add_function(wrap_pyfunction!(autoregression_weights, module)?)
}
