//! Questions that differ from those stored in the run: [`ChangedQuestions`].
//!
//! Questions that are missing in a damaged run, although it has records about them: [`LostQuestions`].

use std::collections::{BTreeMap, HashSet};
use std::path::Path;

use super::record_log::each_trial;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::QuestionPart;
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{QuestionId, RunQuestion, TrialKey};

/// Maximum number of characters of a text or name in a message.
const MAX_CHARS: usize = 60;

/// The first question that differs from the stored one, and the number of questions that differ in the same part.
#[derive(Debug, Default)]
pub(super) struct ChangedQuestions {
    first: Option<(QuestionPart, String)>,
    same_part: usize,
}

impl ChangedQuestions {
    /// Adds a question that differs from the stored one in a part.
    pub(super) fn add(&mut self, part: QuestionPart, stored: &RunQuestion, now: &RunQuestion) {
        let first = self.first.get_or_insert_with(|| (part, describe_change(part, stored, now)));
        self.same_part += usize::from(first.0 == part);
    }

    /// The error text; `None` if no question differs. `is_decoded_alike` returns true if image files are decoded as in
    /// the stored run.
    pub(super) fn problem(&self, is_decoded_alike: impl FnOnce() -> bool) -> Option<String> {
        let (part, first) = self.first.as_ref()?;
        let more = match self.same_part {
            1 => String::new(),
            2 => "; so has 1 more question".to_owned(),
            count => format!("; so have {} more questions", count - 1),
        };
        let remedy = match part {
            QuestionPart::Image if is_decoded_alike() => "restore the file or its --data",
            QuestionPart::Image => "restore the file, and flags that decide how it is read (--decode)",
            _ => "restore --data and --questions",
        };
        Some(format!("{first}{more}; {remedy}, or use another --out"))
    }
}

/// The change of a question in words.
fn describe_change(part: QuestionPart, stored: &RunQuestion, now: &RunQuestion) -> String {
    let id = excerpt(&stored.id.0, MAX_CHARS);
    let frame = excerpt(&stored.frame.0, MAX_CHARS);
    match (part, part_text(part, stored).zip(part_text(part, now))) {
        (QuestionPart::Image, _) => {
            format!("the image {frame:?} of question {id:?} has changed since the run began")
        }
        (part, Some((before, now))) => format!(
            "question {id:?} has another {} than in this run: {:?}, before {:?}",
            part.words(),
            excerpt(&now, MAX_CHARS),
            excerpt(&before, MAX_CHARS)
        ),
        (part, None) => format!("question {id:?} has another {} than in this run", part.words()),
    }
}

/// The text of a part of a question; `None` for parts without a text.
fn part_text(part: QuestionPart, question: &RunQuestion) -> Option<String> {
    match part {
        QuestionPart::Text => Some(question.text.clone()),
        QuestionPart::Choices => Some(question.choices.join(", ")),
        QuestionPart::Answer => Some(question.answer.clone().unwrap_or_default()),
        QuestionPart::Frame => Some(question.frame.0.clone()),
        QuestionPart::Family => Some(question.family.name().to_owned()),
        QuestionPart::Scene => Some(question.scene.clone()),
        QuestionPart::Image | QuestionPart::Group => None,
    }
}

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
