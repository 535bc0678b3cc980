//! Prompt templates for questions to a model: [`Prompts`].

use std::fs;
use std::path::Path;

use minijinja::{AutoEscape, Environment, UndefinedBehavior, Value, context};

use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::questions::letter;
use crate::types::{Choices, Digest, Family, FrameId, Question, QuestionId, View};

/// Template for questions with the image.
const CHOICE: &str = "choice.txt";
/// Template for questions without the image.
const BLIND: &str = "blind.txt";

/// Prompt templates: the built-in ones of `prompts/`, or the user's.
#[derive(Debug)]
pub struct Prompts {
    templates: Environment<'static>,
    digest: Digest,
}

impl Prompts {
    /// The built-in prompts.
    ///
    /// # Errors
    /// Never in practice: tests render the embedded templates.
    pub fn built_in() -> Result<Self> {
        Self::new(Sources::default())
    }

    /// Reads the prompts in a folder; the built-in prompts replace missing ones.
    ///
    /// # Errors
    /// If the folder has no prompt, if it contains a file that is not a prompt, README.md or a hidden file, or if a
    /// template is invalid or omits the question or a choice.
    pub fn load(dir: &Path) -> Result<Self> {
        let mut sources = Sources::default();
        let mut found = false;
        for entry in fs::read_dir(dir).map_err(|error| Error::file(dir, "read", error))? {
            let path = entry.map_err(|error| Error::file(dir, "read", error))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let source = match &*name {
                CHOICE => &mut sources.choice,
                BLIND => &mut sources.blind,
                "README.md" => continue,
                name if name.starts_with('.') => continue,
                _ => {
                    return Err(prompt_error(
                        &path.display().to_string(),
                        "no prompt has this name; a folder of prompts holds choice.txt and blind.txt, or one of them",
                    ));
                }
            };
            let text = reading::settings(&path)?;
            *source = text.trim_start_matches('\u{FEFF}').replace("\r\n", "\n");
            found = true;
        }
        if !found {
            return Err(prompt_error(&dir.display().to_string(), "the folder holds neither choice.txt nor blind.txt"));
        }
        Self::new(sources)
    }

    fn new(sources: Sources) -> Result<Self> {
        let mut templates = Environment::new();
        templates.set_undefined_behavior(UndefinedBehavior::Strict);
        templates.set_auto_escape_callback(|_| AutoEscape::None);
        let digest = Digest::from_parts([sources.choice.as_bytes(), sources.blind.as_bytes()]);
        for (name, source) in [(CHOICE, sources.choice), (BLIND, sources.blind)] {
            templates.add_template_owned(name, source).map_err(|error| prompt_error(name, error))?;
        }
        let prompts = Self { templates, digest };
        let sample = sample_question()?;
        for view in [View::Image, View::Blind] {
            prompts.render(view, &sample)?;
        }
        Ok(prompts)
    }

    /// Digest of all templates.
    #[must_use]
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// Renders the prompt for one question. The texts of the question and the choices are inserted unchanged.
    ///
    /// # Errors
    /// If the template fails, or if the prompt omits the question or a choice: its reply would cost money and measure
    /// nothing.
    pub fn render(&self, view: View, question: &Question) -> Result<String> {
        let name = match view {
            View::Image => CHOICE,
            View::Blind => BLIND,
        };
        let texts = question.choices.texts();
        let choices: Vec<Value> =
            (0..).map(letter).zip(texts).map(|(letter, text)| context! { letter => letter, text => text }).collect();
        let values = context! { question => question.text.as_str(), choices => choices };
        let rendered = self
            .templates
            .get_template(name)
            .and_then(|template| template.render(values))
            .map_err(|error| prompt_error(name, error))?;
        if !rendered.contains(&question.text) {
            return Err(prompt_error(name, "the question does not occur in it; write {{ question }} where it belongs"));
        }
        if let Some(text) = texts.iter().find(|text| !rendered.contains(*text)) {
            return Err(prompt_error(
                name,
                format_args!(
                    "choice {text:?} does not occur in it; go through all of `choices` and write {{{{ choice.text }}}}"
                ),
            ));
        }
        Ok(rendered)
    }
}

/// Text of each template.
struct Sources {
    choice: String,
    blind: String,
}

impl Default for Sources {
    fn default() -> Self {
        Self {
            choice: include_str!("../../../prompts/choice.txt").to_owned(),
            blind: include_str!("../../../prompts/blind.txt").to_owned(),
        }
    }
}

fn prompt_error(name: &str, problem: impl std::fmt::Display) -> Error {
    Error::Prompt { name: name.to_owned(), problem: problem.to_string() }
}

/// Question that checks templates: its texts are so unusual that no template contains them by chance.
fn sample_question() -> Result<Question> {
    let texts = (1..=5).map(|i| format!("sample-choice-{i}-of-5")).collect();
    Ok(Question {
        id: QuestionId("sample".into()),
        frame: FrameId("sample".into()),
        family: Family::RoomType,
        text: "sample-question?".into(),
        choices: Choices::new(texts, 0)?,
        group: None,
        evidence: serde_json::Value::Null,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(text: &str, choices: &[&str]) -> Question {
        let texts = choices.iter().map(|&text| text.to_owned()).collect();
        Question { text: text.into(), choices: Choices::new(texts, 0).unwrap(), ..sample_question().unwrap() }
    }

    fn load(files: &[(&str, &str)]) -> Result<Prompts> {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(dir.path().join(name), text).unwrap();
        }
        Prompts::load(dir.path())
    }

    #[test]
    fn built_in_prompts_have_the_expected_text() {
        let prompts = Prompts::built_in().unwrap();
        let asked = question("What type of room is this?", &["Kitchen", "Bedroom"]);
        assert_eq!(
            prompts.render(View::Image, &asked).unwrap(),
            "What type of room is this?\nA. Kitchen\nB. Bedroom\nAnswer with the option's letter from the given choices directly."
        );
        let blind = prompts.render(View::Blind, &asked).unwrap();
        assert!(blind.starts_with("What type of room is this?\nA. Kitchen\nB. Bedroom\nThe image"));
        assert!(blind.ends_with("directly."));
        let line = regex::Regex::new(r"(?m)^\s*\(?([A-Z])[.):]\s*(.+?)\s*$").unwrap();
        let lines: Vec<_> = line.captures_iter(&blind).map(|c| [c[1].to_owned(), c[2].to_owned()]).collect();
        assert_eq!(lines, [["A", "Kitchen"], ["B", "Bedroom"]]);
    }

    #[test]
    fn template_syntax_in_a_question_is_plain_text() {
        let hostile = question(
            "{{ 7 * 7 }} {% raw %} <b>\"url\":\"\"</b>\nand a second line",
            &["{{ question }}", "a & b", "{# gone #}"],
        );
        let prompts = Prompts::built_in().unwrap();
        for view in [View::Image, View::Blind] {
            let rendered = prompts.render(view, &hostile).unwrap();
            assert!(rendered.starts_with(&hostile.text));
            assert!(rendered.contains("A. {{ question }}\nB. a & b\nC. {# gone #}\n"), "{rendered}");
        }
    }

    #[test]
    fn missing_prompts_stay_built_in() {
        let own = "Q: {{ question }}\r\n{% for c in choices %}({{ c.letter }}) {{ c.text }}\r\n{% endfor %}";
        let prompts = load(&[("choice.txt", own), ("README.md", "x"), (".swp", "x")]).unwrap();
        let asked = question("Red?", &["yes", "no"]);
        assert_eq!(prompts.render(View::Image, &asked).unwrap(), "Q: Red?\n(A) yes\n(B) no\n");
        let built_in = Prompts::built_in().unwrap();
        assert_eq!(prompts.render(View::Blind, &asked).unwrap(), built_in.render(View::Blind, &asked).unwrap());
        assert_ne!(prompts.digest(), built_in.digest());
    }

    #[test]
    fn invalid_folders_are_errors() {
        let choices = "{% for c in choices %}{{ c.text }}{% endfor %}";
        for (files, expected) in [
            (vec![], "neither"),
            (vec![("chioce.txt", "x")], "chioce.txt"),
            (vec![("choice.txt", choices)], "question"),
            (vec![("blind.txt", "{{ question }}")], "sample-choice-1"),
            (
                vec![("choice.txt", "{{ question }}{% for c in choices[:4] %}{{ c.text }}{% endfor %}")],
                "sample-choice-5",
            ),
            (vec![("choice.txt", "{{ question }}{{ choice }}")], "undefined"),
            (vec![("choice.txt", "{% for %}")], "choice.txt"),
        ] {
            let error = load(&files).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
