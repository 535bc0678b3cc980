//! Text of reports: numbers and names in words, and tables ([`table`]) for the terminal, CSV and LaTeX.

pub(crate) mod alert;
pub(crate) mod ladder;
pub(crate) mod latex;
pub(crate) mod table;
pub(crate) mod terminal;
pub(crate) mod words;
