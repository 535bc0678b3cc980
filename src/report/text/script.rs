//! Data in a `script` element of an HTML page: [`to_script_json`].

use serde::Serialize;

use crate::error::{Error, Result};

/// A value as JSON for a `script` element, escaped so that it cannot end the script or open a comment.
///
/// # Errors
/// If the value cannot be serialized.
pub(crate) fn to_script_json<T: Serialize>(value: &T) -> Result<String> {
    let text = serde_json::to_string(value).map_err(|e| Error::data("page", e))?;
    // In JSON, `<` occurs only inside strings.
    Ok(text.replace('<', "\\u003c"))
}
