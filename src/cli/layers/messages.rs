//! Parts of messages about variables and files of flags: [`suggestion`], [`invalid_toml`].

use std::path::Path;

use crate::error::Error;

/// The most similar of the known names, as a question; empty if none is similar.
pub(super) fn suggestion(name: &str, known: &[String], prefix: &str) -> String {
    let alike = |other: &&String| strsim::jaro_winkler(name, other);
    let nearest = known.iter().max_by(|a, b| alike(a).total_cmp(&alike(b)));
    let nearest = nearest.filter(|other| alike(other) > 0.8);
    nearest.map_or_else(String::new, |other| {
        format!("; did you mean {prefix}{other}?")
    })
}

/// The error about invalid TOML, on one line and with its line number.
pub(super) fn invalid_toml(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let before = error.span().and_then(|span| text.get(..span.start));
    let line = before.unwrap_or_default().matches('\n').count() + 1;
    let problem: Vec<&str> = error.message().lines().map(str::trim).collect();
    Error::line(
        path,
        line,
        format_args!("not valid TOML: {}", problem.join(", ")),
    )
}
