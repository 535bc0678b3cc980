//! Names of input files: [`file_name`].

/// A text as a part of a file's name: other characters than letters, digits, `-`, `_` and `.` are replaced.
pub(super) fn file_name(text: &str) -> String {
    let safe = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    text.replace(|c| !safe(c), "_")
}
