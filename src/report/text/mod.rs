//! Text of reports: numbers and names in words, and tables ([`table`]) for the terminal, CSV and LaTeX.

pub mod alert;
pub mod ladder;
pub mod latex;
pub mod table;
pub mod terminal;
pub mod words;
