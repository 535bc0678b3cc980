//! Replies constrained to one letter: the JSON [`schema`] in the request, and the [`constrained_letter`] in the reply.

use serde_json::{Value, json};

use super::parameters::Constrain;
use crate::types::questions::letter;

/// Name of the only field in a reply with `--request constrain=json`.
pub(crate) const ANSWER: &str = "answer";

/// JSON schema of an object whose only field is one of the letters.
pub(crate) fn schema(letters: &[char]) -> Value {
    json!({
        "type": "object", "additionalProperties": false, "required": [ANSWER],
        "properties": {ANSWER: {"type": "string", "enum": letters}},
    })
}

/// Letter in a constrained reply; `None` without a constraint, or if the server did not follow it.
pub(crate) fn constrained_letter(constrain: Constrain, choices: usize, reply: &str) -> Option<String> {
    let object: Option<Value> = match constrain {
        Constrain::None => return None,
        Constrain::Json => serde_json::from_str(without_fence(reply)).ok(),
        Constrain::Choice => None,
    };
    let text = match &object {
        Some(object) if object.as_object()?.len() == 1 => object.get(ANSWER)?.as_str()?,
        Some(_) => return None,
        None => reply,
    };
    (0..choices).map(|index| letter(index).to_string()).find(|letter| letter == text.trim())
}

/// The content of a fenced code block that is the whole text; other texts are returned as they are.
fn without_fence(text: &str) -> &str {
    let fenced = || {
        let inner = text.trim().strip_prefix("```")?.strip_suffix("```")?;
        let (language, block) = inner.split_once('\n')?;
        language.trim().chars().all(char::is_alphanumeric).then_some(block)
    };
    fenced().unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letter_of_a_constrained_reply_is_found() {
        use Constrain::{Choice, Json};
        for (constrain, reply, letter) in [
            (Json, "{\"answer\": \"B\"}", Some("B")),
            (Json, " {\n\"answer\" : \"A\" }\n", Some("A")),
            (Json, "```json\n{\"answer\": \"B\"}\n```\n", Some("B")),
            (Json, "```\n{\"answer\": \"A\"}```", Some("A")),
            (Json, "```json\n{\"answer\": \"C\"}\n```", None),
            (Json, "{\"answer\":\"C\"}", None),
            (Json, "{\"answer\":\"B", None),
            (Json, "{\"answer\":\"B\",\"why\":\"x\"}", None),
            (Json, "The answer is B", None),
            (Choice, "B", Some("B")),
            (Choice, " A\n", Some("A")),
            (Choice, "a", None),
            (Choice, "B. yes", None),
        ] {
            assert_eq!(constrained_letter(constrain, 2, reply).as_deref(), letter, "{reply}");
        }
    }
}
