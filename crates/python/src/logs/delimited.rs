//! Binding of `flightid_logs::delimited` (used by `record/formats/csv.py`).

use std::fs::File;
use std::path::PathBuf;

use flightid_logs::delimited::{Column, DelimitedError, Layout, read};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;

/// Numbers, or texts by their places in a list of them.
type PyColumn<'py> = (Option<Bound<'py, PyArray1<f64>>>, Bound<'py, PyArray1<u32>>, Vec<String>);

/// read_delimited(path: str, skipped_lines: int, n_columns: int, delimiter: str, is_utf16: bool, budget: int) -> list[tuple[NDArray[np.float64] | None, NDArray[np.uint32], list[str]]]
///
/// Columns of a text: numbers; else None, and the place of each row's text in a list.
///
/// ValueError says what is no table; MemoryError holds the bytes beyond the budget.
#[pyfunction]
fn read_delimited<'py>(
    py: Python<'py>,
    path: PathBuf,
    skipped_lines: usize,
    n_columns: usize,
    delimiter: char,
    is_utf16: bool,
    budget: usize,
) -> PyResult<Vec<PyColumn<'py>>> {
    let delimiter = u8::try_from(delimiter).map_err(|_| PyValueError::new_err("a delimiter"))?;
    let layout = Layout { skipped_lines, n_columns, delimiter, is_utf16, budget };
    let columns =
        py.detach(|| read(|| File::open(&path), &layout)).map_err(|error| match error {
            DelimitedError::File(error) => PyErr::from(error),
            DelimitedError::TooLarge { bytes } => PyMemoryError::new_err(bytes),
            _ => PyValueError::new_err(error.to_string()),
        })?;
    let converted = columns.into_iter().map(|column| match column {
        Column::Numbers(values) => {
            (Some(values.into_pyarray(py)), Vec::new().into_pyarray(py), vec![])
        }
        Column::Texts { codes, texts } => (None, codes.into_pyarray(py), texts),
    });
    Ok(converted.collect())
}

/// Add the functions of this file to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(read_delimited, module)?)
}
