//! A run of questions with choices on the site: [`ChoiceMember`].

use super::group_key::GroupKey;
use crate::report::site::{ChoiceRow, RunLink};
use crate::types::{ChoiceDetail, RunQuestion, Trials};

/// A run of questions with choices: its rows, and the trials by which models are compared.
pub(super) struct ChoiceMember {
    pub(super) key: GroupKey,
    pub(super) run: RunLink,
    pub(super) rows: Vec<ChoiceRow>,
    pub(super) trials: Trials<ChoiceDetail>,
    pub(super) questions: Vec<RunQuestion>,
}
