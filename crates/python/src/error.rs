//! Rust errors to Python exception classes: one exhaustive match for each error type, so that a new
//! variant without a Python class does not compile. The classes live in `flightid.errors`.

use flightid_core::CoreError;
use flightid_logs::LogError;
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

fn raise(class: &str, message: String) -> PyErr {
    Python::attach(|py| {
        let made = py
            .import("flightid.errors")
            .and_then(|module| module.getattr(class))
            .and_then(|class| class.call1((message,)));
        match made {
            Ok(instance) => PyErr::from_value(instance),
            Err(error) => error,
        }
    })
}

/// The Python exception for a numerics error.
pub fn from_core(error: CoreError) -> PyErr {
    let message = error.to_string();
    match error {
        CoreError::Shape { .. } => raise("ShapeError", message),
        CoreError::Range { .. } => raise("OptionError", message),
        CoreError::NotFinite { .. } => raise("DataError", message),
        CoreError::Diverged { .. } => raise("DataError", message),
        CoreError::Singular { .. } => raise("SingularError", message),
        CoreError::Expression { .. } => raise("ModelError", message),
        CoreError::UnknownName { .. } => raise("ModelError", message),
        CoreError::Circular { .. } => raise("ModelError", message),
    }
}

/// The Python exception for a log error.
pub fn from_logs(error: LogError) -> PyErr {
    let message = error.to_string();
    match error {
        LogError::NotALog { .. } => raise("LogFormatError", message),
        LogError::Missing { .. } => raise("MissingColumnError", message),
        // `reading.within_memory` says what to do.
        LogError::TooLarge { bytes } => PyMemoryError::new_err(bytes),
        LogError::Unsupported { .. } | LogError::Changed { .. } => raise("LogFormatError", message),
    }
}
