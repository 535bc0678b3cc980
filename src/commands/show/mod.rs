//! `show`: rebuilds the images of one question and compares their digests with those of the images sent.

mod item;
mod settings;
mod sheet;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;

use crate::data::inputs::stem;
use crate::engine::image_rebuilder::ImageRebuilder;
use crate::error::{Error, Result};
use crate::files::write;
use crate::pictures::Payload;
use crate::runs::Outcome;
use crate::runs::sharded_run::open_any_run;
use crate::types::{Condition, Digest, FrameId};

use item::{ShownAnswer, ShownItem, read};
pub(crate) use settings::ShowArgs;

/// Rebuilds and writes the images of a question, and reports for each whether it equals the image sent. With `--sheet`,
/// draws them in one picture instead.
///
/// # Errors
/// If the run, the question, its data or an enhancer is missing, or an image cannot be written.
pub(crate) fn show(args: ShowArgs) -> Result<Outcome> {
    if let Some(path) = &args.sheet {
        return sheet::sheet(&args, path);
    }
    let folder = args.run.clone();
    let name = args.question_id();
    let (manifest, item) = read(open_any_run(&folder)?, name)?;
    let Some(item) = item else {
        let problem = format!("no question {name:?} in this run; report.html and questions.jsonl have their ids");
        return Err(Error::Run { path: folder, problem });
    };
    let conditions = conditions(&item.answers, &args)?;
    let target = match &args.out {
        Some(out) => Target { trusted: out.clone(), out: out.clone() },
        None => Target { trusted: folder.clone(), out: folder.join("shown") },
    };
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &folder, &conditions)?;
    let mut text = item.text.clone();
    let mut all_equal = true;
    for source in shown_frames(&item) {
        let answers: Vec<&ShownAnswer> = item.answers.iter().filter(|answer| answer.shown == source).collect();
        let conditions: Vec<Condition> = conditions
            .iter()
            .filter(|condition| answers.iter().any(|answer| answer.condition.as_ref() == Some(*condition)))
            .cloned()
            .collect();
        if source != item.source && !conditions.is_empty() {
            let _ = writeln!(text, "with the image of {source}:");
        }
        let images = rebuilder.images(&source, &conditions)?;
        for (condition, images) in conditions.iter().zip(images) {
            text += &write_images(&target, &source, condition, &images)?;
            let Some(digest) = Payload::joint_digest(&images) else {
                continue;
            };
            let sent = sent_digests(&answers, condition);
            let comparison = if sent.is_empty() {
                format!("the digest of what was sent is not stored; {digest} now")
            } else if sent.iter().all(|sent| *sent == digest) {
                format!("the same bytes as were sent ({digest})")
            } else {
                all_equal = false;
                format!("NOT the bytes that were sent: {digest} now")
            };
            let _ = writeln!(text, "{condition}: {comparison}");
            text += &reply_lines(&answers, Some(condition));
        }
    }
    let answers: Vec<&ShownAnswer> = item.answers.iter().collect();
    text += &reply_lines(&answers, None);
    if !all_equal {
        text += "the data, an enhancement model or this program has changed since the run\n";
    }
    Ok(Outcome::text(Outcome::complete_if(all_equal), text))
}

/// Output folder of the images.
struct Target {
    /// Folder named by the user: the run or `--out`. It may be a symbolic link.
    trusted: PathBuf,
    /// Folder of the images: `trusted` or a folder in it.
    out: PathBuf,
}

impl Target {
    /// Path of an image. Frame names can contain folders, and a run may come from a stranger.
    ///
    /// # Errors
    /// If a folder below the trusted one is a symbolic link, because a link may lead anywhere.
    fn path(&self, name: &str) -> Result<PathBuf> {
        let path = self.out.join(name);
        let link =
            path.ancestors().skip(1).take_while(|folder| *folder != self.trusted).find(|folder| folder.is_symlink());
        if let Some(link) = link {
            let problem =
                "a link; the images would be written to where it leads. Delete the link, or name another --out";
            return Err(Error::data(link.display(), problem));
        }
        Ok(path)
    }
}

/// Frames shown with the question: its own first, then those shown in controls of the observer.
fn shown_frames(item: &ShownItem) -> Vec<FrameId> {
    let others: BTreeSet<&FrameId> =
        item.answers.iter().filter(|answer| answer.condition.is_some()).map(|answer| &answer.shown).collect();
    let others = others.into_iter().filter(|shown| **shown != item.source);
    std::iter::once(&item.source).chain(others).cloned().collect()
}

/// Writes the images of a frame in a condition. Returns their paths, one per line.
fn write_images(target: &Target, source: &FrameId, condition: &Condition, images: &[Arc<Payload>]) -> Result<String> {
    let mut text = String::new();
    for (index, image) in images.iter().enumerate() {
        let suffix = if images.len() > 1 { format!("_{index:03}") } else { String::new() };
        let name = format!("{}_{condition}{suffix}.{}", stem(source)?, image.extension());
        let path = target.path(&name)?;
        write(&path, image.file())?;
        let _ = writeln!(text, "{condition}: {}", path.display());
    }
    Ok(text)
}

/// Conditions of the question, limited to those of `--condition`.
///
/// # Errors
/// If the question was only asked without images, or not in a condition of `--condition`.
fn conditions(answers: &[ShownAnswer], args: &ShowArgs) -> Result<Vec<Condition>> {
    let wanted = &args.condition;
    let asked: BTreeSet<Condition> = answers.iter().filter_map(|answer| answer.condition.clone()).collect();
    if asked.is_empty() {
        let problem = "the item was only asked without images, so there is nothing to show".to_owned();
        let path = args.run.clone();
        return Err(Error::Run { path, problem });
    }
    if wanted.is_empty() {
        return Ok(asked.into_iter().collect());
    }
    if let Some(missing) = wanted.iter().find(|condition| !asked.contains(condition)) {
        let asked: Vec<String> = asked.iter().map(ToString::to_string).collect();
        let problem = format!("the item was not asked at {missing}; it was at {}", asked.join(", "));
        return Err(Error::usage("--condition", problem));
    }
    Ok(wanted.clone())
}

/// Digests of the images sent in a condition.
fn sent_digests(answers: &[&ShownAnswer], condition: &Condition) -> BTreeSet<Digest> {
    answers
        .iter()
        .filter(|answer| answer.condition.as_ref() == Some(condition))
        .filter_map(|answer| answer.sent)
        .collect()
}

/// Replies in a condition, one line per answer; `None` selects the answers without an image. Replies are escaped, so
/// that they cannot send control characters to the terminal.
fn reply_lines(answers: &[&ShownAnswer], condition: Option<&Condition>) -> String {
    let mut text = String::new();
    let note = if condition.is_none() { " without an image" } else { "" };
    for answer in answers.iter().filter(|answer| answer.condition.as_ref() == condition) {
        let ShownAnswer { model, outcome, reply, .. } = answer;
        let _ = writeln!(text, "  {model}{note}: {outcome}: {reply:?}");
    }
    text
}
