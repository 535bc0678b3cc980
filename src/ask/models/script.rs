//! Model whose replies come from a file: [`Script`].

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};

use crate::ask::failures::AskError;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::{Condition, Digest, FailureKind, QuestionId, Reply};

/// Model that replies from a JSONL file.
///
/// A line is `{"question": "<id>", "reply": ".."}`, optionally with `"condition": "L3-noise"` for a single condition,
/// or `{"default": ".."}` for all other questions. The most specific line applies.
#[derive(Debug)]
pub struct Script {
    name: String,
    path: PathBuf,
    digest: Digest,
    replies: HashMap<Scope, String>,
}

/// Questions to which a line applies.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Scope {
    InCondition(QuestionId, Condition),
    Question(QuestionId),
    Default,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptLine {
    question: Option<QuestionId>,
    condition: Option<Condition>,
    reply: Option<String>,
    default: Option<String>,
}

impl ScriptLine {
    /// The scope and the reply; `None` for an invalid combination of fields.
    fn scope_and_reply(self) -> Option<(Scope, String)> {
        match (self.question, self.condition, self.reply, self.default) {
            (Some(id), Some(condition), Some(reply), None) => Some((Scope::InCondition(id, condition), reply)),
            (Some(id), None, Some(reply), None) => Some((Scope::Question(id), reply)),
            (None, None, None, Some(reply)) => Some((Scope::Default, reply)),
            _ => None,
        }
    }
}

impl Script {
    /// Reads a file of replies.
    ///
    /// # Errors
    /// If the file cannot be read, a line is invalid, or two lines apply to the same question and condition.
    pub fn load(path: &Path) -> Result<Self> {
        let text = reading::text(path)?;
        let text = text.trim_start_matches('\u{feff}');
        let mut replies = HashMap::new();
        let mut line_numbers: HashMap<Scope, usize> = HashMap::new();
        for (number, line) in (1..).zip(text.lines()) {
            if line.trim().is_empty() {
                continue;
            }
            let line: ScriptLine =
                serde_json::from_str(line).map_err(|error| Error::json_line(path, number, &error))?;
            let (scope, reply) = line.scope_and_reply().ok_or_else(|| {
                Error::line(
                    path,
                    number,
                    r#"expected {"question": "<id>", "reply": ".."}, with "condition": "L3-noise" if it is for one condition, or {"default": ".."}"#,
                )
            })?;
            if let Some(first) = line_numbers.insert(scope.clone(), number) {
                let problem = format_args!("answers the same question as line {first}; keep one of the two lines");
                return Err(Error::line(path, number, problem));
            }
            replies.insert(scope, reply);
        }
        Ok(Self {
            name: format!("script:{}", path.display()),
            path: path.to_owned(),
            digest: Digest::from_bytes(text.as_bytes()),
            replies,
        })
    }

    /// Name in records and tables: `script:` and the path.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn content(&self) -> Value {
        json!({"script": self.digest})
    }

    pub(super) fn answer(&self, id: &QuestionId, condition: Option<&Condition>) -> Result<Reply, AskError> {
        condition
            .and_then(|condition| self.replies.get(&Scope::InCondition(id.clone(), condition.clone())))
            .or_else(|| self.replies.get(&Scope::Question(id.clone())))
            .or_else(|| self.replies.get(&Scope::Default))
            .cloned()
            .map(Reply::local)
            .ok_or_else(|| {
                let message =
                    format!(r#"{} has no reply to question {id} and no {{"default": ".."}} line"#, self.path.display());
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
    fn errors_name_the_line_once() {
        let error = load("\n{\n").unwrap_err().to_string();
        assert!(error.ends_with(", line 2: EOF while parsing an object"), "{error}");
    }
}
