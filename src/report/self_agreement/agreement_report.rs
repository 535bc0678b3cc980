//! All that a report without true answers shows: [`AgreementReport`].

use super::tables;
use crate::sentences::{Sentence, self_agreement};
use crate::tables::{EnhancerRow, enhancers, with_training};
use crate::text::alert::Alert;
use crate::text::table::Table;
use darkqa_score::comparisons::self_agreement::SelfAgreement;

/// All that a report without true answers shows.
pub(crate) struct AgreementReport<'a> {
    pub(super) found: &'a SelfAgreement<'a>,
    /// Warnings above the numbers.
    pub(super) alerts: Vec<Alert>,
    /// The findings in words.
    pub(super) sentences: Vec<Sentence>,
    /// The tables; the first is the summary.
    pub(super) tables: Vec<Table>,
}

impl<'a> AgreementReport<'a> {
    /// The report of these results; `used` states how each enhancer was used.
    pub(crate) fn new(
        found: &'a SelfAgreement<'a>,
        alerts: Vec<Alert>,
        used: &[EnhancerRow],
    ) -> Self {
        let mut tables = with_training(tables::tables(found), &found.grid.listing);
        tables.extend(enhancers(used));
        Self {
            sentences: self_agreement(found),
            found,
            alerts,
            tables,
        }
    }
}
