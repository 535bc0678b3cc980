//! HTML pages from templates: [`filled`].

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::types::text::escape_hidden;

/// Parts that several pages share, each with its placeholder in the templates.
const PARTS: [(&str, &str); 3] = [
    ("<!-- figures -->", include_str!("page/figures.html")),
    ("<!-- tables -->", include_str!("page/tables.html")),
    // The rows of a table, which stand in that part.
    ("<!-- rows -->", include_str!("page/rows.html")),
];

/// The HTML of a template with its values, which are escaped, and without hidden characters.
///
/// # Errors
/// If the template cannot be filled.
pub(super) fn filled(template: &str, values: impl Serialize) -> Result<String> {
    let failed = |e: &dyn std::fmt::Display| Error::data("report.html", e);
    let whole = PARTS
        .iter()
        .fold(template.to_owned(), |text, (placeholder, part)| {
            text.replace(placeholder, part)
        });
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment
        .add_template("page", &whole)
        .map_err(|e| failed(&e))?;
    let template = environment.get_template("page").map_err(|e| failed(&e))?;
    let page = template.render(Serde(values)).map_err(|e| failed(&e))?;
    Ok(escape_hidden(&page).into_owned())
}
