//! Face of `flightid_core::language::lookup_table`. (Python side: models/language/tables.py)

use std::collections::BTreeMap;

use flightid_core::CoreError;
use flightid_core::language::lookup_table::{
    Interpolation, LookupTable as CoreTable, Outside, cubic_spline as spline,
};
use flightid_core::numerics::running_median::running_median as medians;
use flightid_core::numerics::sample_signs::SampleSigns;
use flightid_core::numerics::span_hashes::span_hashes as hashes;
use flightid_core::numerics::windowed_sinc::windowed_sinc as sinc;
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::RowMajor1;

/// __init__(self, axes: Sequence[Sequence[float]], values: Sequence[float], interpolation: str, outside: str) -> None
///
/// A table of one or two axes: breakpoints of each axis and values, row-major; interpolation
/// "linear", "pchip" or "cubic"; beyond the breakpoints "hold", "linear" or "refuse".
#[pyclass(frozen, module = "flightid._native")]
pub struct LookupTable {
    table: CoreTable,
}

/// Tables by name, as the core takes them; their content is shared.
pub(crate) fn shared(tables: BTreeMap<String, Py<LookupTable>>) -> BTreeMap<String, CoreTable> {
    tables.into_iter().map(|(name, table)| (name, table.get().table.clone())).collect()
}

#[pymethods]
impl LookupTable {
    #[new]
    fn new(
        axes: Vec<Vec<f64>>,
        values: Vec<f64>,
        interpolation: &str,
        outside: &str,
    ) -> PyResult<Self> {
        let interpolation = match interpolation {
            "linear" => Interpolation::Linear,
            "pchip" => Interpolation::Pchip,
            "cubic" => Interpolation::Cubic,
            other => return Err(PyValueError::new_err(format!("interpolation {other:?}"))),
        };
        let outside = match outside {
            "hold" => Outside::Hold,
            "linear" => Outside::Linear,
            "refuse" => Outside::Refuse,
            other => return Err(PyValueError::new_err(format!("outside {other:?}"))),
        };
        let table = CoreTable::new(axes, values, interpolation, outside).map_err(from_core)?;
        Ok(Self { table })
    }

    /// evaluate(self, first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]
    ///
    /// Values at pairs of places, shape (n,); a table of one axis does not look at the second.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        first: RowMajor1<'_, f64>,
        second: RowMajor1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (x, y) = (first.as_slice()?, second.as_slice()?);
        if x.len() != y.len() {
            let (found, needed) = (y.len(), x.len());
            return Err(from_core(CoreError::Shape { what: "places in a table", found, needed }));
        }
        let found: Vec<f64> = x.iter().zip(y).map(|(&x, &y)| self.table.at(x, y)).collect();
        Ok(found.into_pyarray(py))
    }

    /// nodes(self) -> list[list[float]]
    ///
    /// Values at the nodes, then slopes along the first axis, along the second, and mixed; row-major.
    fn nodes(&self) -> Vec<Vec<f64>> {
        self.table.nodes().to_vec()
    }
}

/// cubic_spline(points: NDArray[np.float64], values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]
///
/// The cubic spline through points, without a knot at the second and last but one, at some places.
#[pyfunction]
fn cubic_spline<'py>(
    py: Python<'py>,
    points: RowMajor1<'_, f64>,
    values: RowMajor1<'_, f64>,
    at: RowMajor1<'_, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (points, values, at) = (points.as_slice()?, values.as_slice()?, at.as_slice()?);
    let made = py.detach(|| spline(points, values, at)).map_err(from_core)?;
    Ok(made.into_pyarray(py))
}

/// windowed_sinc(values: NDArray[np.float64], position: NDArray[np.float64], cutoff: float, half: int, beta: float) -> NDArray[np.float64]
///
/// Uniform samples at fractional positions, by a sinc of `half` samples on each side under a Kaiser
/// window; `cutoff` in cycles per sample. The ends are continued by odd reflection.
#[pyfunction]
fn windowed_sinc<'py>(
    py: Python<'py>,
    values: RowMajor1<'_, f64>,
    position: RowMajor1<'_, f64>,
    cutoff: f64,
    half: usize,
    beta: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (values, position) = (values.as_slice()?, position.as_slice()?);
    Ok(py.detach(|| sinc(values, position, cutoff, half, beta)).into_pyarray(py))
}

/// running_median(values: NDArray[np.float64], half: int) -> NDArray[np.float64]
///
/// Median of each sample and `half` neighbours on either side; the ends go on as they are.
#[pyfunction]
fn running_median<'py>(
    py: Python<'py>,
    values: RowMajor1<'_, f64>,
    half: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let values = values.as_slice()?;
    Ok(py.detach(|| medians(values, half)).into_pyarray(py))
}

/// sample_signs(stamps: NDArray[np.float64], values: NDArray[np.float64], half: int, times: float) -> tuple[bool, float, bool, float, bool]
///
/// Whether all samples and stamps are finite; range; whether any sample is that before; largest step;
/// whether any may be `times` the median distance from the median of `half` neighbours on either side.
#[pyfunction]
fn sample_signs(
    py: Python<'_>,
    stamps: RowMajor1<'_, f64>,
    values: RowMajor1<'_, f64>,
    half: usize,
    times: f64,
) -> PyResult<(bool, f64, bool, f64, bool)> {
    let (stamps, values) = (stamps.as_slice()?, values.as_slice()?);
    let found = py.detach(|| SampleSigns::of(stamps, values, half, times));
    Ok((found.is_finite, found.range, found.rests, found.largest_step, found.stands_out))
}

/// span_hashes(samples: NDArray[np.float64], span: int) -> NDArray[np.uint64]
///
/// Hashes of all spans of `span` samples (a power of two) that move.
#[pyfunction]
fn span_hashes<'py>(
    py: Python<'py>,
    samples: RowMajor1<'_, f64>,
    span: usize,
) -> PyResult<Bound<'py, PyArray1<u64>>> {
    let samples = samples.as_slice()?;
    Ok(py.detach(|| hashes(samples, span)).into_pyarray(py))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(cubic_spline, module)?)?;
    module.add_function(wrap_pyfunction!(windowed_sinc, module)?)?;
    module.add_function(wrap_pyfunction!(running_median, module)?)?;
    module.add_function(wrap_pyfunction!(sample_signs, module)?)?;
    module.add_function(wrap_pyfunction!(span_hashes, module)?)?;
    module.add_class::<LookupTable>()
}
