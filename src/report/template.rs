//! Rendering of HTML pages from templates: [`render`].

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::types::text::escape_hidden;

/// Parts that several pages share: placeholder in a template, and its text.
const PARTS: [(&str, &str); 3] = [
    ("<!-- figures -->", include_str!("page/figures.html")),
    ("<!-- tables -->", include_str!("page/tables.html")),
    // The part of tables contains this placeholder, so it must come later.
    ("<!-- rows -->", include_str!("page/rows.html")),
];

/// Renders a template as HTML. Values are escaped, and hidden characters are made visible.
///
/// # Errors
/// If the template cannot be rendered.
pub(super) fn render(template: &str, values: impl Serialize) -> Result<String> {
    let whole = PARTS.iter().fold(template.to_owned(), |text, (placeholder, part)| text.replace(placeholder, part));
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    let page =
        environment.render_named_str("page", &whole, Serde(values)).map_err(|e| Error::data("report.html", e))?;
    Ok(escape_hidden(&page).into_owned())
}
