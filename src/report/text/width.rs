//! The width of the terminal: [`columns`].

/// Width in columns if the width of the terminal is unknown.
const DEFAULT: usize = 80;
/// Minimum width in columns that is assumed; chosen.
const MIN: usize = 60;

/// The width of the output in columns: the variable `COLUMNS`, otherwise the width of the terminal, otherwise 80; at
/// least 60.
pub(crate) fn columns() -> usize {
    std::env::var("COLUMNS")
        .ok()
        .and_then(|columns| columns.trim().parse().ok())
        .filter(|columns| *columns > 0)
        .or_else(|| terminal_size::terminal_size().map(|(width, _)| usize::from(width.0)))
        .unwrap_or(DEFAULT)
        .max(MIN)
}
