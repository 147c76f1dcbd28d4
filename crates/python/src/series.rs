//! Face of what is done to sampled series.
//! (Python side: uncertainty/residual_noise.py)

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

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(autoregression_weights, module)?)
}
