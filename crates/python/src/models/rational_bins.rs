//! Face of `flightid_core::frequency_domain::rational_bins`. (Python side:
//! responses/errors/pilot_search.py)

use flightid_core::frequency_domain::rational_bins::RationalBins as CoreBins;
use num_complex::Complex64;
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};

/// __init__(self, inputs: NDArray[np.complex128], turns: NDArray[np.complex128], lengths: Sequence[int], order: int, n_own: int) -> None
///
/// Fourier bins of inputs (n_in, n_bins), record after record; turns of modulus one by bin; bins of each
/// record; order of the responses, and terms of each record's transient.
#[pyclass(frozen, module = "flightid._native")]
pub struct RationalBins {
    bins: CoreBins,
}

#[pymethods]
impl RationalBins {
    #[new]
    fn new(
        inputs: RowMajor2<'_, Complex64>,
        turns: RowMajor1<'_, Complex64>,
        lengths: Vec<usize>,
        order: usize,
        n_own: usize,
    ) -> PyResult<Self> {
        let (inputs, turns) = (inputs.as_slice()?.to_vec(), turns.as_slice()?.to_vec());
        let bins = CoreBins::new(inputs, turns, lengths, order, n_own).map_err(from_core)?;
        Ok(Self { bins })
    }

    /// numerator(self, coefficients: NDArray[np.float64]) -> NDArray[np.complex128]
    ///
    /// Numerators times inputs, with transients, at each bin.
    fn numerator<'py>(
        &self,
        py: Python<'py>,
        coefficients: RowMajor1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let coefficients = coefficients.as_slice()?;
        let found = py.detach(|| self.bins.numerator(coefficients)).map_err(from_core)?;
        Ok(found.into_pyarray(py))
    }

    /// solve(self, output: NDArray[np.complex128], power: NDArray[np.float64], pulled: NDArray[np.complex128]) -> NDArray[np.float64] | None
    ///
    /// Numerators, denominator but its first, and transients whose weighed sum comes nearest to a target;
    /// squared weights and target times conjugate weights by bin. None where columns are too alike.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        output: RowMajor1<'_, Complex64>,
        power: RowMajor1<'_, f64>,
        pulled: RowMajor1<'_, Complex64>,
    ) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let (output, power, pulled) = (output.as_slice()?, power.as_slice()?, pulled.as_slice()?);
        let found = py.detach(|| self.bins.solve(output, power, pulled)).map_err(from_core)?;
        Ok(found.map(|each| each.into_pyarray(py)))
    }
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<RationalBins>()
}
