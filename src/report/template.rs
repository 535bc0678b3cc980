//! Rendering of HTML pages from templates: [`render`].
//!
//! Content security policy of pages with one inline script: [`allow_script`].

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment};
use serde::Serialize;
use sha2::{Digest as _, Sha256};

use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::escape_hidden;

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
pub fn render(template: &str, values: impl Serialize) -> Result<String> {
    let whole = PARTS.iter().fold(template.to_owned(), |text, (placeholder, part)| text.replace(placeholder, part));
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    let page =
        environment.render_named_str("page", &whole, Serde(values)).map_err(|e| Error::data("report.html", e))?;
    Ok(escape_hidden(&page).into_owned())
}

/// Text in the policy of a template that the digest of the script replaces.
const PLACEHOLDER: &str = "SCRIPT-DIGEST";

/// The page with the digest of its script in its policy, so that a browser runs that script alone. The data of a page
/// are in its script, so that the digest is computed last.
pub(super) fn allow_script(page: &str) -> String {
    let script =
        page.split_once("<script>").and_then(|(_, rest)| rest.split_once("</script>")).map_or("", |(script, _)| script);
    let digest = STANDARD.encode(Sha256::digest(script));
    page.replacen(PLACEHOLDER, &format!("sha256-{digest}"), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_policy_has_the_digest_of_the_script() {
        let page = "<meta content=\"script-src 'SCRIPT-DIGEST'\"><script>alert('Hello, world.');</script>";
        // The example of the specification, Content Security Policy Level 3.
        let expected = "script-src 'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='";
        assert!(allow_script(page).contains(expected), "{}", allow_script(page));
    }
}
