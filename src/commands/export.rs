//! `export`: writes ready-made sets for other tools, one set with its images per condition.
//!
//! Writer of one ready-made set: [`ReadySet`].

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{create_new, write};
use darkqa_base::types::manifests::PngForm;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::questions::letter;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Choices, Condition, Decides, FrameId, Question};
use darkqa_data::{DataSource, Dataset, DecodeArgs, SceneArgs, SelectionArgs, SetArgs};
use darkqa_engine::images::enhancement::enhancers::{self, EnhancerModels, EnhancerRunArgs};
use darkqa_engine::images::frame_work::FrameWork;
use darkqa_engine::images::frames::{Source, input_summary, inspect_all, photographs, warn_of_inputs};
use darkqa_engine::images::image_pipeline::ImagePipeline;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::recipes::Recipe;
use darkqa_engine::images::timings::{ImageSteps, Timings};
use darkqa_engine::images::trials::{check_enhanced, check_used, conditions, open_data, rules, select};
use darkqa_engine::images::workers::pool;
use darkqa_enhance::EnhancerArgs;
use darkqa_light::{LightArgs, LightSettings};
use darkqa_pictures::png;
use darkqa_runs::Outcome;
use darkqa_runs::resolved_shard::{ShardArgs, keep_shard};
use darkqa_runs::shard::Shard;

/// The flags of `export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The form of the sets
    #[arg(value_name = "KIND", value_enum, add = Decides::Nothing)]
    pub kind: SetForm,
    /// A folder of frames, or a ready-made set (.parquet, .tsv, .csv, .json, .jsonl, a folder of them)
    #[arg(value_name = "DATA", value_parser = darkqa_data::parse_data_source, add = Decides::Reply)]
    pub data: DataSource,
    /// Where the sets go, one for each condition
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Options for reading a ready-made set.
    #[command(flatten)]
    pub set: SetArgs,
    /// The light of the photographs, pairs, and classes by folder.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The flags that select questions.
    #[command(flatten)]
    pub selection: SelectionArgs,
    /// The reading of images.
    #[command(flatten)]
    pub decode: DecodeArgs,
    /// The flags for the degradations.
    #[command(flatten)]
    pub light: LightArgs,
    /// The enhancers, and the images that they apply to.
    #[command(flatten)]
    pub enhancers: EnhancerArgs,
    /// The flags for running enhancers.
    #[command(flatten)]
    pub loading: EnhancerRunArgs,
    /// The part of the frames.
    #[command(flatten)]
    pub part: ShardArgs,
    /// Replace sets that exist already
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub force: bool,
}

/// Writes one set per condition.
///
/// # Errors
/// If the data cannot be read, a set exists already, or a file cannot be written.
pub(crate) fn export(args: &ExportArgs, progress: &Progress) -> Result<Outcome> {
    if args.scene.pairs.is_some() {
        let problem =
            "export takes pairs from a folder whose frames.jsonl names the photographs in the dark (\"dark\")";
        return Err(Error::usage("--pairs", problem));
    }
    let set = args.scene.set_light(&args.data, &args.set.root.data_root)?;
    let light = LightSettings::resolve(&args.light, set)?;
    let enhancement = args.enhancers.clone().for_set(set);
    check_used(&light, &enhancement)?;
    let dataset = open_data(
        &args.data,
        &args.scene,
        &args.set,
        &args.selection,
        &rules(args.selection.rules.as_deref())?,
        args.decode.rule(),
        progress,
    )?;
    for line in dataset.printed_summary() {
        progress.note(line);
    }
    let questions = select(dataset.questions().to_vec(), &args.selection)?;
    refuse_several_images(&dataset, &questions)?;
    let shard = args.part.resolve()?;
    let asked: BTreeSet<&FrameId> = questions.iter().map(|question| &question.frame).collect();
    let names = file_names(asked.iter().copied());
    let own_questions = shard_questions(&questions, asked, shard)?;
    let files = enhancers::read_models(&args.enhancers.llie)?;
    let recipe = Recipe::lossless(&light.kinds, &files);
    let recipe = recipe.with_enhanced_images(&args.enhancers.enhanced)?;
    let workers = pool(args.loading.threads.threads)?;
    let mut sources = workers.install(|| inspect_all(&dataset, &own_questions, progress))?;
    if !light.matches.is_empty() {
        workers.install(|| photographs::measure(&dataset, &mut sources))?;
    }
    if !shard.is_part() {
        // Only all frames together show whether there are photographs.
        photographs::check_matches(&sources, &light.matches)?;
    }
    let photographed = photographs::names(&sources);
    let on = enhancement.on();
    let conditions = conditions(&light, &photographed, on, &recipe.enhancer_names());
    check_enhanced(&conditions, &enhancement)?;
    warn_of_inputs(&input_summary(&sources));
    recipe.check(&sources, &conditions)?;
    let mut sets = open_sets(args, shard, &dataset, &conditions, &questions)?;
    let timings = Timings::default();
    let steps = ImageSteps {
        frames: &dataset,
        recipe: &recipe,
        limit: None,
        timings: &timings,
        png: PngForm::NEWEST,
        stored: None,
    };
    let enhancers = EnhancerModels::load(files, &args.loading)?.take()?;
    let mut pipeline = ImagePipeline::new(steps, enhancers, args.loading.probe.implausible());
    workers.install(|| pipeline.probe_sources(&sources))?;
    let frames: BTreeMap<&FrameId, &Source> = sources.iter().map(|source| (&source.name, source)).collect();
    let bar = progress.bar("images", frames.len() * conditions.len());
    workers.install(|| {
        for (frame, source) in &frames {
            let frame_questions: Vec<(usize, &Question)> =
                questions.iter().enumerate().filter(|(_, question)| question.frame == **frame).collect();
            for source_frame in &source.frames {
                let mut work = FrameWork::for_source(pipeline.steps, source, source_frame);
                for (condition, set) in conditions.iter().zip(&mut sets) {
                    if !source_frame.can_show(condition) {
                        continue;
                    }
                    let pixels = pipeline.pixels(&mut work, condition)?;
                    set.add(&names[frame], &png(&pixels)?, &frame_questions)?;
                    bar.inc();
                }
            }
        }
        Ok::<(), Error>(())
    })?;
    drop(bar);
    let mut paths = Vec::new();
    for set in sets {
        paths.extend(set.finish()?);
    }
    let mut output = format!(
        "{} about {} in {}:\n",
        counted(own_questions.len(), "question"),
        counted(sources.len(), "image"),
        counted(conditions.len(), "condition")
    );
    for path in &paths {
        let _ = writeln!(output, "{}", path.display());
    }
    Ok(Outcome { status: Status::Complete, output, written: paths })
}

/// The questions about the frames of a shard.
fn shard_questions(questions: &[Question], asked: BTreeSet<&FrameId>, shard: Shard) -> Result<Vec<Question>> {
    let mut own: Vec<&FrameId> = asked.into_iter().collect();
    keep_shard(&mut own, shard)?;
    let own: BTreeSet<&FrameId> = own.into_iter().collect();
    Ok(questions.iter().filter(|question| own.contains(&question.frame)).cloned().collect())
}

/// Refuses questions that show several images, because the sets have one image per question.
fn refuse_several_images(dataset: &Dataset, questions: &[Question]) -> Result<()> {
    match questions.iter().find(|question| !dataset.image_series(&question.frame).is_empty()) {
        None => Ok(()),
        Some(first) => Err(Error::usage(
            "--multi-image",
            format_args!(
                "the question {:?} shows {} images, and an exported set has one image per question; --multi-image skip leaves such rows \
                 out",
                first.id.0,
                dataset.image_series(&first.frame).len()
            ),
        )),
    }
}

/// Opens the set of each condition.
///
/// # Errors
/// If a set exists already, and `--force` is not set.
fn open_sets(
    args: &ExportArgs,
    shard: Shard,
    dataset: &Dataset,
    conditions: &[Condition],
    questions: &[Question],
) -> Result<Vec<ReadySet>> {
    let sets: Vec<ReadySet> = conditions
        .iter()
        .map(|condition| {
            let place = SetPlace { out: &args.out, data: dataset.name(), shard };
            ReadySet::new(args.kind, &place, condition, questions)
        })
        .collect();
    let existing = sets.iter().find(|set| set.path().exists());
    match existing.filter(|_| !args.force) {
        Some(set) => Err(Error::data(
            set.path().display(),
            "the set exists already; --force overwrites it, another --out keeps both",
        )),
        None => Ok(sets),
    }
}

/// A unique file name for each frame: its name without folders and extension, followed by a number if it is already
/// used.
fn file_names<'a>(frames: impl Iterator<Item = &'a FrameId>) -> BTreeMap<&'a FrameId, String> {
    let mut used = BTreeSet::new();
    let mut names = BTreeMap::new();
    for frame in frames {
        let name = frame.bare().replace(|letter| !is_plain(letter), "_");
        let name = name.trim_start_matches('.').to_owned();
        let mut unique = name.clone();
        let mut number = 2;
        while !used.insert(unique.to_lowercase()) {
            unique = format!("{name}-{number}");
            number += 1;
        }
        names.insert(frame, unique);
    }
    names
}

fn is_plain(letter: char) -> bool {
    letter.is_alphanumeric() || "-_.".contains(letter)
}

/// The form of a ready-made set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "lowercase")]
pub(crate) enum SetForm {
    /// A .tsv with the images in it, as VLMEvalKit reads it
    VlmEvalKit,
    /// metadata.jsonl beside the images, as Hugging Face and lmms-eval load it
    ImageFolder,
    /// questions.jsonl beside the images, as LLaVA reads it
    Llava,
}

/// The last sentence of each question for LLaVA.
const LLAVA_INSTRUCTION: &str = "Answer with the option's letter from the given choices directly.";

/// Location of the sets.
pub(super) struct SetPlace<'a> {
    /// Folder of all sets.
    out: &'a Path,
    /// Name of the data set.
    data: &'a str,
    shard: Shard,
}

impl SetPlace<'_> {
    /// The main file of the set of a condition. Its name contains the shard, if there are several.
    fn file(&self, form: SetForm, condition: &Condition) -> PathBuf {
        let part = if self.shard.is_part() { format!("-{}", self.shard.folder()) } else { String::new() };
        let folder = self.out.join(condition.to_string());
        match form {
            SetForm::VlmEvalKit => self.out.join(format!("{}_{condition}{part}.tsv", self.data)),
            SetForm::ImageFolder => folder.join(format!("metadata{part}.jsonl")),
            SetForm::Llava => folder.join(format!("questions{part}.jsonl")),
        }
    }
}

/// The set of one condition, written frame by frame, so that only one image is in memory.
pub(super) struct ReadySet {
    form: SetForm,
    path: PathBuf,
    /// Maximum number of choices of a question, which is the number of choice columns of a table.
    max_choices: usize,
    /// Writer of the unfinished file; `None` before the first row.
    writer: Option<csv::Writer<File>>,
}

impl ReadySet {
    fn new(form: SetForm, place: &SetPlace<'_>, condition: &Condition, questions: &[Question]) -> Self {
        let max_choices = questions.iter().map(|question| question.choices.len()).max();
        Self { form, path: place.file(form, condition), max_choices: max_choices.unwrap_or(0), writer: None }
    }

    /// The main file of the set.
    fn path(&self) -> &Path {
        &self.path
    }

    /// Adds an image under a name, with the questions about it.
    fn add(&mut self, name: &str, image: &[u8], questions: &[(usize, &Question)]) -> Result<()> {
        let file = format!("images/{name}.png");
        if self.form != SetForm::VlmEvalKit {
            let folder = self.path.parent().unwrap_or(Path::new(""));
            write(&folder.join(&file), image)?;
        }
        let mut first = None;
        for &(index, question) in questions {
            match self.form {
                SetForm::ImageFolder => self.write_line(&image_folder_line(&file, question))?,
                SetForm::Llava => self.write_line(&llava_line(&file, question))?,
                SetForm::VlmEvalKit => {
                    // The first row has the image, the others the index of the first row.
                    let cell = match first {
                        None => STANDARD.encode(image),
                        Some(first) => usize::to_string(&first),
                    };
                    first = first.or(Some(index));
                    let mut cells = table_row(index, cell, question);
                    cells.resize(COLUMNS.len() + self.max_choices, String::new());
                    self.write_row(cells)?;
                }
            }
        }
        Ok(())
    }

    /// Writes a line of JSON, as a row with one unquoted cell.
    fn write_line(&mut self, value: &Value) -> Result<()> {
        self.write_row(vec![value.to_string()])
    }

    /// Writes a row; creates the file with its header before the first one.
    fn write_row(&mut self, cells: Vec<String>) -> Result<()> {
        let path = unfinished_path(&self.path);
        let writer = match &mut self.writer {
            Some(writer) => writer,
            none => {
                let folder = path.parent().unwrap_or(Path::new("."));
                fs::create_dir_all(folder).map_err(|e| Error::file(folder, "make", e))?;
                let file = create_new(&path).map_err(|e| Error::file(&path, "write", e))?;
                let quotes = match self.form {
                    SetForm::VlmEvalKit => csv::QuoteStyle::Necessary,
                    SetForm::ImageFolder | SetForm::Llava => csv::QuoteStyle::Never,
                };
                let mut builder = csv::WriterBuilder::new();
                let writer = none.insert(builder.delimiter(b'\t').quote_style(quotes).from_writer(file));
                if self.form == SetForm::VlmEvalKit {
                    let letters = (0..self.max_choices).map(|i| letter(i).to_string());
                    let header = COLUMNS.iter().map(|&name| name.to_owned()).chain(letters);
                    writer.write_record(header).map_err(|e| Error::data(path.display(), e))?;
                }
                writer
            }
        };
        writer.write_record(cells).map_err(|e| Error::data(path.display(), e))
    }

    /// Renames the complete file to its final path, and returns the path; `None` if the shard has no image in this
    /// condition.
    fn finish(self) -> Result<Option<PathBuf>> {
        let unfinished = unfinished_path(&self.path);
        let Some(mut writer) = self.writer else {
            return Ok(None);
        };
        writer.flush().map_err(|e| Error::file(&unfinished, "write", e))?;
        drop(writer);
        fs::rename(&unfinished, &self.path).map_err(|e| Error::file(&self.path, "write", e))?;
        Ok(Some(self.path))
    }
}

/// Path of the file of a set until it is complete.
fn unfinished_path(path: &Path) -> PathBuf {
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".part");
    unfinished.into()
}

/// The columns of a table before the choices.
const COLUMNS: [&str; 6] = ["index", "image", "question", "answer", "category", "id"];

/// A row of VLMEvalKit's table (`vlmeval/dataset/image_mcq.py`). A short cell in the column `image` is the index of the
/// row that has the image.
fn table_row(index: usize, image: String, question: &Question) -> Vec<String> {
    [
        index.to_string(),
        image,
        question.text.clone(),
        true_letter(question),
        question.family.name().to_owned(),
        question.id.0.clone(),
    ]
    .into_iter()
    .chain(question.choices.texts().iter().cloned())
    .collect()
}

/// The letter of the true choice; empty if it is unknown.
fn true_letter(question: &Question) -> String {
    question.choices.truth().map_or_else(String::new, |truth| letter(truth).to_string())
}

/// A line of `metadata.jsonl` for an image folder.
fn image_folder_line(file: &str, question: &Question) -> Value {
    json!({
        "file_name": file,
        "id": question.id,
        "question": question.text,
        "options": question.choices.texts(),
        "answer": true_letter(question),
        "category": question.family,
    })
}

/// A line of a question file for LLaVA (`llava/eval/model_vqa_loader.py`), with the letter of the true choice.
fn llava_line(file: &str, question: &Question) -> Value {
    json!({
        "question_id": question.id,
        "image": file,
        "text": format!("{}\n{}\n{LLAVA_INSTRUCTION}", question.text, lettered(&question.choices)),
        "answer": true_letter(question),
        "category": question.family,
    })
}

/// The choices, one line each with its letter.
fn lettered(choices: &Choices) -> String {
    choices.texts().iter().enumerate().map(|(i, text)| format!("{}. {text}", letter(i))).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_frames_share_a_file() {
        let frames = ["a/b.png", "a_b", "A_B.jpg", "../c d.png", "2"].map(|name| FrameId(name.into()));
        let names: Vec<String> = file_names(frames.iter()).into_values().collect();
        assert_eq!(names, ["_c_d", "2", "A_B-3", "a_b", "a_b-2"]);
    }
}
