//! Parsing of token probabilities in all known shapes, [`positions`], and detection of reasoning, [`thought`].

use serde_json::Value;

use super::usage;
use darkqa_base::types::{Thought, TokenPosition};

/// Maximum number of positions to read; chosen: the answer is at the beginning, at most after the few tokens of a JSON
/// field.
const MAX_POSITIONS: usize = 16;

/// Log probabilities up to this value are unknown: vLLM writes -9999.
const UNKNOWN_LOGPROB: f64 = -9990.0;

/// Maximum difference of the log probabilities of one token; chosen: servers round them.
const ROUNDING: f64 = 1e-4;

/// Parses the `logprobs` of a choice or of a part of a response: OpenAI's list or object with the list `content`, or
/// the legacy lists `tokens`, `token_logprobs` and `top_logprobs`. `None` without any position.
pub(super) fn positions(logprobs: Option<&Value>) -> Option<Vec<TokenPosition>> {
    let logprobs = logprobs?;
    let list = logprobs.as_array().or_else(|| logprobs.get("content")?.as_array());
    let positions: Vec<TokenPosition> = match list {
        Some(list) => list.iter().take(MAX_POSITIONS).filter_map(position).collect(),
        None => legacy_positions(logprobs)?,
    };
    (!positions.is_empty()).then_some(positions)
}

/// Parses one entry in OpenAI's form: `{"token", "logprob", "bytes", "top_logprobs": [{"token", "logprob", "bytes"}]}`.
fn position(entry: &Value) -> Option<TokenPosition> {
    let (token, logprob) = token_logprob(entry)?;
    let top_tokens = entry
        .get("top_logprobs")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
        .filter_map(token_logprob)
        .filter_map(|(token, logprob)| Some((token, logprob?)));
    Some(TokenPosition { likeliest: with_chosen(top_tokens, &token, logprob), token })
}

/// Parses a token and its log probability, `None` if unknown. The token comes from its `bytes` if they are valid UTF-8.
fn token_logprob(entry: &Value) -> Option<(String, Option<f64>)> {
    let token = entry
        .get("bytes")
        .and_then(text_from_bytes)
        .filter(|text| !text.is_empty())
        .or_else(|| Some(entry.get("token")?.as_str()?.to_owned()))?;
    Some((token, known_logprob(entry.get("logprob"))))
}

/// Decodes a list of bytes as UTF-8.
fn text_from_bytes(bytes: &Value) -> Option<String> {
    let bytes = bytes.as_array()?.iter().map(|byte| u8::try_from(byte.as_u64()?).ok()).collect::<Option<_>>()?;
    String::from_utf8(bytes).ok()
}

/// A log probability; `None` if it is unknown. A value above 0 is a rounding error.
fn known_logprob(value: Option<&Value>) -> Option<f64> {
    let logprob = value?.as_f64()?;
    (logprob > UNKNOWN_LOGPROB).then_some(logprob.min(0.0))
}

/// Top tokens without duplicates, including the chosen token, which some servers omit from their list.
///
/// A tokenizer may have several tokens with the same text, such as a letter and its byte, with different probabilities.
/// Entries with the same text are therefore duplicates only if their probabilities are equal too.
fn with_chosen(
    top_tokens: impl Iterator<Item = (String, f64)>,
    chosen: &str,
    chosen_logprob: Option<f64>,
) -> Vec<(String, f64)> {
    let mut tokens: Vec<(String, f64)> = Vec::new();
    let chosen = chosen_logprob.map(|logprob| (chosen.to_owned(), logprob));
    for (token, logprob) in top_tokens.chain(chosen) {
        let is_duplicate = tokens.iter().any(|(other, known)| *other == token && (known - logprob).abs() < ROUNDING);
        if !is_duplicate {
            tokens.push((token, logprob));
        }
    }
    tokens
}

/// Parses the lists of legacy completions: `{"tokens": […], "token_logprobs": […], "top_logprobs": [{token:
/// logprob}]}`.
fn legacy_positions(logprobs: &Value) -> Option<Vec<TokenPosition>> {
    let tokens = list(logprobs, "tokens")?;
    tokens
        .iter()
        .take(MAX_POSITIONS)
        .enumerate()
        .map(|(index, token)| {
            let token = token.as_str()?.to_owned();
            let logprob = known_logprob(list(logprobs, "token_logprobs").and_then(|list| list.get(index)));
            let top_tokens = list(logprobs, "top_logprobs")
                .and_then(|list| list.get(index)?.as_object())
                .into_iter()
                .flatten()
                .filter_map(|(token, logprob)| Some((token.clone(), known_logprob(Some(logprob))?)));
            Some(TokenPosition { likeliest: with_chosen(top_tokens, &token, logprob), token })
        })
        .collect()
}

fn list<'a>(logprobs: &'a Value, field: &str) -> Option<&'a Vec<Value>> {
    logprobs.get(field).and_then(Value::as_array)
}

/// Detects reasoning in a message: reasoning tokens in the usage, reasoning fields or parts, or marks in the text.
pub(super) fn thought(message: &Value, usage: Option<&Value>, text: &str) -> Thought {
    let in_usage = usage.and_then(usage::reasoning) > Some(0);
    let in_parts = message.get("content").and_then(Value::as_array).into_iter().flatten().any(|part| {
        let kind = part.get("type").and_then(Value::as_str);
        matches!(kind, Some("thinking" | "reasoning"))
    });
    let in_text = ["<think", "</think>", "<|channel", "<channel|>"].iter().any(|mark| text.contains(mark));
    if in_usage || in_parts || in_text || has_reasoning(message) { Thought::Before } else { Thought::None }
}

/// True if a message has a non-empty reasoning field.
fn has_reasoning(message: &Value) -> bool {
    ["reasoning_content", "reasoning"].iter().any(|field| message.get(*field).is_some_and(is_filled))
}

/// True for a non-blank string or a non-empty list.
fn is_filled(value: &Value) -> bool {
    match value {
        Value::String(text) => !text.trim().is_empty(),
        Value::Array(items) => !items.is_empty(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn every_shape_gives_the_same_tokens() {
        let expected =
            [TokenPosition { token: "B".to_owned(), likeliest: vec![(" A".to_owned(), -3.0), ("B".to_owned(), -0.1)] }];
        let listed = json!([{"token": " A", "logprob": -3.0}, {"token": "C", "logprob": -9999.0}, {"token": "D", "logprob": null}]);
        for shape in [
            json!({"content": [{"token": "B", "logprob": -0.1, "top_logprobs": listed}], "refusal": null}),
            json!([{"token": "B", "logprob": -0.1, "top_logprobs": listed}]),
            json!([{"token": "token_id:33", "bytes": [66], "logprob": -0.1, "top_logprobs": [
                {"token": "token_id:9", "bytes": [32, 65], "logprob": -3.0},
                {"token": "token_id:33", "bytes": [66], "logprob": -0.1},
                {"token": "token_id:33", "bytes": [66], "logprob": -0.1},
            ]}]),
            json!({"tokens": ["B"], "token_logprobs": [-0.1], "top_logprobs": [{" A": -3.0}]}),
        ] {
            assert_eq!(positions(Some(&shape)).as_deref(), Some(&expected[..]), "{shape}");
        }
    }

    #[test]
    fn empty_shapes_have_no_positions() {
        for shape in [
            json!(null),
            json!({}),
            json!([]),
            json!({"content": []}),
            json!({"content": null}),
            json!({"content": [{"logprob": 1}]}),
            json!({"tokens": []}),
        ] {
            assert_eq!(positions(Some(&shape)), None, "{shape}");
        }
        assert_eq!(positions(None), None);
        // Two tokens with the same text, a letter and its byte, are different.
        let twins = json!([{"token": "A", "logprob": -1.0, "top_logprobs": [
            {"id": 68, "token": "A", "bytes": [65], "logprob": -1.0},
            {"id": 292, "token": "A", "bytes": [65], "logprob": -2.5},
        ]}]);
        let twins = &positions(Some(&twins)).unwrap()[0].likeliest;
        assert_eq!(twins.len(), 2);
        // The chosen token has no log probability.
        let alone = json!([{"token": "B"}]);
        assert!(positions(Some(&alone)).unwrap()[0].likeliest.is_empty());
    }

    #[test]
    fn reasoning_is_detected_everywhere() {
        let none = json!({"content": "B", "reasoning_content": "", "reasoning": null});
        let zero = json!({"completion_tokens_details": {"reasoning_tokens": 0}});
        assert_eq!(thought(&none, Some(&zero), "B"), Thought::None);
        for (message, usage, text) in [
            (json!({"reasoning_content": "A?"}), json!(null), "B"),
            (json!({"reasoning": "A?"}), json!(null), "B"),
            (json!({"content": [{"type": "thinking"}]}), json!(null), "B"),
            (json!({}), json!(null), "<think>A?</think>B"),
            (json!({}), json!({"completion_tokens_details": {"reasoning_tokens": 9}}), "B"),
            (json!({}), json!({"output_tokens_details": {"reasoning_tokens": 9}}), "B"),
        ] {
            assert_eq!(thought(&message, Some(&usage), text), Thought::Before);
        }
    }
}
