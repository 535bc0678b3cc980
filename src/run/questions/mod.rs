//! `questions`: multiple-choice questions about frames, by rule.

mod checked;
mod statistics_cache;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use crate::dataset::{Dataset, PixelLimit};
use crate::error::{Error, Result};
use crate::files::{reading, write};
use crate::job::progress::Progress;
use crate::job::workers::{ThreadArgs, pool};
use crate::job::{Outcome, StdoutFormat};
use crate::questions::balance::BalanceMode;
use crate::questions::colors::Palette;
use crate::questions::reason::Reason;
use crate::questions::room::RoomSource;
use crate::questions::rule_context::RuleResult as Candidate;
use crate::questions::rules::Rules;
use crate::questions::statistics::{self, FrameStatistics, measure, strangers};
use crate::questions::summary::QuestionSummary;
use crate::questions::{Generated, GeneratedQuestion, QuestionRequest, generate};
use crate::report;
use crate::types::Decides;
use crate::types::manifest::Status;
use crate::types::{Digest, Family, FrameId, Labels, QuestionId};

use statistics_cache::StatisticsCache;

/// The flags of `questions`.
#[derive(Debug, Args)]
pub(crate) struct QuestionsArgs {
    /// A folder of frames with their maps (frames.jsonl, classes.json), as import makes it
    #[arg(value_name = "DATA", add = Decides::Reply)]
    pub data: PathBuf,
    /// Where the questions go (.jsonl); what was measured of the frames is kept beside it
    #[arg(long, value_name = "FILE", value_parser = file, add = Decides::Nothing)]
    pub out: PathBuf,
    /// The rulebook; default: the one built in (src/questions/rules.toml)
    #[arg(long, value_name = "FILE", help_heading = "Rules", add = Decides::Trials)]
    pub rules: Option<PathBuf>,
    /// The names of colours, a table like src/questions/colors.txt; default: the one built in
    #[arg(long, value_name = "FILE", help_heading = "Rules", add = Decides::Trials)]
    pub colors: Option<PathBuf>,
    /// Only these families: room_type, affordance, presence, color, closest; default: all
    #[arg(long, value_name = "LIST", help_heading = "Rules", value_delimiter = ',', value_parser = family, add = Decides::Trials)]
    pub families: Vec<Family>,
    /// How the answers are evened out
    #[arg(long, value_enum, default_value_t, help_heading = "Rules", add = Decides::Trials)]
    pub balance: BalanceMode,
    /// What says which room it is
    #[arg(long, value_enum, default_value_t, help_heading = "Rules", add = Decides::Trials)]
    pub room: RoomSource,
    /// Refuse numbers of a semantic map that classes.json does not have, instead of counting them as unlabelled
    #[arg(long, help_heading = "Rules", add = Decides::Trials)]
    pub strict: bool,
    /// Write what became of every candidate, a line each; default: not written
    #[arg(long, value_name = "FILE", help_heading = "Checking", add = Decides::Nothing)]
    pub candidates: Option<PathBuf>,
    /// Write the statistics of frames, questions and answers: JSON, CSV and a figure; default: not written
    #[arg(long, value_name = "DIR", help_heading = "Checking", add = Decides::Nothing)]
    pub stats: Option<PathBuf>,
    /// Write a page on which a person accepts or rejects each question; default: not written
    #[arg(long, value_name = "FILE.html", help_heading = "Checking", add = Decides::Nothing)]
    pub review: Option<PathBuf>,
    /// Leave out what a person has rejected on such a page; repeatable; default: nothing
    #[arg(long, value_name = "FILE", help_heading = "Checking", add = Decides::Trials)]
    pub verdicts: Vec<PathBuf>,
    /// Print the statistics as JSON instead of a table
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub json: bool,
    /// How large an image may be.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// On how many threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Reads the path of a file that questions go to.
fn file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let fit = path.file_stem().is_some() && !path.is_dir();
    fit.then_some(path)
        .ok_or_else(|| "a file expected, as questions.jsonl".to_owned())
}

/// Reads a family of questions that are made by rule.
fn family(name: &str) -> Result<Family, String> {
    match Family::from(name.trim()) {
        Family::Other(_) => {
            Err("one of room_type, affordance, presence, color, closest expected".to_owned())
        }
        family => Ok(family),
    }
}

/// The flags with the tables that they name.
struct QuestionMaking<'a> {
    args: &'a QuestionsArgs,
    rules: Rules,
    palette: Palette,
}

impl<'a> QuestionMaking<'a> {
    fn read(args: &'a QuestionsArgs) -> Result<Self> {
        let rules = read(args.rules.as_deref(), Rules::parse)?;
        let palette = read(args.colors.as_deref(), Palette::parse)?;
        Ok(Self {
            args,
            rules: rules.map_or_else(Rules::built_in, Ok)?,
            palette: palette.map_or_else(Palette::built_in, Ok)?,
        })
    }
}

fn read<T>(path: Option<&Path>, parse: fn(&str) -> Result<T>) -> Result<Option<T>> {
    let Some(path) = path else {
        return Ok(None);
    };
    let text = reading::text(path)?;
    parse(&text)
        .map(Some)
        .map_err(|e| e.at(path.display().to_string()))
}

/// Makes the questions.
///
/// What cannot be measured of one frame is said, counted, and does not stop the others.
///
/// # Errors
/// Where there are no frames, no classes, or a file cannot be written.
pub(crate) fn questions(args: &QuestionsArgs, progress: &Progress) -> Result<Outcome> {
    let making = &QuestionMaking::read(args)?;
    let dataset = Dataset::of_frames(&args.data)?;
    let dataset = dataset.with_most_pixels(args.limit.max_pixels.get());
    let labels = dataset.labels().ok_or_else(|| {
        let problem = "no classes.json in this folder, which says what the numbers of its maps stand for; `darkqa-eval import` writes one";
        Error::data(args.data.display(), problem)
    })?;
    let (frames, failed) = measured(making, &dataset, labels, progress)?;
    let order = QuestionRequest {
        dataset: dataset.title(),
        labels,
        rules: &making.rules,
        palette: &making.palette,
        families: if args.families.is_empty() {
            Family::PAPER.into_iter().collect()
        } else {
            args.families.iter().cloned().collect::<BTreeSet<_>>()
        },
        room_source: args.room,
        balance: args.balance,
        rejected: checked::rejected(&args.verdicts)?,
    };
    let mut candidates = Vec::new();
    let made = generate(&frames, &order, |frame, candidate| {
        if args.candidates.is_some() {
            candidates.push(told(frame, candidate));
        }
    })?;
    write(
        &args.out,
        &lines(made.asked.iter().map(WrittenQuestion::of))?,
    )?;
    if let Some(path) = &args.candidates {
        write(path, &lines(candidates)?)?;
    }
    let summary = QuestionSummary::new(&frames, &made, &order, failed);
    let json = report::questions::json(&summary)?;
    if let Some(folder) = &args.stats {
        write(&folder.join("statistics.json"), json.as_bytes())?;
        write(
            &folder.join("statistics.csv"),
            &report::questions::csv(&summary)?,
        )?;
        let figure = report::questions::figure::figure(&summary)?;
        write(&folder.join("statistics.svg"), figure.as_bytes())?;
    }
    if let Some(page) = &args.review {
        checked::review(page, &dataset, &frames, &made.asked)?;
    }
    warn(&made, making);
    Ok(Outcome {
        status: if failed == 0 {
            Status::Complete
        } else {
            Status::Incomplete
        },
        output: match StdoutFormat::of(args.json) {
            StdoutFormat::Json => json,
            StdoutFormat::Table => format!(
                "{}{}\n",
                report::questions::table(&summary),
                args.out.display()
            ),
        },
    })
}

/// Says what is not wrong, but likely not meant.
fn warn(made: &Generated, making: &QuestionMaking<'_>) {
    for uneven in &made.uneven {
        tracing::warn!("{uneven}");
    }
    let closest = made.tallies.get(&Family::Closest);
    let scale = closest.and_then(|tally| tally.fallen.get(&Reason::Scale));
    if let Some(frames) = scale {
        let measure = &making.rules.book().measure;
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
    making: &QuestionMaking<'_>,
    dataset: &Dataset,
    labels: &Labels,
    progress: &Progress,
) -> Result<(Vec<FrameStatistics>, usize)> {
    let kept = StatisticsCache::open(&beside(&making.args.out, "statistics.jsonl"))?;
    let cores = pool(making.args.threads.threads)?;
    let names: Vec<&FrameId> = dataset.frames().collect();
    let bar = progress.bar("frames", names.len());
    let context = context(making, labels);
    let results: Vec<Option<FrameStatistics>> = cores.install(|| {
        let frames = names.par_iter().map(|name| {
            let found = one(making, dataset, labels, &kept, context, name);
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
            making.args.data.display(),
            "none of its frames could be measured",
        ));
    }
    kept.finish(&frames)?;
    Ok((frames, failed))
}

/// All that decides what is measured, but for the frame.
fn context(making: &QuestionMaking<'_>, labels: &Labels) -> Digest {
    let version = statistics::VERSION.to_le_bytes();
    let parts = [
        making.rules.measure_digest(),
        making.palette.digest(),
        labels.digest(),
    ];
    Digest::of_parts(
        [&version[..]]
            .into_iter()
            .chain(parts.iter().map(|part| &part.as_bytes()[..])),
    )
}

fn one(
    making: &QuestionMaking<'_>,
    dataset: &Dataset,
    labels: &Labels,
    kept: &StatisticsCache,
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
        let found = measure(&frame, labels, &making.rules, &making.palette, key)?;
        kept.add(&found)?;
        found
    };
    let unknown = strangers(&found);
    if making.args.strict && !unknown.is_empty() {
        let problem = format_args!(
            "its semantic map has the numbers {unknown:?}, which classes.json has not"
        );
        return Err(Error::data(format_args!("frame {:?}", name.0), problem));
    }
    Ok(found)
}

/// A question as a line of its file, in the order of the keys.
#[derive(Serialize)]
struct WrittenQuestion<'a> {
    id: &'a QuestionId,
    frame: &'a FrameId,
    family: &'a Family,
    question: &'a str,
    choices: &'a [String],
    answer: &'a str,
    evidence: &'a Value,
}

impl<'a> WrittenQuestion<'a> {
    fn of(asked: &'a GeneratedQuestion) -> Self {
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
