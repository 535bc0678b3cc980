//! The width of the terminal: [`columns`].

/// Width where nothing states how wide the terminal is, in columns.
const DEFAULT: usize = 80;
/// Least width that tables are fitted to, in columns; chosen.
const LEAST: usize = 60;

/// How many columns the output may take: those of `COLUMNS`, else of the terminal, else 80; at least 60.
pub(crate) fn columns() -> usize {
    let stated = std::env::var("COLUMNS").ok();
    let stated = stated.and_then(|columns| columns.trim().parse().ok());
    let terminal = || terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
    let columns = stated.filter(|columns| *columns > 0).or_else(terminal);
    columns.unwrap_or(DEFAULT).max(LEAST)
}
