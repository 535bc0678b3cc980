//! Conversion of question lines that other tools write: [`translated`].
//!
//! - Hugging Face's `imagefolder` and lmms-eval: `{"file_name" or "image", "id", "question", "options", "answer", "category"}`. The
//!   options are a list of texts, with or without letters before them (VSI-Bench), or a text with such a list in JSON. The
//!   answer is a letter or a text.
//! - LLaVA: `{"question_id", "image", "text", "category"}`. Each choice is a line of the text with its letter. `answer` is the
//!   letter of the true choice.

use serde_json::{Map, Value, json};

use crate::types::Choices;
use crate::types::question::letter;

/// A line with the keys of this program. A line that has them already is not changed.
///
/// # Errors
/// If a line of another tool is incomplete, or its answer may mean two choices.
pub(super) fn translated(value: Value) -> Result<Value, String> {
    let Value::Object(mut line) = value else {
        return Ok(value);
    };
    if line.contains_key("choices") {
        return Ok(Value::Object(line));
    }
    rename(&mut line, "file_name", "image");
    rename(&mut line, "question_id", "id");
    rename(&mut line, "ground_truth", "answer");
    rename(&mut line, "category", "family");
    rename(&mut line, "question_type", "family");
    let options = match line.remove("options") {
        Some(options) => options_of(&options)?,
        None => match line.remove("text") {
            Some(Value::String(text)) => {
                let (question, choices) = in_text(&text).ok_or(
                    "no choices: neither a list of them nor lines that begin with A., B., …",
                )?;
                line.insert("question".to_owned(), json!(question));
                choices
            }
            _ => return Ok(Value::Object(line)),
        },
    };
    let answer = line
        .get("answer")
        .and_then(Value::as_str)
        .ok_or("no answer: a letter or the text of a choice expected")?;
    let truth = truth(answer, &options)?;
    line.insert("answer".to_owned(), json!(options[truth]));
    line.insert("choices".to_owned(), json!(options));
    Ok(Value::Object(line))
}

fn rename(line: &mut Map<String, Value>, from: &str, to: &str) {
    if !line.contains_key(to)
        && let Some(value) = line.remove(from)
    {
        line.insert(to.to_owned(), value);
    }
}

/// The options. If every option begins with its own letter, the letters are removed.
fn options_of(options: &Value) -> Result<Vec<String>, String> {
    let list: Option<Vec<String>> = match options {
        Value::Array(list) => list
            .iter()
            .map(|option| Some(option.as_str()?.to_owned()))
            .collect(),
        // Some sets store the list as a text.
        Value::String(text) => serde_json::from_str(text).ok(),
        _ => None,
    };
    let list = list.ok_or("options: a list of texts expected")?;
    let bare: Option<Vec<String>> = list
        .iter()
        .enumerate()
        .map(|(i, option)| after_letter(option, i))
        .collect();
    Ok(bare.unwrap_or(list))
}

/// The text after the letter of an index, as in `A. yes`, `A) yes`, `(A) yes` and `A: yes`; `None` without the letter.
fn after_letter(text: &str, index: usize) -> Option<String> {
    if index >= Choices::MOST {
        return None;
    }
    let text = text.trim();
    let text = text.strip_prefix('(').unwrap_or(text);
    let rest = text.strip_prefix(letter(index))?;
    let rest = rest.strip_prefix(['.', ')', ':'])?.trim();
    (!rest.is_empty()).then(|| rest.to_owned())
}

/// The question and the choices of a text with one line per choice; an instruction may follow.
fn in_text(text: &str) -> Option<(String, Vec<String>)> {
    let lines: Vec<&str> = text.lines().collect();
    let first = lines
        .iter()
        .position(|line| after_letter(line, 0).is_some())?;
    let choices: Vec<String> = (0..)
        .zip(&lines[first..])
        .map_while(|(i, line)| after_letter(line, i))
        .collect();
    let question = lines[..first].join("\n").trim().to_owned();
    (choices.len() >= 2 && !question.is_empty()).then_some((question, choices))
}

/// The index of the choice that an answer means, by its text or by its letter.
fn truth(answer: &str, options: &[String]) -> Result<usize, String> {
    let by_text = options.iter().position(|option| option == answer);
    let bare = answer
        .trim()
        .trim_start_matches('(')
        .trim_end_matches(['.', ')']);
    let by_letter = (0..options.len().min(Choices::MOST)).find(|&i| bare == letter(i).to_string());
    match (by_text, by_letter) {
        (Some(text), Some(letter)) if text != letter => Err(format!(
            "the answer {answer:?} is both the text of one option and the letter of another"
        )),
        (Some(truth), _) | (None, Some(truth)) => Ok(truth),
        (None, None) => Err(format!(
            "the answer {answer:?} is neither a letter nor the text of one of {options:?}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: Value) -> Result<(String, Vec<String>, String), String> {
        let line = translated(line)?;
        let text = |key: &str| line[key].as_str().unwrap_or("?").to_owned();
        let choices = line["choices"].as_array().unwrap();
        let choices = choices
            .iter()
            .map(|choice| choice.as_str().unwrap().to_owned())
            .collect();
        Ok((text("question"), choices, text("answer")))
    }

    #[test]
    fn every_dialect_is_read() {
        let expected = (
            "Who?".to_owned(),
            vec!["yes".to_owned(), "no".to_owned()],
            "no".to_owned(),
        );
        for line in [
            json!({"id": 1, "file_name": "a.png", "question": "Who?", "options": ["yes", "no"], "answer": "B"}),
            json!({"id": 1, "image": "a.png", "question": "Who?", "options": ["A. yes", "B. no"], "ground_truth": "B"}),
            json!({"id": 1, "image": "a.png", "question": "Who?", "options": "[\"(A) yes\", \"(B) no\"]", "answer": "no"}),
            json!({"question_id": 1, "image": "a.png", "text": "Who?\nA. yes\nB. no\nAnswer with the option's letter from the given choices directly.", "answer": "(B)"}),
            json!({"id": 1, "frame": "a", "question": "Who?", "choices": ["yes", "no"], "answer": "no"}),
        ] {
            assert_eq!(read(line.clone()).unwrap(), expected, "{line}");
        }
        let more = translated(json!({"question_id": 7, "image": "a", "text": "?\nA. x\nB. y", "answer": "A", "category": "c"})).unwrap();
        assert_eq!(
            (&more["id"], &more["family"], &more["image"]),
            (&json!(7), &json!("c"), &json!("a"))
        );
    }

    #[test]
    fn an_ambiguous_or_incomplete_line_is_refused() {
        for (line, says) in [
            (
                json!({"options": ["B", "A"], "answer": "A", "question": "?"}),
                "both the text",
            ),
            (
                json!({"options": ["x", "y"], "answer": "C", "question": "?"}),
                "neither a letter",
            ),
            (
                json!({"options": [1, 2], "answer": "A", "question": "?"}),
                "a list of texts",
            ),
            (json!({"options": ["x", "y"], "question": "?"}), "no answer"),
            (json!({"text": "Who?", "answer": "A"}), "no choices"),
        ] {
            let problem = read(line).unwrap_err();
            assert!(problem.contains(says), "{problem}");
        }
        // A text that is also its own letter is not ambiguous.
        assert_eq!(
            read(json!({"options": ["A", "B"], "answer": "A", "question": "?"}))
                .unwrap()
                .2,
            "A"
        );
    }
}
