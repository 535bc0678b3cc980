//! Text of reports: numbers and names in words, and tables ([`table`]) for the terminal, CSV and LaTeX.

pub(crate) mod alert;
pub(crate) mod csv;
pub(crate) mod frame_count;
pub(crate) mod ladder;
pub(crate) mod latex;
pub(crate) mod noise_profiles;
pub(crate) mod outcome_words;
pub(crate) mod readable;
pub(crate) mod script;
pub(crate) mod table;
pub(crate) mod terminal;
pub(crate) mod width;
pub(crate) mod words;
pub(crate) mod wrapped;
