//! Data in a script of a page: [`embedded`].

use serde::Serialize;

use crate::error::{Error, Result};

/// A value as JSON for a `script` element, as a program or as data, escaped so that nothing in it ends the script or opens a comment.
///
/// # Errors
/// If the value cannot be written.
pub(crate) fn embedded<T: Serialize>(value: &T) -> Result<String> {
    let text = serde_json::to_string(value).map_err(|e| Error::data("page", e))?;
    // A bracket stands in strings alone.
    Ok(text.replace('<', "\\u003c"))
}
