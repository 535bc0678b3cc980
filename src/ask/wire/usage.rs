//! Parsing of the token usage that a server reports, in all known shapes: [`read`].

use serde_json::{Value, json};

use super::charge;
use crate::types::{StatedCost, Usage};

/// Parses the `usage` in a body, with the charge and the service tier that the body states. `None` if it states none of
/// them.
pub(super) fn in_body(body: &Value) -> Option<Usage> {
    let usage = Usage {
        cost: charge::cost_in_body(body),
        service_tier: charge::tier(body),
        ..read(body.get("usage")).unwrap_or_default()
    };
    (usage != Usage::default()).then_some(usage)
}

/// Adds the charge that the headers of a response state; the higher one counts. Without a usage, a charge of 0 states
/// nothing.
pub(crate) fn with_cost(usage: Option<Usage>, cost: Option<StatedCost>) -> Option<Usage> {
    match (usage, cost) {
        (Some(usage), cost) => Some(Usage { cost: usage.cost.max(cost), ..usage }),
        (None, Some(cost)) if cost.dollars() > 0.0 => Some(Usage { cost: Some(cost), ..Usage::default() }),
        (None, _) => None,
    }
}

/// Parses a `usage` that was cut off its body.
pub(super) fn alone(usage: Option<Value>) -> Option<Usage> {
    in_body(&json!({"usage": usage?}))
}

/// Parses the `usage` of chat completions (`prompt_tokens`, `completion_tokens`) or of responses (`input_tokens`,
/// `output_tokens`).
///
/// Some servers charge reasoning tokens without counting them as reply tokens (xAI, Gemini's compatible route). The
/// number of reply tokens is therefore the maximum of: the reported number; the total minus the prompt; and the
/// reported number plus the reasoning tokens, if these are more than the reported number and so cannot be part of it.
/// `None` without any number.
fn read(usage: Option<&Value>) -> Option<Usage> {
    let usage = usage?;
    let prompt = first_of(usage, ["prompt_tokens", "input_tokens"]);
    let completion = first_of(usage, ["completion_tokens", "output_tokens"]);
    let total = number_in(usage, "total_tokens");
    // OpenAI reports cached tokens in the details, Anthropic in two top-level fields.
    let cached = detail(usage, PROMPT_DETAILS, "cached_tokens");
    let written = number_in(usage, "cache_creation_input_tokens").unwrap_or(0);
    let read = number_in(usage, "cache_read_input_tokens");
    // Anthropic does not count tokens that are read from or written to its cache as prompt tokens.
    let uncounted = read.unwrap_or(0).saturating_add(written);
    let exceeds_prompt = total.is_none() && prompt.is_some_and(|prompt| uncounted > prompt);
    let is_uncounted = uncounted > 0 && (exceeds_prompt || sum([prompt, completion, Some(uncounted)]) == total);
    let prompt = prompt.map(|prompt| if is_uncounted { prompt.saturating_add(uncounted) } else { prompt });
    let uncounted_reasoning = reasoning(usage).filter(|reasoning| completion.is_some_and(|c| *reasoning > c));
    let completion = [
        completion,
        uncounted_reasoning.and_then(|reasoning| completion?.checked_add(reasoning)),
        total.zip(prompt).and_then(|(all, prompt)| all.checked_sub(prompt)),
    ];
    let usage = Usage {
        prompt_tokens: prompt,
        completion_tokens: completion.into_iter().flatten().max(),
        cached_tokens: cached.or(read).filter(|cached| *cached > 0),
        total_tokens: total,
        ..Usage::default()
    };
    (usage != Usage::default()).then_some(usage)
}

fn first_of(usage: &Value, names: [&str; 2]) -> Option<u64> {
    names.iter().find_map(|name| number(usage.get(*name)?))
}

/// Names of the object with details about the prompt.
const PROMPT_DETAILS: [&str; 2] = ["prompt_tokens_details", "input_tokens_details"];

/// Names of the object with details about the reply.
const REPLY_DETAILS: [&str; 2] = ["completion_tokens_details", "output_tokens_details"];

/// Number of reasoning tokens; `None` if the server does not report it.
pub(super) fn reasoning(usage: &Value) -> Option<u64> {
    detail(usage, REPLY_DETAILS, "reasoning_tokens").or_else(|| number_in(usage, "reasoning_tokens"))
}

/// Number in the first of several objects that has it.
fn detail(usage: &Value, objects: [&str; 2], name: &str) -> Option<u64> {
    objects.iter().find_map(|object| number_in(usage.get(*object)?, name))
}

fn number_in(object: &Value, name: &str) -> Option<u64> {
    number(object.get(name)?)
}

/// Sum of numbers; `None` if one is unknown.
fn sum(numbers: [Option<u64>; 3]) -> Option<u64> {
    numbers.into_iter().sum()
}

/// Maximum plausible number of tokens, so that no sum overflows; chosen.
const MAX_TOKENS: u64 = 1_000_000_000_000_000;

/// Parses a number of tokens: an integer, a fraction, which is rounded up, or either as a string.
fn number(value: &Value) -> Option<u64> {
    let number = match value {
        Value::Number(number) => number.as_u64().or_else(|| round_up(number.as_f64()?)),
        Value::String(text) => {
            let text = text.trim();
            text.parse().ok().or_else(|| round_up(text.parse().ok()?))
        }
        _ => None,
    };
    number.filter(|number| *number <= MAX_TOKENS)
}

/// Rounds a fraction up; `None` if it is not a plausible number of tokens.
fn round_up(number: f64) -> Option<u64> {
    (0.0..=MAX_TOKENS as f64).contains(&number).then_some(number.ceil() as u64)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::ask::costs::Price;

    /// Usages of several vendors, with the charged prompt and reply tokens.
    fn vendors() -> [(&'static str, Value, [u64; 2]); 8] {
        [
            (
                "OpenAI: reasoning inside",
                json!({"prompt_tokens": 1000, "completion_tokens": 600, "total_tokens": 1600, "completion_tokens_details": {"reasoning_tokens": 512}}),
                [1000, 600],
            ),
            (
                "xAI: reasoning outside",
                json!({"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 6100, "completion_tokens_details": {"reasoning_tokens": 5000}}),
                [1000, 5100],
            ),
            (
                "Gemini: reasoning in the total alone",
                json!({"prompt_tokens": 1000, "completion_tokens": 5, "total_tokens": 1805}),
                [1000, 805],
            ),
            (
                "OpenAI Responses",
                json!({"input_tokens": 1000, "output_tokens": 70, "total_tokens": 1070, "output_tokens_details": {"reasoning_tokens": 64}}),
                [1000, 70],
            ),
            (
                "Perplexity: reasoning beside both",
                json!({"prompt_tokens": 1000, "completion_tokens": 30, "reasoning_tokens": 400, "total_tokens": 1030}),
                [1000, 430],
            ),
            (
                "DeepSeek: a cache inside the prompt",
                json!({"prompt_tokens": 1000, "completion_tokens": 9, "total_tokens": 1009, "prompt_cache_hit_tokens": 900}),
                [1000, 9],
            ),
            (
                "Anthropic behind a gateway: a cache outside the prompt",
                json!({"prompt_tokens": 100, "completion_tokens": 10, "total_tokens": 1010, "cache_read_input_tokens": 900}),
                [1000, 10],
            ),
            (
                "a gateway that writes text and fractions",
                json!({"prompt_tokens": "1000", "completion_tokens": 20.0, "total_tokens": " 1060.5 "}),
                [1000, 61],
            ),
        ]
    }

    #[test]
    fn charged_tokens_match_the_vendors_bill() {
        let price = Price {
            input: 10.0,
            output: 100.0,
            cached_input: None,
            image_tokens: None,
            tiers: crate::ask::costs::TierFactors::default(),
        };
        for (vendor, usage, [prompt, reply]) in vendors() {
            let read = read(Some(&usage)).unwrap();
            let tokens = (read.prompt_tokens, read.completion_tokens);
            assert_eq!(tokens, (Some(prompt), Some(reply)), "{vendor}");
            let expected = (prompt * 10 + reply * 100) as f64 / 1e6;
            assert!((price.charged(read) - expected).abs() < 1e-12, "{vendor}");
        }
    }

    fn prompt_tokens(usage: &Value) -> Option<u64> {
        read(Some(usage)).unwrap().prompt_tokens
    }

    #[test]
    fn caches_outside_the_prompt_are_added() {
        let large = json!({"input_tokens": 100, "output_tokens": 1, "cache_read_input_tokens": 2000});
        assert_eq!(prompt_tokens(&large), Some(2100));
        let within = json!({"input_tokens": 100, "output_tokens": 1, "cache_read_input_tokens": 60});
        assert_eq!(prompt_tokens(&within), Some(100));
    }

    #[test]
    fn missing_numbers_follow_from_the_total() {
        let usage = read(Some(&json!({"prompt_tokens": 9, "total_tokens": 12}))).unwrap();
        assert_eq!(usage.completion_tokens, Some(3));
        assert_eq!(usage.total_tokens, Some(12));
        let odd = json!({"prompt_tokens": -1, "completion_tokens": "many", "total_tokens": null});
        assert_eq!(read(Some(&odd)), None);
        let small = json!({"prompt_tokens": 9, "completion_tokens": 3, "total_tokens": 2});
        assert_eq!(read(Some(&small)).unwrap().completion_tokens, Some(3));
    }

    #[test]
    fn implausible_numbers_are_ignored() {
        for tokens in [json!(u64::MAX), json!(-1), json!("1e99"), json!("nan"), json!(null)] {
            let stated = json!({"prompt_tokens": tokens, "completion_tokens": tokens, "cache_read_input_tokens": 3});
            let usage = read(Some(&stated)).unwrap();
            assert_eq!((usage.prompt_tokens, usage.completion_tokens), (None, None));
        }
    }
}
