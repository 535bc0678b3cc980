//! Errors of arguments as Python's exceptions.

use darkqa_ground::error::Error;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A `TypeError` that names an argument, what it takes, and the type of what was given.
pub(crate) fn wrong_type(name: &str, expected: &str, given: &Bound<'_, PyAny>) -> PyErr {
    let given = given.get_type().name();
    let given = given.map_or_else(|_| "another type".to_owned(), |name| name.to_string());
    PyTypeError::new_err(format!("{name}: {expected} expected, got {given}"))
}

/// A `ValueError` with the words of an error of the synthesis, and the name of an argument instead of the program's flag.
pub(crate) fn value_error(error: &Error) -> PyErr {
    let text = error.to_string();
    PyValueError::new_err(text.strip_prefix("--").unwrap_or(&text).to_owned())
}
