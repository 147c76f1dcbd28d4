//! Face of what is done to sampled series.
//! (Python side: uncertainty/residual_noise.py, uncertainty/slow_drift.py,
//! uncertainty/unequal_noise.py, responses/windows/transform.py)

use flightid_core::frequency_domain::composite::{CompositeRule, composite as core_composite};
use flightid_core::numerics::folded_frames::folded_frames as folded;
use flightid_core::numerics::folded_rows::{Frames, Ladder, Piece};
use flightid_core::numerics::half_band::HalfBand;
use flightid_core::numerics::levinson::weights as levinson;
use flightid_core::numerics::rank_bounds::rank_bound;
use flightid_core::numerics::ranks::ranks as ranked;
use flightid_core::numerics::slow_drift::{Parts, Rounds, Spectrum};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadwriteArray1, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::error::from_core;
use crate::row_major::{RowMajor1, RowMajor2};

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

/// drift_beside(power: NDArray[np.float64], tables: tuple[NDArray[np.float64], NDArray[np.float64]], sizes: tuple[int, int], begun: tuple[NDArray[np.float64], NDArray[np.float64], float], corner: float, rounds: tuple[int, float, float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]
///
/// Lags and weights of an autoregression and the variance of the drift beside it after some rounds,
/// from those they begin with. `tables` hold the first rows of the inverse of a real transform and one
/// less the cosine of each bin, `sizes` the length of the transform and how many samples there are;
/// `rounds` their number, the change that ends them, the sharpest line and the lowest valley.
#[pyfunction]
#[allow(clippy::type_complexity)]
fn drift_beside<'py>(
    py: Python<'py>,
    power: RowMajor1<'_, f64>,
    tables: (RowMajor2<'_, f64>, RowMajor1<'_, f64>),
    sizes: (usize, usize),
    begun: (RowMajor1<'_, f64>, RowMajor1<'_, f64>, f64),
    corner: f64,
    rounds: (usize, f64, f64, f64),
) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, f64)> {
    let spectrum = Spectrum {
        power: power.as_slice()?,
        cosines: tables.0.as_slice()?,
        turns: tables.1.as_slice()?,
        length: sizes.0,
        n: sizes.1,
    };
    let (lags, weights) = (begun.0.as_slice()?.to_vec(), begun.1.as_slice()?.to_vec());
    let begun = Parts { lags, weights, variance: begun.2 };
    let (most, settled, sharpest, cut) = rounds;
    let rounds = Rounds { most, settled, sharpest, cut };
    let found = py.detach(|| spectrum.apart(begun, corner, rounds)).map_err(from_core)?;
    Ok((found.lags.into_pyarray(py), found.weights.into_pyarray(py), found.variance))
}

/// drift_likelihood(power: NDArray[np.float64], tables: tuple[NDArray[np.float64], NDArray[np.float64]], sizes: tuple[int, int], parts: tuple[NDArray[np.float64], NDArray[np.float64], float], corner: float, sharpest: float) -> float
///
/// Twice Whittle's likelihood of an autoregression and the drift beside it, as `drift_beside` has them.
#[pyfunction]
fn drift_likelihood(
    py: Python<'_>,
    power: RowMajor1<'_, f64>,
    tables: (RowMajor2<'_, f64>, RowMajor1<'_, f64>),
    sizes: (usize, usize),
    parts: (RowMajor1<'_, f64>, RowMajor1<'_, f64>, f64),
    corner: f64,
    sharpest: f64,
) -> PyResult<f64> {
    let (cosines, turns) = (tables.0.as_slice()?, tables.1.as_slice()?);
    let (power, length, n) = (power.as_slice()?, sizes.0, sizes.1);
    let (lags, weights) = (parts.0.as_slice()?.to_vec(), parts.1.as_slice()?.to_vec());
    let parts = Parts { lags, weights, variance: parts.2 };
    let spectrum = Spectrum { power, cosines, turns, length, n };
    py.detach(|| spectrum.likelihood(&parts, corner, sharpest)).map_err(from_core)
}

/// folded_frames(records: list[NDArray[np.float64]], halves: list[tuple[NDArray[np.float64], NDArray[np.float64]]], windows: list[tuple[int, int]], frames: tuple[int, int], begun: NDArray[np.float64], step: NDArray[np.float64], rows: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> None
///
/// Even parts of windows of channels by distance from their middles, and odd ones with the sign of
/// exp(−jωd), into `rows`: at the first level's samples and at half as many in each that follows,
/// records slowest, then windows, channels within each. `halves` are the records' by `halved` with
/// `begun`, or none without weights; `windows` each record's first and how many, `frames` their
/// samples and those between starts.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "records, windows, what is made of them, and where")]
fn folded_frames(
    py: Python<'_>,
    records: Vec<RowMajor2<'_, f64>>,
    halves: Vec<(RowMajor2<'_, f64>, RowMajor2<'_, f64>)>,
    windows: Vec<(usize, usize)>,
    frames: (usize, usize),
    begun: RowMajor1<'_, f64>,
    step: RowMajor1<'_, f64>,
    mut rows: Vec<(PyReadwriteArray1<'_, f64>, PyReadwriteArray1<'_, f64>)>,
) -> PyResult<()> {
    let frames = Frames { length: frames.0, hop: frames.1 };
    let bands = (HalfBand::new(begun.as_slice()?), HalfBand::new(step.as_slice()?));
    let begun = (!begun.as_slice()?.is_empty()).then_some(&bands.0);
    let ladder = Ladder { begun, step: &bands.1, levels: rows.len() };
    let mut pieces = Vec::with_capacity(records.len());
    for (at, (record, &(first, count))) in records.iter().zip(&windows).enumerate() {
        let halves = match halves.get(at) {
            Some((even, odd)) => [even.as_slice()?, odd.as_slice()?],
            None => [&[][..]; 2],
        };
        let (samples, n) = (record.as_slice()?, record.shape()[1]);
        pieces.push(Piece { samples, n, halves, first, count });
    }
    let mut found = Vec::with_capacity(rows.len());
    for (even, odd) in &mut rows {
        found.push([even.as_slice_mut()?, odd.as_slice_mut()?]);
    }
    py.detach(|| folded(&pieces, frames, ladder, &mut found)).map_err(from_core)
}

/// halved(samples: NDArray[np.float64], parity: int, weights: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Channels at places of even (0) or odd (1) number, those between weighed onto them: by `weights`,
/// nearest neighbours first.
#[pyfunction]
fn halved<'py>(
    py: Python<'py>,
    samples: RowMajor2<'_, f64>,
    parity: bool,
    weights: RowMajor1<'_, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (shape, band) = (samples.shape(), HalfBand::new(weights.as_slice()?));
    let (channels, parity) = (shape[0], usize::from(parity));
    let width = (shape[1] + 1).saturating_sub(parity) / 2;
    let rows = samples.as_slice()?.chunks_exact(shape[1].max(1));
    let mut found = Vec::with_capacity(channels * width);
    py.detach(|| rows.for_each(|row| found.extend_from_slice(&band.halved(row, parity))));
    found.into_pyarray(py).reshape([channels, width])
}

/// ranks(row: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Ranks about zero and of unit variance, ties sharing theirs; zeros where all numbers are the same.
#[pyfunction]
fn ranks<'py>(py: Python<'py>, row: RowMajor1<'_, f64>) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let row = row.as_slice()?;
    Ok(py.detach(|| ranked(row)).into_pyarray(py))
}

/// rank_bounds(rows: NDArray[np.float64], ranks: NDArray[np.float64]) -> NDArray[np.float64]
///
/// Upper bounds of the mean products of ranks, of unit mean square, with the ranks of each of some
/// rows of numbers that are not negative; infinite where nothing is told.
#[pyfunction]
fn rank_bounds<'py>(
    py: Python<'py>,
    rows: RowMajor2<'_, f64>,
    ranks: RowMajor1<'_, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let n = rows.as_array().ncols().max(1);
    let (rows, ranks) = (rows.as_slice()?, ranks.as_slice()?);
    let found: Vec<f64> =
        py.detach(|| rows.chunks_exact(n).map(|row| rank_bound(row, ranks)).collect());
    Ok(found.into_pyarray(py))
}

/// Add this file's names to the module.
///
/// # Errors
/// Never in practice; PyO3's own.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(composite, module)?)?;
    module.add_function(wrap_pyfunction!(drift_beside, module)?)?;
    module.add_function(wrap_pyfunction!(drift_likelihood, module)?)?;
    module.add_function(wrap_pyfunction!(folded_frames, module)?)?;
    module.add_function(wrap_pyfunction!(halved, module)?)?;
    module.add_function(wrap_pyfunction!(rank_bounds, module)?)?;
    module.add_function(wrap_pyfunction!(ranks, module)?)?;
    module.add_function(wrap_pyfunction!(autoregression_weights, module)?)
}
