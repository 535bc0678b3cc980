//! `show`: the images that one item was asked with, made again and proved by their digests.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use super::Verdict;
use super::again::Album;
use super::inputs::stem;
use super::report::kept;
use super::written::write;
use crate::config::ShowItem;
use crate::error::{Error, Result};
use crate::store;
use crate::types::manifest::Status;
use crate::types::question::letter;
use crate::types::{ChoiceDetail, Condition, Digest, Outcome, Record, RunQuestion};

/// Makes the images again, writes them, and says of each whether it is the one that was sent.
///
/// # Errors
/// Where the run or the item is not there, or its data or enhancers are not where they were.
pub fn show(config: ShowItem) -> Result<Verdict> {
    let folder = config.run.clone();
    let manifest = kept(&folder)?;
    let item = config.item.split('#').next().unwrap_or_default().to_owned();
    let records: Vec<Record> = store::read_records::<ChoiceDetail>(&folder)?
        .into_iter()
        .filter(|record| record.question.0 == item)
        .collect();
    let Some(first) = records.first() else {
        let problem = format!(
            "no question {item:?} in this run; report.html and questions.jsonl have their ids"
        );
        return Err(Error::Run {
            path: folder,
            problem,
        });
    };
    let frame = first.detail.frame.clone();
    let listed = store::read_questions(&folder)?;
    let listed = listed
        .into_iter()
        .find(|listed| listed.id == first.question);
    let conditions = conditions(&records, &config.conditions, &folder)?;
    let out = config.out.clone().unwrap_or_else(|| folder.join("shown"));
    let mut album = Album::open(config.again, &manifest, &folder, &conditions)?;
    let mut desk = album.desk(&frame)?;
    let mut text = question(first, listed.as_ref());
    let mut all_same = true;
    for condition in &conditions {
        let made = album.image(&mut desk, condition)?;
        let digest = made.digest;
        let path = out.join(format!("{}_{condition}.{}", stem(&frame)?, made.ending));
        write(&path, &made.file)?;
        let sent = sent(&records, condition);
        let proof = if sent.is_empty() {
            format!("nothing is known of what was sent; {digest} now")
        } else if sent.iter().all(|sent| *sent == digest) {
            format!("the very bytes that were sent ({digest})")
        } else {
            all_same = false;
            format!("NOT the bytes that were sent: {digest} now")
        };
        let _ = writeln!(text, "{condition}: {}: {proof}", path.display());
        text += &replies(&records, Some(condition));
    }
    text += &replies(&records, None);
    if !all_same {
        text += "what decides the images is not as it was: the data, an enhancement model, or this program\n";
    }
    Ok(Verdict {
        status: if all_same {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: text,
    })
}

/// The conditions that the item was shown in, or those of them that are wanted.
fn conditions(records: &[Record], wanted: &[Condition], folder: &Path) -> Result<Vec<Condition>> {
    let there: BTreeSet<Condition> = records
        .iter()
        .filter_map(|record| record.condition.clone())
        .collect();
    if there.is_empty() {
        let problem =
            "the item was asked without images alone: there is nothing to show".to_owned();
        let path = folder.to_owned();
        return Err(Error::Run { path, problem });
    }
    if wanted.is_empty() {
        return Ok(there.into_iter().collect());
    }
    if let Some(missing) = wanted.iter().find(|condition| !there.contains(condition)) {
        let there: Vec<String> = there.iter().map(ToString::to_string).collect();
        let problem = format!(
            "the item was not asked at {missing}; it was at {}",
            there.join(", ")
        );
        return Err(Error::usage("--condition", problem));
    }
    Ok(wanted.to_vec())
}

fn question(record: &Record, listed: Option<&RunQuestion>) -> String {
    let mut text = format!("{}, about {}\n", record.question, record.detail.frame);
    if let Some(listed) = listed {
        let _ = writeln!(text, "{}", listed.text);
    }
    for (index, choice) in record.detail.choices.iter().enumerate() {
        let truth = if index == record.detail.truth {
            "  (true)"
        } else {
            ""
        };
        let _ = writeln!(text, "  {}. {choice}{truth}", letter(index));
    }
    text
}

/// The digests of what was sent in a condition.
fn sent(records: &[Record], condition: &Condition) -> BTreeSet<Digest> {
    let there = records
        .iter()
        .filter(|record| record.condition.as_ref() == Some(condition));
    there
        .filter_map(|record| Some(record.detail.image.as_ref()?.digest))
        .collect()
}

/// What each model made of the item in a condition, or without an image; replies in the form of a JSON text, so that nothing
/// in them reaches the terminal as a control.
fn replies(records: &[Record], condition: Option<&Condition>) -> String {
    let mut text = String::new();
    for record in records
        .iter()
        .filter(|record| record.condition.as_ref() == condition)
    {
        let without = if condition.is_none() {
            " without an image"
        } else {
            ""
        };
        let outcome = match record.detail.outcome {
            Outcome::Right => "right",
            Outcome::Wrong => "wrong",
            Outcome::Unparsed => "not readable",
            Outcome::Failed => "failed",
        };
        let failure = || {
            record
                .failure
                .as_ref()
                .map(|failure| failure.message.as_str())
        };
        let said = record.reply.as_deref().or_else(failure).unwrap_or_default();
        let said: String = said.chars().take(200).collect();
        let _ = writeln!(text, "  {}{without}: {outcome}: {said:?}", record.model);
    }
    text
}
