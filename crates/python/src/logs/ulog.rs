//! Binding of `flightid_logs::ulog` (used by `logs/ulog/reader.py`).

use std::path::PathBuf;

use flightid_logs::ulog::Ulog;
use flightid_logs::ulog::entry::{Entry, Value};
use numpy::{IntoPyArray, PyArray1};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::from_logs;
use crate::file_bytes::FileBytes;

type Pair = (String, Py<PyAny>);
type Line = (u64, u8, Option<u16>, String);

/// __init__(self, data: bytes) -> None
///
/// Index of a PX4 ULog; columns are gathered from the bytes, here a copy, when they are asked for.
#[pyclass(frozen, name = "Ulog", module = "flightid._native")]
pub struct PyUlog {
    data: FileBytes,
    log: Ulog,
}

/// open_ulog(path: str) -> Ulog
///
/// Map and index a log. Of a file that is shortened while it is in use every reading fails.
#[pyfunction]
fn open_ulog(py: Python<'_>, path: PathBuf) -> PyResult<PyUlog> {
    let bytes = py.detach(|| FileBytes::open(&path))?;
    index(py, bytes)
}

fn index(py: Python<'_>, data: FileBytes) -> PyResult<PyUlog> {
    let log = py.detach(|| Ulog::index(data.as_ref()));
    data.require_whole()?;
    Ok(PyUlog { data, log: log.map_err(from_logs)? })
}

#[pymethods]
impl PyUlog {
    #[new]
    fn new(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        index(py, FileBytes::Owned(data.to_vec()))
    }

    /// size(self) -> int
    ///
    /// Bytes of the file.
    fn size(&self) -> usize {
        self.data.as_ref().len()
    }

    /// header(self) -> tuple[int, int, int, list[int]]
    ///
    /// Version, start on the boot clock (us), synchronisation records, places of appended data.
    fn header(&self) -> (u8, u64, u64, Vec<usize>) {
        (self.log.version, self.log.start_us, self.log.syncs, self.log.appended.clone())
    }

    /// tables(self) -> list[tuple[str, int, int]]
    ///
    /// Name, instance and rows of every announced table.
    fn tables(&self) -> Vec<(String, u8, usize)> {
        let tables = self.log.tables.iter();
        tables.map(|table| (table.name.to_string(), table.instance, table.offsets.len())).collect()
    }

    /// columns(self, message: str) -> list[tuple[str, str]]
    ///
    /// Name and type of the flattened columns of a message; empty where it has none.
    fn columns(&self, message: &str) -> Vec<(String, String)> {
        let columns = self.log.formats.columns(message).into_iter();
        columns.map(|column| (column.name, column.primitive.name().to_string())).collect()
    }

    /// gather(self, message: str, instance: int | None, columns: list[str]) -> list[NDArray[np.float64]]
    ///
    /// Values of some columns of an instance, or of all instances in file order.
    fn gather<'py>(
        &self,
        py: Python<'py>,
        message: &str,
        instance: Option<u8>,
        columns: Vec<String>,
    ) -> PyResult<Vec<Bound<'py, PyArray1<f64>>>> {
        let bytes = self.data.as_ref();
        let gathered = py.detach(|| self.log.gather(bytes, message, instance, &columns));
        self.data.require_whole()?;
        let arrays = gathered.map_err(from_logs)?;
        Ok(arrays.into_iter().map(|values| values.into_pyarray(py)).collect())
    }

    /// infos(self) -> list[tuple[str, int | float | str | bytes]]
    ///
    /// Information entries in file order.
    fn infos(&self, py: Python<'_>) -> PyResult<Vec<Pair>> {
        self.log.infos.iter().map(|entry| pair(py, entry)).collect()
    }

    /// multi_infos(self) -> list[tuple[bool, str, int | float | str | bytes]]
    ///
    /// Parts of multiple-information entries; true where a part continues the one before.
    fn multi_infos(&self, py: Python<'_>) -> PyResult<Vec<(bool, String, Py<PyAny>)>> {
        let parts = self.log.multi_infos.iter();
        parts
            .map(|(continues, entry)| {
                pair(py, entry).map(|(name, value)| (*continues, name, value))
            })
            .collect()
    }

    /// parameters(self) -> list[tuple[str, int | float | str | bytes]]
    ///
    /// Parameters when logging started.
    fn parameters(&self, py: Python<'_>) -> PyResult<Vec<Pair>> {
        self.log.parameters.iter().map(|entry| pair(py, entry)).collect()
    }

    /// defaults(self) -> list[tuple[int, str, int | float | str | bytes]]
    ///
    /// Default values with the bits that say whose: 1 the system's, 2 this airframe's.
    fn defaults(&self, py: Python<'_>) -> PyResult<Vec<(u8, String, Py<PyAny>)>> {
        let defaults = self.log.defaults.iter();
        defaults
            .map(|(kinds, entry)| pair(py, entry).map(|(name, value)| (*kinds, name, value)))
            .collect()
    }

    /// changes(self) -> list[tuple[int, str, int | float | str | bytes]]
    ///
    /// Stamp (us), name and value of parameters set while logging.
    fn changes(&self, py: Python<'_>) -> PyResult<Vec<(u64, String, Py<PyAny>)>> {
        let changes = self.log.changes.iter();
        changes
            .map(|change| {
                pair(py, &change.item).map(|(name, value)| (change.stamp_us, name, value))
            })
            .collect()
    }

    /// lines(self) -> list[tuple[int, int, int | None, str]]
    ///
    /// Stamp (us), severity, tag and text of logged lines.
    fn lines(&self) -> Vec<Line> {
        let lines = self.log.lines.iter();
        lines.map(|line| (line.stamp_us, line.level, line.tag, line.text.clone())).collect()
    }

    /// dropouts(self) -> list[tuple[int, int]]
    ///
    /// Stamp of the last sample before (us) and length (ms) of the logger's dropouts.
    fn dropouts(&self) -> Vec<(u64, u16)> {
        let dropouts = self.log.dropouts.iter();
        dropouts.map(|dropout| (dropout.stamp_us, dropout.item)).collect()
    }

    /// skipped(self) -> list[tuple[int, int, str]]
    ///
    /// Byte ranges that were not read, with the reason.
    fn skipped(&self) -> Vec<(usize, usize, &'static str)> {
        let ranges = self.log.skipped.iter();
        ranges.map(|range| (range.start, range.stop, range.reason.words())).collect()
    }
}

fn pair(py: Python<'_>, entry: &Entry) -> PyResult<Pair> {
    let value = match &entry.value {
        Value::Integer(value) => value.into_py_any(py)?,
        Value::Real(value) => value.into_py_any(py)?,
        Value::Text(text) => text.into_py_any(py)?,
        Value::Bytes(bytes) => PyBytes::new(py, bytes).into_py_any(py)?,
    };
    Ok((entry.name.clone(), value))
}

/// Add the class of this file to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyUlog>()?;
    module.add_function(wrap_pyfunction!(open_ulog, module)?)
}
