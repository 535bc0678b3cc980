//! `init`: a folder of data that a run takes as it is, to put one's own images and questions in.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use crate::dataset::{DataPlace, Dataset, SceneArgs, SelectionArgs, SetArgs};
use crate::error::{Error, Result};
use crate::files::{reading, write};
use crate::images::progress::Progress;
use crate::images::trials::questions::open_data;
use crate::picture::ReadingRule;
use crate::picture::png;
use crate::runs::Outcome;
use crate::text::words::counted;
use crate::types::manifests::Status;
use crate::types::questions::letter;
use crate::types::{Choices, Decides, FrameId, Question, shell_word};
use darkqa_questions::rules::Rules;

/// The flags of `init`.
#[derive(Debug, Args)]
pub(crate) struct InitArgs {
    /// The folder to make
    #[arg(value_name = "DIR", add = Decides::Nothing)]
    pub folder: PathBuf,
    /// Copy the first three images of this folder, and write lines about them; default: pictures of built-in rooms
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub frames: Option<PathBuf>,
}

/// The rooms whose pictures are written.
const ROOMS: &str = "frames=3,seed=20,size=480x360";
/// The number of questions about each picture, and of images of a folder that are copied.
const EACH: usize = 2;
const PICTURES: usize = 3;
/// The files of the pictures of rooms.
const ROOM_FILES: [&str; PICTURES] = ["room1.png", "room2.png", "room3.png"];
/// The number of columns of choices.
const COLUMNS: usize = 4;

/// Why a file is not written.
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

/// Writes the folder. Nothing is overwritten.
///
/// # Errors
/// If a file exists already, or cannot be read or written.
pub(crate) fn init(args: &InitArgs, progress: &Progress) -> Result<Outcome> {
    let at = |name: &str| args.folder.join(name);
    let mut files = vec!["README.txt", "questions.csv", "dataset.json"];
    if args.frames.is_none() {
        files.extend(ROOM_FILES);
    }
    if let Some(exists) = files.iter().map(|name| at(name)).find(|path| path.exists()) {
        return Err(Error::data(exists.display(), EXISTS));
    }
    let lines = match &args.frames {
        Some(frames) => frame_lines(frames, &args.folder)?,
        None => room_lines(&args.folder, progress)?,
    };
    let mut table = csv::Writer::from_writer(Vec::new());
    let wrong = |e: csv::Error| Error::data("questions.csv", e);
    let header = [
        "image", "question", "A", "B", "C", "D", "answer", "category",
    ];
    table.write_record(header).map_err(wrong)?;
    for line in &lines {
        table.write_record(line).map_err(wrong)?;
    }
    let table = table
        .into_inner()
        .map_err(|e| Error::data("questions.csv", e))?;
    write(&at("questions.csv"), &table)?;
    let name = args
        .folder
        .file_name()
        .unwrap_or_default()
        .to_string_lossy();
    let info = json!({"schema": "darkqa.dataset/1", "name": name});
    write(&at("dataset.json"), format!("{info:#}\n").as_bytes())?;
    write(&at("README.txt"), README.as_bytes())?;
    let folder = args.folder.display().to_string();
    let data = shell_word(&folder);
    Ok(Outcome::wrote(
        &args.folder,
        Status::Complete,
        format!(
            "{}: {}\n\nnext:\n  darkqa-eval check {data}\n  darkqa-eval --data {data} --model gpt-4o --dry-run\n  darkqa-eval --data {data} --model gpt-4o\n",
            folder,
            counted(lines.len(), "question")
        ),
    ))
}

/// A line of the table.
type Line = Vec<String>;

fn line(image: &str, question: &str, choices: &[String], truth: usize, category: &str) -> Line {
    let mut line = vec![image.to_owned(), question.to_owned()];
    line.extend(choices.iter().cloned());
    line.resize(2 + COLUMNS, String::new());
    line.extend([letter(truth).to_string(), category.to_owned()]);
    line
}

/// Writes pictures of built-in rooms, and returns lines about them: what the rules ask, with true answers.
fn room_lines(folder: &Path, progress: &Progress) -> Result<Vec<Line>> {
    let rooms = ROOMS.parse().map_err(|e: String| Error::data("rooms", e))?;
    let (place, rules) = (DataPlace::Rooms(rooms), Rules::built_in()?);
    let (set, selection) = (SetArgs::default(), SelectionArgs::default());
    let dataset = open_data(
        (&place, &SceneArgs::default(), &set),
        &selection,
        &rules,
        ReadingRule::default(),
        progress,
    )?;
    let mut lines = Vec::new();
    for (number, (frame, name)) in dataset.frames().zip(ROOM_FILES).enumerate() {
        write(
            &folder.join(name),
            &png(&dataset.picture(frame)?.decode()?)?,
        )?;
        let of_frame = dataset
            .questions()
            .iter()
            .filter(|question| question.frame == *frame);
        let mut families: BTreeMap<&str, &Question> = BTreeMap::new();
        for question in of_frame.filter(|question| question.choices.len() <= COLUMNS) {
            families.entry(question.family.name()).or_insert(question);
        }
        let families: Vec<&Question> = families.into_values().collect();
        let start = number.min(families.len().saturating_sub(EACH));
        lines.extend(families[start..].iter().take(EACH).map(|question| {
            let choices: &Choices = &question.choices;
            let family = question.family.name();
            line(
                name,
                &question.text,
                choices.texts(),
                choices.truth().unwrap_or_default(),
                family,
            )
        }));
    }
    Ok(lines)
}

/// Copies images of a folder, and returns lines about them that are true of any image: whether it has colours, and its form.
fn frame_lines(frames: &Path, folder: &Path) -> Result<Vec<Line>> {
    let dataset = Dataset::from_images(frames, &[])?;
    let copied: Vec<(&FrameId, &Path, PathBuf)> = dataset
        .frames()
        .take(PICTURES)
        .map(|frame| {
            let path = dataset.image_file(frame).unwrap_or(frames);
            let name = path.file_name().unwrap_or_default();
            (frame, path, folder.join(name))
        })
        .collect();
    // The folder may be that of the images.
    let is_itself = |path: &Path, copy: &Path| path.canonicalize().ok() == copy.canonicalize().ok();
    let mut others = copied
        .iter()
        .filter(|(_, path, copy)| copy.exists() && !is_itself(path, copy));
    if let Some((_, _, copy)) = others.next() {
        return Err(Error::data(copy.display(), EXISTS));
    }
    let (mut lines, yes_no) = (Vec::new(), ["yes".to_owned(), "no".to_owned()]);
    for (number, (frame, path, copy)) in copied.into_iter().enumerate() {
        let image = copy.file_name().unwrap_or_default().to_string_lossy();
        let picture = dataset.picture(frame)?.decode()?;
        if !copy.exists() {
            write(&copy, &reading::bytes(path)?)?;
        }
        let mut pixels = picture.samples().chunks_exact(3);
        let has_colours = pixels
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
        // By turns, so that neither answer is always the true one.
        for (question, is_true) in [form[number % 2], colours[number % 2]] {
            let truth = usize::from(!is_true);
            lines.push(line(&image, question, &yes_no, truth, "form"));
        }
    }
    Ok(lines)
}
