//! Errors as Python exceptions: the package's own classes, so that `except palpate.Error` catches them all.

use numpy::AsSliceError;
use palpate_core::Error;
use palpate_devices::OpenError;
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError};
use pyo3::prelude::*;

/// What a function gives Python, or what it raises.
pub type Answer<T> = Result<T, Failure>;

/// The exception that a call raises.
pub struct Failure(PyErr);

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let class = match &error {
            Error::Interrupted => return Self(PyKeyboardInterrupt::new_err(())),
            Error::Io { path, source } => {
                let message = source.to_string();
                return Self(PyOSError::new_err((source.raw_os_error(), message, path.display().to_string())));
            }
            Error::Store { .. } => "StoreError",
            Error::Precision(_) => "PrecisionError",
            Error::Singular(_) | Error::Invalid(_) | Error::Memory(_) => "BodyError",
        };
        Self::of_class(class, &error.to_string())
    }
}

impl From<OpenError> for Failure {
    fn from(error: OpenError) -> Self {
        Self::of_class("DeviceError", &error.to_string())
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self(error)
    }
}

impl From<AsSliceError> for Failure {
    fn from(error: AsSliceError) -> Self {
        Self(error.into())
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        failure.0
    }
}

impl Failure {
    /// One of the package's own exceptions.
    fn of_class(class: &str, message: &str) -> Self {
        Python::attach(|py| {
            let class = py.import("palpate.errors").and_then(|errors| errors.getattr(class));
            Self(class.and_then(|class| class.call1((message,))).map_or_else(|error| error, PyErr::from_value))
        })
    }
}
