//! Groups of parameters: mappings from field name to value, read into structs of the core.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A value of a group by name.
///
/// # Errors
/// `ValueError` where the group lacks it.
pub fn item<'py>(group: &Bound<'py, PyDict>, key: &str) -> PyResult<Bound<'py, PyAny>> {
    group.get_item(key)?.ok_or_else(|| PyValueError::new_err(format!("{key} is missing")))
}

/// Read the named fields of a struct from a group.
macro_rules! read {
    ($group:expr, $type:ident { $($field:ident),* $(,)? }) => {
        $type { $($field: $crate::group::item($group, stringify!($field))?.extract()?),* }
    };
}

pub(crate) use read;
