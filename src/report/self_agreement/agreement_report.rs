//! Content of a report on questions without true answers: [`AgreementReport`].

use super::tables;
use crate::report::sentences::{Sentence, self_agreement};
use crate::report::tables::{EnhancerRow, enhancers, with_training};
use crate::report::text::alert::Alert;
use crate::report::text::table::Table;
use darkqa_score::comparisons::self_agreement::SelfAgreement;

/// Results of one or more runs on questions without true answers, as sentences and as tables.
pub(crate) struct AgreementReport<'a> {
    pub(super) found: &'a SelfAgreement<'a>,
    /// Warnings at the top of the report.
    pub(super) alerts: Vec<Alert>,
    /// Findings as sentences.
    pub(super) sentences: Vec<Sentence>,
    /// All tables; the first is the summary.
    pub(super) tables: Vec<Table>,
}

impl<'a> AgreementReport<'a> {
    /// Writes the sentences and the tables of a report. `enhancer_rows` describe the use of each enhancer.
    pub(crate) fn new(found: &'a SelfAgreement<'a>, alerts: Vec<Alert>, enhancer_rows: &[EnhancerRow]) -> Self {
        let mut tables = with_training(tables::tables(found), &found.grid.listing);
        tables.extend(enhancers(enhancer_rows));
        Self { sentences: self_agreement(found), found, alerts, tables }
    }
}
