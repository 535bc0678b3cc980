//! Content of a report on multiple-choice questions: [`ChoiceReport`].

use crate::report::sentences::{Sentence, sentences};
use crate::report::tables::{EnhancerRow, enhancers, observer_notes, tables, with_training};
use crate::report::text::alert::{Alert, AlertKind};
use crate::report::text::table::Table;
use darkqa_score::findings::Findings;

/// Findings of one or more runs as sentences and tables, for the terminal, the page and the files of a report.
#[derive(Debug)]
pub struct ChoiceReport<'a> {
    /// Findings to show; a hidden observer is left out.
    pub findings: &'a Findings<'a>,
    /// Warnings and notes at the top of the report.
    pub alerts: Vec<Alert>,
    /// Findings as sentences.
    pub(crate) sentences: Vec<Sentence>,
    /// All tables; the first is the summary.
    pub tables: Vec<Table>,
}

impl<'a> ChoiceReport<'a> {
    /// Creates the report of `findings`. Notes about the observer follow `alerts`.
    #[must_use]
    pub fn new(findings: &'a Findings<'a>, alerts: Vec<Alert>) -> Self {
        let shown = findings.shown();
        let notes = observer_notes(&findings.observer).into_iter().map(|note| Alert::new(AlertKind::Observer, note));
        Self {
            findings: shown,
            alerts: alerts.into_iter().chain(notes).collect(),
            sentences: sentences(shown),
            tables: with_training(tables(findings), &findings.grid.listing),
        }
    }

    /// Adds the table of enhancer use.
    pub(crate) fn with_enhancers(mut self, rows: &[EnhancerRow]) -> Self {
        self.tables.extend(enhancers(rows));
        self
    }
}
