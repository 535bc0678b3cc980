//! Ready-made image multiple-choice sets.
//!
//! `.tsv` as VLMEvalKit writes it (`vlmeval/dataset/image_mcq.py`): tab-separated with a header; `index`, `question`,
//! an optional `hint`, the choices in the columns `A`, `B`, … (an empty cell is no choice), `answer` (a letter),
//! `category`, and either `image_path` or `image`, which holds the file in base64 or the index of the row that does.
//! `.jsonl` as [`questions`] describes, with `image`. Paths are relative to the file.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use csv::{ByteRecord, Position, Reader, ReaderBuilder, StringRecord};

use super::{Dataset, Picture, Source, questions, stem};
use crate::error::{Error, Result};
use crate::types::question::letter;
use crate::types::{Choices, Family, FrameId, Question, QuestionId};

/// A longer cell of the column `image` is a file, a shorter one the index of another row (as in VLMEvalKit).
const LONGEST_INDEX: usize = 64;

pub(super) fn open(path: &Path) -> Result<Dataset> {
    if !path.is_file() {
        return Err(Error::usage(
            "--data",
            format_args!("{}: no such file or folder", path.display()),
        ));
    }
    let (sources, questions) = match path.extension().and_then(|ending| ending.to_str()) {
        Some("tsv") => tsv(path)?,
        Some("jsonl") => jsonl(path)?,
        _ => {
            let problem = format_args!(
                "{}: a folder of frames, a .tsv or a .jsonl file expected",
                path.display()
            );
            return Err(Error::usage("--data", problem));
        }
    };
    Ok(Dataset {
        name: stem(path),
        sources,
        questions,
    })
}

type Parts = (BTreeMap<FrameId, Source>, Vec<Question>);

fn jsonl(path: &Path) -> Result<Parts> {
    let questions = questions::read(path)?;
    let beside = path.parent().unwrap_or(Path::new("."));
    let mut sources = BTreeMap::new();
    for question in &questions {
        let file = existing(beside, &question.frame.0).map_err(|problem| {
            Error::data(
                path.display(),
                format_args!("question {:?}: {problem}", question.id.0),
            )
        })?;
        sources.insert(question.frame.clone(), Source::image(file));
    }
    Ok((sources, questions))
}

fn existing(beside: &Path, image: &str) -> Result<PathBuf, String> {
    let file = beside.join(image);
    if file.is_file() {
        Ok(file)
    } else {
        Err(format!("no such image: {}", file.display()))
    }
}

/// The columns of a table by what they hold.
struct Columns {
    index: usize,
    question: usize,
    answer: usize,
    image: ImageColumn,
    hint: Option<usize>,
    category: Option<usize>,
    choices: Vec<(char, usize)>,
}

enum ImageColumn {
    Path(usize),
    Base64(usize),
}

impl Columns {
    fn of(header: &StringRecord) -> Result<Self, String> {
        let find = |name: &str| header.iter().position(|column| column.trim() == name);
        let need = |name: &str| find(name).ok_or_else(|| format!("the column {name:?} is missing"));
        let image = match (find("image_path"), find("image")) {
            (Some(column), _) => ImageColumn::Path(column),
            (None, Some(column)) => ImageColumn::Base64(column),
            (None, None) => return Err("neither a column \"image_path\" nor \"image\"".to_owned()),
        };
        let choices =
            (0..Choices::MOST).filter_map(|i| Some((letter(i), find(&letter(i).to_string())?)));
        Ok(Self {
            index: need("index")?,
            question: need("question")?,
            answer: need("answer")?,
            image,
            hint: find("hint"),
            category: find("category"),
            choices: choices.collect(),
        })
    }

    fn question(&self, row: &StringRecord, frame: FrameId) -> Result<Question> {
        let cell = |column: usize| row.get(column).unwrap_or_default();
        let id = cell(self.index).trim().to_owned();
        let answer = cell(self.answer).trim();
        let shown: Vec<(char, &str)> = self
            .choices
            .iter()
            .map(|&(letter, column)| (letter, cell(column)))
            .filter(|(_, text)| !text.trim().is_empty())
            .collect();
        let truth = shown
            .iter()
            .position(|(letter, _)| answer == letter.to_string())
            .ok_or_else(|| {
                Error::data(
                    "answer",
                    format_args!(
                        "question {id:?}: the answer {answer:?} is none of its choices' letters"
                    ),
                )
            })?;
        let choices = Choices::new(
            shown.iter().map(|(_, text)| (*text).to_owned()).collect(),
            truth,
        )?;
        let hint = self.hint.map(cell).filter(|hint| !hint.trim().is_empty());
        let text = hint.map_or_else(
            || cell(self.question).to_owned(),
            |hint| format!("{hint}\n{}", cell(self.question)),
        );
        let family = self
            .category
            .map(cell)
            .filter(|name| !name.trim().is_empty())
            .map_or_else(questions::other, Family::from);
        Ok(Question {
            id: QuestionId(id),
            frame,
            family,
            text,
            choices,
            evidence: serde_json::Value::Null,
        })
    }
}

fn reader(path: &Path) -> Result<Reader<File>> {
    let file = File::open(path).map_err(|e| Error::file(path, "read", e))?;
    Ok(ReaderBuilder::new()
        .delimiter(b'\t')
        .flexible(true)
        .from_reader(file))
}

fn tsv(path: &Path) -> Result<Parts> {
    let mut reader = reader(path)?;
    let header = reader
        .headers()
        .map_err(|e| Error::data(path.display(), e))?;
    let columns = Columns::of(header).map_err(|problem| {
        Error::data(
            path.display(),
            format_args!("not a VLMEvalKit table: {problem}"),
        )
    })?;
    let beside = path.parent().unwrap_or(Path::new("."));
    let (mut sources, mut questions) = (BTreeMap::new(), Vec::new());
    let mut row = StringRecord::new();
    while reader
        .read_record(&mut row)
        .map_err(|e| Error::data(path.display(), e))?
    {
        let position = row.position().cloned().unwrap_or_else(Position::new);
        let line = |problem: String| Error::line(path, position.line() as usize, problem);
        let frame = match columns.image {
            ImageColumn::Path(column) => {
                let image = row.get(column).unwrap_or_default();
                let frame = FrameId(image.to_owned());
                if !sources.contains_key(&frame) {
                    sources.insert(
                        frame.clone(),
                        Source::image(existing(beside, image).map_err(line)?),
                    );
                }
                frame
            }
            ImageColumn::Base64(column) => match row.get(column).unwrap_or_default().trim() {
                "" => return Err(line("the column \"image\" is empty".to_owned())),
                index if index.len() <= LONGEST_INDEX => FrameId(index.to_owned()),
                _ => {
                    let frame =
                        FrameId(row.get(columns.index).unwrap_or_default().trim().to_owned());
                    let cell = Cell {
                        file: path.to_owned(),
                        position: position.clone(),
                        column,
                    };
                    sources.insert(frame.clone(), Source::Cell(cell));
                    frame
                }
            },
        };
        let place = format!("{}, line {}", path.display(), position.line());
        questions.push(columns.question(&row, frame).map_err(|e| e.at(place))?);
    }
    if let Some(stray) = questions
        .iter()
        .find(|question| !sources.contains_key(&question.frame))
    {
        let problem = format_args!(
            "question {:?} shares the image of row {:?}, which holds none",
            stray.id.0, stray.frame.0
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok((sources, questions))
}

/// The place of an image in a table: read when it is needed, so that a table of gigabytes is never held.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    file: PathBuf,
    position: Position,
    column: usize,
}

impl Cell {
    pub(super) fn picture(&self) -> Result<Picture> {
        let place = format!("{}, line {}", self.file.display(), self.position.line());
        let mut reader = reader(&self.file)?;
        let mut row = ByteRecord::new();
        reader
            .seek(self.position.clone())
            .map_err(|e| Error::data(&place, e))?;
        reader
            .read_byte_record(&mut row)
            .map_err(|e| Error::data(&place, e))?;
        let mut text = row
            .get(self.column)
            .unwrap_or_default()
            .trim_ascii()
            .to_vec();
        if let Some(comma) = text
            .starts_with(b"data:")
            .then(|| text.iter().position(|&b| b == b','))
            .flatten()
        {
            text.drain(..=comma);
        }
        let bytes = STANDARD
            .decode(&text)
            .map_err(|e| Error::data(&place, format_args!("the image is not base64: {e}")))?;
        Ok(Picture::Encoded { bytes, place })
    }
}
