//! All that a report of questions with choices shows: [`ChoiceReport`].

use crate::sentences::{Sentence, sentences};
use crate::tables::{EnhancerRow, enhancers, observer_notes, tables, with_training};
use crate::text::alert::{Alert, AlertKind};
use crate::text::table::Table;
use darkqa_score::findings::Findings;

/// The findings of one run or several, in words and as tables. The terminal, the page and all files are made from it.
#[derive(Debug)]
pub struct ChoiceReport<'a> {
    /// The numbers that are shown.
    pub findings: &'a Findings<'a>,
    /// Warnings above the numbers.
    pub alerts: Vec<Alert>,
    /// The findings in words.
    pub(crate) sentences: Vec<Sentence>,
    /// The tables; the first is the summary.
    pub tables: Vec<Table>,
}

impl<'a> ChoiceReport<'a> {
    /// The report of these findings.
    #[must_use]
    pub fn new(findings: &'a Findings<'a>, alerts: Vec<Alert>) -> Self {
        let shown = findings.shown();
        let notes = observer_notes(&findings.observer);
        let notes = notes
            .into_iter()
            .map(|note| Alert::new(AlertKind::Observer, note));
        Self {
            findings: shown,
            alerts: alerts.into_iter().chain(notes).collect(),
            sentences: sentences(shown),
            tables: with_training(tables(findings), &findings.grid.listing),
        }
    }

    /// The report with how each enhancer was used.
    pub(crate) fn with_enhancers(mut self, used: &[EnhancerRow]) -> Self {
        self.tables.extend(enhancers(used));
        self
    }
}
