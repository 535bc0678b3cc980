//! Answers in structured form: JSON with an answer key, `\boxed{}`, `<answer>`.

use std::sync::LazyLock;

use regex::Regex;
use serde_json::Value;

use super::lenient;
use crate::choice::choice_views::ChoiceViews;
use crate::choice::text::clean::compiled;

use darkqa_base::types::questions::{Answer, UnreadReason};

/// JSON keys whose value is the answer, in lower case without spaces and punctuation.
const KEYS: [&str; 24] = [
    "answer",
    "ans",
    "choice",
    "option",
    "finalanswer",
    "correctanswer",
    "correctoption",
    "correctchoice",
    "answerchoice",
    "answeroption",
    "answerletter",
    "selectedoption",
    "selectedchoice",
    "selectedanswer",
    "selected",
    "selection",
    "chosenoption",
    "letter",
    "youranswer",
    "bestanswer",
    "finalchoice",
    "答案",
    "정답",
    "回答",
];

/// JSON keys of the answer inside an object that is the value of an answer key.
const INNER_KEYS: [&str; 5] = ["text", "label", "value", "name", "id"];

static TAGGED: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?is)(?:<(?:final[_ -]?)?(?:answer|choice|option)>|\[answer\])",
        r"(.*?)(?:</(?:final[_ -]?)?(?:answer|choice|option)>|\[/answer\]|\n\n|\z)"
    ))
});

/// Maximum length of a LaTeX box, in bytes. An answer is shorter.
const BOX_BYTES: usize = 2000;

/// The answer under an answer key in the JSON objects of a text. If any object has such a key, later levels are not
/// tried, even if its value cannot be parsed.
pub(super) fn json(tidy: &str, choices: &ChoiceViews) -> Option<Answer> {
    let mut answers = Vec::new();
    let mut from = 0;
    while let Some(at) = tidy[from..].find('{') {
        let start = from + at;
        let mut values = serde_json::Deserializer::from_str(&tidy[start..]).into_iter::<Value>();
        // The cost of a failed attempt is limited by the depth, which `serde_json` bounds, so the scan stays linear.
        from = match values.next() {
            Some(Ok(value)) => {
                for (key, value) in value.as_object().into_iter().flatten() {
                    if KEYS.contains(&normalize_key(key).as_str()) {
                        answers.push(value_answer(value, choices));
                    }
                }
                start + values.byte_offset()
            }
            _ => start + 1,
        };
    }
    common_answer(&answers)
}

/// A key in lower case without spaces and punctuation.
fn normalize_key(key: &str) -> String {
    key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The answer in a JSON value. A number is parsed as a choice's text, never as its index.
fn value_answer(value: &Value, choices: &ChoiceViews) -> Answer {
    let unread = Answer::Unparsed(UnreadReason::NoChoice);
    match value {
        Value::String(text) => text_answer(text, choices),
        Value::Number(number) => text_answer(&number.to_string(), choices),
        Value::Array(values) => {
            let answers: Vec<Answer> = values.iter().map(|value| value_answer(value, choices)).collect();
            common_answer(&answers).unwrap_or(unread)
        }
        Value::Object(fields) => {
            let answers: Vec<Answer> = fields
                .iter()
                .filter(|(key, _)| {
                    let key = normalize_key(key);
                    KEYS.contains(&key.as_str()) || INNER_KEYS.contains(&key.as_str())
                })
                .map(|(_, value)| value_answer(value, choices))
                .collect();
            common_answer(&answers).unwrap_or(unread)
        }
        Value::Null | Value::Bool(_) => unread,
    }
}

/// The answer in `\boxed{…}` and `<answer>…</answer>`.
pub(super) fn boxed(tidy: &str, choices: &ChoiceViews) -> Option<Answer> {
    let tagged = TAGGED.captures_iter(tidy).filter_map(|found| found.get(1)).map(|inner| inner.as_str());
    let answers: Vec<Answer> = boxes(tidy)
        .chain(tagged)
        .filter(|inner| !inner.trim().is_empty())
        .map(|inner| text_answer(inner, choices))
        .collect();
    common_answer(&answers)
}

/// Contents of LaTeX boxes, up to the closing brace of each.
fn boxes(text: &str) -> impl Iterator<Item = &str> {
    const OPENINGS: [&str; 3] = ["\\boxed", "\\fbox", "\\framebox"];
    OPENINGS.into_iter().flat_map(move |opening| {
        text.match_indices(opening).filter_map(move |(at, _)| {
            let inner = text[at + opening.len()..].trim_start().strip_prefix('{')?;
            let inner = &inner[..inner.floor_char_boundary(BOX_BYTES)];
            let mut depth = 1_usize;
            inner
                .char_indices()
                .find(|(_, c)| {
                    match c {
                        '{' => depth += 1,
                        '}' => depth -= 1,
                        _ => {}
                    }
                    depth == 0
                })
                .map(|(end, _)| &inner[..end])
        })
    })
}

fn text_answer(text: &str, choices: &ChoiceViews) -> Answer {
    lenient::read_part(text, choices)
}

/// The answer on which all answers agree. Answers that could not be read are ignored if others could be read.
fn common_answer(answers: &[Answer]) -> Option<Answer> {
    let mut readable = answers.iter().filter(|answer| {
        !matches!(answer, Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Empty | UnreadReason::Refused))
    });
    let first = *readable.next().or(answers.first())?;
    let same = readable.all(|answer| *answer == first);
    Some(if same { first } else { Answer::Unparsed(UnreadReason::Ambiguous) })
}
