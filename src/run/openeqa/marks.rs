//! What the judge is to mark: the [`Prediction`]s of a run, and the [`Marks`] that are left.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use super::item::Judged;
use super::stage::Stage;
use crate::ask::openeqa::{blind_answer, judged};
use crate::run::askers::Asker;
use crate::run::openeqa::plan::Due;
use crate::run::trial::{Prompt, Trial};
use crate::score::llm_match::{Protocol, shortened};
use crate::score::subject::Subject;
use crate::types::{Digest, OpenRecord, TrialKey, View};

/// The records of a run by their keys.
pub(super) type Kept = BTreeMap<TrialKey, OpenRecord>;

/// What is known of one answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Said {
    /// Nothing yet, or nothing came.
    Missing,
    /// That there is none: worth nothing, unjudged.
    Null,
    /// This, as it is judged.
    Text {
        answer: Arc<str>,
        /// Whether the protocol has cut it.
        cut: bool,
    },
}

/// One answer to one question.
#[derive(Debug, Clone)]
pub(super) struct Prediction {
    pub(super) subject: Subject,
    /// The question's place among those asked.
    pub(super) question: usize,
    /// The answer before the protocol did anything to it.
    pub(super) whole: Option<String>,
    pub(super) said: Said,
    /// The trial that marks it.
    pub(super) mark: Option<TrialKey>,
}

/// Every answer that is due, model by model, and then those that were given.
pub(super) fn predictions(
    stage: &Stage<'_>,
    due: &[Due],
    given: &[OpenRecord],
    kept: &Kept,
    protocol: Protocol,
) -> Vec<Prediction> {
    let places: HashMap<&str, usize> = stage
        .questions
        .iter()
        .enumerate()
        .map(|(index, question)| (&*question.id.0, index))
        .collect();
    let asked = due.iter().map(|due| {
        let asker = &stage.askers[due.asker];
        let subject = Subject::shown(asker.model.name(), due.condition.as_ref());
        let record = kept.get(&due.key).filter(|record| record.failure.is_none());
        (
            subject,
            due.question,
            record.map(|record| whole(record, protocol)),
        )
    });
    let given = given.iter().filter_map(|record| {
        let subject = Subject::shown(&record.model, record.condition.as_ref());
        let question = *places.get(&*record.question.0)?;
        Some((subject, question, Some(record.reply.clone())))
    });
    asked
        .chain(given)
        .map(|(subject, question, answer)| {
            let said = match &answer {
                None => Said::Missing,
                Some(None) => Said::Null,
                Some(Some(whole)) => judgeable(whole, protocol),
            };
            let mark = match (&said, &stage.judge) {
                (Said::Text { answer, .. }, Some(judge)) => {
                    Some(key(judge, &prompt(stage, question, answer)))
                }
                _ => None,
            };
            Prediction {
                subject,
                question,
                whole: answer.flatten(),
                said,
                mark,
            }
        })
        .collect()
}

/// The answer in a model's reply; `None` where there is none, which is an error upstream.
fn whole(record: &OpenRecord, protocol: Protocol) -> Option<String> {
    let reply = record.reply.as_deref()?;
    match (record.view, blind_answer(reply), protocol) {
        (View::Image, _, _) => Some(reply.to_owned()),
        (View::Blind, Some(answer), _) => Some(answer),
        (View::Blind, None, Protocol::Upstream) => None,
        (View::Blind, None, Protocol::Tolerant) => Some(reply.trim().to_owned()),
    }
}

fn judgeable(whole: &str, protocol: Protocol) -> Said {
    let answer = match protocol {
        Protocol::Upstream => shortened(whole),
        Protocol::Tolerant => whole,
    };
    Said::Text {
        answer: answer.into(),
        cut: answer != whole,
    }
}

fn prompt(stage: &Stage<'_>, question: usize, answer: &str) -> String {
    let question = &stage.questions[question];
    let extra = question.extra.as_deref();
    judged(&question.text, &question.answer, extra, answer)
}

fn key(judge: &Asker, prompt: &str) -> TrialKey {
    let parts = ["darkqa.mark/1", judge.model.name(), &judge.digest, prompt];
    Digest::of_parts(parts.map(str::as_bytes)).into()
}

/// The marks of a run.
#[derive(Debug)]
pub(super) struct Marks {
    /// How many different answers there are to mark, marked or not.
    pub(super) due: HashSet<TrialKey>,
    /// Those that are left.
    pub(super) left: Vec<Trial<Judged>>,
}

impl Marks {
    /// Lays out the marks, each answer to a question once, and leaves out those that are there or on their way.
    pub(super) fn new(
        stage: &Stage<'_>,
        predictions: &[Prediction],
        there: &HashSet<TrialKey>,
    ) -> Self {
        let mut marks = Self {
            due: HashSet::new(),
            left: Vec::new(),
        };
        for Prediction {
            question,
            said,
            mark,
            ..
        } in predictions
        {
            let (Said::Text { answer, .. }, Some(key)) = (said, *mark) else {
                continue;
            };
            if !marks.due.insert(key) || there.contains(&key) {
                continue;
            }
            marks.left.push(Trial {
                key,
                asker: 0,
                prompt: Prompt::of(prompt(stage, *question, answer).into()),
                item: Judged {
                    question: Arc::clone(&stage.questions[*question]),
                    answer: Arc::clone(answer),
                },
            });
        }
        marks
    }
}
