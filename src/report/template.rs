//! HTML pages from templates: [`filled`].

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, HtmlEscape, Value};
use serde::Serialize;

use crate::error::{Error, Result};
use crate::types::shown_text::shown;

/// Parts that several pages share, each with its placeholder in the templates.
const PARTS: [(&str, &str); 3] = [
    ("<!-- figures -->", include_str!("page/figures.html")),
    ("<!-- tables -->", include_str!("page/tables.html")),
    // The rows of a table, which stand in that part.
    ("<!-- rows -->", include_str!("page/rows.html")),
];

/// A sentence as HTML in which no line ends within the name of a flag, as after the dashes of `--profile`.
fn unbroken_flags(sentence: &str) -> Value {
    let words = sentence.split(' ').map(|word| {
        let word = HtmlEscape(word).to_string();
        if word.contains("--") {
            format!("<span class=\"flag\">{word}</span>")
        } else {
            word
        }
    });
    Value::from_safe_string(words.collect::<Vec<_>>().join(" "))
}

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
    environment.add_filter("flags", unbroken_flags);
    environment
        .add_template("page", &whole)
        .map_err(|e| failed(&e))?;
    let template = environment.get_template("page").map_err(|e| failed(&e))?;
    let page = template.render(Serde(values)).map_err(|e| failed(&e))?;
    Ok(shown(&page).into_owned())
}
