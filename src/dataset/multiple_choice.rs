//! Ready-made image multiple-choice sets.
//!
//! `.tsv` as VLMEvalKit writes it (`vlmeval/dataset/image_mcq.py`): tab-separated with a header; `index`, `question`,
//! an optional `hint`, the choices in the columns `A`, `B`, … (an empty cell is no choice), `answer` (a letter),
//! `category`, and either `image_path` or `image`, which holds the file in base64 or the index of the row that does.
//! `.jsonl` as [`questions`] describes, with `image`. Paths are relative to the file.
//! A frame is named by the path of its image, spelled in one way (`beside.rs`).

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use csv::{ByteRecord, Position, Reader, ReaderBuilder, StringRecord};

use super::beside::Beside;
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
    let mut questions = questions::read(path)?;
    let beside = Beside::of(path);
    let mut sources = BTreeMap::new();
    for question in &mut questions {
        let (frame, file) = beside.image(&question.frame.0).map_err(|problem| {
            Error::data(
                path.display(),
                format_args!("question {:?}: {problem}", question.id.0),
            )
        })?;
        question.frame = frame.clone();
        sources.insert(frame, Source::image(file));
    }
    Ok((sources, questions))
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
        let id = filled(row, self.index, "index")?.to_owned();
        filled(row, self.question, "question")?;
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

/// A cell without the space around it, which must not be empty.
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
    let beside = Beside::of(path);
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
                let (frame, file) = beside
                    .image(image)
                    .map_err(|problem| Error::data(&place, problem))?;
                sources.insert(frame.clone(), Source::image(file));
                frame
            }
            ImageColumn::Base64(column) => match filled(&row, column, "image").map_err(at)? {
                index if index.len() <= LONGEST_INDEX => FrameId(index.to_owned()),
                _ => {
                    let index = filled(&row, columns.index, "index").map_err(at)?;
                    let frame = FrameId(index.to_owned());
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
        questions.push(columns.question(&row, frame).map_err(at)?);
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

#[cfg(test)]
mod tests {
    use std::fs;

    use image::RgbImage;

    use super::*;

    /// A set of this name and text, with two images in a folder beside it and one outside.
    struct Scene(tempfile::TempDir);

    impl Scene {
        fn new(name: &str, text: &str) -> Self {
            let folder = tempfile::tempdir().unwrap();
            let scene = Self(folder);
            fs::create_dir_all(scene.path("set/fr")).unwrap();
            for (file, sample) in [("set/fr/a.png", 1), ("set/fr/b.png", 2), ("out.png", 3)] {
                let image = RgbImage::from_pixel(2, 1, image::Rgb([sample; 3]));
                image.save(scene.path(file)).unwrap();
            }
            fs::write(scene.path("set").join(name), text).unwrap();
            scene
        }

        fn path(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn open(&self, name: &str) -> Result<Dataset> {
            open(&self.path("set").join(name))
        }
    }

    fn frames(set: &Dataset) -> Vec<&str> {
        let questions = set.questions().iter();
        questions
            .map(|question| question.frame.0.as_str())
            .collect()
    }

    #[test]
    fn one_file_is_one_frame_however_it_is_spelled() {
        let outside = Scene::new("x", "");
        let absolute = outside.path("out.png").display().to_string();
        let spellings = [
            "fr/a.png",
            "./fr/a.png",
            "fr//./a.png",
            "fr/../fr/a.png",
            "../set/fr/a.png",
            "HERE/fr/a.png",
            "HERE/../set/fr/a.png",
            "fr/b.png",
            "../out.png",
            "fr/../../out.png",
            &absolute,
        ];
        let expected = [
            &["fr/a.png"; 7][..],
            &["fr/b.png", "../out.png", "../out.png", &absolute],
        ]
        .concat();
        let scene = Scene::new("x", "");
        let here = scene.path("set").display().to_string();
        let spellings = spellings.map(|image| image.replace("HERE", &here));
        let lines: Vec<String> = (0..)
            .zip(&spellings)
            .map(|(i, image)| {
                serde_json::json!({"id": i, "image": image, "question": "?", "choices": ["x", "y"], "answer": "x"}).to_string()
            })
            .collect();
        let rows: Vec<String> = (0..)
            .zip(&spellings)
            .map(|(i, image)| format!("{i}\t{image}\t?\tx\ty\tA"))
            .collect();
        let header = "index\timage_path\tquestion\tA\tB\tanswer\n";
        for (name, text) in [
            ("a.jsonl", lines.join("\n")),
            ("a.tsv", format!("{header}{}", rows.join("\n"))),
        ] {
            fs::write(scene.path("set").join(name), text).unwrap();
            let set = scene.open(name).unwrap();
            assert_eq!(frames(&set), expected, "{name}");
            for (frame, sample) in [("fr/a.png", 1), ("../out.png", 3)] {
                let image = set.picture(&FrameId(frame.into())).unwrap();
                assert_eq!(image.decode().unwrap().samples()[0], sample);
            }
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed_before_its_parent_is_taken() {
        let scene = Scene::new("a.tsv", "");
        fs::create_dir_all(scene.path("far/deep")).unwrap();
        let image = RgbImage::from_pixel(2, 1, image::Rgb([9; 3]));
        fs::create_dir_all(scene.path("far/fr")).unwrap();
        image.save(scene.path("far/fr/a.png")).unwrap();
        std::os::unix::fs::symlink(scene.path("far/deep"), scene.path("set/link")).unwrap();
        let table = "index\timage_path\tquestion\tA\tB\tanswer\n1\tlink/../fr/a.png\t?\tx\ty\tA\n2\tfr/a.png\t?\tx\ty\tA\n";
        fs::write(scene.path("set/a.tsv"), table).unwrap();
        let set = scene.open("a.tsv").unwrap();
        assert_eq!(frames(&set), ["link/../fr/a.png", "fr/a.png"]);
        let sample = |i: usize| {
            let picture = set.picture(&set.questions()[i].frame).unwrap();
            picture.decode().unwrap().samples()[0]
        };
        assert_eq!((sample(0), sample(1)), (9, 1));
    }

    #[test]
    fn rows_that_cannot_be_asked_are_named() {
        let header =
            "index\timage_path\tquestion\tA\tB\tanswer\tcategory\n1\tfr/a.png\t?\tx\ty\tA\tc\n";
        for (row, says) in [
            (
                " \tfr/a.png\t?\tx\ty\tA\tc",
                "the column \"index\" is empty",
            ),
            ("2\t \t?\tx\ty\tA\tc", "the column \"image_path\" is empty"),
            ("2", "the column \"image_path\" is empty"),
            (
                "2\tfr/a.png\t \tx\ty\tA\tc",
                "the column \"question\" is empty",
            ),
            ("2\tfr/c.png\t?\tx\ty\tA\tc", "no such image: "),
            ("2\tfr/a.png\t?\tx\ty\tC\tc", "the answer \"C\""),
            (
                "2\tfr/a.png\t?\tx\ty\tA\tall",
                "\"all\" is the name of the total",
            ),
        ] {
            let scene = Scene::new("a.tsv", &format!("{header}{row}\n"));
            let error = scene.open("a.tsv").unwrap_err().to_string();
            assert!(
                error.contains("a.tsv, line 3: ") && error.contains(says),
                "{error}"
            );
        }
        let empty = r#"{"id":1,"image":"","question":"?","choices":["x","y"],"answer":"x"}"#;
        let scene = Scene::new("a.jsonl", empty);
        let error = scene.open("a.jsonl").unwrap_err().to_string();
        assert!(
            error.ends_with("question \"1\": no image is named"),
            "{error}"
        );
    }

    #[test]
    fn a_broken_image_in_a_table_is_named() {
        let mut file = std::io::Cursor::new(Vec::new());
        RgbImage::new(40, 40)
            .write_to(&mut file, image::ImageFormat::Png)
            .unwrap();
        let whole = file.into_inner();
        let (mut flipped, cut) = (whole.clone(), &whole[..whole.len() - 12]);
        let data = whole.windows(4).position(|four| four == b"IDAT").unwrap() + 6;
        flipped[data] ^= 0x10;
        for (cell, says) in [
            (STANDARD.encode(&flipped), "not a "),
            (STANDARD.encode(cut), "not a whole image"),
            ("no base64!".repeat(9), "not base64"),
            (STANDARD.encode([7; 99]), "not an image"),
        ] {
            let header = "index\timage\tquestion\tA\tB\tanswer";
            let scene = Scene::new("a.tsv", &format!("{header}\n1\t{cell}\t?\tx\ty\tA\n"));
            let set = scene.open("a.tsv").unwrap();
            let picture = set.picture(&FrameId("1".into()));
            let error = picture
                .and_then(|picture| picture.decode())
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("a.tsv, line 2: ") && error.contains(says),
                "{error}"
            );
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
