//! Answers in a form: JSON with an answer's key, `\boxed{}`, `<answer>`.

use std::sync::LazyLock;

use regex::Regex;
use serde_json::Value;

use super::clean::compiled;
use super::lenient;
use super::plain::{fold, plain};
use super::view::{ChoiceViews, ReplyView};
use crate::types::question::{Answer, UnreadReason};

/// Keys whose value is the answer, without case, spaces and punctuation.
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

/// Keys that hold the answer inside an answer's object.
const INNER_KEYS: [&str; 5] = ["text", "label", "value", "name", "id"];

static TAGGED: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?is)(?:<(?:final[_ -]?)?(?:answer|choice|option)>|\[answer\])",
        r"(.*?)(?:</(?:final[_ -]?)?(?:answer|choice|option)>|\[/answer\]|\n\n|\z)"
    ))
});

/// The longest box that is looked into, in bytes; an answer is shorter.
const BOX_BYTES: usize = 2000;

/// The answer under an answer's key in the JSON objects of a text. An object with such a key is the last word, also
/// where its value cannot be read.
pub(super) fn json(tidy: &str, offered: &ChoiceViews) -> Option<Answer> {
    let mut answers = Vec::new();
    let mut from = 0;
    while let Some(at) = tidy[from..].find('{') {
        let start = from + at;
        let mut values = serde_json::Deserializer::from_str(&tidy[start..]).into_iter::<Value>();
        // A failed attempt costs no more than its depth, which `serde_json` bounds: the scan stays linear.
        from = match values.next() {
            Some(Ok(value)) => {
                for (key, value) in value.as_object().into_iter().flatten() {
                    if KEYS.contains(&key_form(key).as_str()) {
                        answers.push(value_answer(value, offered));
                    }
                }
                start + values.byte_offset()
            }
            _ => start + 1,
        };
    }
    agreed(&answers)
}

fn key_form(key: &str) -> String {
    key.chars()
        .filter(|c| c.is_alphanumeric())
        .flat_map(char::to_lowercase)
        .collect()
}

/// The answer that a JSON value gives. A number is a choice's text, never its position.
fn value_answer(value: &Value, offered: &ChoiceViews) -> Answer {
    let nothing = Answer::Unparsed(UnreadReason::NoChoice);
    match value {
        Value::String(text) => text_answer(text, offered),
        Value::Number(number) => text_answer(&number.to_string(), offered),
        Value::Array(values) => {
            let answers: Vec<Answer> = values
                .iter()
                .map(|value| value_answer(value, offered))
                .collect();
            agreed(&answers).unwrap_or(nothing)
        }
        Value::Object(fields) => {
            let named = fields.iter().filter(|(key, _)| {
                let key = key_form(key);
                KEYS.contains(&key.as_str()) || INNER_KEYS.contains(&key.as_str())
            });
            let answers: Vec<Answer> = named
                .map(|(_, value)| value_answer(value, offered))
                .collect();
            agreed(&answers).unwrap_or(nothing)
        }
        Value::Null | Value::Bool(_) => nothing,
    }
}

/// The answer in `\boxed{…}` and `<answer>…</answer>`.
pub(super) fn boxed(tidy: &str, offered: &ChoiceViews) -> Option<Answer> {
    let tagged = TAGGED
        .captures_iter(tidy)
        .filter_map(|found| found.get(1))
        .map(|inner| inner.as_str());
    let inner = boxes(tidy)
        .chain(tagged)
        .filter(|inner| !inner.trim().is_empty());
    let answers: Vec<Answer> = inner.map(|inner| text_answer(inner, offered)).collect();
    agreed(&answers)
}

/// What stands in LaTeX boxes, up to the brace that closes each.
fn boxes(text: &str) -> impl Iterator<Item = &str> {
    const OPENINGS: [&str; 3] = ["\\boxed", "\\fbox", "\\framebox"];
    OPENINGS.into_iter().flat_map(move |opening| {
        text.match_indices(opening).filter_map(move |(at, _)| {
            let inner = text[at + opening.len()..].trim_start().strip_prefix('{')?;
            let inner = &inner[..inner.floor_char_boundary(BOX_BYTES)];
            let mut depth = 1_usize;
            let close = inner.char_indices().find(|(_, c)| {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    _ => {}
                }
                depth == 0
            });
            close.map(|(end, _)| &inner[..end])
        })
    })
}

fn text_answer(text: &str, offered: &ChoiceViews) -> Answer {
    let text = plain(text);
    lenient::spoken(&ReplyView::new(&text, &fold(&text), offered))
}

/// The one choice that the answers agree on; what could not be read at all has no voice beside others.
fn agreed(answers: &[Answer]) -> Option<Answer> {
    let mute = |answer: &&Answer| {
        !matches!(
            answer,
            Answer::Unparsed(UnreadReason::NoChoice | UnreadReason::Empty | UnreadReason::Refused)
        )
    };
    let mut voices = answers.iter().filter(mute);
    let first = *voices.next().or(answers.first())?;
    let same = voices.all(|answer| *answer == first);
    Some(if same {
        first
    } else {
        Answer::Unparsed(UnreadReason::Ambiguous)
    })
}
