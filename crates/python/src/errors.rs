//! Core errors as Python exceptions: the package's own classes, so that `except palpate.Error` catches them all.

use palpate_core::Error;
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError};
use pyo3::prelude::*;

/// The Python exception for a core error.
pub fn to_python(py: Python<'_>, error: Error) -> PyErr {
    let class = match &error {
        Error::Interrupted => return PyKeyboardInterrupt::new_err(()),
        Error::Io { path, source } => {
            let message = source.to_string();
            return PyOSError::new_err((source.raw_os_error(), message, path.display().to_string()));
        }
        Error::Store { .. } => "StoreError",
        Error::Precision(_) => "PrecisionError",
        Error::Singular(_) | Error::Invalid(_) | Error::Memory(_) => "BodyError",
    };
    raised(py, class, error.to_string())
}

/// One of the package's own exceptions.
pub fn raised(py: Python<'_>, class: &str, message: String) -> PyErr {
    match py.import("palpate.errors").and_then(|m| m.getattr(class)).and_then(|c| c.call1((message,))) {
        Ok(exception) => PyErr::from_value(exception),
        Err(import_error) => import_error,
    }
}
