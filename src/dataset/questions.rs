//! Files of questions: one JSON object per line.
//!
//! `{"id", "frame", "family", "question", "choices", "answer", "evidence"}`; a ready-made set has `"image"`, a path
//! relative to the file, in place of `"frame"`. `answer` is the text of the true choice. Lines that other tools write are
//! converted first (`dialect.rs`).

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::dialect::translated;
use crate::error::{Error, Result};
use crate::files::reading::json_lines;
use crate::types::{Choices, Family, FrameId, Question, QuestionId};

#[derive(Debug, Deserialize)]
struct QuestionLine {
    id: Value,
    #[serde(alias = "image")]
    frame: String,
    #[serde(default = "other")]
    family: Family,
    question: String,
    choices: Vec<String>,
    answer: Option<String>,
    #[serde(default)]
    evidence: Value,
}

/// The family of a question that names none.
pub(super) fn other() -> Family {
    Family::Other("other".to_owned())
}

/// The family, unless it has the name that the tables use for the total.
pub(super) fn checked(family: Family) -> Result<Family> {
    if family.name().trim() == Family::TOTAL {
        return Err(Error::data(
            "family",
            format_args!(
                "the family {:?} is the name of the total over all families; rename it",
                Family::TOTAL
            ),
        ));
    }
    Ok(family)
}

/// The questions of a file.
///
/// # Errors
/// If a line is not valid JSON, a key is missing, the choices are not valid, the answer is not among them, or the family
/// has the name of the total. The error names the file and the line.
pub(crate) fn read(path: &Path) -> Result<Vec<Question>> {
    let lines = json_lines::<Value>(path)?.into_iter();
    lines
        .map(|(number, value)| {
            let value = translated(value).map_err(|problem| Error::line(path, number, problem))?;
            let line = serde_json::from_value::<QuestionLine>(value)
                .map_err(|e| Error::json_line(path, number, &e))?;
            line.into_question()
                .map_err(|e| e.at(format!("{}, line {number}", path.display())))
        })
        .collect()
}

impl QuestionLine {
    fn into_question(self) -> Result<Question> {
        let id = match self.id {
            Value::String(id) if !id.is_empty() => id,
            Value::Number(id) => id.to_string(),
            other => {
                return Err(Error::data(
                    "id",
                    format_args!("the id {other} is neither text nor a number"),
                ));
            }
        };
        if self.question.trim().is_empty() {
            return Err(Error::data(
                "question",
                format_args!("question {id:?} is empty"),
            ));
        }
        let Some(answer) = self.answer else {
            return Err(Error::data(
                "answer",
                format_args!(
                    "question {id:?} has no answer; questions without answers are asked about every image with --ask FILE"
                ),
            ));
        };
        let truth = self
            .choices
            .iter()
            .position(|choice| *choice == answer)
            .ok_or_else(|| {
                Error::data(
                    "answer",
                    format_args!(
                        "question {id:?}: the answer {answer:?} is not among the choices {:?}",
                        self.choices
                    ),
                )
            })?;
        let choices = Choices::new(self.choices, truth)?;
        let family = checked(self.family)?;
        Ok(Question {
            id: QuestionId(id),
            frame: FrameId(self.frame),
            family,
            text: self.question,
            choices,
            evidence: self.evidence,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn parse(text: &str) -> Result<Vec<Question>> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        read(file.path())
    }

    #[test]
    fn a_line_is_a_question() {
        let read = parse(
            "{\"id\":7,\"frame\":\"a/0\",\"family\":\"color\",\"question\":\"What?\",\"choices\":[\"red\",\"blue\"],\"answer\":\"blue\"}\n\n",
        );
        let question = &read.unwrap()[0];
        assert_eq!(
            (
                question.id.0.as_str(),
                question.choices.truth(),
                &question.family
            ),
            ("7", Some(1), &Family::Color)
        );
    }

    #[test]
    fn broken_lines_are_named() {
        let good = r#"{"id":"a","frame":"f","question":"q","choices":["x","y"],"answer":"x"}"#;
        for (line, says) in [
            ("{", "line 2: EOF"),
            (r#"{"id":"a"}"#, "line 2: missing field `frame`"),
            (
                r#"{"id":"a","frame":"f","question":"q","choices":["x","y"],"answer":"z"}"#,
                "line 2: question \"a\": the answer \"z\" is not among",
            ),
            (
                r#"{"id":"a","frame":"f","question":"q","choices":["x"],"answer":"x"}"#,
                "line 2: 1 choices",
            ),
            (
                r#"{"id":"a","frame":"f","question":" ","choices":["x","y"],"answer":"x"}"#,
                "line 2: question \"a\" is empty",
            ),
            (
                r#"{"id":"a","frame":"f","family":" all","question":"q","choices":["x","y"],"answer":"x"}"#,
                "line 2: the family \"all\" is the name of the total",
            ),
            (
                r#"{"id":null,"frame":"f","question":"q","choices":["x","y"],"answer":"x"}"#,
                "line 2: the id null",
            ),
        ] {
            let error = parse(&format!("{good}\n{line}\n")).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }
}
