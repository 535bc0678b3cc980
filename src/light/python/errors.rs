//! Python exceptions about arguments.

use darkqa_base::error::Error;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// `TypeError` with the argument's name, the expected value, and the type of the given one.
pub(crate) fn wrong_type(name: &str, expected: &str, given: &Bound<'_, PyAny>) -> PyErr {
    let given = match given.get_type().name() {
        Ok(name) => name.to_string(),
        Err(_) => "another type".to_owned(),
    };
    PyTypeError::new_err(format!("{name}: {expected} expected, got {given}"))
}

/// `ValueError` with the message of an error of the synthesis. The program's flag at its start becomes the argument's
/// name.
pub(crate) fn value_error(error: &Error) -> PyErr {
    let text = error.to_string();
    PyValueError::new_err(text.strip_prefix("--").unwrap_or(&text).to_owned())
}
