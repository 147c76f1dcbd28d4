//! Binding of `flightid_logs::dataflash` (used by `logs/dataflash.py`).

use std::path::PathBuf;

use flightid_logs::LogError;
use flightid_logs::dataflash::{Dataflash, Field, Table};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;

use crate::error::from_logs;

/// Field as Python sees it: label, format character, unit, multiplier, numbers a row.
type FieldRow = (String, char, String, f64, usize);
/// Table as Python sees it: name, type, rows, fields.
type TableRow = (String, u8, usize, Vec<FieldRow>);
/// Instances, and first stamp, last stamp and usual step, s.
type Description = (Vec<i64>, Option<(f64, f64, Option<f64>)>);

/// An indexed DataFlash log with its bytes.
///
/// The bytes are owned, not mapped: a Rust slice over a mapping is only sound while no other process
/// writes or cuts the file (a read behind the cut would end the process), and a log that is being
/// copied is cut. Reading costs about half a millisecond a megabyte and lets every method release
/// the interpreter lock without a line of unsafe code.
#[pyclass(frozen)]
struct DataflashFile(Dataflash<Vec<u8>>);

/// open_dataflash(path: str) -> DataflashFile
///
/// Read and index a log.
#[pyfunction]
fn open_dataflash(py: Python<'_>, path: PathBuf) -> PyResult<DataflashFile> {
    let bytes = py.detach(|| std::fs::read(path))?;
    index(py, bytes)
}

/// index_dataflash(data: bytes) -> DataflashFile
///
/// Index a log that is in memory; the bytes are copied.
#[pyfunction]
fn index_dataflash(py: Python<'_>, data: &[u8]) -> PyResult<DataflashFile> {
    index(py, data.to_vec())
}

fn index(py: Python<'_>, bytes: Vec<u8>) -> PyResult<DataflashFile> {
    py.detach(|| Dataflash::open(bytes)).map(DataflashFile).map_err(from_logs)
}

impl DataflashFile {
    fn table_at(&self, table: usize) -> PyResult<&Table> {
        self.0.tables().get(table).ok_or_else(|| missing("table", table))
    }

    fn field_at(&self, table: usize, field: usize) -> PyResult<(&Table, &Field)> {
        let table = self.table_at(table)?;
        Ok((table, table.fields().get(field).ok_or_else(|| missing("field", field))?))
    }

    fn row(&self, table: &Table) -> TableRow {
        let fields = table.fields().iter().map(|field| {
            let (scale, width) = (field.scale.factor(), field.kind.width());
            (field.name.clone(), field.code, field.unit.clone(), scale, width)
        });
        (table.name().to_owned(), table.type_id(), table.len(), fields.collect())
    }
}

fn missing(what: &'static str, place: usize) -> PyErr {
    from_logs(LogError::Missing { what, name: place.to_string(), available: "fewer".to_owned() })
}

#[pymethods]
impl DataflashFile {
    /// tables(self) -> list[tuple[str, int, int, list[tuple[str, str, str, float, int]]]]
    ///
    /// Every message type that is defined: name, type, rows and fields (label, format character,
    /// unit, multiplier, numbers a row).
    fn tables(&self) -> Vec<TableRow> {
        self.0.tables().iter().map(|table| self.row(table)).collect()
    }

    /// describe(self, table: int) -> tuple[list[int], tuple[float, float, float | None] | None]
    ///
    /// Instances of a table, and its first stamp, last stamp and median step in s.
    fn describe(&self, py: Python<'_>, table: usize) -> PyResult<Description> {
        let table = self.table_at(table)?;
        Ok(py.detach(|| {
            let instances = self.0.instances(table);
            let stamps = self.0.describe(table, &instances);
            (instances, stamps.map(|found| (found.first_s, found.last_s, found.interval_s)))
        }))
    }

    /// skipped(self) -> list[tuple[int, int, str]]
    ///
    /// Byte ranges that are in no message: start, stop, reason.
    fn skipped(&self) -> Vec<(usize, usize, String)> {
        let ranges = self.0.skipped().iter();
        ranges.map(|range| (range.start, range.stop, range.reason.to_string())).collect()
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
        Ok(py.detach(|| self.0.rows(table, instance)))
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
        Ok(py.detach(|| self.0.numbers(table, field, instance)).into_pyarray(py))
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
        let stamps = py.detach(|| self.0.stamps(table, instance));
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
        Ok(py.detach(|| self.0.texts(table, field, instance)))
    }
}

/// Add the functions of this file to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<DataflashFile>()?;
    module.add_function(wrap_pyfunction!(open_dataflash, module)?)?;
    module.add_function(wrap_pyfunction!(index_dataflash, module)?)
}
