//! Parser for the wait in a server's error message: [`wait_in_words`].

use std::sync::LazyLock;

use regex::Regex;
use tokio::time::Duration;

/// Phrases that mark a sentence as being about a wait, in lower case.
const WAIT_PHRASES: [&str; 4] = ["try again", "retry", "wait", "available"];

/// Matches “in”, “after” or “for” and the duration that follows, such as `1h2m3.5s`, `250ms`, `6 seconds` or
/// `1 minute and 3 seconds`. Group 1 is the duration.
static DURATION: LazyLock<Regex> = LazyLock::new(|| {
    let pattern = r"(?i)\b(?:in|after|for)\s+(?:about\s+)?((?:\d+(?:\.\d+)?\s*(?:milliseconds?|ms|minutes?|mins?|hours?|days?|seconds?|secs?|d|h|m|s)[,\s]*(?:and\s+)?)+)";
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// Matches one number and its unit. Group 1 is the number, group 2 the unit.
static NUMBER_AND_UNIT: LazyLock<Regex> = LazyLock::new(|| {
    let pattern = r"(?i)(\d+(?:\.\d+)?)\s*(milliseconds?|ms|minutes?|mins?|hours?|days?|seconds?|secs?|d|h|m|s)";
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// Matches the end of a sentence, but not the decimal point in `6.5s`.
static SENTENCE_END: LazyLock<Regex> = LazyLock::new(|| {
    Regex::new(r"[.!?]\s|\n").unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
});

/// Returns the longest wait stated in a text, such as “Please try again in 7m12s.”
///
/// Only sentences with one of [`WAIT_PHRASES`] are searched. `None` if no wait is found.
pub(in crate::ask) fn wait_in_words(text: &str) -> Option<Duration> {
    SENTENCE_END
        .split(text)
        .filter(|sentence| {
            let sentence = sentence.to_lowercase();
            WAIT_PHRASES.iter().any(|phrase| sentence.contains(phrase))
        })
        .flat_map(|sentence| {
            DURATION.captures_iter(sentence).filter_map(|captures| {
                let found = captures.get(1)?;
                // Skip a match that ends inside a word: “in 2 months” is not two minutes.
                let next_char = sentence[found.end()..].chars().next();
                let ends_inside_word = !found.as_str().ends_with(char::is_whitespace)
                    && next_char.is_some_and(char::is_alphabetic);
                (!ends_inside_word)
                    .then(|| parse_duration(found.as_str()))
                    .flatten()
            })
        })
        .max()
}

/// Adds up the numbers with units in a text. `None` if the sum is zero or does not fit into a [`Duration`].
fn parse_duration(text: &str) -> Option<Duration> {
    let seconds: f64 = NUMBER_AND_UNIT
        .captures_iter(text)
        .filter_map(|part| {
            let number: f64 = part[1].parse().ok()?;
            let unit = part[2].to_lowercase();
            Some(number * seconds_per(&unit))
        })
        .sum();
    let wait = Duration::try_from_secs_f64(seconds).ok()?;
    (!wait.is_zero()).then_some(wait)
}

/// Length of a unit in seconds. The unit is in lower case and matched by [`NUMBER_AND_UNIT`].
fn seconds_per(unit: &str) -> f64 {
    match unit {
        "ms" | "millisecond" | "milliseconds" => 1e-3,
        unit if unit.starts_with('d') => 86_400.0,
        unit if unit.starts_with('h') => 3600.0,
        unit if unit.starts_with('m') => 60.0,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_waits_in_every_form() {
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
            ("Please try again in 1 day and 2 hours.", 93_600.0),
            ("Retry in 5s. Retry in 9s.", 9.0),
        ] {
            let found = wait_in_words(text).map(|wait| wait.as_secs_f64());
            assert!(
                found.is_some_and(|found| (found - seconds).abs() < 1e-9),
                "{text}: {found:?}"
            );
        }
    }

    #[test]
    fn ignores_texts_without_a_wait() {
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
