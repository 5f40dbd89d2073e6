//! Errors as exceptions.

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    stonewise,
    Error,
    PyException,
    "Why something could not be done, in the words of the command line."
);

/// An exception with this text.
pub fn error(text: impl Into<String>) -> PyErr {
    Error::new_err(text.into())
}

/// An exception with the text that the command line would print.
pub fn explained(cause: impl Into<anyhow::Error>) -> PyErr {
    error(stonewise_cli::explain(&cause.into()))
}
