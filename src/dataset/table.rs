//! Tables of questions about images: `.tsv` as VLMEvalKit writes it (`vlmeval/dataset/image_mcq.py`).
//!
//! Tab-separated with a header: `index`, `question`, an optional `hint`, the choices in the columns `A`, `B`, … (an empty
//! cell is not a choice), `answer` (a letter), `category`, and `image_path` or `image`. A cell of `image` holds the file
//! in base64, or the index of the row that does.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use csv::{ByteRecord, Position, Reader, ReaderBuilder, StringRecord};

use super::sibling_files::SiblingFiles;
use super::{ImageFile, ImageSource, ReadingRule, questions};
use crate::error::{Error, Result};
use crate::types::question::letter;
use crate::types::{Choices, Family, FrameId, Question, QuestionId};

/// The maximum length of an index in the column `image`. A longer cell is a file in base64 (as in VLMEvalKit).
const LONGEST_INDEX: usize = 64;

/// The positions of the columns of a table.
struct TableColumns {
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

impl TableColumns {
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
        let id = filled(row, self.index, "index")?.to_owned();
        filled(row, self.question, "question")?;
        let answer = cell(self.answer).trim();
        let filled_choices: Vec<(char, &str)> = self
            .choices
            .iter()
            .map(|&(letter, column)| (letter, cell(column)))
            .filter(|(_, text)| !text.trim().is_empty())
            .collect();
        let truth = filled_choices
            .iter()
            .position(|(letter, _)| answer == letter.to_string())
            .ok_or_else(|| {
                Error::data(
                    "answer",
                    format_args!(
                        "question {id:?}: the answer {answer:?} is not the letter of one of its choices"
                    ),
                )
            })?;
        let choices = Choices::new(
            filled_choices
                .iter()
                .map(|(_, text)| (*text).to_owned())
                .collect(),
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
        let family = questions::checked(family)?;
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

/// The text of a cell without the space around it. An empty cell is an error.
fn filled<'a>(row: &'a StringRecord, column: usize, name: &str) -> Result<&'a str> {
    match row.get(column).unwrap_or_default().trim() {
        "" => Err(Error::data(
            name,
            format_args!("the column {name:?} is empty"),
        )),
        text => Ok(text),
    }
}

fn reader(path: &Path) -> Result<Reader<File>> {
    let file = File::open(path).map_err(|e| Error::file(path, "read", e))?;
    Ok(ReaderBuilder::new()
        .delimiter(b'\t')
        .flexible(true)
        .from_reader(file))
}

/// The images and the questions of a table.
pub(super) fn read(path: &Path) -> Result<(BTreeMap<FrameId, ImageSource>, Vec<Question>)> {
    let mut reader = reader(path)?;
    let header = reader
        .headers()
        .map_err(|e| Error::data(path.display(), e))?;
    let columns = TableColumns::of(header).map_err(|problem| {
        Error::data(
            path.display(),
            format_args!("not a VLMEvalKit table: {problem}"),
        )
    })?;
    let siblings = SiblingFiles::of(path);
    let (mut sources, mut questions) = (BTreeMap::new(), Vec::new());
    let mut row = StringRecord::new();
    while reader
        .read_record(&mut row)
        .map_err(|e| Error::data(path.display(), e))?
    {
        let position = row.position().cloned().unwrap_or_else(Position::new);
        let place = format!("{}, line {}", path.display(), position.line());
        let at = |e: Error| e.at(&place);
        let frame = match columns.image {
            ImageColumn::Path(column) => {
                let image = filled(&row, column, "image_path").map_err(at)?;
                let (frame, file) = siblings
                    .image(image)
                    .map_err(|problem| Error::data(&place, problem))?;
                sources.insert(frame.clone(), ImageSource::image(file));
                frame
            }
            ImageColumn::Base64(column) => match filled(&row, column, "image").map_err(at)? {
                index if index.len() <= LONGEST_INDEX => FrameId(index.to_owned()),
                _ => {
                    let index = filled(&row, columns.index, "index").map_err(at)?;
                    let frame = FrameId(index.to_owned());
                    let cell = ImageCell {
                        file: path.to_owned(),
                        position: position.clone(),
                        column,
                    };
                    sources.insert(frame.clone(), ImageSource::Cell(cell));
                    frame
                }
            },
        };
        questions.push(columns.question(&row, frame).map_err(at)?);
    }
    if let Some(unmatched) = questions
        .iter()
        .find(|question| !sources.contains_key(&question.frame))
    {
        let problem = format_args!(
            "question {:?} uses the image of row {:?}, which has no image",
            unmatched.id.0, unmatched.frame.0
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok((sources, questions))
}

/// The place of an image in a table. It is read when needed, so that a table of gigabytes is never in memory.
#[derive(Debug, Clone)]
pub(crate) struct ImageCell {
    file: PathBuf,
    position: Position,
    column: usize,
}

impl ImageCell {
    pub(super) fn image(&self, rule: ReadingRule) -> Result<ImageFile> {
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
        Ok(ImageFile::new(bytes, place, rule))
    }
}
