//! A run among those that share a table: [`ChoiceMember`].

use super::group::GroupKey;
use crate::report::site::{ChoiceRow, RunLink};
use crate::types::{ChoiceDetail, RunQuestion, Trials};

/// A run of questions with choices: its rows, and the records that models are compared by.
pub(super) struct ChoiceMember {
    pub(super) key: GroupKey,
    pub(super) run: RunLink,
    pub(super) rows: Vec<ChoiceRow>,
    pub(super) trials: Trials<ChoiceDetail>,
    pub(super) questions: Vec<RunQuestion>,
}
