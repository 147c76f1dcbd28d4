//! Binding of `flightid_logs::dataflash` (used by `logs/dataflash/reader.py`).

use std::path::PathBuf;

use flightid_logs::LogError;
use flightid_logs::dataflash::{Dataflash, Field, Table, printed};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error::from_logs;
use crate::file_bytes::FileBytes;

/// Field as Python sees it: label, format character, unit, multiplier, numbers a row.
type FieldRow = (String, char, String, f64, usize);
/// Table as Python sees it: name, type, rows.
type TableRow<'a> = (&'a str, u8, usize);
/// Instances, and first stamp, last stamp and usual step, s.
type Description = (Vec<i64>, Option<(f64, f64, Option<f64>)>);

/// An indexed DataFlash log with its bytes.
#[pyclass(frozen)]
struct DataflashFile(Dataflash<FileBytes>);

/// open_dataflash(path: str) -> DataflashFile
///
/// Map and index a log. Of a file that is shortened while it is in use every reading fails.
#[pyfunction]
fn open_dataflash(py: Python<'_>, path: PathBuf) -> PyResult<DataflashFile> {
    let bytes = py.detach(|| FileBytes::open(&path))?;
    index(py, bytes)
}

/// index_dataflash(data: bytes) -> DataflashFile
///
/// Index a log that is in memory; the bytes are copied.
#[pyfunction]
fn index_dataflash(py: Python<'_>, data: &[u8]) -> PyResult<DataflashFile> {
    index(py, FileBytes::Owned(data.to_vec()))
}

/// dataflash_of_text(text: bytes, budget: int) -> tuple[bytes, int]
///
/// The binary log that a text log was printed from, and how many of its lines are no message.
/// MemoryError holds the bytes beyond the budget.
#[pyfunction]
fn dataflash_of_text<'py>(
    py: Python<'py>,
    text: &[u8],
    budget: usize,
) -> PyResult<(Bound<'py, PyBytes>, usize)> {
    let made = py.detach(|| printed::to_binary(text, budget)).map_err(from_logs)?;
    Ok((PyBytes::new(py, &made.bytes), made.bad_lines))
}

fn index(py: Python<'_>, bytes: FileBytes) -> PyResult<DataflashFile> {
    let log = py.detach(|| Dataflash::open(bytes));
    let log = log.map(DataflashFile).map_err(from_logs)?;
    log.0.source().require_whole()?;
    Ok(log)
}

impl DataflashFile {
    /// Every reading of rows comes through here: what was read of a file that was cut is refused.
    fn read<T: Send>(&self, py: Python<'_>, work: impl Send + FnOnce() -> T) -> PyResult<T> {
        let made = py.detach(work);
        self.0.source().require_whole()?;
        Ok(made)
    }

    fn table_at(&self, table: usize) -> PyResult<&Table> {
        self.0.tables().get(table).ok_or_else(|| missing("table", table))
    }

    fn field_at(&self, table: usize, field: usize) -> PyResult<(&Table, &Field)> {
        let table = self.table_at(table)?;
        Ok((table, table.fields().get(field).ok_or_else(|| missing("field", field))?))
    }
}

fn missing(what: &'static str, place: usize) -> PyErr {
    from_logs(LogError::Missing { what, name: place.to_string(), available: "fewer".to_owned() })
}

#[pymethods]
impl DataflashFile {
    /// tables(self) -> list[tuple[str, int, int]]
    ///
    /// Every message type that is defined: name, type and rows.
    fn tables(&self) -> Vec<TableRow<'_>> {
        let tables = self.0.tables().iter();
        tables.map(|table| (table.name(), table.type_id(), table.len())).collect()
    }

    /// fields(self, table: int) -> list[tuple[str, str, str, float, int]]
    ///
    /// Fields of a table: label, format character, unit, multiplier, numbers a row (0 for text).
    fn fields(&self, table: usize) -> PyResult<Vec<FieldRow>> {
        let fields = self.table_at(table)?.fields().iter().map(|field| {
            let (scale, width) = (field.scale.factor(), field.kind.width());
            (field.name.clone(), field.code, field.unit.clone(), scale, width)
        });
        Ok(fields.collect())
    }

    /// offsets(self, table: int) -> NDArray[np.float64]
    ///
    /// Place of each row in the file.
    fn offsets<'py>(&self, py: Python<'py>, table: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let places = self.table_at(table)?.offsets().iter().map(|place| place as f64);
        Ok(places.collect::<Vec<f64>>().into_pyarray(py))
    }

    /// describe(self, table: int) -> tuple[list[int], tuple[float, float, float | None] | None]
    ///
    /// Instances of a table, and its first stamp, last stamp and median step in s.
    fn describe(&self, py: Python<'_>, table: usize) -> PyResult<Description> {
        let table = self.table_at(table)?;
        self.read(py, || {
            let instances = self.0.instances(table);
            let stamps = self.0.describe(table, &instances);
            (instances, stamps.map(|found| (found.first_s, found.last_s, found.interval_s)))
        })
    }

    /// skipped(self) -> list[tuple[int, int, str]]
    ///
    /// Byte ranges that are in no message: start, stop, reason.
    fn skipped(&self) -> Vec<(usize, usize, String)> {
        let ranges = self.0.skipped().iter();
        ranges.map(|range| (range.start, range.stop, range.reason.to_string())).collect()
    }

    /// silences(self, longest_s: float) -> list[tuple[float, float]]
    ///
    /// Last stamp before and first after each span above `longest_s` without any stamp, s.
    fn silences(&self, py: Python<'_>, longest_s: f64) -> PyResult<Vec<(f64, f64)>> {
        self.read(py, || self.0.silences(longest_s))
    }

    /// size(self) -> int
    ///
    /// Bytes of the file.
    fn size(&self) -> usize {
        self.0.bytes().len()
    }

    /// rows(self, table: int, instance: int | None) -> int
    ///
    /// Rows of a table, or of one instance.
    #[pyo3(signature = (table, instance))]
    fn rows(&self, py: Python<'_>, table: usize, instance: Option<i64>) -> PyResult<usize> {
        let table = self.table_at(table)?;
        self.read(py, || self.0.rows(table, instance))
    }

    /// numbers(self, table: int, field: int, instance: int | None) -> NDArray[np.float64]
    ///
    /// Scaled numbers, flat; an array field has 32 a row.
    #[pyo3(signature = (table, field, instance))]
    fn numbers<'py>(
        &self,
        py: Python<'py>,
        table: usize,
        field: usize,
        instance: Option<i64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (table, field) = self.field_at(table, field)?;
        Ok(self.read(py, || self.0.numbers(table, field, instance))?.into_pyarray(py))
    }

    /// columns(self, table: int, fields: list[int], instance: int | None) -> list[NDArray[np.float64]]
    ///
    /// Scaled numbers of several fields, as by `numbers`, in one pass over the rows.
    #[pyo3(signature = (table, fields, instance))]
    fn columns<'py>(
        &self,
        py: Python<'py>,
        table: usize,
        fields: Vec<usize>,
        instance: Option<i64>,
    ) -> PyResult<Vec<Bound<'py, PyArray1<f64>>>> {
        let field_at = |field| self.field_at(table, field).map(|(_, field)| field);
        let fields: Vec<&Field> = fields.into_iter().map(field_at).collect::<PyResult<_>>()?;
        let table = self.table_at(table)?;
        let columns = self.read(py, || self.0.columns(table, &fields, instance))?;
        Ok(columns.into_iter().map(|values| values.into_pyarray(py)).collect())
    }

    /// stamps(self, table: int, instance: int | None) -> NDArray[np.float64] | None
    ///
    /// Stamps in s; None where the message has none.
    #[pyo3(signature = (table, instance))]
    fn stamps<'py>(
        &self,
        py: Python<'py>,
        table: usize,
        instance: Option<i64>,
    ) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let table = self.table_at(table)?;
        let stamps = self.read(py, || self.0.stamps(table, instance))?;
        Ok(stamps.map(|values| values.into_pyarray(py)))
    }

    /// texts(self, table: int, field: int, instance: int | None) -> list[str]
    ///
    /// Texts of a field that holds text.
    #[pyo3(signature = (table, field, instance))]
    fn texts(
        &self,
        py: Python<'_>,
        table: usize,
        field: usize,
        instance: Option<i64>,
    ) -> PyResult<Vec<String>> {
        let (table, field) = self.field_at(table, field)?;
        self.read(py, || self.0.texts(table, field, instance))
    }
}

/// Add the functions of this file to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<DataflashFile>()?;
    module.add_function(wrap_pyfunction!(open_dataflash, module)?)?;
    module.add_function(wrap_pyfunction!(index_dataflash, module)?)?;
    module.add_function(wrap_pyfunction!(dataflash_of_text, module)?)
}
