//! `init`: creates a runnable example data set, to be filled with the user's own images and questions; with `--ci`, a
//! workflow that compares a model with an earlier run.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, write};
use darkqa_base::types::manifests::Status;
use darkqa_base::types::questions::letter;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Decides, FrameId, Question, shell_word};
use darkqa_data::{DataSource, SceneArgs, SelectionArgs, SetArgs, open_images};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::trials::open_data;
use darkqa_pictures::{DecodeRule, png};
use darkqa_questions::rules::Rules;
use darkqa_runs::Outcome;

/// The flags of `init`.
#[derive(Debug, Args)]
pub(crate) struct InitArgs {
    /// The folder to make
    #[arg(value_name = "DIR", required_unless_present = "ci", add = Decides::Nothing)]
    pub folder: Option<PathBuf>,
    /// Copy the first three images of this folder, and write lines about them; default: pictures of built-in rooms
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub frames: Option<PathBuf>,
    /// Write only a workflow into DIR, or here, that fails if a model sees less in the dark than in an earlier run;
    /// default: none
    #[arg(long, value_name = "SERVICE", value_enum, conflicts_with = "frames", add = Decides::Nothing)]
    pub ci: Option<CiService>,
}

/// A service that runs workflows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CiService {
    /// GitHub Actions.
    Github,
}

/// The workflow for GitHub Actions, and its place in a repository.
const GITHUB: (&str, &str) = (include_str!("github.yml"), ".github/workflows/darkqa.yml");

/// The built-in rooms whose images are written.
const ROOMS: &str = "frames=3,seed=20,size=480x360";

/// Number of questions about each image.
const QUESTIONS_PER_IMAGE: usize = 2;

/// Number of images.
const IMAGES: usize = 3;

/// File names of the images of rooms.
const ROOM_FILES: [&str; IMAGES] = ["room1.png", "room2.png", "room3.png"];

/// Number of choice columns.
const CHOICE_COLUMNS: usize = 4;

/// The error about an existing file.
const EXISTS: &str = "exists already; init overwrites nothing: name another folder";

const README: &str = "\
This folder is a data set of darkqa-eval: images, and questions about them.

questions.csv   one question per line; a spreadsheet can edit it
  image         the image, as a path from this folder
  question      the text, without the choices
  A B C D       the choices; leave cells empty for fewer than four, add E, F, ... for more
  answer        the letter of the true choice
  category      the kind of question, by which the report groups
images          PNG, JPEG, WebP, TIFF, BMP or OpenEXR, in this folder or those below;
                --data-root DIR allows a folder outside of this one
dataset.json    the name of the data set

Replace the images and the lines with your own, then run the check again.
";

/// Creates the folder. Nothing is overwritten.
///
/// # Errors
/// If a file exists already, or cannot be read or written.
pub(crate) fn init(args: &InitArgs, progress: &Progress) -> Result<Outcome> {
    let folder = args.folder.as_deref().unwrap_or(Path::new("."));
    if let Some(CiService::Github) = args.ci {
        return workflow(folder);
    }
    let mut files = vec!["README.txt", "questions.csv", "dataset.json"];
    if args.frames.is_none() {
        files.extend(ROOM_FILES);
    }
    if let Some(exists) = files.iter().map(|name| folder.join(name)).find(|path| path.exists()) {
        return Err(Error::data(exists.display(), EXISTS));
    }
    let rows = match &args.frames {
        Some(frames) => image_rows(frames, folder)?,
        None => room_rows(folder, progress)?,
    };
    let mut table = csv::Writer::from_writer(Vec::new());
    let header = ["image", "question", "A", "B", "C", "D", "answer", "category"];
    table.write_record(header).map_err(|e| Error::data("questions.csv", e))?;
    for row in &rows {
        table.write_record(row).map_err(|e| Error::data("questions.csv", e))?;
    }
    let table = table.into_inner().map_err(|e| Error::data("questions.csv", e))?;
    write(&folder.join("questions.csv"), &table)?;
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let info = json!({"schema": "darkqa.dataset/1", "name": name});
    write(&folder.join("dataset.json"), format!("{info:#}\n").as_bytes())?;
    write(&folder.join("README.txt"), README.as_bytes())?;
    let place = folder.display().to_string();
    let data = shell_word(&place);
    Ok(Outcome::wrote(
        folder,
        Status::Complete,
        format!(
            "{}: {}\n\nnext:\n  darkqa-eval check {data}\n  darkqa-eval --data {data} --model gpt-4o --dry-run\n  darkqa-eval --data {data} --model gpt-4o\n",
            place,
            counted(rows.len(), "question")
        ),
    ))
}

/// Writes the workflow into a repository.
fn workflow(repository: &Path) -> Result<Outcome> {
    let (text, place) = GITHUB;
    let file = repository.join(place);
    if file.exists() {
        return Err(Error::data(file.display(), EXISTS));
    }
    write(&file, text.as_bytes())?;
    Ok(Outcome::wrote(
        &file,
        Status::Complete,
        format!(
            "{}\n\nnext, then commit data and baseline:\n  darkqa-eval init data\n  darkqa-eval --data data --model gpt-4o --out baseline\n",
            file.display()
        ),
    ))
}

/// A row of the question table.
type QuestionRow = Vec<String>;

fn row(image: &str, question: &str, choices: &[String], truth: usize, category: &str) -> QuestionRow {
    let mut row = vec![image.to_owned(), question.to_owned()];
    row.extend(choices.iter().cloned());
    row.resize(2 + CHOICE_COLUMNS, String::new());
    row.extend([letter(truth).to_string(), category.to_owned()]);
    row
}

/// Writes images of built-in rooms, and returns rows with questions by rule about them.
fn room_rows(folder: &Path, progress: &Progress) -> Result<Vec<QuestionRow>> {
    let rooms = ROOMS.parse().map_err(|e: String| Error::data("rooms", e))?;
    let (place, rules) = (DataSource::Rooms(rooms), Rules::built_in()?);
    let (set, selection) = (SetArgs::default(), SelectionArgs::default());
    let dataset = open_data(&place, &SceneArgs::default(), &set, &selection, &rules, DecodeRule::default(), progress)?;
    let mut rows = Vec::new();
    for (number, (frame, name)) in dataset.frames().zip(ROOM_FILES).enumerate() {
        write(&folder.join(name), &png(&dataset.picture(frame)?.decode()?)?)?;
        let mut by_family: BTreeMap<&str, &Question> = BTreeMap::new();
        for question in dataset
            .questions()
            .iter()
            .filter(|question| question.frame == *frame && question.choices.len() <= CHOICE_COLUMNS)
        {
            by_family.entry(question.family.name()).or_insert(question);
        }
        let questions: Vec<&Question> = by_family.into_values().collect();
        let start = number.min(questions.len().saturating_sub(QUESTIONS_PER_IMAGE));
        rows.extend(questions[start..].iter().take(QUESTIONS_PER_IMAGE).map(|question| {
            row(
                name,
                &question.text,
                question.choices.texts(),
                question.choices.truth().unwrap_or_default(),
                question.family.name(),
            )
        }));
    }
    Ok(rows)
}

/// Copies images of a folder, and returns rows with questions about their colours and shape, which can be asked about
/// any image.
fn image_rows(frames: &Path, folder: &Path) -> Result<Vec<QuestionRow>> {
    let dataset = open_images(frames, &[])?;
    let copies: Vec<(&FrameId, &Path, PathBuf)> = dataset
        .frames()
        .take(IMAGES)
        .map(|frame| {
            let path = dataset.image_file(frame).unwrap_or(frames);
            let name = path.file_name().unwrap_or_default();
            (frame, path, folder.join(name))
        })
        .collect();
    // The images may already be in the folder.
    if let Some((_, _, copy)) =
        copies.iter().find(|(_, path, copy)| copy.exists() && path.canonicalize().ok() != copy.canonicalize().ok())
    {
        return Err(Error::data(copy.display(), EXISTS));
    }
    let (mut rows, yes_no) = (Vec::new(), ["yes".to_owned(), "no".to_owned()]);
    for (number, (frame, path, copy)) in copies.into_iter().enumerate() {
        let image = copy.file_name().unwrap_or_default().to_string_lossy();
        let picture = dataset.picture(frame)?.decode()?;
        if !copy.exists() {
            write(&copy, &files::bytes(path)?)?;
        }
        let has_colours = picture
            .samples()
            .chunks_exact(3)
            .any(|p| p.iter().max() > p.iter().min().map(|least| least.saturating_add(8)).as_ref());
        let (width, height) = (picture.width(), picture.height());
        let form = [
            ("Is this photograph wider than it is high?", width > height),
            ("Is this photograph higher than it is wide?", height > width),
        ];
        let colours = [
            ("Is this photograph black and white?", !has_colours),
            ("Does this photograph have colours?", has_colours),
        ];
        // Alternate the questions, so that neither answer is always the true one.
        for (question, is_true) in [form[number % 2], colours[number % 2]] {
            let truth = usize::from(!is_true);
            rows.push(row(&image, question, &yes_no, truth, "form"));
        }
    }
    Ok(rows)
}
