//! Several runs of questions with choices as one: [`combine`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::join::{Joined, join};
use crate::error::{Error, Result};
use crate::job::stored::StoredRun;
use crate::report::page::{self, PageInputs};
use crate::score::chance::OfferedChoices;
use crate::score::findings::Findings;
use crate::types::manifest::RunManifest;
use crate::types::{ChoiceDetail, QuestionId, Record, RunQuestion};

/// Several runs as one.
pub(super) type Combined = Joined<ChoiceDetail>;

impl Combined {
    /// What the records say.
    pub(super) fn findings(&self) -> Findings<'_> {
        let scenes = self.questions.iter();
        let scenes = scenes.map(|question| (question.frame.clone(), question.scene.clone()));
        let offers = offers(&self.records, &self.questions);
        Findings::new(&self.records, &scenes.collect(), offers)
    }

    /// What the page shows besides.
    pub(super) fn shown(&self) -> PageInputs<'_> {
        let runs = self.runs.iter().map(|run| page::PageRun {
            name: run.name.clone(),
            manifest: &run.manifest,
            records: &self.records[run.records.clone()],
            cost: run.cost.clone(),
        });
        PageInputs {
            runs: runs.collect(),
            questions: &self.questions,
            thumbnails: &self.thumbnails,
        }
    }

    /// The runs and where they lie.
    pub(super) fn places(&self) -> Vec<(&RunManifest, &Path)> {
        let runs = self.runs.iter();
        runs.map(|run| (&run.manifest, &*run.folder)).collect()
    }
}

/// Puts runs together, as [`join`] does.
///
/// # Errors
/// If a run shares no question with the others, or one of one name has other choices or another truth.
pub(super) fn combine(runs: Vec<StoredRun<ChoiceDetail>>) -> Result<Combined> {
    if runs.len() > 1 {
        agree(&runs)?;
    }
    join(runs, |_| true)
}

/// What is offered, for the chance line: each question as often as it has orders of its choices, since an answer to each order
/// counts for itself; those not asked yet once. A run that kept no questions has those in its records.
fn offers(records: &[Record], questions: &[RunQuestion]) -> Vec<OfferedChoices> {
    let mut orders = BTreeMap::<&QuestionId, BTreeSet<&[String]>>::new();
    let mut all = BTreeMap::<&QuestionId, OfferedChoices>::new();
    for record in records {
        orders
            .entry(&record.question)
            .or_default()
            .insert(&record.detail.choices);
        all.entry(&record.question)
            .or_insert_with(|| OfferedChoices {
                family: record.detail.family.clone(),
                choices: record.detail.choices.len(),
            });
    }
    for question in questions {
        all.entry(&question.id).or_insert_with(|| OfferedChoices {
            family: question.family.clone(),
            choices: question.choices.len(),
        });
    }
    let offers = all.into_iter().flat_map(|(question, offer)| {
        let times = orders.get(question).map_or(1, BTreeSet::len);
        std::iter::repeat_n(offer, times)
    });
    offers.collect()
}

/// Makes sure that runs can be compared.
fn agree(runs: &[StoredRun<ChoiceDetail>]) -> Result<()> {
    let mut questions = BTreeMap::<&QuestionId, (usize, BTreeSet<&String>, &String)>::new();
    let wrong = |run: &StoredRun<ChoiceDetail>, problem: String| {
        let path = run.folder.clone();
        Err(Error::Run { path, problem })
    };
    for (index, run) in runs.iter().enumerate() {
        let (mut shared, others) = (false, !questions.is_empty());
        for record in &run.records {
            let choices: BTreeSet<&String> = record.detail.choices.iter().collect();
            let Some(truth) = record.detail.choices.get(record.detail.truth) else {
                let problem = format!("the record {} has no true choice", record.key);
                return wrong(run, problem);
            };
            let (place, there, true_there) = questions
                .entry(&record.question)
                .or_insert_with(|| (index, choices.clone(), truth));
            shared |= *place != index;
            if (&*there, *true_there) != (&choices, truth) {
                let problem = format!(
                    "the question {} has other choices or another truth in {}; report them each by itself",
                    record.question,
                    runs[*place].folder.display()
                );
                return wrong(run, problem);
            }
        }
        if others && !shared {
            let problem = format!(
                "the run shares no question with {}; report them each by itself",
                runs[0].folder.display()
            );
            return wrong(run, problem);
        }
    }
    Ok(())
}
