//! Models without an endpoint: a function in this process ([`Local`]), guesses ([`Random`]), and replies from a file
//! ([`Script`]).

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};

use crate::failures::AskError;
use crate::requests::Call;
use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::questions::letter;
use darkqa_base::types::{Condition, Digest, FailureKind, Finish, Observed, Question, QuestionId, Reply};

/// Finish reason of a reply that is a guess.
const GUESS: &str = "guess";

/// Answer of the function of a [`Local`] model.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LocalAnswer {
    /// Index of the choice; `None` if the function does not know.
    pub choice: Option<usize>,
    /// Observation to record; `None` without an image.
    pub observed: Option<Observed>,
    /// True to record the answer as a guess.
    pub guessed: bool,
}

/// A function that answers a question.
pub(super) type AnswerFn = dyn Fn(&Question, &Call<'_>) -> Result<LocalAnswer, String> + Send + Sync;

/// Model whose answers come from a function. If the function does not know the answer, [`Random`] guesses: the same
/// seed, question, condition and turn give the same guess.
pub struct Local {
    name: String,
    digest: Digest,
    fallback: Random,
    answer_fn: Box<AnswerFn>,
}

impl fmt::Debug for Local {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Local({})", self.name)
    }
}

impl Local {
    /// Creates a model; `digest` is the digest of everything that decides the function's answers.
    #[must_use]
    pub fn new(name: String, digest: Digest, fallback: Random, answer_fn: Box<AnswerFn>) -> Self {
        Self { name, digest, fallback, answer_fn }
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn content(&self) -> Value {
        json!({"local": self.name, "digest": self.digest, "prior": self.fallback.content()})
    }

    pub(super) fn answer(&self, question: &Question, call: Call<'_>) -> Result<Reply, AskError> {
        let answer =
            (self.answer_fn)(question, &call).map_err(|message| AskError::new(FailureKind::Request, message))?;
        let text = match answer.choice {
            Some(choice) => letter(choice).to_string(),
            None => self.fallback.answer(question, call),
        };
        let reply = Reply::local(text);
        Ok(Reply {
            finish: if answer.guessed { Finish::Other(GUESS.to_owned()) } else { reply.finish },
            observed: answer.observed,
            chances: None,
            ..reply
        })
    }
}

/// A model that answers with the letter of a random choice; all choices are equally likely. The guess depends only on
/// the seed, question, condition and turn, not on the order in which questions are asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Random {
    /// Seed of the guesses.
    pub seed: u64,
}

impl Random {
    /// Name in records and tables.
    pub const NAME: &'static str = "random";

    pub(super) fn content(self) -> Value {
        json!({"random": self.seed})
    }

    pub(super) fn answer(self, question: &Question, call: Call<'_>) -> String {
        let mut context = call.condition.map(ToString::to_string).unwrap_or_default();
        if call.turn > 0 {
            context = format!("{context} turn {}", call.turn);
        }
        let mut digest = Digest::from_parts([
            Self::NAME.as_bytes(),
            &self.seed.to_le_bytes(),
            question.id.0.as_bytes(),
            context.as_bytes(),
        ]);
        let count = question.choices.len() as u64;
        // Reject draws from the largest multiple of `count` upwards: their remainders would favour the first choices.
        let limit = u64::MAX - u64::MAX % count;
        loop {
            let (chunks, _) = digest.as_bytes().as_chunks::<8>();
            let draw = chunks.iter().map(|bytes| u64::from_le_bytes(*bytes)).find(|draw| *draw < limit);
            if let Some(draw) = draw {
                return letter((draw % count) as usize).to_string();
            }
            digest = Digest::from_bytes(digest.as_bytes());
        }
    }
}

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
        let text = files::text(path)?;
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
    use crate::{Message, Query};
    use darkqa_base::types::{Choices, Condition, Evidence, Family, FrameId, QuestionId};

    fn question(id: usize, choices: usize) -> Question {
        let texts = (0..choices).map(|i| format!("choice {i}")).collect();
        Question {
            id: QuestionId(id.to_string()),
            frame: FrameId("f".into()),
            family: Family::Presence,
            text: "?".into(),
            choices: Choices::new(texts, 0).unwrap(),
            group: None,
            evidence: Evidence::default(),
        }
    }

    fn guess(seed: u64, question: &Question, condition: Option<&Condition>, turn: u32) -> String {
        let call = Call { query: Query::Choice(question), condition, message: Message::text_only(""), turn };
        Random { seed }.answer(question, call)
    }

    #[test]
    fn guesses_are_uniform() {
        let mut counts = [0_u32; 3];
        for id in 0..3000 {
            let reply = guess(7, &question(id, 3), None, 0);
            counts[usize::from(reply.as_bytes()[0] - b'A')] += 1;
        }
        // 129 is five standard deviations of the count for uniform guesses.
        assert!(counts.iter().all(|count| count.abs_diff(1000) < 130), "{counts:?}");
    }

    fn guesses(seed: u64, condition: &str) -> String {
        let condition = condition.parse().unwrap();
        (0..40).map(|id| guess(seed, &question(id, 4), Some(&condition), 0)).collect()
    }

    #[test]
    fn guesses_depend_on_seed_question_and_condition() {
        assert_eq!(guesses(1, "L3-noise"), guesses(1, "L3-noise"));
        assert_ne!(guesses(1, "L3-noise"), guesses(2, "L3-noise"));
        assert_ne!(guesses(1, "L3-noise"), guesses(1, "L3-ev"));
    }

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
