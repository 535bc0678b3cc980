//! Parsing of the token usage that a server reports, in all known shapes: [`read`].
//!
//! Charges and service tiers that servers state in their replies: [`cost_in_body`], [`cost_in_headers`], [`tier`].
//!
//! Only charges in US dollars count:
//!
//! - a field whose name says so: `cost_in_usd_ticks` of xAI (10¹⁰ to the dollar, docs.x.ai/developers/cost-tracking),
//!   `cost_usd_total` of LLM Gateway (docs.llmgateway.io/features/cost-breakdown), `total_cost_usd`,
//!   `cost_in_usd_nanos` and the like;
//! - in `usage`, `cost` of OpenRouter, whose credits are US dollars (openrouter.ai/docs, "Usage Accounting"); with the
//!   user's own key for the provider (`is_byok`), what that provider charges is added;
//! - in `usage`, `cost.total_cost` of Perplexity (docs.perplexity.ai), and `estimated_cost` of DeepInfra
//!   (docs.deepinfra.com);
//! - `provider_metadata.gateway.cost` of a message from Vercel's AI Gateway (vercel.com/docs/ai-gateway);
//! - the header `x-litellm-response-cost` of LiteLLM (docs.litellm.ai/docs/proxy/response_headers), and others whose
//!   name says that it is the cost of the request or response in US dollars.
//!
//! A currency or unit that stands beside a charge must be the US dollar.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use reqwest::header::HeaderMap;
use serde_json::{Map, Value, json};

use darkqa_base::types::{ServiceTier, StatedCost, Usage};

/// Where a body, or an event of a stream, has its token usage, as JSON pointers; the first that is there counts. A
/// vendor with a place of its own is a row here, and names of its own are words in [`read`].
const PLACES: [&str; 1] = ["/usage"];

/// The token usage in a body or an event, as the server wrote it.
pub(super) fn raw(body: &Value) -> Option<&Value> {
    PLACES.iter().find_map(|place| body.pointer(place).filter(|usage| !usage.is_null()))
}

/// True if an event states a number of reply tokens other than 0.
pub(super) fn states_reply_tokens(event: &Value) -> bool {
    raw(event).is_some_and(|usage| REPLY_TOKENS.iter().any(|name| number_in(usage, name) > Some(0)))
}

/// Parses the `usage` in a body, with the charge and the service tier that the body states. `None` if it states none of
/// them.
pub(super) fn in_body(body: &Value) -> Option<Usage> {
    let usage = Usage { cost: cost_in_body(body), service_tier: tier(body), ..read(raw(body)).unwrap_or_default() };
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
    let completion = first_of(usage, REPLY_TOKENS);
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

/// Names of the number of reply tokens.
const REPLY_TOKENS: [&str; 2] = ["completion_tokens", "output_tokens"];

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

/// The charge in a body with its `usage`, in US dollars; the highest of several. `None` if the server states none.
fn cost_in_body(body: &Value) -> Option<StatedCost> {
    let usage = raw(body).and_then(Value::as_object);
    let in_usage = usage.and_then(cost_in_usage);
    let beside = body.as_object().and_then(named_in_dollars);
    let gateway = body
        .pointer("/choices/0/message/provider_metadata/gateway")
        .and_then(Value::as_object)
        .and_then(|gateway| plain(gateway, "cost", "cost"));
    in_usage.max(beside).max(gateway)
}

/// Header of LiteLLM with the cost of the response.
const LITELLM: &str = "x-litellm-response-cost";

/// The charge in the headers of a response, in US dollars; the highest of several. `None` if the server states none.
pub(crate) fn cost_in_headers(headers: &HeaderMap) -> Option<StatedCost> {
    headers
        .iter()
        .filter(|(name, _)| name.as_str() == LITELLM || is_cost_of_request(name.as_str()))
        .filter_map(|(name, value)| {
            let text = value.to_str().ok()?;
            // LiteLLM writes None for a model whose price it does not know.
            let number = text.trim().parse::<f64>().ok()?;
            in_dollars(name.as_str(), number)
        })
        .max()
}

/// True if a header's name says that it is the cost of one request in US dollars, and not a sum.
fn is_cost_of_request(name: &str) -> bool {
    let words: Vec<&str> = name.split(['-', '_']).collect();
    let has = |word| words.contains(&word);
    has("cost") && has("usd") && (has("request") || has("response"))
}

/// The service tier in a body or its `usage`; `None` if the server states none.
pub(super) fn tier(body: &Value) -> Option<ServiceTier> {
    let of = |fields: &Value| ServiceTier::from_name(fields.get("service_tier")?.as_str()?);
    of(body).or_else(|| of(body.get("usage")?))
}

/// The charge in `usage`.
fn cost_in_usage(usage: &Map<String, Value>) -> Option<StatedCost> {
    let named = named_in_dollars(usage);
    if let Some(unit) = foreign_unit(usage) {
        warn_once(&format!("a charge in {unit}, not in US dollars"));
        return named;
    }
    let cost = match usage.get("cost") {
        Some(Value::Object(parts)) => match foreign_unit(parts) {
            Some(unit) => {
                warn_once(&format!("a charge in {unit}, not in US dollars"));
                None
            }
            None => ["total_cost", "total"]
                .iter()
                .find_map(|name| plain(parts, name, "cost.total_cost"))
                .or_else(|| named_in_dollars(parts)),
        },
        _ => plain(usage, "cost", "usage.cost"),
    };
    let cost = cost.map(|cost| match own_key_cost(usage) {
        Some(upstream) => cost.plus(upstream),
        None => cost,
    });
    let total = ["total_cost", "estimated_cost"].iter().find_map(|name| plain(usage, name, name));
    named.max(cost).max(total)
}

/// The provider's charge for a request with the user's own key for this provider, which OpenRouter does not include in
/// `cost`.
fn own_key_cost(usage: &Map<String, Value>) -> Option<StatedCost> {
    usage.get("is_byok").filter(|own| **own == true)?;
    let details = usage.get("cost_details")?.as_object()?;
    let name = "upstream_inference_cost";
    plain(details, name, name)
}

/// The currency or unit that fields state, if it is not the US dollar.
fn foreign_unit(fields: &Map<String, Value>) -> Option<String> {
    fields
        .iter()
        .filter(|(name, _)| {
            let name = name.to_lowercase();
            name.contains("currency") || name == "unit" || name.contains("cost_unit")
        })
        .filter_map(|(_, value)| value.as_str())
        .find(|unit| {
            let unit = unit.trim().to_lowercase();
            !["usd", "us$", "$", "dollar", "dollars", "us dollars", ""].contains(&unit.as_str())
        })
        .map(|unit| unit.chars().filter(|c| !c.is_control()).take(20).collect())
}

/// The charge of a field whose unit is the dollar.
fn plain(fields: &Map<String, Value>, name: &str, shown: &str) -> Option<StatedCost> {
    in_dollars(shown, amount(fields.get(name)?)?)
}

/// Words of the name of a field with the whole charge of a request in US dollars.
const WORDS: [&str; 13] = [
    "cost",
    "total",
    "usd",
    "dollars",
    "in",
    "estimated",
    "actual",
    "ticks",
    "nanos",
    "nano",
    "micros",
    "micro",
    "cents",
];

/// The highest charge among fields whose names say that they are in US dollars. Names with other words are parts of the
/// charge, or sums.
fn named_in_dollars(fields: &Map<String, Value>) -> Option<StatedCost> {
    fields
        .iter()
        .filter_map(|(name, value)| {
            let words: Vec<String> = name.split('_').map(str::to_lowercase).collect();
            let has = |word: &str| words.iter().any(|other| other == word);
            let is_cost = has("cost") && (has("usd") || has("dollars"));
            if !is_cost || !words.iter().all(|word| WORDS.contains(&word.as_str())) {
                return None;
            }
            let per_dollar = if has("ticks") {
                1e10
            } else if has("nanos") || has("nano") {
                1e9
            } else if has("micros") || has("micro") {
                1e6
            } else if has("cents") {
                1e2
            } else {
                1.0
            };
            in_dollars(name, amount(value)? / per_dollar)
        })
        .max()
}

/// A plausible charge; warns of another one.
fn in_dollars(name: &str, dollars: f64) -> Option<StatedCost> {
    let cost = StatedCost::from_dollars(dollars);
    if cost.is_none() {
        warn_once(&format!("{name} of {dollars}, no plausible charge in US dollars"));
    }
    cost
}

/// Parses a number, or a number in a string.
fn amount(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value.as_str()?.trim().trim_start_matches('$').parse().ok())
}

/// Maximum number of warnings about charges that do not count; chosen.
const MAX_WARNINGS: usize = 3;

/// Warns, once for each text, of a charge that does not count.
fn warn_once(problem: &str) {
    static WARNED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    // Numbers differ from reply to reply: one warning for each kind.
    let kind: String = problem.chars().filter(|c| !c.is_ascii_digit()).collect();
    let mut warned = WARNED.lock().unwrap_or_else(PoisonError::into_inner);
    if warned.len() < MAX_WARNINGS && warned.insert(kind) {
        tracing::warn!("a reply states {problem}: it is ignored, and the price table counts");
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::costs::Price;

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
            tiers: crate::costs::TierFactors::default(),
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

    fn dollars(body: &Value) -> Option<f64> {
        cost_in_body(body).map(StatedCost::dollars)
    }

    #[test]
    fn charges_of_vendors_are_read() {
        let vercel = json!({"gateway": {"cost": "0.0045405", "generationId": "g"}});
        for (vendor, body, expected) in [
            (
                "OpenRouter",
                json!({"usage": {"cost": 0.13, "is_byok": false, "cost_details": {"upstream_inference_cost": 0.12}}}),
                0.13,
            ),
            (
                "OpenRouter with an own key",
                json!({"usage": {"cost": 0.006, "is_byok": true, "cost_details": {"upstream_inference_cost": 0.12}}}),
                0.126,
            ),
            ("xAI", json!({"usage": {"cost_in_usd_ticks": 37_756_000}}), 0.003_775_6),
            (
                "Perplexity",
                json!({"usage": {"cost": {"input_tokens_cost": 0.001, "request_cost": 0.005, "total_cost": 0.006}}}),
                0.006,
            ),
            ("DeepInfra", json!({"usage": {"estimated_cost": 2.6e-5}}), 2.6e-5),
            (
                "LLM Gateway",
                json!({"usage": {"cost_usd_total": 0.000_125, "cost_usd_input": 0.5, "cost_usd_request": 0.25}}),
                0.000_125,
            ),
            ("Vercel", json!({"choices": [{"message": {"provider_metadata": vercel}}]}), 0.004_540_5),
            ("another one", json!({"usage": {"cost": "0.02", "currency": "USD"}}), 0.02),
            ("nanos", json!({"usage": {"cost_in_usd_nanos": 5_000_000}}), 0.005),
            ("beside the usage", json!({"total_cost_usd": 0.25}), 0.25),
        ] {
            let found = dollars(&body).unwrap_or(-1.0);
            assert!((found - expected).abs() < 1e-9, "{vendor}: {found}");
        }
    }

    #[test]
    fn other_units_and_implausible_charges_are_ignored() {
        for body in [
            json!({"usage": {"prompt_tokens": 9}}),
            json!({"usage": {"cost": 3, "currency": "CNY"}}),
            json!({"usage": {"cost": 3, "cost_unit": "credits"}}),
            json!({"usage": {"cost": {"total_cost": 3, "currency": "EUR"}}}),
            json!({"usage": {"credits_used": 3, "points": 3, "credit_cost": 5}}),
            json!({"usage": {"cost": -0.5}}),
            json!({"usage": {"cost": "NaN"}}),
            json!({"usage": {"cost": 1e9}}),
            json!({"usage": {"cost": null}}),
            json!({"usage": {"cost_in_usd_ticks": -4}}),
            json!({"usage": {"cost_usd_input": 0.5}}),
            json!({"cost": 0.5, "total_cost_of_key_usd": 3}),
        ] {
            assert_eq!(dollars(&body), None, "{body}");
        }
    }

    #[test]
    fn headers_with_the_cost_of_the_response_are_read() {
        for (name, value, expected) in [
            ("x-litellm-response-cost", "0.13", Some(0.13)),
            ("x-litellm-response-cost", "2.6e-05", Some(2.6e-5)),
            ("x-litellm-response-cost", "None", None),
            ("x-litellm-response-cost", "-1", None),
            ("x-litellm-key-spend", "7.5", None),
            ("x-total-cost-usd", "7.5", None),
            ("x-gateway-request-cost-usd", "0.25", Some(0.25)),
        ] {
            let mut headers = HeaderMap::new();
            headers.insert(name, value.parse().unwrap());
            let found = cost_in_headers(&headers).map(StatedCost::dollars);
            assert_eq!(found, expected, "{name}: {value}");
        }
    }

    #[test]
    fn tiers_are_read() {
        for (body, expected) in [
            (json!({"service_tier": "priority"}), Some(ServiceTier::Priority)),
            (json!({"service_tier": "default"}), Some(ServiceTier::Standard)),
            (json!({"service_tier": null}), None),
            (json!({"usage": {"service_tier": "standard"}}), Some(ServiceTier::Standard)),
            (json!({"usage": {"service_tier": "batch"}}), None),
            (json!({"service_tier": "turbo"}), Some(ServiceTier::Other)),
        ] {
            assert_eq!(tier(&body), expected, "{body}");
        }
    }
}
