//! Data within a script of a page: [`embedded`].

use serde::Serialize;

use crate::error::{Error, Result};

/// A value as JSON that stands within a script: nothing in it ends the script or opens a comment.
///
/// # Errors
/// Where it cannot be written.
pub(super) fn embedded<T: Serialize>(value: &T) -> Result<String> {
    let text = serde_json::to_string(value).map_err(|e| Error::data("page", e))?;
    Ok(text.replace("</", "<\\/").replace("<!--", "<\\!--"))
}
