//! The trials of the judge: [`plan_marks`].

use std::collections::HashSet;
use std::sync::Arc;

use super::record::OpenItem;
use super::setup::OpenSetup;
use crate::ask::prompts::openeqa::judge_prompt;
use crate::data::openeqa::OpenQuestion;
use crate::engine::images::trials::{Prompt, SourcePlan, Trial, TrialGroup};
use crate::engine::models::ModelUnderTest;
use crate::error::Result;
use crate::runs::predictions::{AnswerState, predictions};
use crate::types::{Digest, OpenDetail, QuestionId, Record, TrialKey};

/// The prompt that asks the judge to mark an answer.
pub(super) fn mark_prompt(question: &OpenQuestion, answer: &str) -> Prompt {
    let extra = question.extra.as_deref();
    Prompt::from_text(judge_prompt(&question.text, &question.answer, extra, answer).into())
}

/// The key of a mark. It does not depend on model and condition, so that the same answer to a question is judged once.
fn mark_key(judge: &ModelUnderTest, prompt: &Prompt) -> Result<TrialKey> {
    let facts = (judge.model.name(), &*judge.digest, &*prompt.before);
    Digest::canonical("darkqa.mark/2", &facts).map(Into::into)
}

/// The trials for all marks of a run, grouped by walk. Each distinct answer to a question is marked once.
pub(super) fn plan_marks(setup: &OpenSetup<'_>, records: &[Record<OpenDetail>]) -> Result<Vec<SourcePlan<OpenItem>>> {
    let Some(judge) = &setup.judge else {
        return Ok(Vec::new());
    };
    let ids: Vec<&QuestionId> = setup.questions.iter().map(|question| &question.id).collect();
    let mut by_walk: Vec<Vec<Trial<OpenItem>>> = Vec::new();
    by_walk.resize_with(setup.sources.len(), Vec::new);
    let mut planned = HashSet::new();
    for prediction in predictions(records, &ids, setup.config.protocol) {
        let AnswerState::Text { answer, .. } = prediction.state else {
            continue;
        };
        let question = &setup.questions[prediction.question];
        let prompt = mark_prompt(question, &answer);
        let key = mark_key(judge, &prompt)?;
        if planned.insert(key) {
            by_walk[setup.walk_of(question)].push(Trial {
                key,
                model: 0,
                prompt,
                item: OpenItem::Mark { question: Arc::clone(question), answer },
            });
        }
    }
    Ok(by_walk
        .into_iter()
        .enumerate()
        .map(|(source, trials)| SourcePlan { source, groups: vec![TrialGroup { condition: None, trials }] })
        .collect())
}
