//! `show`: making the images of one item again, and checking by their digests that they are those that were sent.

mod item;
mod settings;
mod sheet;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;

use crate::dataset::inputs::stem;
use crate::error::{Error, Result};
use crate::files::write;
use crate::picture::Payload;
use crate::runs::Outcome;
use crate::runs::rebuild::ImageRebuilder;
use crate::runs::run_parts::any_run;
use crate::types::{Condition, Digest, FrameId};

use item::{ShownAnswer, ShownItem, read};
pub(crate) use settings::ShowArgs;

/// Makes the images again, writes them, and prints for each whether it is the one that was sent; or draws one picture of them.
///
/// # Errors
/// If the run or the item is missing, or its data or enhancers are not found.
pub(crate) fn show(args: ShowArgs) -> Result<Outcome> {
    if let Some(path) = &args.sheet {
        return sheet::sheet(&args, path);
    }
    let folder = args.run.clone();
    let name = args.question_id();
    let (manifest, item) = read(any_run(&folder)?, name)?;
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
    let target = match &args.out {
        Some(out) => Target {
            trusted: out.clone(),
            out: out.clone(),
        },
        None => Target {
            trusted: folder.clone(),
            out: folder.join("shown"),
        },
    };
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &folder, &conditions)?;
    let mut text = item.text.clone();
    let mut all_same = true;
    for source in sources(&item) {
        let answers: Vec<&ShownAnswer> = item
            .answers
            .iter()
            .filter(|answer| answer.shown == source)
            .collect();
        let asked = |condition: &&Condition| {
            answers
                .iter()
                .any(|answer| answer.condition.as_ref() == Some(condition))
        };
        let conditions: Vec<Condition> = conditions.iter().filter(asked).cloned().collect();
        if source != item.source && !conditions.is_empty() {
            let _ = writeln!(text, "with the image of {source}:");
        }
        let images = rebuilder.images(&source, &conditions)?;
        for (condition, images) in conditions.iter().zip(images) {
            text += &written(&target, &source, condition, &images)?;
            let Some(digest) = Payload::joint_digest(&images) else {
                continue;
            };
            let sent = sent(&answers, condition);
            let comparison = if sent.is_empty() {
                format!("the digest of what was sent is not stored; {digest} now")
            } else if sent.iter().all(|sent| *sent == digest) {
                format!("the same bytes as were sent ({digest})")
            } else {
                all_same = false;
                format!("NOT the bytes that were sent: {digest} now")
            };
            let _ = writeln!(text, "{condition}: {comparison}");
            text += &replies(&answers, Some(condition));
        }
    }
    let answers: Vec<&ShownAnswer> = item.answers.iter().collect();
    text += &replies(&answers, None);
    if !all_same {
        text += "the data, an enhancement model or this program has changed since the run\n";
    }
    Ok(Outcome::text(Outcome::complete_if(all_same), text))
}

/// Where the images go.
struct Target {
    /// The folder that the user names: that of the run, or `--out`. It may be a link.
    trusted: PathBuf,
    /// The folder of the images.
    out: PathBuf,
}

impl Target {
    /// The path of an image. Names of frames have folders, and a run may come from a stranger.
    ///
    /// # Errors
    /// If a folder on the way is a link, which may lead anywhere.
    fn path(&self, name: &str) -> Result<PathBuf> {
        let path = self.out.join(name);
        let folders = path.ancestors().skip(1);
        let mut inner = folders.take_while(|folder| *folder != self.trusted);
        if let Some(link) = inner.find(|folder| folder.is_symlink()) {
            let problem = "a link; the images would be written to where it leads. Delete the link, or name another --out";
            return Err(Error::data(link.display(), problem));
        }
        Ok(path)
    }
}

/// The frames that were shown with the item: its own first, then those that a control of the observer was shown.
fn sources(item: &ShownItem) -> Vec<FrameId> {
    let others: BTreeSet<&FrameId> = item
        .answers
        .iter()
        .filter(|answer| answer.condition.is_some())
        .map(|answer| &answer.shown)
        .collect();
    let others = others.into_iter().filter(|shown| **shown != item.source);
    std::iter::once(&item.source)
        .chain(others)
        .cloned()
        .collect()
}

/// Writes the images of a source in a condition; the lines with their paths.
fn written(
    target: &Target,
    source: &FrameId,
    condition: &Condition,
    images: &[Arc<Payload>],
) -> Result<String> {
    let mut text = String::new();
    for (place, image) in images.iter().enumerate() {
        let place = if images.len() > 1 {
            format!("_{place:03}")
        } else {
            String::new()
        };
        let name = format!("{}_{condition}{place}.{}", stem(source)?, image.extension());
        let path = target.path(&name)?;
        write(&path, image.file())?;
        let _ = writeln!(text, "{condition}: {}", path.display());
    }
    Ok(text)
}

/// The conditions of the item, limited to those of `--condition`.
fn conditions(answers: &[ShownAnswer], args: &ShowArgs) -> Result<Vec<Condition>> {
    let wanted = &args.condition;
    let asked: BTreeSet<Condition> = answers
        .iter()
        .filter_map(|answer| answer.condition.clone())
        .collect();
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

/// The digests of the images that were sent in a condition.
fn sent(answers: &[&ShownAnswer], condition: &Condition) -> BTreeSet<Digest> {
    answers
        .iter()
        .filter(|answer| answer.condition.as_ref() == Some(condition))
        .filter_map(|answer| answer.sent)
        .collect()
}

/// The reply of each model in a condition, or without an image. Replies are escaped, so that they cannot send control
/// characters to the terminal.
fn replies(answers: &[&ShownAnswer], condition: Option<&Condition>) -> String {
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
