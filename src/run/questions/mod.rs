//! `questions`: multiple-choice questions about frames, by rule.

mod checked;
mod kept;

use std::path::{Path, PathBuf};

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use crate::config::{Questions, Show, Strangers};
use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::progress::Progress;
use crate::questions::reason::Reason;
use crate::questions::statistics::{self, FrameStatistics, measure, strangers};
use crate::questions::summary::Summary;
use crate::questions::survey::Verdict as Candidate;
use crate::questions::{Asked, Generated, Order, generate};
use crate::report;
use crate::types::manifest::Status;
use crate::types::{Digest, Family, FrameId, Labels, QuestionId};

use kept::Kept;

/// Makes the questions.
///
/// What cannot be measured of one frame is said, counted, and does not stop the others.
///
/// # Errors
/// Where there are no frames, no classes, or a file cannot be written.
pub fn questions(config: &Questions, progress: &Progress) -> Result<Outcome> {
    let dataset = Dataset::of_frames(&config.data)?.with_most_pixels(config.most_pixels);
    let labels = dataset.labels().ok_or_else(|| {
        let problem = "no classes.json in this folder, which says what the numbers of its maps stand for; `darkqa-eval import` writes one";
        Error::data(config.data.display(), problem)
    })?;
    let (frames, failed) = measured(config, &dataset, labels, progress)?;
    let order = Order {
        dataset: dataset.title(),
        labels,
        rules: &config.rules,
        palette: &config.palette,
        families: config.families.clone(),
        room_source: config.room,
        balance: config.balance,
        rejected: checked::rejected(&config.verdicts)?,
    };
    let mut candidates = Vec::new();
    let made = generate(&frames, &order, |frame, candidate| {
        if config.candidates.is_some() {
            candidates.push(told(frame, candidate));
        }
    })?;
    write(&config.out, &lines(made.asked.iter().map(Line::of))?)?;
    if let Some(path) = &config.candidates {
        write(path, &lines(candidates)?)?;
    }
    let summary = Summary::new(&frames, &made, &order, failed);
    let json = report::questions::json(&summary)?;
    if let Some(folder) = &config.stats {
        write(&folder.join("statistics.json"), json.as_bytes())?;
        write(
            &folder.join("statistics.csv"),
            &report::questions::csv(&summary)?,
        )?;
        let figure = report::questions::figure::figure(&summary)?;
        write(&folder.join("statistics.svg"), figure.as_bytes())?;
    }
    if let Some(page) = &config.review {
        checked::review(page, &dataset, &frames, &made.asked)?;
    }
    warn(&made, config);
    Ok(Outcome {
        status: if failed == 0 {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: match config.show {
            Show::Json => json,
            Show::Table => format!(
                "{}{}\n",
                report::questions::table(&summary),
                config.out.display()
            ),
        },
    })
}

/// Says what is not wrong, but likely not meant.
fn warn(made: &Generated, config: &Questions) {
    for uneven in &made.uneven {
        tracing::warn!("{uneven}");
    }
    let closest = made.tallies.get(&Family::Closest);
    let scale = closest.and_then(|tally| tally.fallen.get(&Reason::Scale));
    if let Some(frames) = scale {
        let measure = &config.rules.book().measure;
        tracing::warn!(
            "{frames} frames have a median depth outside {}–{} mm, which no room has, and are asked nothing of depth; is their depth_scale right?",
            measure.least_median_depth_mm,
            measure.most_median_depth_mm
        );
    }
}

/// The file of what was measured, beside the questions.
fn beside(out: &Path, what: &str) -> PathBuf {
    let stem = out.file_stem().unwrap_or_default().to_string_lossy();
    out.with_file_name(format!("{stem}.{what}"))
}

/// Measures the frames that were not measured before, and counts those that cannot be.
fn measured(
    config: &Questions,
    dataset: &Dataset,
    labels: &Labels,
    progress: &Progress,
) -> Result<(Vec<FrameStatistics>, usize)> {
    let kept = Kept::open(&beside(&config.out, "statistics.jsonl"))?;
    let threads = config.threads.map_or(0, std::num::NonZero::get);
    let cores = ThreadPoolBuilder::new().num_threads(threads).build();
    let cores = cores.map_err(|e| Error::usage("--threads", e))?;
    let names: Vec<&FrameId> = dataset.frames().collect();
    let bar = progress.bar("frames", names.len());
    let context = context(config, labels);
    let results: Vec<Option<FrameStatistics>> = cores.install(|| {
        let frames = names.par_iter().map(|name| {
            let found = one(config, dataset, labels, &kept, context, name);
            bar.inc();
            found.map_err(|e| tracing::error!("{e}")).ok()
        });
        frames.collect()
    });
    drop(bar);
    let failed = results.iter().filter(|result| result.is_none()).count();
    let frames: Vec<FrameStatistics> = results.into_iter().flatten().collect();
    if frames.is_empty() {
        return Err(Error::data(
            config.data.display(),
            "none of its frames could be measured",
        ));
    }
    kept.finish(&frames)?;
    Ok((frames, failed))
}

/// All that decides what is measured, but for the frame.
fn context(config: &Questions, labels: &Labels) -> Digest {
    let version = statistics::VERSION.to_le_bytes();
    let parts = [
        config.rules.measure_digest(),
        config.palette.digest(),
        labels.digest(),
    ];
    Digest::of_parts(
        [&version[..]]
            .into_iter()
            .chain(parts.iter().map(|part| &part.as_bytes()[..])),
    )
}

fn one(
    config: &Questions,
    dataset: &Dataset,
    labels: &Labels,
    kept: &Kept,
    context: Digest,
    name: &FrameId,
) -> Result<FrameStatistics> {
    let files = dataset.files(name)?;
    let seen = files.digest()?;
    let parts = [&context.as_bytes()[..], seen.as_bytes(), name.0.as_bytes()];
    let key = Digest::of_parts(parts);
    let found = if let Some(found) = kept.get(key) {
        found
    } else {
        let frame = files.decode()?;
        let found = measure(&frame, labels, &config.rules, &config.palette, key)?;
        kept.add(&found)?;
        found
    };
    let unknown = strangers(&found);
    if config.strangers == Strangers::Refused && !unknown.is_empty() {
        let problem = format_args!(
            "its semantic map has the numbers {unknown:?}, which classes.json has not"
        );
        return Err(Error::data(format_args!("frame {:?}", name.0), problem));
    }
    Ok(found)
}

/// A question as a line of its file, in the order of the keys.
#[derive(Serialize)]
struct Line<'a> {
    id: &'a QuestionId,
    frame: &'a FrameId,
    family: &'a Family,
    question: &'a str,
    choices: &'a [String],
    answer: &'a str,
    evidence: &'a Value,
}

impl<'a> Line<'a> {
    fn of(asked: &'a Asked) -> Self {
        let question = &asked.question;
        Self {
            id: &question.id,
            frame: &question.frame,
            family: &question.family,
            question: &question.text,
            choices: question.choices.texts(),
            answer: asked.answer(),
            evidence: &question.evidence,
        }
    }
}

/// A candidate as a line of its file.
fn told(frame: &FrameId, candidate: &Candidate) -> Value {
    match candidate {
        Candidate::Holds(claim) => json!({
            "frame": frame,
            "family": claim.family,
            "about": claim.about,
            "answer": claim.answer(),
            "reason": null,
            "question": claim.text,
            "evidence": claim.evidence,
        }),
        Candidate::Falls(fallen) => json!({
            "frame": frame,
            "family": fallen.family,
            "about": fallen.about,
            "answer": fallen.answer,
            "reason": fallen.reason,
        }),
    }
}

fn lines<T: Serialize>(values: impl IntoIterator<Item = T>) -> Result<Vec<u8>> {
    let mut lines = Vec::new();
    for value in values {
        serde_json::to_writer(&mut lines, &value).map_err(|e| Error::data("questions", e))?;
        lines.push(b'\n');
    }
    Ok(lines)
}
