//! A question of a run with the replies to it, as text: [`ShownItem`].

use std::fmt::Write;

use crate::error::Result;
use crate::report::text::outcome_words;
use crate::runs::stored::AnyRun;
use crate::types::manifests::RunManifest;
use crate::types::questions::letter;
use crate::types::{Condition, Digest, FrameId, OpenDetail, Record, RunQuestion};

/// The reply of a model to the item in a condition.
pub(super) struct ShownAnswer {
    pub(super) model: String,
    pub(super) condition: Option<Condition>,
    /// Outcome of the trial, in the words of the report.
    pub(super) outcome: String,
    pub(super) reply: String,
    /// The frame or walk shown.
    pub(super) shown: FrameId,
    /// Digest of the image sent, or of all images of a walk.
    pub(super) sent: Option<Digest>,
}

/// A question and the replies to it.
pub(super) struct ShownItem {
    pub(super) source: FrameId,
    pub(super) text: String,
    pub(super) answers: Vec<ShownAnswer>,
}

/// The manifest of a run, and one item of it; `None` if the run did not ask the item.
///
/// # Errors
/// If a record cannot be read.
pub(super) fn read(run: AnyRun, name: &str) -> Result<(RunManifest, Option<ShownItem>)> {
    Ok(match run {
        AnyRun::Choice(run) => {
            let records = run.records_of(name)?;
            let item = records.first().map(|first| ShownItem {
                source: first.detail.frame.clone(),
                text: choice_text(first, stored_question(&run.questions, name)),
                answers: records.iter().map(choice_answer).collect(),
            });
            (run.manifest, item)
        }
        AnyRun::Open(run) => {
            let records = run.records_of(name)?;
            let item = records.first().map(|first| ShownItem {
                source: FrameId(first.detail.episode.clone()),
                text: open_text(first, stored_question(&run.questions, name)),
                answers: records.iter().map(open_answer).collect(),
            });
            (run.manifest, item)
        }
    })
}

fn stored_question<'a>(questions: &'a [RunQuestion], name: &str) -> Option<&'a RunQuestion> {
    questions.iter().find(|question| question.id.0 == name)
}

pub(super) fn choice_text(record: &Record, stored_question: Option<&RunQuestion>) -> String {
    let images = stored_question.map_or(&[][..], |question| &question.images);
    let images: Vec<&str> = images.iter().map(|frame| &*frame.0).collect();
    let about = match &*images {
        [] => record.detail.frame.to_string(),
        several => format!("{} images: {}", several.len(), several.join(", ")),
    };
    let mut text = format!("{}, about {about}\n", record.question);
    if let Some(stored_question) = stored_question {
        let _ = writeln!(text, "{}", stored_question.text);
    }
    for (index, choice) in record.detail.choices.iter().enumerate() {
        let truth = if Some(index) == record.detail.truth { "  (true)" } else { "" };
        let _ = writeln!(text, "  {}. {choice}{truth}", letter(index));
    }
    text
}

fn choice_answer(record: &Record) -> ShownAnswer {
    ShownAnswer {
        model: record.model.clone(),
        condition: record.condition.clone(),
        outcome: outcome_words::outcome(record),
        reply: reply_excerpt(record),
        shown: record.detail.sent_frame().clone(),
        sent: record.detail.file_digest(),
    }
}

fn open_text(record: &Record<OpenDetail>, stored_question: Option<&RunQuestion>) -> String {
    let mut text = format!("{}, about {}\n", record.question, record.detail.episode);
    if let Some(stored_question) = stored_question {
        let answer = stored_question.answer.as_deref().unwrap_or_default();
        let _ = writeln!(text, "{}\n  {answer}  (true)", stored_question.text);
    }
    text
}

fn open_answer(record: &Record<OpenDetail>) -> ShownAnswer {
    ShownAnswer {
        model: record.model.clone(),
        condition: record.condition.clone(),
        outcome: match (&record.failure, &record.detail.judged) {
            (Some(failure), _) => format!("failed ({})", outcome_words::failure_reason(failure.kind, failure.status)),
            (None, Some(_)) => "marked".to_owned(),
            (None, None) => "answered".to_owned(),
        },
        reply: reply_excerpt(record),
        shown: FrameId(record.detail.episode.clone()),
        sent: record.detail.images.as_ref().map(|images| images.digest),
    }
}

/// The first 200 characters of the reply, of the refusal, or of the error.
fn reply_excerpt<D>(record: &Record<D>) -> String {
    let text = record.text_or_error().unwrap_or_default();
    text.chars().take(200).collect()
}
