//! Several runs as one: [`merge`].

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::Kept;
use super::cost::cost;
use crate::error::{Error, Result};
use crate::report::page::{self, Shown};
use crate::score::chance::Offer;
use crate::score::findings::Findings;
use crate::types::manifest::RunManifest;
use crate::types::{Outcome, QuestionId, Record, RunQuestion, Thumbnail, TrialKey, View};

/// Several runs as one.
pub(super) struct Merged {
    pub(super) runs: Vec<Part>,
    pub(super) records: Vec<Record>,
    pub(super) questions: Vec<RunQuestion>,
    pub(super) thumbnails: Vec<Thumbnail>,
}

/// One of them.
pub(super) struct Part {
    pub(super) folder: PathBuf,
    pub(super) name: String,
    pub(super) manifest: RunManifest,
    pub(super) cost: Option<String>,
    /// Where its records are among all.
    pub(super) records: Range<usize>,
}

impl Merged {
    /// What the records say.
    pub(super) fn findings(&self) -> Findings<'_> {
        let scenes = self.questions.iter();
        let scenes = scenes.map(|question| (question.frame.clone(), question.scene.clone()));
        let offers = offers(&self.records, &self.questions);
        Findings::new(&self.records, &scenes.collect(), offers)
    }

    /// What the page shows besides.
    pub(super) fn shown(&self) -> Shown<'_> {
        let runs = self.runs.iter().map(|run| page::Run {
            name: run.name.clone(),
            manifest: &run.manifest,
            records: &self.records[run.records.clone()],
            cost: run.cost.clone(),
        });
        Shown {
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

/// Puts runs together. A model that answered the same item in two of them in different ways (another seed, prompt or
/// parameter) stands once for each, with the run's name; a trial that two of them share counts once.
///
/// # Errors
/// Where a run shares no question with the others, or one of one name has other choices or another truth.
pub(super) fn merge(runs: Vec<Kept>) -> Result<Merged> {
    let mut twice = BTreeSet::new();
    if runs.len() > 1 {
        agree(&runs)?;
        twice = answered_twice(&runs);
    }
    let names = names(&runs);
    let mut merged = Merged {
        runs: Vec::new(),
        records: Vec::new(),
        questions: Vec::new(),
        thumbnails: Vec::new(),
    };
    let mut known = HashSet::<TrialKey>::new();
    let mut listed = BTreeSet::<QuestionId>::new();
    let mut pictured = BTreeSet::new();
    for (run, name) in runs.into_iter().zip(names) {
        let first = merged.records.len();
        let cost = cost(&run.records)?;
        for mut record in run.records {
            if known.contains(&record.key) {
                continue;
            }
            if record.detail.outcome != Outcome::Failed {
                known.insert(record.key);
            }
            if twice.contains(&(record.view, record.model.clone())) {
                record.model = format!("{} ({name})", record.model);
            }
            merged.records.push(record);
        }
        merged.runs.push(Part {
            folder: run.folder,
            name,
            manifest: run.manifest,
            cost,
            records: first..merged.records.len(),
        });
        let questions = run.questions.into_iter();
        merged
            .questions
            .extend(questions.filter(|question| listed.insert(question.id.clone())));
        let thumbnails = run.thumbnails.into_iter();
        merged.thumbnails.extend(thumbnails.filter(|thumbnail| {
            pictured.insert((thumbnail.frame.clone(), thumbnail.condition.clone()))
        }));
    }
    Ok(merged)
}

/// What is offered, for the chance line: each question as often as it has orders of its choices, since an answer to each order
/// counts for itself; those not asked yet once. A run that kept no questions has those in its records.
fn offers(records: &[Record], questions: &[RunQuestion]) -> Vec<Offer> {
    let mut orders = BTreeMap::<&QuestionId, BTreeSet<&[String]>>::new();
    let mut all = BTreeMap::<&QuestionId, Offer>::new();
    for record in records {
        orders
            .entry(&record.question)
            .or_default()
            .insert(&record.detail.choices);
        all.entry(&record.question).or_insert_with(|| Offer {
            family: record.detail.family.clone(),
            choices: record.detail.choices.len(),
        });
    }
    for question in questions {
        all.entry(&question.id).or_insert_with(|| Offer {
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

/// What runs are called: their folders' names, or their paths where two have one name.
fn names(runs: &[Kept]) -> Vec<String> {
    let short: Vec<String> = runs.iter().map(Kept::name).collect();
    let distinct: BTreeSet<&String> = short.iter().collect();
    if distinct.len() == runs.len() {
        return short;
    }
    let paths = runs.iter().map(|run| run.folder.display().to_string());
    paths.collect()
}

/// The models that answered the same item in two runs as different trials.
fn answered_twice(runs: &[Kept]) -> BTreeSet<(View, String)> {
    let mut keys = HashMap::new();
    let mut twice = BTreeSet::new();
    for (index, run) in runs.iter().enumerate() {
        for record in &run.records {
            let item = (
                (record.view, &record.model),
                (&record.condition, &record.question),
                (&record.detail.choices, record.detail.repeat),
            );
            let (key, place) = *keys.entry(item).or_insert((record.key, index));
            if key != record.key && place != index {
                twice.insert((record.view, record.model.clone()));
            }
        }
    }
    twice
}

/// Makes sure that runs can be compared.
fn agree(runs: &[Kept]) -> Result<()> {
    let mut questions = BTreeMap::<&QuestionId, (usize, BTreeSet<&String>, &String)>::new();
    let wrong = |run: &Kept, problem: String| {
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
