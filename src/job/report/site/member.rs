//! A run among those that share a table: [`ChoiceMember`].

use super::group::GroupKey;
use crate::report::site::{ChoiceRow, RunLink};
use crate::types::{Record, RunQuestion};

/// A run of questions with choices: its rows, and the records that models are compared by.
pub(super) struct ChoiceMember {
    pub(super) key: GroupKey,
    pub(super) run: RunLink,
    pub(super) rows: Vec<ChoiceRow>,
    pub(super) records: Vec<Record>,
    pub(super) questions: Vec<RunQuestion>,
}
