//! `questions`: makes multiple-choice questions about frames by rule.
//!
//! `questions --against`: compares the look of the frames with that of another set.
//!
//! Paths of the files with frame statistics, next to the questions: [`statistics_path`], [`shard_files`].

mod checked;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, write};
use darkqa_data::{Dataset, FolderArgs, open_frames, open_images};
use darkqa_engine::images::frames::InputTally;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::trials::{note_built_in_families, rules};
use darkqa_engine::images::workers::{ThreadArgs, pool};

use checked::StatisticsCache;
use darkqa_base::types::questions::FAMILIES;
use darkqa_base::types::text::{counted, plural};
use darkqa_base::types::{Decides, Digest, Evidence, Family, FrameId, Labels, QuestionId, shell_word};
use darkqa_questions::appearance::FrameAppearance;
use darkqa_questions::balance::BalanceMode;
use darkqa_questions::colors::Palette;
use darkqa_questions::reason::Reason;
use darkqa_questions::room::RoomSource;
use darkqa_questions::rule_context::RuleResult;
use darkqa_questions::rules::Rules;
use darkqa_questions::statistics::{self, FrameStatistics, measure, unknown_labels};
use darkqa_questions::summary::QuestionSummary;
use darkqa_questions::{Generated, GeneratedQuestion, QuestionRequest, generate};
use darkqa_report::questions::AppearanceComparison;
use darkqa_runs::Outcome;
use darkqa_runs::resolved_shard::{keep_shard, shard_from_flag};
use darkqa_runs::shard::Shard;

/// The flags of `questions`.
#[derive(Debug, Args)]
pub(crate) struct QuestionsArgs {
    /// A folder of frames with their maps (frames.jsonl, classes.json), as import makes it
    #[arg(value_name = "DATA", required = true, add = Decides::Reply)]
    pub data: Vec<PathBuf>,
    /// Where the questions go (.jsonl); the statistics of the frames go into a file next to it
    #[arg(long, value_name = "FILE", value_parser = file, add = Decides::Nothing)]
    pub out: PathBuf,
    /// The rulebook; default: the one built in (src/questions/rules.toml)
    #[arg(long, value_name = "FILE", help_heading = "Rules", add = Decides::Trials)]
    pub rules: Option<PathBuf>,
    /// The names of colours, a table like src/questions/colors.txt; default: the one built in
    #[arg(long, value_name = "FILE", help_heading = "Rules", add = Decides::Trials)]
    pub colors: Option<PathBuf>,
    #[arg(
        long,
        value_name = "LIST",
        help_heading = "Rules",
        help = format!("Only these families: {}; default: all", family_names()),
        value_delimiter = ',',
        value_parser = family,
        add = Decides::Trials
    )]
    pub families: Vec<Family>,
    /// How the answers are evened out
    #[arg(long, value_enum, default_value_t, help_heading = "Rules", add = Decides::Trials)]
    pub balance: BalanceMode,
    /// Where the kind of room is read from
    #[arg(long, value_enum, default_value_t, help_heading = "Rules", add = Decides::Trials)]
    pub room: RoomSource,
    /// Refuse numbers of a semantic map that classes.json does not have, instead of counting them as unlabelled
    #[arg(long, help_heading = "Rules", add = Decides::Trials)]
    pub strict: bool,
    /// Write every candidate and why it was taken or rejected, one per line; default: not written
    #[arg(long, value_name = "FILE", help_heading = "Checking", add = Decides::Nothing)]
    pub candidates: Option<PathBuf>,
    /// Write the statistics of frames, questions and answers: JSON, CSV and a figure; default: not written
    #[arg(long, value_name = "DIR", help_heading = "Checking", add = Decides::Nothing)]
    pub stats: Option<PathBuf>,
    /// Compare how the frames look (light, edges, segments, depth, colours) with those of another folder, with or
    /// without maps; default: not compared
    #[arg(long, value_name = "DIR", help_heading = "Checking", add = Decides::Nothing)]
    pub against: Option<PathBuf>,
    /// Write a page on which a person answers each question before the rule's answer is shown, and which saves what was
    /// found; default: not written
    #[arg(long, value_name = "FILE.html", help_heading = "Checking", add = Decides::Nothing)]
    pub review: Option<PathBuf>,
    /// Leave out what a person has rejected on such a page, and show the shares found wrong and ambiguous; with the
    /// files of two people also Cohen's κ; repeatable; default: nothing
    #[arg(long, value_name = "FILE", help_heading = "Checking", add = Decides::Trials)]
    pub verdicts: Vec<PathBuf>,
    /// Print the statistics as JSON instead of a table
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub json: bool,
    /// The reading of frames.
    #[command(flatten)]
    pub folders: FolderArgs,
    /// Only measure this part of the frames, as 2/4, or auto/4 for the task of this process in a Slurm array or the pod
    /// of an indexed Kubernetes job. Questions are balanced over all frames: the same command without --shard makes
    /// them from what all parts measured; default: all frames
    #[arg(long, value_name = "I/N|auto/N|auto", help_heading = "Scale", add = Decides::Trials)]
    pub shard: Option<String>,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The path of the file that questions are written to.
fn file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let valid = path.file_stem().is_some() && !path.is_dir();
    valid.then_some(path).ok_or_else(|| "a file expected, as questions.jsonl".to_owned())
}

/// The family of questions in a text; only families that are made by rule.
fn family(name: &str) -> Result<Family, String> {
    match Family::from(name.trim()) {
        Family::Other(_) => Err(format!("one of {} expected", family_names())),
        family => Ok(family),
    }
}

/// The names of the families that are made by rule, with commas.
fn family_names() -> String {
    FAMILIES.iter().map(|row| row.name).collect::<Vec<_>>().join(", ")
}

/// The folder of frames.
///
/// # Errors
/// If several are named, because a run takes only one. The message names the command that joins them.
fn folder(args: &QuestionsArgs) -> Result<&Path> {
    match &*args.data {
        [folder] => Ok(folder),
        folders => {
            let sources: String =
                folders.iter().map(|folder| format!(" --src {}", shell_word(&folder.display().to_string()))).collect();
            let problem = format_args!(
                "one folder expected, which a run takes with its questions; darkqa-eval import folder{sources} --out JOINED makes one of {}",
                folders.len()
            );
            Err(Error::usage("DATA", problem))
        }
    }
}

/// The flags, with the rules and colours read from the files that they name.
struct QuestionSettings<'a> {
    args: &'a QuestionsArgs,
    rules: Rules,
    palette: Palette,
}

impl<'a> QuestionSettings<'a> {
    fn read(args: &'a QuestionsArgs) -> Result<Self> {
        let palette = read_table(args.colors.as_deref(), Palette::parse)?;
        Ok(Self { args, rules: rules(args.rules.as_deref())?, palette: palette.map_or_else(Palette::built_in, Ok)? })
    }

    /// The families to make; all if no flag names any.
    fn families(&self) -> BTreeSet<Family> {
        if self.args.families.is_empty() {
            Family::by_rule().collect()
        } else {
            self.args.families.iter().cloned().collect()
        }
    }

    /// The comparison with the set of `--against`; `None` without the flag.
    fn comparison(&self, dataset: &Dataset, progress: &Progress) -> Result<Option<AppearanceComparison>> {
        let args = self.args;
        let Some(folder) = &args.against else {
            return Ok(None);
        };
        let other = open_images(folder, &args.folders.root.data_root)?;
        let other = other.with_rule(args.folders.decode.rule());
        compare([dataset, &other], &self.palette, args.threads, progress).map(Some)
    }
}

/// Reads and parses a file; `None` if none was named.
fn read_table<T>(path: Option<&Path>, parse: fn(&str) -> Result<T>) -> Result<Option<T>> {
    let Some(path) = path else {
        return Ok(None);
    };
    let text = files::settings(path)?;
    parse(&text).map(Some).map_err(|e| e.at(path.display().to_string()))
}

/// Makes the questions and writes them. If a frame fails, the error is logged and counted, and the others continue.
///
/// # Errors
/// If there are no frames or no classes, or a file cannot be written.
pub(crate) fn questions(args: &QuestionsArgs, progress: &Progress) -> Result<Outcome> {
    let settings = &QuestionSettings::read(args)?;
    let folder = folder(args)?;
    let dataset = open_frames(folder, &args.folders.root.data_root)?;
    let dataset = dataset.with_rule(args.folders.decode.rule());
    let labels = dataset.labels().ok_or_else(|| {
        let problem = "no classes.json in this folder, which gives the class of each number in its maps; `darkqa-eval import` writes one";
        Error::data(folder.display(), problem)
    })?;
    let shard = shard_from_flag(args.shard.as_deref())?;
    note_built_in_families(&settings.rules, progress);
    let (frames, failed) = measure_frames(settings, &dataset, labels, shard, progress)?;
    if shard.is_part() {
        return Ok(shard_outcome(args, shard, frames.len(), failed));
    }
    let verdicts = checked::read_verdicts(&args.verdicts)?;
    let request = QuestionRequest {
        dataset: dataset.title(),
        labels,
        rules: &settings.rules,
        palette: &settings.palette,
        families: settings.families(),
        room_source: args.room,
        balance: args.balance,
        rejected: verdicts.rejected,
    };
    let mut candidates = Vec::new();
    let generated = generate(&frames, &request, |frame, result| {
        if args.candidates.is_some() {
            candidates.push(candidate_line(frame, result));
        }
    })?;
    write(&args.out, &lines(generated.asked.iter().map(WrittenQuestion::new))?)?;
    if let Some(path) = &args.candidates {
        write(path, &lines(candidates)?)?;
    }
    let summary = QuestionSummary::new(&frames, &generated, &request, failed);
    let comparison = settings.comparison(&dataset, progress)?;
    let json = darkqa_report::questions::json(&summary, &verdicts.checks, comparison.as_ref())?;
    if let Some(folder) = &args.stats {
        write_statistics(folder, &summary, &json)?;
    }
    if let Some(page) = &args.review {
        checked::write_review(page, &dataset, &frames, &generated.asked)?;
    }
    warn(&generated, settings);
    let status = Outcome::complete_if(failed == 0);
    if args.json {
        return Ok(Outcome::text(status, json));
    }
    let looks = comparison.as_ref().map_or_else(String::new, AppearanceComparison::table);
    let table = darkqa_report::questions::table(&summary);
    let checks = darkqa_report::questions::text(&verdicts.checks);
    let output = format!("{table}{looks}{checks}{}\n", args.out.display());
    Ok(Outcome::wrote(&args.out, status, output))
}

/// Writes the statistics into a folder as JSON, CSV and SVG.
fn write_statistics(folder: &Path, summary: &QuestionSummary, json: &str) -> Result<()> {
    let csv = darkqa_report::questions::csv(summary)?;
    let figure = darkqa_report::questions::figure(summary)?;
    write(&folder.join("statistics.json"), json.as_bytes())?;
    write(&folder.join("statistics.csv"), &csv)?;
    write(&folder.join("statistics.svg"), figure.as_bytes())
}

/// Warns of results that are valid but probably not intended.
fn warn(generated: &Generated, settings: &QuestionSettings<'_>) {
    for uneven in &generated.uneven {
        tracing::warn!("{uneven}");
    }
    let closest = generated.counts.get(&Family::Closest);
    let scale = closest.and_then(|tally| tally.rejections.get(&Reason::Scale));
    if let Some(frames) = scale {
        let measure = &settings.rules.book().measure;
        tracing::warn!(
            "{} a median depth outside {}–{} mm, which no room has, so no questions about depth are made; is their depth_scale right?",
            plural(*frames as usize, "frame has", "frames have"),
            measure.least_median_depth_mm,
            measure.most_median_depth_mm
        );
    }
}

/// The outcome of a command with `--shard`, which measures frames but makes no questions, because these are balanced
/// over all frames.
fn shard_outcome(args: &QuestionsArgs, shard: Shard, frames: usize, failed: usize) -> Outcome {
    let path = statistics_path(&args.out, shard);
    let status = Outcome::complete_if(failed == 0);
    let output = format!(
        "{}: statistics of {}; the same command without --shard makes the questions from those of all parts\n",
        path.display(),
        counted(frames, "frame")
    );
    Outcome::wrote(path, status, output)
}

/// The statistics of the frames of a shard, and the number of failed frames. Frames in the cache are not measured
/// again.
fn measure_frames(
    settings: &QuestionSettings<'_>,
    dataset: &Dataset,
    labels: &Labels,
    shard: Shard,
    progress: &Progress,
) -> Result<(Vec<FrameStatistics>, usize)> {
    let out = &settings.args.out;
    let cache = StatisticsCache::open(&statistics_path(out, shard), &shard_files(out)?)?;
    let workers = pool(settings.args.threads.threads)?;
    let mut names: Vec<&FrameId> = dataset.frames().collect();
    keep_shard(&mut names, shard)?;
    let bar = progress.bar("frames", names.len());
    let measuring = Measuring {
        settings,
        dataset,
        labels,
        context: context_digest(settings, labels),
        cache: &cache,
        tally: InputTally::default(),
    };
    let results: Vec<Option<FrameStatistics>> = workers.install(|| {
        names
            .par_iter()
            .map(|name| {
                let found = measuring.measure_frame(name);
                bar.inc();
                found.map_err(|e| tracing::error!("{e}")).ok()
            })
            .collect()
    });
    drop(bar);
    measuring.tally.warn();
    let failed = results.iter().filter(|result| result.is_none()).count();
    let frames: Vec<FrameStatistics> = results.into_iter().flatten().collect();
    if frames.is_empty() {
        return Err(Error::data(dataset.name(), "no frame in this folder could be measured"));
    }
    cache.finish(&frames)?;
    Ok((frames, failed))
}

/// Digest of everything except the frame that determines the statistics.
fn context_digest(settings: &QuestionSettings<'_>, labels: &Labels) -> Digest {
    let version = statistics::VERSION.to_le_bytes();
    let parts = [settings.rules.measure_digest(), settings.palette.digest(), labels.digest()];
    Digest::from_parts([&version[..]].into_iter().chain(parts.iter().map(|part| &part.as_bytes()[..])))
}

/// The inputs and the cache for measuring frames.
struct Measuring<'a> {
    settings: &'a QuestionSettings<'a>,
    dataset: &'a Dataset,
    labels: &'a Labels,
    /// From [`context_digest`].
    context: Digest,
    cache: &'a StatisticsCache,
    tally: InputTally,
}

impl Measuring<'_> {
    /// The statistics of a frame, from the cache or measured.
    fn measure_frame(&self, name: &FrameId) -> Result<FrameStatistics> {
        let files = self.dataset.files(name)?;
        self.tally.add(name, &files.note());
        let content = files.digest()?;
        let key = Digest::from_parts([&self.context.as_bytes()[..], content.as_bytes(), name.0.as_bytes()]);
        let found = if let Some(found) = self.cache.get(key) {
            found
        } else {
            let frame = files.decode()?;
            let QuestionSettings { rules, palette, .. } = self.settings;
            let found = measure(&frame, self.labels, rules, palette, key)?;
            self.cache.add(&found)?;
            found
        };
        let unknown = unknown_labels(&found);
        if self.settings.args.strict && !unknown.is_empty() {
            let problem = format_args!("its semantic map has the numbers {unknown:?}, which are not in classes.json");
            return Err(Error::data(format_args!("frame {:?}", name.0), problem));
        }
        Ok(found)
    }
}

/// A question as a line of the output file, with the keys in this order.
#[derive(Serialize)]
struct WrittenQuestion<'a> {
    id: &'a QuestionId,
    frame: &'a FrameId,
    family: &'a Family,
    question: &'a str,
    choices: &'a [String],
    answer: &'a str,
    evidence: &'a Evidence,
}

impl<'a> WrittenQuestion<'a> {
    fn new(asked: &'a GeneratedQuestion) -> Self {
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

/// A candidate as a line of the `--candidates` file.
fn candidate_line(frame: &FrameId, result: &RuleResult) -> Value {
    match result {
        RuleResult::Viable(candidate) => json!({
            "frame": frame,
            "family": candidate.family,
            "about": candidate.about,
            "answer": candidate.answer(),
            "reason": null,
            "question": candidate.text,
            "evidence": candidate.evidence,
        }),
        RuleResult::Rejected(rejection) => json!({
            "frame": frame,
            "family": rejection.family,
            "about": rejection.about,
            "answer": rejection.answer,
            "reason": rejection.reason,
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

/// Compares the frames of two sets.
///
/// # Errors
/// If a set has no images, or an image cannot be read: leaving it out would bias the comparison.
fn compare(
    sets: [&Dataset; 2],
    palette: &Palette,
    threads: ThreadArgs,
    progress: &Progress,
) -> Result<AppearanceComparison> {
    let looks = |set: &Dataset| {
        let found = looks(set, palette, threads, progress)?;
        if found.is_empty() {
            return Err(Error::data(set.name(), "no images to compare"));
        }
        Ok(found)
    };
    let [own, others] = [looks(sets[0])?, looks(sets[1])?];
    Ok(AppearanceComparison::new([(sets[0].name(), &own), (sets[1].name(), &others)]))
}

/// The look of each frame.
fn looks(
    dataset: &Dataset,
    palette: &Palette,
    threads: ThreadArgs,
    progress: &Progress,
) -> Result<Vec<FrameAppearance>> {
    let names: Vec<&FrameId> = dataset.frames().collect();
    let tally = InputTally::default();
    let bar = progress.bar("looks", names.len());
    let looks = pool(threads.threads)?.install(|| {
        names
            .par_iter()
            .map(|name| {
                let files = dataset.files(name)?;
                tally.add(name, &files.note());
                let look = FrameAppearance::new(&files.decode()?, palette);
                bar.inc();
                Ok(look)
            })
            .collect::<Result<Vec<FrameAppearance>>>()
    });
    drop(bar);
    tally.warn();
    looks
}

/// Suffix of the file names.
const SUFFIX: &str = ".statistics.jsonl";

/// The file of a shard, or of all frames.
fn statistics_path(out: &Path, shard: Shard) -> PathBuf {
    let stem = stem(out);
    out.with_file_name(if shard.is_part() {
        format!("{stem}.{}{SUFFIX}", shard.folder())
    } else {
        format!("{stem}{SUFFIX}")
    })
}

/// The existing files of shards, of any number of shards, sorted.
///
/// # Errors
/// If the folder cannot be read.
fn shard_files(out: &Path) -> Result<Vec<PathBuf>> {
    let folder = match out.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let prefix = format!("{}.shard-", stem(out));
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))? {
        let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(&prefix) && name.ends_with(SUFFIX) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn stem(out: &Path) -> String {
    let stem = out.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}
