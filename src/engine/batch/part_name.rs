//! Names of input files: [`file_name`].

/// Converts a text to a part of a file name: characters other than ASCII letters, digits, `-`, `_` and `.` are
/// replaced.
pub(super) fn file_name(text: &str) -> String {
    text.replace(|c: char| !(c.is_ascii_alphanumeric() || "-_.".contains(c)), "_")
}
