//! A model whose replies come from a file: [`Script`].

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};

use crate::ask::failures::AskError;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::{Condition, Digest, FailureKind, QuestionId, Reply};

/// Replies from a JSONL file, one a line:
/// `{"question": "<id>", "reply": ".."}`, the same with `"condition": "L3-noise"` for one condition, `{"default": ".."}` for the rest.
/// The most specific line applies.
#[derive(Debug)]
pub struct Script {
    name: String,
    path: PathBuf,
    digest: Digest,
    replies: HashMap<Cue, String>,
}

/// The questions that a line answers.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Cue {
    InCondition(QuestionId, Condition),
    Question(QuestionId),
    Default,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    question: Option<QuestionId>,
    condition: Option<Condition>,
    reply: Option<String>,
    default: Option<String>,
}

impl Line {
    fn read(self) -> Option<(Cue, String)> {
        match (self.question, self.condition, self.reply, self.default) {
            (Some(id), Some(condition), Some(reply), None) => {
                Some((Cue::InCondition(id, condition), reply))
            }
            (Some(id), None, Some(reply), None) => Some((Cue::Question(id), reply)),
            (None, None, None, Some(reply)) => Some((Cue::Default, reply)),
            _ => None,
        }
    }
}

impl Script {
    /// Reads a file of replies.
    ///
    /// # Errors
    /// If a line is broken, or has the same question and condition as an earlier line.
    pub fn load(path: &Path) -> Result<Self> {
        let text = reading::text(path)?;
        let text = text.trim_start_matches('\u{feff}');
        let mut replies = HashMap::new();
        let mut lines: HashMap<Cue, usize> = HashMap::new();
        for (number, line) in (1..).zip(text.lines()) {
            if line.trim().is_empty() {
                continue;
            }
            let line: Line = serde_json::from_str(line)
                .map_err(|error| Error::json_line(path, number, &error))?;
            let (cue, reply) = line.read().ok_or_else(|| {
                Error::line(
                    path,
                    number,
                    r#"expected {"question": "<id>", "reply": ".."}, with "condition": "L3-noise" if it is for one condition, or {"default": ".."}"#,
                )
            })?;
            if let Some(first) = lines.insert(cue.clone(), number) {
                let problem = format_args!(
                    "answers the same question as line {first}; keep one of the two lines"
                );
                return Err(Error::line(path, number, problem));
            }
            replies.insert(cue, reply);
        }
        Ok(Self {
            name: format!("script:{}", path.display()),
            path: path.to_owned(),
            digest: Digest::from_bytes(text.as_bytes()),
            replies,
        })
    }

    /// The name in records and tables: `script:` and the path.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn content(&self) -> Value {
        json!({"script": self.digest})
    }

    pub(super) fn answer(
        &self,
        id: &QuestionId,
        condition: Option<&Condition>,
    ) -> Result<Reply, AskError> {
        let reply = condition
            .and_then(|condition| {
                self.replies
                    .get(&Cue::InCondition(id.clone(), condition.clone()))
            })
            .or_else(|| self.replies.get(&Cue::Question(id.clone())))
            .or_else(|| self.replies.get(&Cue::Default));
        reply.cloned().map(Reply::local).ok_or_else(|| {
            let message = format!(
                r#"{} has no reply to question {id} and no {{"default": ".."}} line"#,
                self.path.display()
            );
            AskError::new(FailureKind::Request, message)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn load(text: &str) -> Result<Script> {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        Script::load(file.path())
    }

    #[test]
    fn a_byte_order_mark_is_not_part_of_the_first_line() {
        let line = r#"{"default": "A"}"#;
        let marked = load(&format!("\u{feff}{line}\n")).unwrap();
        let plain = load(&format!("{line}\n")).unwrap();
        assert_eq!(marked.content(), plain.content());
    }

    #[test]
    fn the_error_names_a_broken_line_once() {
        let error = load("\n{\n").unwrap_err().to_string();
        assert!(
            error.ends_with(", line 2: EOF while parsing an object"),
            "{error}"
        );
    }
}
