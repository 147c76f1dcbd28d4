//! Binding of `flightid_logs::blackbox` (used by `logs/blackbox/reader.py`).

use flightid_logs::LogError;
use flightid_logs::blackbox::{Blackbox, FrameTable, flights};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::from_logs;

type Event = (Option<i64>, u8, i64, i64);

/// __init__(self, data: bytes, flight: int, budget: int) -> None
///
/// One flight of a blackbox log, decoded; MemoryError holds the bytes beyond the budget.
#[pyclass(frozen, name = "Blackbox", module = "flightid._native")]
pub struct PyBlackbox {
    log: Blackbox,
}

#[pymethods]
impl PyBlackbox {
    #[new]
    fn new(py: Python<'_>, data: &[u8], flight: usize, budget: usize) -> PyResult<Self> {
        let decoded = py.detach(|| {
            let (start, stop) = flights(data).get(flight).copied().unwrap_or((0, data.len()));
            Blackbox::decode(&data[start..stop], budget)
        });
        Ok(Self { log: decoded.map_err(from_logs)? })
    }

    /// headers(self) -> list[tuple[str, str]]
    ///
    /// Name and value of each line of the header.
    fn headers(&self) -> Vec<(String, String)> {
        self.log.header.lines.clone()
    }

    /// tables(self) -> list[tuple[str, list[str], int]]
    ///
    /// Name, columns and rows of the frames of the loop, of slow changes and of positions.
    fn tables(&self) -> Vec<(&'static str, Vec<String>, usize)> {
        let named = [("main", &self.log.main), ("slow", &self.log.slow), ("gps", &self.log.gps)];
        named
            .map(|(name, table)| (name, table.names.clone(), table.stamps_us.len()))
            .into_iter()
            .collect()
    }

    /// numbers(self, table: str, column: int) -> NDArray[np.float64]
    ///
    /// Values of a column as logged.
    fn numbers<'py>(
        &self,
        py: Python<'py>,
        table: &str,
        column: usize,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let values = self.table(table)?.numbers(column).ok_or_else(|| missing(table, column))?;
        Ok(values.into_pyarray(py))
    }

    /// stamps_us(self, table: str) -> NDArray[np.float64]
    ///
    /// Stamps of a table's rows, µs, without the clock's turning over.
    fn stamps_us<'py>(&self, py: Python<'py>, table: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let stamps = self.table(table)?.stamps_us.iter();
        Ok(stamps.map(|&stamp| stamp as f64).collect::<Vec<_>>().into_pyarray(py))
    }

    /// events(self) -> list[tuple[int | None, int, int, int]]
    ///
    /// Stamp (µs), kind and two values of each event.
    fn events(&self) -> Vec<Event> {
        let events = self.log.events.iter();
        events.map(|event| (event.stamp_us, event.kind, event.values[0], event.values[1])).collect()
    }

    /// skipped(self) -> list[tuple[int, int, str]]
    ///
    /// Byte ranges of the flight that hold no frame, with the reason.
    fn skipped(&self) -> Vec<(usize, usize, &'static str)> {
        self.log.skipped.iter().map(|range| (range.start, range.stop, range.reason)).collect()
    }

    /// ending(self) -> tuple[bool, int]
    ///
    /// Whether the logger ended the flight itself, and frames that lost those they build on.
    fn ending(&self) -> (bool, usize) {
        (self.log.ended, self.log.undecodable)
    }
}

impl PyBlackbox {
    fn table(&self, name: &str) -> PyResult<&FrameTable> {
        match name {
            "main" => Ok(&self.log.main),
            "slow" => Ok(&self.log.slow),
            "gps" => Ok(&self.log.gps),
            _ => Err(missing(name, 0)),
        }
    }
}

fn missing(table: &str, column: usize) -> PyErr {
    from_logs(LogError::Missing {
        what: "column",
        name: format!("{table}[{column}]"),
        available: "main, slow, gps".to_string(),
    })
}

/// blackbox_flights(data: bytes) -> list[tuple[int, int]]
///
/// Where each flight of a blackbox file begins and ends.
#[pyfunction]
fn blackbox_flights(py: Python<'_>, data: &[u8]) -> Vec<(usize, usize)> {
    py.detach(|| flights(data))
}

/// Add what this file holds to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(blackbox_flights, module)?)?;
    module.add_class::<PyBlackbox>()
}
