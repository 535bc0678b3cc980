//! The wait that a server states in words: [`wait_in_words`].

use std::sync::LazyLock;

use regex::Regex;
use tokio::time::Duration;

/// Words of a sentence that is about a wait.
const ABOUT_WAITS: [&str; 4] = ["try again", "retry", "wait", "available"];

/// A duration behind “in”, “after” or “for”, as `1h2m3.5s`, `250ms`, `6 seconds` or `1 minute and 3 seconds`.
static DURATION: LazyLock<Regex> = LazyLock::new(|| {
    let pattern = r"(?i)\b(?:in|after|for)\s+(?:about\s+)?((?:\d+(?:\.\d+)?\s*(?:milliseconds?|ms|minutes?|mins?|hours?|seconds?|secs?|h|m|s)[,\s]*(?:and\s+)?)+)";
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// One number with its unit.
static PART: LazyLock<Regex> = LazyLock::new(|| {
    let pattern =
        r"(?i)(\d+(?:\.\d+)?)\s*(milliseconds?|ms|minutes?|mins?|hours?|seconds?|secs?|h|m|s)";
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// The end of a sentence; the point of `6.5s` is none.
static SENTENCE_END: LazyLock<Regex> = LazyLock::new(|| {
    Regex::new(r"[.!?]\s|\n").unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// The longest wait in the sentences of a text that are about one, as in “Please try again in 7m12s.”
pub(in crate::ask) fn wait_in_words(text: &str) -> Option<Duration> {
    SENTENCE_END
        .split(text)
        .filter(|sentence| {
            let sentence = sentence.to_lowercase();
            ABOUT_WAITS.iter().any(|words| sentence.contains(words))
        })
        .flat_map(|sentence| {
            DURATION.captures_iter(sentence).filter_map(|found| {
                let found = found.get(1)?;
                // “in 2 months” is not two minutes.
                let behind = sentence[found.end()..].chars().next();
                let is_cut = !found.as_str().ends_with(char::is_whitespace)
                    && behind.is_some_and(char::is_alphabetic);
                (!is_cut).then(|| duration(found.as_str())).flatten()
            })
        })
        .max()
}

/// The sum of all parts of a duration; `None` if it is zero or too long.
fn duration(text: &str) -> Option<Duration> {
    let seconds: f64 = PART
        .captures_iter(text)
        .filter_map(|part| {
            let number: f64 = part[1].parse().ok()?;
            let unit = part[2].to_lowercase();
            Some(number * seconds_of(&unit))
        })
        .sum();
    let wait = Duration::try_from_secs_f64(seconds).ok()?;
    (!wait.is_zero()).then_some(wait)
}

fn seconds_of(unit: &str) -> f64 {
    match unit {
        "ms" | "millisecond" | "milliseconds" => 1e-3,
        unit if unit.starts_with('h') => 3600.0,
        unit if unit.starts_with('m') => 60.0,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_of_every_form_are_read() {
        for (text, seconds) in [
            (
                "Rate limit reached for m … (TPM): Limit 30000, Used 29000, Requested 2000. Please try again in 2s. Visit x.",
                2.0,
            ),
            ("Please try again in 6ms.", 0.006),
            ("Please try again in 7m12s.", 432.0),
            ("try again in 1h2m3.5s", 3723.5),
            ("try again in 17.359s. Need more tokens?", 17.359),
            ("Please retry in 34.0773s.", 34.0773),
            ("Please retry after 6 seconds.", 6.0),
            ("Please wait for 1 minute and 3 seconds", 63.0),
            ("The model will be available in 20 secs", 20.0),
            ("RETRY AFTER 250 ms", 0.25),
            ("Retry in 5s. Retry in 9s.", 9.0),
        ] {
            let found = wait_in_words(text).map(|wait| wait.as_secs_f64());
            assert!(
                found.is_some_and(|found| (found - seconds).abs() < 1e-9),
                "{text}: {found:?}"
            );
        }
        for text in [
            "",
            "Limit 30000 in 60 s was used up.",
            "try again in -5s",
            "try again in 0s",
            "try again in inf",
            "try again in 2 months",
            "try again later",
            "retry in 1e300s",
            "You are limited to 20 requests in 1 minute. Come back later.",
        ] {
            assert_eq!(wait_in_words(text), None, "{text}");
        }
    }
}
