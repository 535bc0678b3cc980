//! The likeliest tokens of a reply, in the shapes in which servers state them: [`positions`], [`thought`].

use serde_json::Value;

use super::usage;
use crate::types::{Thought, TokenPosition};

/// The number of positions that are kept; chosen: an answer stands at the beginning, behind the few tokens of a JSON field at most.
const KEPT: usize = 16;

/// Logarithms below this are no numbers: vLLM writes -9999 for what it does not know.
const UNKNOWN: f64 = -9990.0;

/// Logarithms that differ by less are of the same token; chosen: servers round them.
const SAME_TOKEN: f64 = 1e-4;

/// The positions in the `logprobs` of a choice or of a part of a response: a list or an object with the list `content`, as OpenAI
/// defines them, or the older lists `tokens`, `token_logprobs` and `top_logprobs`. `None` if there is none.
pub(super) fn positions(logprobs: Option<&Value>) -> Option<Vec<TokenPosition>> {
    let logprobs = logprobs?;
    let list = logprobs.as_array();
    let list = list.or_else(|| logprobs.get("content")?.as_array());
    let positions: Vec<TokenPosition> = match list {
        Some(list) => list.iter().take(KEPT).filter_map(position).collect(),
        None => older(logprobs)?,
    };
    (!positions.is_empty()).then_some(positions)
}

/// One entry of OpenAI's form: `{"token", "logprob", "bytes", "top_logprobs": [{"token", "logprob", "bytes"}]}`.
fn position(entry: &Value) -> Option<TokenPosition> {
    let (token, own) = chance(entry)?;
    let listed = entry.get("top_logprobs").and_then(Value::as_array);
    let listed = listed
        .into_iter()
        .flatten()
        .filter_map(chance)
        .filter_map(|(token, logprob)| Some((token, logprob?)));
    Some(TokenPosition {
        likeliest: with_chosen(listed, &token, own),
        token,
    })
}

/// A token, by its bytes if they are given and are text, with the logarithm of its probability if it is known.
fn chance(entry: &Value) -> Option<(String, Option<f64>)> {
    let bytes = entry.get("bytes").and_then(Value::as_array);
    let bytes = bytes.and_then(|bytes| {
        let bytes = bytes.iter().map(|byte| u8::try_from(byte.as_u64()?).ok());
        String::from_utf8(bytes.collect::<Option<_>>()?).ok()
    });
    let token = bytes.filter(|text| !text.is_empty());
    let token = token.or_else(|| Some(entry.get("token")?.as_str()?.to_owned()))?;
    Some((token, logarithm(entry.get("logprob"))))
}

/// The logarithm of a probability; `None` if it is none. One above 0 comes from rounding.
fn logarithm(value: Option<&Value>) -> Option<f64> {
    let logprob = value?.as_f64()?;
    (logprob > UNKNOWN).then_some(logprob.min(0.0))
}

/// Each token once, with the one that was chosen, which some servers leave out of their list.
///
/// A tokenizer may have several tokens of one text, as a letter and its byte, each with a probability of its own. Entries of one
/// text are therefore the same token only if their probabilities are equal, too.
fn with_chosen(
    listed: impl Iterator<Item = (String, f64)>,
    token: &str,
    own: Option<f64>,
) -> Vec<(String, f64)> {
    let mut likeliest: Vec<(String, f64)> = Vec::new();
    let own = own.map(|logprob| (token.to_owned(), logprob));
    for (token, logprob) in listed.chain(own) {
        let is_same = |(known, other): &(String, f64)| {
            *known == token && (other - logprob).abs() < SAME_TOKEN
        };
        if !likeliest.iter().any(is_same) {
            likeliest.push((token, logprob));
        }
    }
    likeliest
}

/// The lists of the older completions: `{"tokens": […], "token_logprobs": […], "top_logprobs": [{token: logprob}]}`.
fn older(logprobs: &Value) -> Option<Vec<TokenPosition>> {
    let list = |field| logprobs.get(field).and_then(Value::as_array);
    let tokens = list("tokens")?;
    tokens
        .iter()
        .take(KEPT)
        .enumerate()
        .map(|(at, token)| {
            let token = token.as_str()?.to_owned();
            let own = logarithm(list("token_logprobs").and_then(|list| list.get(at)));
            let listed = list("top_logprobs").and_then(|list| list.get(at)?.as_object());
            let listed = listed
                .into_iter()
                .flatten()
                .filter_map(|(token, logprob)| Some((token.clone(), logarithm(Some(logprob))?)));
            Some(TokenPosition {
                likeliest: with_chosen(listed, &token, own),
                token,
            })
        })
        .collect()
}

/// Whether a message has reasoning: tokens of it in the usage, a text of it beside the content, parts of it, or marks in the text.
pub(super) fn thought(message: &Value, usage: Option<&Value>, text: &str) -> Thought {
    let tokens = usage.and_then(usage::reasoning) > Some(0);
    let parts = message.get("content").and_then(Value::as_array);
    let in_parts = parts.into_iter().flatten().any(|part| {
        let kind = part.get("type").and_then(Value::as_str);
        matches!(kind, Some("thinking" | "reasoning"))
    });
    let marked = ["<think", "</think>", "<|channel", "<channel|>"];
    let in_text = marked.iter().any(|mark| text.contains(mark));
    if tokens || in_parts || in_text || has_reasoning(message) {
        Thought::Before
    } else {
        Thought::None
    }
}

/// Whether a message has reasoning beside its content.
pub(super) fn has_reasoning(message: &Value) -> bool {
    ["reasoning_content", "reasoning"]
        .iter()
        .any(|field| message.get(*field).is_some_and(is_filled))
}

/// Whether a field of reasoning says anything.
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
        let expected = [TokenPosition {
            token: "B".to_owned(),
            likeliest: vec![(" A".to_owned(), -3.0), ("B".to_owned(), -0.1)],
        }];
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
            assert_eq!(
                positions(Some(&shape)).as_deref(),
                Some(&expected[..]),
                "{shape}"
            );
        }
    }

    #[test]
    fn what_says_nothing_is_none() {
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
        // Two tokens of one text, as a letter and its byte, are not one.
        let twins = json!([{"token": "A", "logprob": -1.0, "top_logprobs": [
            {"id": 68, "token": "A", "bytes": [65], "logprob": -1.0},
            {"id": 292, "token": "A", "bytes": [65], "logprob": -2.5},
        ]}]);
        let twins = &positions(Some(&twins)).unwrap()[0].likeliest;
        assert_eq!(twins.len(), 2);
        // A list alone: the chosen token has no number.
        let alone = json!([{"token": "B"}]);
        assert!(positions(Some(&alone)).unwrap()[0].likeliest.is_empty());
    }

    #[test]
    fn reasoning_is_seen_wherever_it_stands() {
        let none = json!({"content": "B", "reasoning_content": "", "reasoning": null});
        let zero = json!({"completion_tokens_details": {"reasoning_tokens": 0}});
        assert_eq!(thought(&none, Some(&zero), "B"), Thought::None);
        for (message, usage, text) in [
            (json!({"reasoning_content": "A?"}), json!(null), "B"),
            (json!({"reasoning": "A?"}), json!(null), "B"),
            (json!({"content": [{"type": "thinking"}]}), json!(null), "B"),
            (json!({}), json!(null), "<think>A?</think>B"),
            (
                json!({}),
                json!({"completion_tokens_details": {"reasoning_tokens": 9}}),
                "B",
            ),
            (
                json!({}),
                json!({"output_tokens_details": {"reasoning_tokens": 9}}),
                "B",
            ),
        ] {
            assert_eq!(thought(&message, Some(&usage), text), Thought::Before);
        }
    }
}
