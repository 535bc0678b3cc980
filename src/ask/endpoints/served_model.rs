//! The model that served a reply, from the headers of gateways: [`served_model`].

use reqwest::header::HeaderMap;

/// Headers of gateways with the number of fallbacks, or the index of the route taken; 0 is the first choice.
///
/// Sources: LiteLLM's and Cloudflare AI Gateway's documentation of response headers.
const STEP_HEADERS: [&str; 1] = ["cf-aig-step"];

/// Headers with the name of the model that a gateway fell back to, then those with the id of its deployment.
const NAME_HEADERS: [&str; 2] = ["x-litellm-model-group", "x-litellm-model-name"];
const ID_HEADERS: [&str; 1] = ["x-litellm-model-id"];

/// Name of the model that served a reply: `named`, the one in the body, unless the headers state that a gateway fell
/// back to another model and the body repeats the name `asked`.
pub(super) fn served_model(headers: &HeaderMap, asked: &str, named: Option<String>) -> Option<String> {
    let repeats_name = named.as_deref().is_none_or(|named| named == asked);
    if !repeats_name || !is_fallback(headers) {
        return named;
    }
    let first = |names: &[&str]| {
        names
            .iter()
            .filter_map(|name| headers.get(*name)?.to_str().ok())
            .map(str::trim)
            .find(|text| !text.is_empty() && *text != asked)
            .map(str::to_owned)
    };
    first(&NAME_HEADERS)
        .or_else(|| Some(format!("{asked} (fallback, deployment {})", first(&ID_HEADERS)?)))
        .or_else(|| Some(format!("{asked} (fallback)")))
}

/// True if a header states a fallback: its name contains the word, or it is in [`STEP_HEADERS`], and its value is a
/// number above 0 or `true`.
fn is_fallback(headers: &HeaderMap) -> bool {
    headers.iter().any(|(name, value)| {
        let name = name.as_str();
        let is_count = name.contains("fallback") || STEP_HEADERS.contains(&name);
        let value = value.to_str().unwrap_or_default().trim();
        let is_positive = value.parse::<u32>().is_ok_and(|count| count > 0);
        is_count && (is_positive || value.eq_ignore_ascii_case("true"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn served(pairs: &[(&'static str, &str)], named: &str) -> Option<String> {
        let headers = pairs.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap())).collect();
        served_model(&headers, "gpt-4o", Some(named.to_owned()))
    }

    #[test]
    fn fallbacks_of_gateways_are_named() {
        let attempted = ("x-litellm-attempted-fallbacks", "1");
        for (pairs, expected) in [
            (vec![attempted, ("x-litellm-model-group", "gpt-4o-mini")], "gpt-4o-mini"),
            (
                vec![attempted, ("x-litellm-model-group", "gpt-4o"), ("x-litellm-model-id", "3f2a")],
                "gpt-4o (fallback, deployment 3f2a)",
            ),
            (vec![("helicone-fallback-index", "2")], "gpt-4o (fallback)"),
            (vec![("cf-aig-step", "1")], "gpt-4o (fallback)"),
        ] {
            assert_eq!(served(&pairs, "gpt-4o").as_deref(), Some(expected));
        }
        let named = served(&[attempted], "gpt-4o-mini");
        assert_eq!(named.as_deref(), Some("gpt-4o-mini"), "the body names it");
    }

    #[test]
    fn first_choices_keep_their_name() {
        for pairs in [
            vec![
                ("x-litellm-attempted-fallbacks", "0"),
                ("x-litellm-attempted-retries", "2"),
                ("x-litellm-model-group", "gpt-4o"),
                ("x-litellm-model-id", "3f2a"),
            ],
            vec![("cf-aig-step", "0")],
            vec![("x-fallbacks", "none")],
            vec![],
        ] {
            assert_eq!(served(&pairs, "gpt-4o").as_deref(), Some("gpt-4o"));
        }
    }
}
