//! `show`: making the images of one item again, and checking by their digests that they are those that were sent.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use crate::dataset::inputs::stem;
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::rebuild::{ImageRebuilder, RebuildArgs, RebuiltImage};
use crate::job::stored::AnyRun;
use crate::types::manifest::{RunManifest, Status};
use crate::types::question::letter;
use crate::types::{self, Condition, Decides, Digest, FrameId, OpenDetail, Record, RunQuestion};

/// The flags of `show`.
#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    /// The folder of a run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// The id of a question
    #[arg(value_name = "ITEM", add = Decides::Nothing)]
    pub item: String,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all that it was asked in
    #[arg(long, value_name = "CONDITION", add = Decides::Nothing)]
    pub condition: Vec<Condition>,
    /// Where the images go; default: shown in the folder of the run
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Where the data and enhancers are now.
    #[command(flatten)]
    pub rebuild: RebuildArgs,
}

/// The reply of one model to the item, in one condition.
struct ShownAnswer {
    model: String,
    condition: Option<Condition>,
    outcome: &'static str,
    reply: String,
    /// The digest of the image that was sent, or of all images of a walk.
    sent: Option<Digest>,
}

/// The item and the replies to it.
struct ShownItem {
    source: FrameId,
    text: String,
    answers: Vec<ShownAnswer>,
}

/// Makes the images again, writes them, and prints for each whether it is the one that was sent.
///
/// # Errors
/// If the run or the item is missing, or its data or enhancers are not found.
pub(crate) fn show(args: ShowArgs) -> Result<Outcome> {
    let folder = args.run.clone();
    let name = args.item.split('#').next().unwrap_or_default();
    let (manifest, item) = read(AnyRun::open(&folder)?, name);
    let Some(item) = item else {
        let problem = format!(
            "no question {name:?} in this run; report.html and questions.jsonl have their ids"
        );
        return Err(Error::Run {
            path: folder,
            problem,
        });
    };
    let conditions = conditions(&item.answers, &args)?;
    let out = args.out.clone().unwrap_or_else(|| folder.join("shown"));
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &folder, &conditions)?;
    let images = rebuilder.images(&item.source, &conditions)?;
    let mut text = item.text;
    let mut all_same = true;
    for (condition, images) in conditions.iter().zip(images) {
        let multiple = images.len() > 1;
        for (place, image) in images.iter().enumerate() {
            let place = if multiple {
                format!("_{place:03}")
            } else {
                String::new()
            };
            let name = format!(
                "{}_{condition}{place}.{}",
                stem(&item.source)?,
                image.ending
            );
            let path = out.join(name);
            write(&path, &image.file)?;
            let _ = writeln!(text, "{condition}: {}", path.display());
        }
        let digest = joint_digest(&images);
        let sent = sent(&item.answers, condition);
        let comparison = if sent.is_empty() {
            format!("the digest of what was sent is not stored; {digest} now")
        } else if sent.iter().all(|sent| *sent == digest) {
            format!("the very bytes that were sent ({digest})")
        } else {
            all_same = false;
            format!("NOT the bytes that were sent: {digest} now")
        };
        let _ = writeln!(text, "{condition}: {comparison}");
        text += &replies(&item.answers, Some(condition));
    }
    text += &replies(&item.answers, None);
    if !all_same {
        text += "the data, an enhancement model or this program has changed since the run\n";
    }
    Ok(Outcome {
        status: if all_same {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: text,
    })
}

/// The manifest of a run, and one item of it; `None` if the run did not ask the item.
fn read(run: AnyRun, name: &str) -> (RunManifest, Option<ShownItem>) {
    match run {
        AnyRun::Choice(run) => {
            let matching = run
                .records
                .iter()
                .filter(|record| record.question.0 == name);
            let records: Vec<&Record> = matching.collect();
            let item = records.first().map(|first| ShownItem {
                source: first.detail.frame.clone(),
                text: choice_text(first, stored_question(&run.questions, name)),
                answers: records.iter().map(|record| choice_answer(record)).collect(),
            });
            (run.manifest, item)
        }
        AnyRun::Open(run) => {
            let matching = run
                .records
                .iter()
                .filter(|record| record.question.0 == name);
            let records: Vec<&Record<OpenDetail>> = matching.collect();
            let item = records.first().map(|first| ShownItem {
                source: FrameId(first.detail.episode.clone()),
                text: open_text(first, stored_question(&run.questions, name)),
                answers: records.iter().map(|record| open_answer(record)).collect(),
            });
            (run.manifest, item)
        }
    }
}

fn stored_question<'a>(questions: &'a [RunQuestion], name: &str) -> Option<&'a RunQuestion> {
    questions.iter().find(|question| question.id.0 == name)
}

fn choice_text(record: &Record, stored_question: Option<&RunQuestion>) -> String {
    let mut text = format!("{}, about {}\n", record.question, record.detail.frame);
    if let Some(stored_question) = stored_question {
        let _ = writeln!(text, "{}", stored_question.text);
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

fn choice_answer(record: &Record) -> ShownAnswer {
    ShownAnswer {
        model: record.model.clone(),
        condition: record.condition.clone(),
        outcome: match record.detail.outcome {
            types::TrialOutcome::Right => "right",
            types::TrialOutcome::Wrong => "wrong",
            types::TrialOutcome::Unparsed => "not readable",
            types::TrialOutcome::Failed => "failed",
        },
        reply: reply(record.reply.as_deref(), record.failure.as_ref()),
        sent: record.detail.image.as_ref().map(|image| image.digest),
    }
}

fn open_text(record: &Record<OpenDetail>, stored_question: Option<&RunQuestion>) -> String {
    let mut text = format!("{}, about {}\n", record.question, record.detail.episode);
    if let Some(stored_question) = stored_question {
        let _ = writeln!(
            text,
            "{}\n  {}  (true)",
            stored_question.text, stored_question.answer
        );
    }
    text
}

fn open_answer(record: &Record<OpenDetail>) -> ShownAnswer {
    ShownAnswer {
        model: record.model.clone(),
        condition: record.condition.clone(),
        outcome: match (&record.failure, &record.detail.judged) {
            (Some(_), _) => "failed",
            (None, Some(_)) => "marked",
            (None, None) => "answered",
        },
        reply: reply(record.reply.as_deref(), record.failure.as_ref()),
        sent: record.detail.images.as_ref().map(|images| images.digest),
    }
}

fn reply(reply: Option<&str>, failure: Option<&types::Failure>) -> String {
    let message = failure.map(|failure| failure.message.as_str());
    let text = reply.or(message).unwrap_or_default();
    text.chars().take(200).collect()
}

/// The conditions of the item, limited to those of `--condition`.
fn conditions(answers: &[ShownAnswer], args: &ShowArgs) -> Result<Vec<Condition>> {
    let wanted = &args.condition;
    let asked = answers.iter().filter_map(|answer| answer.condition.clone());
    let asked: BTreeSet<Condition> = asked.collect();
    if asked.is_empty() {
        let problem =
            "the item was only asked without images, so there is nothing to show".to_owned();
        let path = args.run.clone();
        return Err(Error::Run { path, problem });
    }
    if wanted.is_empty() {
        return Ok(asked.into_iter().collect());
    }
    if let Some(missing) = wanted.iter().find(|condition| !asked.contains(condition)) {
        let asked: Vec<String> = asked.iter().map(ToString::to_string).collect();
        let problem = format!(
            "the item was not asked at {missing}; it was at {}",
            asked.join(", ")
        );
        return Err(Error::usage("--condition", problem));
    }
    Ok(wanted.clone())
}

/// The digest of images that are sent together, as in a record.
fn joint_digest(images: &[RebuiltImage]) -> Digest {
    match images {
        [only] => only.digest,
        multiple => Digest::of_parts(multiple.iter().map(|image| &image.digest.as_bytes()[..])),
    }
}

/// The digests of the images that were sent in a condition.
fn sent(answers: &[ShownAnswer], condition: &Condition) -> BTreeSet<Digest> {
    let matching = answers
        .iter()
        .filter(|answer| answer.condition.as_ref() == Some(condition));
    matching.filter_map(|answer| answer.sent).collect()
}

/// The reply of each model in a condition, or without an image. Replies are escaped, so that they cannot send control
/// characters to the terminal.
fn replies(answers: &[ShownAnswer], condition: Option<&Condition>) -> String {
    let mut text = String::new();
    let without = if condition.is_none() {
        " without an image"
    } else {
        ""
    };
    for answer in answers
        .iter()
        .filter(|answer| answer.condition.as_ref() == condition)
    {
        let ShownAnswer {
            model,
            outcome,
            reply,
            ..
        } = answer;
        let _ = writeln!(text, "  {model}{without}: {outcome}: {reply:?}");
    }
    text
}
