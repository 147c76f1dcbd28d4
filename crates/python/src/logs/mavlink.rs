//! Binding of `flightid_logs::mavlink` (used by `logs/mavlink/reader.py`).

use flightid_logs::mavlink::{Known, is_telemetry, read};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::from_logs;

type Frames<'py> = ((u32, u8, u8), Bound<'py, PyArray1<f64>>, Bound<'py, PyBytes>);

/// is_telemetry_log(head: bytes) -> bool
///
/// Whether bytes begin as a telemetry log of a ground station does.
#[pyfunction]
fn is_telemetry_log(head: &[u8]) -> bool {
    is_telemetry(head)
}

/// telemetry_frames(data: bytes, known: dict[int, tuple[int, int]], budget: int) -> tuple[list[tuple[tuple[int, int, int], NDArray[np.float64], bytes]], int]
///
/// Of each message, system and component the stamps (s) and payloads, padded to their width; and
/// bytes in no frame. MemoryError holds the bytes beyond the budget.
#[pyfunction]
fn telemetry_frames<'py>(
    py: Python<'py>,
    data: &[u8],
    known: Known,
    budget: usize,
) -> PyResult<(Vec<Frames<'py>>, usize)> {
    let log = py.detach(|| read(data, &known, budget)).map_err(from_logs)?;
    let found = log.frames.into_iter().map(|(key, frames)| {
        let stamps: Vec<f64> = frames.stamps_us.iter().map(|&us| us as f64 / 1e6).collect();
        (key, stamps.into_pyarray(py), PyBytes::new(py, &frames.payloads))
    });
    Ok((found.collect(), log.lost))
}

/// Add what this file holds to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(is_telemetry_log, module)?)?;
    module.add_function(wrap_pyfunction!(telemetry_frames, module)?)
}
