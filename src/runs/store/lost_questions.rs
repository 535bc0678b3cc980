//! Questions that are missing in a damaged run, although it has records about them: [`LostQuestions`].

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use super::record_log::each_trial;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{QuestionId, RunQuestion, TrialKey};

/// Maximum number of characters of a question's name in the message.
const MAX_CHARS: usize = 60;

/// The keys of the records about questions that are not stored, by question.
#[derive(Debug, Default)]
pub(super) struct LostQuestions(BTreeMap<QuestionId, Vec<TrialKey>>);

impl LostQuestions {
    /// Finds the records about questions that are not `stored`. The records are read only if a question of the data is
    /// not stored, or if the file of questions is damaged.
    ///
    /// # Errors
    /// If the records cannot be read.
    pub(super) fn find(
        folder: &Path,
        data: &[RunQuestion],
        stored: &HashSet<QuestionId>,
        damage: Option<&str>,
    ) -> Result<Self> {
        let mut lost = Self::default();
        let has_new = data.iter().any(|question| !stored.contains(&question.id));
        if has_new || damage.is_some() {
            each_trial(folder, |trial, _| {
                if !stored.contains(&trial.question) {
                    lost.0.entry(trial.question).or_default().push(trial.key);
                }
            })?;
        }
        Ok(lost)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Checks that the data contains each lost question: a key of its records is among those of the `planned` trials. A
    /// key contains the text and choices of its question.
    ///
    /// # Errors
    /// If no record of a question is among the planned trials.
    pub(super) fn check(&self, path: &Path, planned: impl FnOnce() -> Result<HashSet<TrialKey>>) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        let planned = planned()?;
        let mut others = self.0.iter().filter(|(_, keys)| !keys.iter().any(|key| planned.contains(key)));
        let Some((first, _)) = others.next() else {
            return Ok(());
        };
        let problem = format!(
            "{} of {} lost questions cannot be made again, such as {:?}: the records are intact; call the command that made them, with \
             the same data",
            others.count() + 1,
            self.len(),
            excerpt(&first.0, MAX_CHARS)
        );
        Err(Error::Run { path: path.to_owned(), problem })
    }
}
