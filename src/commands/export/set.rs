//! Writer of one ready-made set: [`ReadySet`].

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use clap::ValueEnum;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::files::{create_new, write};
use crate::runs::shard::Shard;
use crate::types::questions::letter;
use crate::types::{Choices, Condition, Question};

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
    pub(super) out: &'a Path,
    /// Name of the data set.
    pub(super) data: &'a str,
    pub(super) shard: Shard,
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
    pub(super) fn new(form: SetForm, place: &SetPlace<'_>, condition: &Condition, questions: &[Question]) -> Self {
        let max_choices = questions.iter().map(|question| question.choices.len()).max();
        Self { form, path: place.file(form, condition), max_choices: max_choices.unwrap_or(0), writer: None }
    }

    /// The main file of the set.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Adds an image under a name, with the questions about it.
    pub(super) fn add(&mut self, name: &str, image: &[u8], questions: &[(usize, &Question)]) -> Result<()> {
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
    pub(super) fn finish(self) -> Result<Option<PathBuf>> {
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
