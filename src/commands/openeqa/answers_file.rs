//! Files with answers of people or other programs, in the format of upstream's result files: [`read`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

use super::questions::MAX_NAMED;
use super::record::detail;
use super::settings::AnswersFile;
use crate::data::openeqa::OpenQuestion;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::report::text::words::first_names;
use crate::types::degradations::Kind;
use crate::types::{Condition, Degradation, Digest, KindSet, OpenDetail, Record, Step, TrialKey, Via};

/// An entry of a file. Other fields are ignored.
#[derive(Debug, Deserialize)]
struct AnswerEntry {
    question_id: String,
    /// `None` (`null`) if the person could not answer.
    answer: Option<String>,
    /// Condition of the frames shown, for example `L2-noise`.
    condition: Option<Condition>,
    /// Level of the frames shown, for example `L2`.
    level: Option<String>,
    /// Person who answered, if several did.
    annotator: Option<Value>,
}

/// Reads the answers in a file as records, in the order of the file. Warns about answers to questions that are not
/// selected.
///
/// # Errors
/// If the file cannot be read, a person answered the same question twice in the same condition, or a level exists in
/// several variants.
pub(super) fn read(
    config: &AnswersFile,
    questions: &[Arc<OpenQuestion>],
    variants: KindSet,
) -> Result<Vec<Record<OpenDetail>>> {
    let path = &config.path;
    let text = reading::bytes(path)?;
    let entries: Vec<AnswerEntry> = serde_json::from_slice(&text).map_err(|e| {
        Error::data(
            path.display(),
            format_args!(
                "{e}; a JSON array of {{\"question_id\", \"answer\"}} expected, with \"condition\" or \"level\" and \"annotator\" \
                 where there are several"
            ),
        )
    })?;
    let known: BTreeMap<&str, usize> =
        questions.iter().enumerate().map(|(index, question)| (&*question.id.0, index)).collect();
    let (mut records, mut unknown) = (Vec::new(), Vec::new());
    let mut seen = BTreeSet::new();
    for entry in &entries {
        let Some(&index) = known.get(&*entry.question_id) else {
            unknown.push(&*entry.question_id);
            continue;
        };
        let condition = condition(entry, variants).map_err(|problem| {
            Error::data(path.display(), format_args!("question {}: {problem}", entry.question_id))
        })?;
        let person = entry.annotator.as_ref().map(|name| match name {
            Value::String(name) => name.clone(),
            other => other.to_string(),
        });
        if !seen.insert((index, condition.clone(), person.clone())) {
            return Err(Error::data(
                path.display(),
                format_args!(
                    "question {} is answered twice at {condition}; state in \"annotator\" who answered",
                    entry.question_id
                ),
            ));
        }
        let key = key(&config.name, entry, &condition, person.as_deref());
        let question = &questions[index];
        let detail = OpenDetail { person, ..detail(question, Step::Answer) };
        let condition = Some(condition);
        let record = Record::blank(key, question.id.clone(), &config.name, condition, detail);
        records.push(Record { reply: entry.answer.clone(), via: Via::File, ..record });
    }
    warn_of_unknown(path, &unknown, entries.len());
    Ok(records)
}

fn warn_of_unknown(path: &Path, unknown: &[&str], all: usize) {
    if !unknown.is_empty() {
        tracing::warn!(
            "{}: {} of {all} answers are to questions that are not asked: {}",
            path.display(),
            unknown.len(),
            first_names(unknown, MAX_NAMED)
        );
    }
}

/// The condition of an answer: untouched frames if the entry states none, as in upstream's own files.
fn condition(entry: &AnswerEntry, variants: KindSet) -> std::result::Result<Condition, String> {
    let level = match (&entry.condition, entry.level.as_deref()) {
        (Some(condition), _) => return Ok(condition.clone()),
        (None, None | Some("L0")) => return Ok(Condition::L0),
        (None, Some(level)) => level,
    };
    // Kinds on the axis of the level.
    let mut degradations: Vec<Degradation> =
        Kind::ALL.into_iter().filter_map(|kind| degradation_at(level, kind).ok()).collect();
    if degradations.is_empty() {
        return Err(degradation_at(level, Kind::Exposure).err().unwrap_or_default());
    }
    let noise = degradations.iter().find(|how| how.kind() == Kind::Sensor);
    let example = noise.or(degradations.last()).map(ToString::to_string);
    degradations.retain(|how| variants.includes(how.kind()));
    match (degradations.pop(), degradations.is_empty()) {
        (Some(degradation), true) => Ok(Condition::raw(Some(degradation))),
        _ => Err(format!(
            "\"level\" does not state which variant was shown; write \"condition\": \"{}\" instead",
            example.unwrap_or_default()
        )),
    }
}

fn degradation_at(level: &str, kind: Kind) -> std::result::Result<Degradation, String> {
    let severity = kind.severity(level).map_err(|e| e.to_string())?;
    Degradation::new(kind, severity, None).map_err(|e| e.to_string())
}

fn key(name: &str, entry: &AnswerEntry, condition: &Condition, person: Option<&str>) -> TrialKey {
    let condition = condition.to_string();
    let answer = entry.answer.as_ref().map(|answer| format!("={answer}"));
    let parts = [
        "darkqa.given/1",
        name,
        &entry.question_id,
        &condition,
        person.unwrap_or_default(),
        answer.as_deref().unwrap_or_default(),
    ];
    Digest::from_parts(parts.map(str::as_bytes)).into()
}
