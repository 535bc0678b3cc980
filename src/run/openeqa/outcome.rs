//! What came of it all: scored, and left in the run folder.

use std::collections::{BTreeMap, HashSet};

use serde_json::{Value, json};

use super::Run;
use super::marks::{Kept, Prediction, Said};
use super::stage::Stage;
use crate::config::{OpenEqa, Show};
use crate::dataset::openeqa::OpenQuestion;
use crate::error::Result;
use crate::report::openeqa::{Asked, OpenReport, Told, json as summary_json, products, table};
use crate::run::stop::End;
use crate::run::{Verdict, now};
use crate::score::llm_match::{Protocol, mark};
use crate::score::open::{Outcome, Scored, Topic, open_summary};
use crate::store;
use crate::types::TrialKey;
use crate::types::manifest::{Counts, Status};

/// What a run was told that decides no answer by itself, and may explain what it holds.
pub(super) fn settings(config: &OpenEqa, stage: &Stage<'_>) -> BTreeMap<String, Value> {
    let models: Vec<&str> = stage
        .askers
        .iter()
        .map(|asker| asker.model.name())
        .collect();
    let conditions: Vec<String> = stage.conditions.iter().map(ToString::to_string).collect();
    let judge = stage.judge.as_ref().map(|judge| judge.model.name());
    let fields = [
        ("--model and --blind-model", json!(models)),
        ("--levels, --variant and --llie", json!(conditions)),
        ("--judge", json!(judge)),
        ("--protocol", json!(config.protocol.to_string())),
        ("--frames", json!(config.frames)),
    ];
    fields
        .map(|(field, value)| (field.to_owned(), value))
        .into()
}

impl Run<'_> {
    /// Scores what the run holds, and leaves it in its folder.
    pub(super) fn show(mut self, end: End) -> Result<Verdict> {
        let kept = self.kept()?;
        let protocol = self.config.protocol;
        let predicted = self.predictions(&kept);
        let outcomes: Vec<Outcome> = predicted
            .iter()
            .map(|prediction| outcome(prediction, &kept, protocol))
            .collect();
        let counts = counts(self.due.iter().map(|due| due.key), &predicted, &kept);
        let unmarked = outcomes.contains(&Outcome::Unmarked);
        let status = match end.status(counts) {
            // Everything came, and not all of it is scored.
            Status::Complete if unmarked => Status::Incomplete,
            status => status,
        };
        if (status, counts) != (self.manifest.status, self.manifest.counts) {
            self.manifest.updated = now();
            (self.manifest.status, self.manifest.counts) = (status, counts);
        }
        let topics: Vec<Topic> = self.stage.questions.iter().map(|q| topic(q)).collect();
        let scored = predicted.iter().zip(&outcomes);
        let scored: Vec<Scored> = scored
            .map(|(prediction, outcome)| Scored {
                subject: prediction.subject.clone(),
                question: prediction.question,
                outcome: *outcome,
                cut: matches!(prediction.said, Said::Text { cut: true, .. }),
            })
            .collect();
        let summary = open_summary(&scored, &topics);
        let asked: Vec<Asked<'_>> = self.stage.questions.iter().map(|q| asked(q)).collect();
        let folder = self.store.folder();
        let thumbnails = store::read_thumbnails(folder)?;
        let name = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let name = name.file_name().unwrap_or(name.as_os_str());
        let told = predicted.into_iter().zip(outcomes);
        let told: Vec<Told> = told
            .map(|(prediction, outcome)| Told {
                subject: prediction.subject,
                question: prediction.question,
                answer: prediction.whole,
                outcome,
            })
            .collect();
        let report = OpenReport {
            summary: &summary,
            manifest: &self.manifest,
            judge: self.stage.judge.as_ref().map(|judge| judge.model.name()),
            protocol,
            name: &name.to_string_lossy(),
            questions: &asked,
            answers: &told,
            thumbnails: &thumbnails,
        };
        for (name, content) in products(&report)? {
            self.store.write(&name, &content)?;
        }
        self.store
            .write("summary.json", summary_json(&report, None)?.as_bytes())?;
        self.store.write_manifest(&self.manifest)?;
        let output = match self.config.output.show {
            Show::Table => table::render(&report, folder),
            Show::Json => summary_json(&report, Some(folder))?,
        };
        if let End::Stopped(error) | End::Retired(error) = end {
            return Err(error);
        }
        Ok(Verdict { status, output })
    }
}

/// How many answers and marks there are to be, and what became of them.
fn counts(due: impl Iterator<Item = TrialKey>, predicted: &[Prediction], kept: &Kept) -> Counts {
    let marks: HashSet<TrialKey> = predicted.iter().filter_map(|p| p.mark).collect();
    let mut counts = Counts::default();
    for key in due.chain(marks) {
        counts.trials += 1;
        match kept.get(&key).map(|record| record.failure.is_some()) {
            Some(false) => counts.answered += 1,
            Some(true) => counts.failed += 1,
            None => {}
        }
    }
    counts
}

/// What came of an answer.
fn outcome(prediction: &Prediction, kept: &Kept, protocol: Protocol) -> Outcome {
    match prediction.said {
        Said::Missing => return Outcome::Missing,
        Said::Null => return Outcome::Null,
        Said::Text { .. } => {}
    }
    let record = prediction.mark.and_then(|key| kept.get(&key));
    let Some(record) = record.filter(|record| record.failure.is_none()) else {
        return Outcome::Unjudged;
    };
    // Read anew: alike in every table, also where an earlier version has kept it.
    let reply = record.reply.as_deref().unwrap_or_default();
    mark(reply, protocol).map_or(Outcome::Unmarked, Outcome::Marked)
}

fn asked(question: &OpenQuestion) -> Asked<'_> {
    Asked {
        id: &question.id,
        text: &question.text,
        answer: &question.answer,
        extra: question.extra.as_deref(),
        category: &question.category,
        episode: &question.episode,
    }
}

fn topic(question: &OpenQuestion) -> Topic {
    Topic {
        episode: question.episode.clone(),
        category: question.category.clone(),
        split: question.split().to_owned(),
    }
}
