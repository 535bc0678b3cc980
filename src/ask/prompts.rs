//! Prompt templates, of this program and of OpenEQA.
//!
//! Prompt templates for questions to a model: [`Prompts`].
//!
//! Prompts of OpenEQA for models and for the judge, byte-identical to `facebookresearch/open-eqa` at cfa3fce.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use minijinja::{AutoEscape, Environment, UndefinedBehavior, Value, context};
use regex::Regex;
use serde::{Deserialize, Serialize};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::questions::letter;
use darkqa_base::types::{Choices, Digest, Evidence, Family, FrameId, Question, QuestionId, View};
use darkqa_prompts::{LETTER, PAPER, TERSE, Templates, openeqa};

/// Template for questions with the image.
const CHOICE: &str = "choice.txt";

/// Template for questions without the image.
const BLIND: &str = "blind.txt";

/// Prompt templates: the built-in ones of `prompts/`, or the user's.
#[derive(Debug)]
pub struct Prompts {
    templates: Environment<'static>,
    sources: Sources,
    digest: Digest,
}

impl Prompts {
    /// The names of the built-in prompts.
    pub const BUILT_IN: [&str; 3] = [Self::DEFAULT, "terse", "letter"];

    /// The name of the prompts that a run uses without a flag: those of the paper.
    pub const DEFAULT: &str = "paper";

    /// The built-in prompts of this name; the default ones for any other name.
    ///
    /// # Errors
    /// Never in practice: tests render the embedded templates.
    pub fn built_in(name: &str) -> Result<Self> {
        Self::new(match name {
            "terse" => Sources::from(TERSE),
            "letter" => Sources::from(LETTER),
            _ => Sources::default(),
        })
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
            let text = files::settings(&path)?;
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
        for (name, source) in [(CHOICE, &sources.choice), (BLIND, &sources.blind)] {
            templates.add_template_owned(name, source.clone()).map_err(|error| prompt_error(name, error))?;
        }
        let digest = sources.digest();
        let prompts = Self { templates, sources, digest };
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

    /// The templates, for the manifest of a run; `None` for the built-in ones, which each version has.
    #[must_use]
    pub fn stored(&self) -> Option<serde_json::Value> {
        let sources = (self.digest != Sources::default().digest()).then_some(&self.sources)?;
        serde_json::to_value(sources).ok()
    }

    /// The prompts of a run, from the digest and the templates in its manifest; `None` if the manifest lacks them, as
    /// those of earlier versions do, or states others.
    #[must_use]
    pub fn from_stored(digest: &str, stored: Option<&serde_json::Value>) -> Option<Self> {
        let sources = match stored {
            Some(stored) => serde_json::from_value(stored.clone()).ok()?,
            None => Sources::default(),
        };
        Self::new(sources).ok().filter(|prompts| prompts.digest.to_string() == digest)
    }

    /// Renders the prompt for one question. The texts of the question and the choices are inserted unchanged.
    ///
    /// # Errors
    /// If the template fails, or if the prompt omits the question or a choice: its reply would cost money and measure
    /// nothing.
    pub fn render(&self, view: View, question: &Question) -> Result<String> {
        self.render_texts(view, &question.text, question.choices.texts())
    }

    /// Renders the prompt for the texts of a question and its choices, like [`render`](Self::render).
    ///
    /// # Errors
    /// As for [`render`](Self::render).
    pub fn render_texts(&self, view: View, question: &str, texts: &[String]) -> Result<String> {
        let name = match view {
            View::Image => CHOICE,
            View::Blind => BLIND,
        };
        let choices: Vec<Value> =
            (0..).map(letter).zip(texts).map(|(letter, text)| context! { letter => letter, text => text }).collect();
        let values = context! { question => question, choices => choices };
        let rendered = self
            .templates
            .get_template(name)
            .and_then(|template| template.render(values))
            .map_err(|error| prompt_error(name, error))?;
        if !rendered.contains(question) {
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
#[derive(Debug, Serialize, Deserialize)]
struct Sources {
    choice: String,
    blind: String,
}

impl Sources {
    fn new(choice: &str, blind: &str) -> Self {
        Self { choice: choice.to_owned(), blind: blind.to_owned() }
    }

    fn digest(&self) -> Digest {
        Digest::from_parts([self.choice.as_bytes(), self.blind.as_bytes()])
    }
}

impl Default for Sources {
    fn default() -> Self {
        Self::from(PAPER)
    }
}

impl From<Templates> for Sources {
    fn from(templates: Templates) -> Self {
        Self::new(templates.choice, templates.blind)
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
        evidence: Evidence::default(),
    })
}

/// Prompt for a model with images: the text before the images and the text after them.
#[must_use]
pub fn vision(question: &str) -> (String, String) {
    const QUERY: &str = "User Query:";
    let template = openeqa::VISION.trim();
    let (before, after) = template.split_once(QUERY).unwrap_or((template, ""));
    let after = fill(after, &[("question", question)]);
    (before.to_owned(), format!("{QUERY}{after}"))
}

/// Prompt for a model without images.
#[must_use]
pub fn blind(question: &str) -> String {
    fill(openeqa::BLIND.trim(), &[("question", question)])
}

/// Extracts the answer from a blind model's reply, as upstream's `parse_output`: the rest of the line after the first
/// "A:", without any further "A:". `None` for a reply without "A:", which is an error upstream.
#[must_use]
pub fn blind_answer(reply: &str) -> Option<String> {
    let (_, after) = reply.split_once("A:")?;
    let line = after.split('\n').next().unwrap_or(after);
    Some(line.replace("A:", "").trim().to_owned())
}

/// Prompt that asks the judge to rate `prediction` against the reference `answer`. Extra answers, even an empty list,
/// select another template.
#[must_use]
pub fn judge_prompt(question: &str, answer: &str, extra: Option<&[String]>, prediction: &str) -> String {
    let values = [("question", question), ("answer", answer), ("prediction", prediction)];
    match extra {
        None => fill(openeqa::MATCH.trim(), &values),
        Some(extra) => {
            let list = python_list(extra);
            let values = [values[0], values[1], values[2], ("extra_answers", &*list)];
            fill(openeqa::MATCH_EXTRA.trim(), &values)
        }
    }
}

/// Fills the `{name}` fields of a template, as Python's `str.format`. Braces in a value are plain text, and unknown
/// names are dropped.
fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut text = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once('{') {
        text += before;
        let Some((name, after)) = after.split_once('}') else {
            rest = after;
            break;
        };
        let value = values.iter().find(|(known, _)| *known == name);
        text += value.map_or("", |(_, value)| value);
        rest = after;
    }
    text + rest
}

/// Formats a list of strings as Python prints it: `['a', "it's"]`.
fn python_list(texts: &[String]) -> String {
    let texts: Vec<String> = texts.iter().map(|text| python_repr(text)).collect();
    format!("[{}]", texts.join(", "))
}

/// Matches one character that Python's `str.isprintable` rejects: the categories "Other" and "Separator", except the
/// space.
static UNPRINTABLE: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"^[\p{C}\p{Z}--\x20]$").ok());

/// Formats a string as Python's `repr`: in single quotes, or in double quotes if it has a single quote and no double
/// quote.
fn python_repr(text: &str) -> String {
    let quote = if text.contains('\'') && !text.contains('"') { '"' } else { '\'' };
    let mut printed = String::from(quote);
    for c in text.chars() {
        match c {
            '\\' => printed += "\\\\",
            '\n' => printed += "\\n",
            '\r' => printed += "\\r",
            '\t' => printed += "\\t",
            _ if c == quote => {
                printed.push('\\');
                printed.push(c);
            }
            _ if !is_unprintable(c) => printed.push(c),
            _ => printed += &escape(u32::from(c)),
        }
    }
    printed.push(quote);
    printed
}

/// Escape sequence of a code point, in the shortest form: two, four or eight hexadecimal digits.
fn escape(code: u32) -> String {
    match code {
        0..0x100 => format!("\\x{code:02x}"),
        0x100..0x1_0000 => format!("\\u{code:04x}"),
        _ => format!("\\U{code:08x}"),
    }
}

fn is_unprintable(c: char) -> bool {
    let mut buffer = [0; 4];
    let text: &str = c.encode_utf8(&mut buffer);
    !c.is_ascii_graphic() && UNPRINTABLE.as_ref().is_some_and(|pattern| pattern.is_match(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Digest;

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
        let prompts = Prompts::built_in(Prompts::DEFAULT).unwrap();
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
        let prompts = Prompts::built_in(Prompts::DEFAULT).unwrap();
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
        let built_in = Prompts::built_in(Prompts::DEFAULT).unwrap();
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

    /// Strings and their `repr` in Python 3.11.7.
    const PYTHON_REPRS: [(&str, &str); 20] = [
        ("", "''"),
        ("plain", "'plain'"),
        ("it's", "\u{22}it's\u{22}"),
        ("\u{22}q\u{22}", "'\u{22}q\u{22}'"),
        ("both ' and \u{22}", "'both \u{5c}' and \u{22}'"),
        ("back\u{5c}slash", "'back\u{5c}\u{5c}slash'"),
        ("tab\u{9}nl\u{a}cr\u{d}", "'tab\u{5c}tnl\u{5c}ncr\u{5c}r'"),
        ("Gr\u{f6}\u{df}e", "'Gr\u{f6}\u{df}e'"),
        ("\u{65e5}\u{672c}\u{8a9e}", "'\u{65e5}\u{672c}\u{8a9e}'"),
        ("\u{a0}nbsp", "'\u{5c}xa0nbsp'"),
        ("\u{200b}zero", "'\u{5c}u200bzero'"),
        ("\u{ad}", "'\u{5c}xad'"),
        ("\u{0}\u{1f}\u{7f}\u{85}", "'\u{5c}x00\u{5c}x1f\u{5c}x7f\u{5c}x85'"),
        ("\u{1f600}", "'\u{1f600}'"),
        ("\u{e0001}", "'\u{5c}U000e0001'"),
        ("\u{2028}", "'\u{5c}u2028'"),
        ("\u{d7ff}", "'\u{5c}ud7ff'"),
        ("\u{e9}'\u{22}", "'\u{e9}\u{5c}'\u{22}'"),
        ("\u{feff}", "'\u{5c}ufeff'"),
        ("\u{378}", "'\u{5c}u0378'"),
    ];

    #[test]
    fn template_lengths_match_upstream() {
        // Sizes in bytes of the trimmed files at cfa3fce.
        for (template, bytes) in
            [(openeqa::VISION, 321), (openeqa::BLIND, 613), (openeqa::MATCH, 669), (openeqa::MATCH_EXTRA, 997)]
        {
            assert_eq!(template.trim().len(), bytes, "{}", Digest::from_bytes(template.as_bytes()));
        }
    }

    #[test]
    fn vision_prompt_splits_at_query() {
        let (before, after) = vision("Where is {answer}?");
        assert!(before.ends_with("answer to the question asked by the user.\n"));
        assert_eq!(after, "User Query: Where is {answer}?");
    }

    #[test]
    fn blind_prompt_ends_with_question() {
        let blind = blind("Is it?");
        assert!(blind.starts_with("You are an intelligent") && blind.ends_with("\n\nQ: Is it?"));
    }

    #[test]
    fn blind_answer_follows_first_marker() {
        for (reply, answer) in [
            ("A: a bed \nExplanation: x", Some("a bed")),
            ("Q: Is it?\nA: A: a bed", Some("a bed")),
            ("Answer: a bed", None),
        ] {
            assert_eq!(blind_answer(reply).as_deref(), answer);
        }
    }

    #[test]
    fn judge_prompt_keeps_braces_of_values() {
        let plain = judge_prompt("Q {prediction}", "it's", None, "{answer}");
        assert!(plain.ends_with("Your Turn:\nQuestion: Q {prediction}\nAnswer: it's\nResponse: {answer}"));
    }

    #[test]
    fn extra_answers_select_their_template() {
        let extra = ["Next to the stairs", "it's here", "\"both\" it's"].map(str::to_owned);
        let prompt = judge_prompt("Q", "A", Some(&extra), "P");
        let list = r#"Extra Answers: ['Next to the stairs', "it's here", '"both" it\'s']"#;
        assert!(prompt.contains(list), "{prompt}");
        assert!(judge_prompt("Q", "A", Some(&[]), "P").contains("Extra Answers: []\n"));
    }

    #[test]
    fn python_repr_matches_python() {
        assert!(UNPRINTABLE.is_some());
        for (text, printed) in PYTHON_REPRS {
            assert_eq!(python_repr(text), printed);
        }
    }
}
