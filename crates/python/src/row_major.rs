//! Arrays of the caller, row by row whatever order they have in memory. (Python side: none)
//!
//! NumPy's own views hand a column-major array over as one slice too, in the wrong order, and refuse
//! one with gaps: both are copied here, once, at the face.

use std::ops::Deref;

use numpy::{Element, Ix1, Ix2, Ix3, PyReadonlyArray, PyUntypedArrayMethods, ndarray::Dimension};
use pyo3::prelude::*;

/// A read-only array whose slice runs row by row.
pub struct RowMajor<'py, T: Element, D: Dimension>(PyReadonlyArray<'py, T, D>);

/// Of one dimension.
pub type RowMajor1<'py, T> = RowMajor<'py, T, Ix1>;
/// Of two.
pub type RowMajor2<'py, T> = RowMajor<'py, T, Ix2>;
/// Of three.
pub type RowMajor3<'py, T> = RowMajor<'py, T, Ix3>;

impl<'a, 'py, T: Element + 'a, D: Dimension + 'a> FromPyObject<'a, 'py> for RowMajor<'py, T, D> {
    type Error = PyErr;

    fn extract(given: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let array: PyReadonlyArray<'py, T, D> = given.extract()?;
        if array.is_c_contiguous() {
            return Ok(Self(array));
        }
        let copied = given.call_method1("copy", ("C",))?;
        Ok(Self(copied.extract()?))
    }
}

impl<'py, T: Element, D: Dimension> Deref for RowMajor<'py, T, D> {
    type Target = PyReadonlyArray<'py, T, D>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}
