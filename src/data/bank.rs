//! Questions without known answers, asked about every photograph: [`Bank`], and its file or built-in name:
//! [`BankSource`].
//!
//! Each line is `{"id", "question", "choices", "family"}`; `family` is optional. A line has no image, because its
//! question is asked about all images, and no answer, so replies are never scored as right or wrong.
//!
//! Families of questions in files: [`unnamed`], [`check_family`].

use std::collections::HashMap;
use std::convert::Infallible;
use std::fmt;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::Deserialize;
use serde_json::{Value, json};

use super::ready_made::one_line;
use darkqa_base::error::{Error, Result};
use darkqa_base::files::text;
use darkqa_base::types::evidence::BANK_ID;
use darkqa_base::types::questions::CANNOT_TELL;
use darkqa_base::types::text::excerpt;
use darkqa_base::types::{Choices, Digest, Family, FrameId, Question, QuestionId};
use darkqa_prompts::HOME;

/// Value of `--ask`: the built-in bank or a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BankSource {
    /// The built-in bank.
    Home(OptOut),
    /// A file of questions.
    File(PathBuf),
}

/// Whether a model may answer “cannot tell” to the questions of the built-in bank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OptOut {
    /// Every choice describes the photograph.
    None,
    /// “Cannot tell” is added as the last choice.
    CannotTell,
}

impl FromStr for BankSource {
    type Err = Infallible;

    /// Parses `home`, `home:uncertain` or a path. An existing file named `home` is a path.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        let path = PathBuf::from(text);
        Ok(match text {
            "home" if !path.is_file() => Self::Home(OptOut::None),
            "home:uncertain" => Self::Home(OptOut::CannotTell),
            _ => Self::File(path),
        })
    }
}

impl fmt::Display for BankSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Home(OptOut::None) => f.write_str("home"),
            Self::Home(OptOut::CannotTell) => f.write_str("home:uncertain"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// Question of a bank, not yet about a photograph.
#[derive(Debug, Clone, PartialEq, Eq)]
struct BankQuestion {
    id: String,
    text: String,
    choices: Choices,
    family: Family,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct BankLine {
    id: Value,
    question: String,
    choices: Vec<String>,
    #[serde(default = "unnamed")]
    family: Family,
}

/// Questions of a bank. Ids and texts are unique.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bank {
    questions: Vec<BankQuestion>,
}

impl Bank {
    /// Opens a bank.
    ///
    /// # Errors
    /// If the file cannot be read or a line is invalid; the error names the file and the line.
    pub fn open(place: &BankSource) -> Result<Self> {
        match place {
            BankSource::Home(opt_out) => Self::parse(HOME, Path::new("home"), *opt_out),
            BankSource::File(path) if !path.exists() => Err(Error::usage(
                "--ask",
                format_args!("{}: no such file; home and home:uncertain are built in", path.display()),
            )),
            BankSource::File(path) => Self::parse(&text(path)?, path, OptOut::None),
        }
    }

    fn parse(text: &str, path: &Path, opt_out: OptOut) -> Result<Self> {
        let mut questions: Vec<BankQuestion> = Vec::new();
        let (mut ids, mut texts) = (HashMap::new(), HashMap::new());
        for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            if line.trim().is_empty() {
                continue;
            }
            let question = parse_line(line, opt_out, path, number)?;
            for (known, name, value) in
                [(&mut ids, "id", question.id.clone()), (&mut texts, "question", question.text.clone())]
            {
                if let Some(first) = known.insert(value.clone(), number) {
                    let problem =
                        format_args!("line {first} has the same {name}, {:?}; each needs its own", excerpt(&value, 60));
                    return Err(Error::line(path, number, problem));
                }
            }
            questions.push(question);
        }
        if questions.is_empty() {
            return Err(Error::data(path.display(), "no questions in it"));
        }
        Ok(Self { questions })
    }

    /// Digest of all questions. The name of the file is not part of it.
    ///
    /// # Errors
    /// None in practice: the questions are text.
    pub fn digest(&self) -> Result<Digest> {
        let lines: Vec<Value> = self
            .questions
            .iter()
            .map(|question| json!([question.id, question.text, question.choices.texts(), question.family]))
            .collect();
        Digest::canonical("darkqa.bank/1", &lines)
    }

    /// Number of questions.
    pub fn count(&self) -> usize {
        self.questions.len()
    }

    /// Combines every photograph with every question, photograph by photograph in the order of the bank.
    ///
    /// `per_image` limits the questions about each photograph to those with the lowest digest of the photograph's name
    /// and the question. The rank of two questions therefore does not depend on other photographs, other questions or
    /// the order of the bank.
    pub fn questions_about<'f>(
        &self,
        frames: impl IntoIterator<Item = &'f FrameId>,
        per_image: Option<NonZeroUsize>,
    ) -> Vec<Question> {
        let limit = per_image.map_or(usize::MAX, NonZeroUsize::get);
        frames
            .into_iter()
            .flat_map(|frame| {
                let mut drawn: Vec<usize> = (0..self.questions.len()).collect();
                if limit < drawn.len() {
                    drawn.sort_by_cached_key(|index| {
                        let text = self.questions[*index].text.as_bytes();
                        *Digest::from_parts([b"ask", frame.0.as_bytes(), text]).as_bytes()
                    });
                    drawn.truncate(limit);
                    drawn.sort_unstable();
                }
                drawn.into_iter().map(move |index| self.questions[index].about(frame))
            })
            .collect()
    }
}

impl BankQuestion {
    /// Asks the question about a photograph.
    fn about(&self, frame: &FrameId) -> Question {
        Question {
            id: QuestionId(format!("{}@{}", self.id, frame.0)),
            frame: frame.clone(),
            family: self.family.clone(),
            text: self.text.clone(),
            choices: self.choices.clone(),
            group: None,
            evidence: json!({ BANK_ID: self.id }).into(),
        }
    }
}

/// Parses and checks one line; `number` is its line number.
fn parse_line(line: &str, opt_out: OptOut, path: &Path, number: usize) -> Result<BankQuestion> {
    let value: Value = serde_json::from_str(line).map_err(|e| Error::json_line(path, number, &e))?;
    for (field, instead) in [
        ("answer", "--questions FILE asks questions whose answers are known"),
        ("image", "each question is asked about every image of --data"),
        ("frame", "each question is asked about every image of --data"),
    ] {
        if value.get(field).is_some() {
            let problem = format!("a question of --ask has no {field:?}: {instead}");
            return Err(Error::line(path, number, problem));
        }
    }
    let mut line: BankLine = serde_json::from_value(value).map_err(|e| Error::json_line(path, number, &e))?;
    let id = match line.id {
        Value::String(id) if !id.trim().is_empty() => id,
        Value::Number(id) => id.to_string(),
        other => {
            return Err(Error::line(
                path,
                number,
                format_args!("the id {} is neither text nor a number", excerpt(&other.to_string(), 60)),
            ));
        }
    };
    if line.question.trim().is_empty() {
        return Err(Error::line(path, number, format_args!("question {:?} is empty", excerpt(&id, 60))));
    }
    for choice in &mut line.choices {
        *choice = one_line(choice);
    }
    if opt_out == OptOut::CannotTell {
        line.choices.push(CANNOT_TELL.to_owned());
    }
    let at = |e: Error| e.at(format!("{}, line {number}", path.display()));
    Ok(BankQuestion {
        id,
        text: line.question.trim().to_owned(),
        choices: Choices::without_truth(line.choices).map_err(at)?,
        family: check_family(line.family).map_err(at)?,
    })
}

/// Family of a question that names none.
pub(super) fn unnamed() -> Family {
    Family::Other("other".to_owned())
}

/// Returns the family unchanged.
///
/// # Errors
/// If its name is the one that tables use for the total over all families.
pub(super) fn check_family(family: Family) -> Result<Family> {
    if family.name().trim() == Family::TOTAL {
        return Err(Error::data(
            "family",
            format_args!("the family {:?} is the name of the total over all families; rename it", Family::TOTAL),
        ));
    }
    Ok(family)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn bank(text: &str) -> Result<Bank> {
        Bank::parse(text, Path::new("bank.jsonl"), OptOut::None)
    }

    fn frames(names: &[&str]) -> Vec<FrameId> {
        names.iter().map(|name| FrameId((*name).into())).collect()
    }

    const TWO: &str = concat!(
        "\u{feff}{\"id\":\"lamp\",\"question\":\"Is there a lamp?\",\"choices\":[\"yes\",\"no\"],\"family\":\"presence\"}\n\n",
        "{\"id\":2,\"question\":\"What color?\",\"choices\":[\"red\",\"blue\",\"green\"]}\n"
    );

    #[test]
    fn built_in_bank_has_25_questions_with_and_without_opt_out() {
        let home = Bank::open(&"home".parse().unwrap()).unwrap();
        let uncertain = Bank::open(&"home:uncertain".parse().unwrap()).unwrap();
        assert_eq!((home.count(), uncertain.count()), (25, 25));
        assert_eq!(home.questions.iter().filter(|question| question.family == Family::Presence).count(), 15);
        for (bare, with_opt_out) in home.questions.iter().zip(&uncertain.questions) {
            assert!(!bare.choices.texts().iter().any(|text| text.contains("cannot")));
            let (last, others) = with_opt_out.choices.texts().split_last().unwrap();
            assert_eq!((&**last, others), (CANNOT_TELL, bare.choices.texts()));
        }
        assert_ne!(home.digest().unwrap(), uncertain.digest().unwrap());
    }

    #[test]
    fn every_question_is_asked_about_every_photograph() {
        let asked = bank(TWO).unwrap().questions_about(&frames(&["a.png", "b/c.png"]), None);
        let ids: Vec<&str> = asked.iter().map(|question| &*question.id.0).collect();
        assert_eq!(ids, ["lamp@a.png", "2@a.png", "lamp@b/c.png", "2@b/c.png"]);
        assert!(asked.iter().all(|question| question.choices.truth().is_none()));
        assert_eq!(asked[0].evidence.value(), json!({"bank_id": "lamp"}));
    }

    fn drawn(home: &Bank, frames: &[FrameId], per_image: usize) -> BTreeSet<String> {
        home.questions_about(frames, NonZeroUsize::new(per_image)).into_iter().map(|question| question.id.0).collect()
    }

    #[test]
    fn questions_per_image_are_drawn_by_photograph_name() {
        let home = Bank::open(&BankSource::Home(OptOut::None)).unwrap();
        let frames = frames(&["a.png", "b.png", "c.png"]);
        let (five, six) = (drawn(&home, &frames, 5), drawn(&home, &frames, 6));
        assert_eq!((five.len(), six.len()), (15, 18));
        assert!(five.is_subset(&six));
        assert!(drawn(&home, &frames[1..], 5).is_subset(&five));
        // The questions differ between photographs.
        let questions: BTreeSet<&str> = five.iter().filter_map(|id| id.split('@').next()).collect();
        assert!(questions.len() > 5, "{questions:?}");
        assert_eq!(drawn(&home, &frames, 99).len(), 75);
    }

    #[test]
    fn errors_name_the_invalid_line() {
        for (rest, message) in [
            ("{", "bank.jsonl, line 4: EOF"),
            (
                r#"{"id":3,"question":"?","choices":["x","y"],"answer":"x"}"#,
                "line 4: a question of --ask has no \"answer\": --questions",
            ),
            (
                r#"{"id":3,"question":"?","choices":["x","y"],"image":"a.png"}"#,
                "line 4: a question of --ask has no \"image\"",
            ),
            (r#"{"id":3,"question":"?","choices":["x","y"],"hint":"a"}"#, "line 4: unknown field `hint`"),
            (r#"{"id":3,"choices":["x","y"]}"#, "line 4: missing field `question`"),
            (r#"{"id":3,"question":" ","choices":["x","y"]}"#, "line 4: question \"3\" is empty"),
            (r#"{"id":true,"question":"?","choices":["x","y"]}"#, "line 4: the id true"),
            (r#"{"id":3,"question":"?","choices":["x"]}"#, "line 4: 1 choice: a question needs 2 to 26"),
            (r#"{"id":3,"question":"?","choices":["x","X "]}"#, "line 4: choices A and B are both"),
            (
                r#"{"id":"2","question":"?","choices":["x","y"]}"#,
                "line 4: line 3 has the same id, \"2\"; each needs its own",
            ),
            (
                r#"{"id":3,"question":"What color?","choices":["x","y"]}"#,
                "line 4: line 3 has the same question, \"What color?\"; each needs its own",
            ),
            (r#"{"id":3,"question":"?","choices":["x","y"],"family":"all"}"#, "line 4: the family \"all\" is the name"),
        ] {
            let text = format!("{}{rest}", TWO.trim_start_matches('\u{feff}'));
            let error = bank(&text).unwrap_err().to_string();
            assert!(error.contains(message), "{rest}: {error}");
        }
        let error = bank("\n").unwrap_err().to_string();
        assert_eq!(error, "bank.jsonl: no questions in it");
        let missing = Bank::open(&BankSource::File("no-such-bank".into())).unwrap_err();
        assert!(missing.to_string().contains("home and home:uncertain are built in"), "{missing}");
    }

    fn digest(text: &str) -> Digest {
        bank(text).unwrap().digest().unwrap()
    }

    #[test]
    fn digest_covers_questions_but_not_blank_lines() {
        assert_eq!(digest(TWO), digest(&TWO.replace("\n\n", "\n")));
        for other in [TWO.replace("red", "pink"), TWO.replace("presence", "color"), TWO.replace("lamp?", "torch?")] {
            assert_ne!(digest(TWO), digest(&other));
        }
    }
}
