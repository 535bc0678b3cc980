//! Parser for the wait in a server's error message: [`wait_in_words`], and in one field of an error: [`wait_in_field`].

use std::sync::LazyLock;

use jiff::{Span, Timestamp};
use regex::Regex;
use tokio::time::Duration;

/// Words that mark a sentence as being about a wait, in lower case.
const WAIT_PHRASES: [&str; 25] = [
    "try again",
    "retry",
    "wait",
    "available",
    "replenish",
    "reset",
    "renew",
    "refill",
    "restore",
    // Chinese, Japanese, Korean
    "重试",
    "再试",
    "等待",
    "恢复",
    "重置",
    "再試行",
    "お待ち",
    "다시 시도",
    // Spanish, French, German, Portuguese, Italian, Russian
    "inténte",
    "intente",
    "réessay",
    "erneut",
    "versuchen",
    "tente novamente",
    "riprova",
    "повтор",
];

/// Pattern of one number with a unit, in English and in the languages of [`WAIT_PHRASES`].
const NUMBER_WITH_UNIT: &str = r"(\d+(?:[.,]\d+)?)\s*(milliseconds?|ms|minut(?:es?|os?|en|i)|mins?|минут\w*|hours?|hrs?|heures?|horas?|stunden?|час\w*|days?|jours?|días?|tagen?|seconds?|secs?|sekunden?|segundos?|secondes?|secondi|секунд\w*|分钟|分鐘|小时|小時|時間|시간|秒|초|분|分|天|d|h|m|s)";

/// Matches a preposition and the duration that follows, such as `1h2m3.5s`, `250ms`, `6 seconds` or `1 minute and 3
/// seconds`. Group 1 is the duration.
static DURATION: LazyLock<Regex> = LazyLock::new(|| {
    compiled(&format!(
        r"(?i)\b(?:in|after|for|within|wait|retry-after:?|en|dans|nach|em|tra|fra|через)\s+(?:about\s+)?((?:{NUMBER_WITH_UNIT}[,\s]*(?:and\s+)?)+)"
    ))
});

/// Matches a duration with Chinese, Japanese or Korean units, which need no preposition. Group 1 is the duration.
static CJK_DURATION: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"((?:\d+(?:\.\d+)?\s*(?:分钟|分鐘|小时|小時|時間|시간|秒|초|분|分|天)\s*)+)"));

/// Matches one number and its unit. Group 1 is the number, group 2 the unit.
static NUMBER_AND_UNIT: LazyLock<Regex> = LazyLock::new(|| compiled(&format!("(?i){NUMBER_WITH_UNIT}")));

/// Matches a duration such as `00:12:34`, or `1.02:03:04` with days, behind a preposition. The groups are days, hours,
/// minutes and seconds.
static CLOCK: LazyLock<Regex> = LazyLock::new(|| {
    compiled(r"(?i)\b(?:in|after|for|within|wait|retry-after:?)\s+(?:(\d+)\.)?(\d{1,3}):([0-5]\d):([0-5]\d)\b")
});

/// Matches a duration of ISO 8601, such as `PT12M`.
static ISO_DURATION: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"\bP(?:\d+D)?(?:T(?:\d+H)?(?:\d+M)?(?:\d+(?:\.\d+)?S)?)?\b"));

/// Matches a number of seconds without a unit, as in `Retry-After: 754`. Group 1 is the number.
static BARE_SECONDS: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)\bretry[-_ ]?after\s*[:=]\s*(\d+(?:\.\d+)?)(?:[\s.,;)]|$)"));

/// Matches a point in time with its zone, of RFC 3339 or in seconds or milliseconds since 1970, behind a preposition.
/// Group 1 is the time.
static MOMENT: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\b(?:at|until|after|on|is|by)\s*:?\s*(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d+)?\s?(?:Z|UTC|GMT|[+-]\d\d:?\d\d)|1\d{9}(?:\d{3})?)\b",
    )
});

/// Matches the end of a sentence, but not the decimal point in `6.5s`.
static SENTENCE_END: LazyLock<Regex> = LazyLock::new(|| compiled(r"[.!?]\s|[。！？\n]"));

fn compiled(pattern: &str) -> Regex {
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
}

/// Returns the longest wait stated in a text, such as “Please try again in 7m12s.”
///
/// Only sentences with one of [`WAIT_PHRASES`] are searched. `None` if no wait is found.
pub(crate) fn wait_in_words(text: &str) -> Option<Duration> {
    wait_in_words_at(text, Timestamp::now())
}

/// The same at a given time, from which the wait until a stated moment is counted.
fn wait_in_words_at(text: &str, now: Timestamp) -> Option<Duration> {
    SENTENCE_END
        .split(text)
        .filter(|sentence| {
            let sentence = sentence.to_lowercase();
            WAIT_PHRASES.iter().any(|phrase| sentence.contains(phrase))
        })
        .filter_map(|sentence| wait_in_sentence(sentence, now))
        .max()
}

/// Longest wait in a sentence, in any form.
fn wait_in_sentence(sentence: &str, now: Timestamp) -> Option<Duration> {
    let durations = DURATION
        .captures_iter(sentence)
        .filter_map(|captures| captures.get(1))
        .filter(|found| {
            // Skip a match that ends inside a word: “in 2 months” is not two minutes.
            let next_char = sentence[found.end()..].chars().next();
            found.as_str().ends_with(char::is_whitespace) || !next_char.is_some_and(char::is_alphabetic)
        })
        .chain(CJK_DURATION.find_iter(sentence))
        .filter_map(|found| parse_duration(found.as_str()));
    let clocks = CLOCK.captures_iter(sentence).filter_map(|captures| {
        let part = |group: usize| captures.get(group).and_then(|part| part.as_str().parse().ok());
        let [days, hours, minutes, seconds] = [1, 2, 3, 4].map(|group| part(group).unwrap_or(0_u64));
        nonzero(Duration::from_secs(days * 86_400 + hours * 3600 + minutes * 60 + seconds))
    });
    let iso = ISO_DURATION.find_iter(sentence).filter_map(|found| iso_duration(found.as_str()));
    let bare = BARE_SECONDS.captures_iter(sentence).filter_map(|captures| seconds(&captures[1]));
    let moments = MOMENT.captures_iter(sentence).filter_map(|captures| until(&captures[1], now));
    durations.chain(clocks).chain(iso).chain(bare).chain(moments).max()
}

/// Wait in a field of an error or a header embedded in it, by its name: `retry_after`, `retryAfterMs`,
/// `estimated_time`, `reset_at`. A value is a number of seconds (milliseconds if the name ends so), a duration or a
/// moment. `None` for other fields and without a wait.
pub(crate) fn wait_in_field(name: &str, value: &str) -> Option<Duration> {
    wait_in_field_at(name, value, Timestamp::now())
}

fn wait_in_field_at(name: &str, value: &str, now: Timestamp) -> Option<Duration> {
    let name: String = name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect();
    let is_wait = ["retryafter", "retrydelay", "retryin", "waitseconds", "estimatedtime", "resetafter", "resetin"]
        .iter()
        .any(|known| name.contains(known));
    let is_moment = name.contains("resetat") || name.contains("resetsat") || name.ends_with("reset");
    let value = value.trim();
    if !(is_wait || is_moment) {
        return None;
    }
    if let Some(wait) = until(value, now) {
        return Some(wait);
    }
    // A small number in a field for a moment may be anything.
    let number = seconds(value).filter(|_| is_wait);
    let in_milliseconds = name.ends_with("ms") || name.ends_with("milliseconds");
    number
        .map(|wait| if in_milliseconds { wait / 1000 } else { wait })
        .or_else(|| iso_duration(value))
        .or_else(|| is_duration(value).then(|| parse_duration(value)).flatten())
}

/// True for a text of numbers with units only.
fn is_duration(text: &str) -> bool {
    NUMBER_AND_UNIT.replace_all(text, "").trim().is_empty()
}

/// Time from `now` until a moment; `None` if it is no moment or not in the future.
fn until(moment: &str, now: Timestamp) -> Option<Duration> {
    let moment = moment.trim();
    let timestamp = match moment.parse::<i64>() {
        Ok(number) if (1_000_000_000..10_000_000_000).contains(&number) => Timestamp::from_second(number).ok()?,
        Ok(number) if (1_000_000_000_000..10_000_000_000_000).contains(&number) => {
            Timestamp::from_millisecond(number).ok()?
        }
        Ok(_) => return None,
        Err(_) => {
            let zoned = ["UTC", "GMT"]
                .iter()
                .find_map(|zone| moment.strip_suffix(zone))
                .map_or_else(|| moment.to_owned(), |local| format!("{}Z", local.trim_end()));
            zoned.parse().ok()?
        }
    };
    let wait = timestamp.duration_since(now);
    Duration::try_from(wait).ok().and_then(nonzero)
}

fn iso_duration(text: &str) -> Option<Duration> {
    if !text.starts_with('P') || !text.contains(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let span: Span = text.parse().ok()?;
    // A day has 24 hours here.
    let seconds = span.total(jiff::SpanTotal::from(jiff::Unit::Second).days_are_24_hours());
    Duration::try_from_secs_f64(seconds.ok()?).ok().and_then(nonzero)
}

/// Parses a positive number of seconds.
fn seconds(text: &str) -> Option<Duration> {
    Duration::try_from_secs_f64(text.parse().ok()?).ok().and_then(nonzero)
}

fn nonzero(wait: Duration) -> Option<Duration> {
    (!wait.is_zero()).then_some(wait)
}

/// Adds up the numbers with units in a text. `None` if the sum is zero or does not fit into a [`Duration`].
fn parse_duration(text: &str) -> Option<Duration> {
    let seconds: f64 = NUMBER_AND_UNIT
        .captures_iter(text)
        .filter_map(|part| {
            let number: f64 = part[1].replace(',', ".").parse().ok()?;
            let unit = part[2].to_lowercase();
            Some(number * seconds_per(&unit))
        })
        .sum();
    Duration::try_from_secs_f64(seconds).ok().and_then(nonzero)
}

/// Length of a unit in seconds. The unit is in lower case and matched by [`NUMBER_AND_UNIT`].
fn seconds_per(unit: &str) -> f64 {
    let begins = |starts: &[&str]| starts.iter().any(|start| unit.starts_with(start));
    if unit == "ms" || begins(&["milli"]) {
        1e-3
    } else if begins(&["d", "jour", "tag", "天"]) {
        86_400.0
    } else if begins(&["h", "stund", "час", "小", "時", "시"]) {
        3600.0
    } else if begins(&["m", "мин", "分", "분"]) {
        60.0
    } else {
        1.0
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
            ("Out of call volume quota. Quota will be replenished in 00:12:34.", 754.0),
            ("Quota resets in 1.00:00:10.", 86_410.0),
            ("Quota will be renewed in 754 seconds", 754.0),
            ("Try again after PT12M.", 720.0),
            ("Please wait 45 seconds before the next request", 45.0),
            ("Rate limited (Retry-After: 754)", 754.0),
            ("The limit resets at 2026-11-29T10:00:30Z.", 30.0),
            ("Retry after 2026-11-29 11:01:00+01:00", 60.0),
            ("Available again at 2026-11-29 10:02:00 UTC", 120.0),
            ("limit reached, reset at: 1795946430", 30.0),
            ("请求过于频繁，请在 30 秒后重试", 30.0),
            ("请 2 分钟后再试。", 120.0),
            ("Bitte versuchen Sie es in 20 Sekunden erneut.", 20.0),
            ("Veuillez réessayer dans 2 minutes.", 120.0),
            ("Inténtelo de nuevo en 1,5 horas", 5400.0),
            ("30秒後に再試行してください", 30.0),
        ] {
            let now = "2026-11-29T10:00:00Z".parse().unwrap();
            let found = wait_in_words_at(text, now).map(|wait| wait.as_secs_f64());
            assert!(found.is_some_and(|found| (found - seconds).abs() < 1e-9), "{text}: {found:?}");
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
            "Try again; the answer came at 12:30:00",
            "The limit was reset at 2001-01-01T00:00:00Z.",
            "Retry the Prompt",
        ] {
            assert_eq!(wait_in_words(text), None, "{text}");
        }
    }

    #[test]
    fn waits_in_fields_are_found() {
        let now = "2026-11-29T10:00:00Z".parse().unwrap();
        for (name, value, seconds) in [
            ("retryDelay", "33s", Some(33.0)),
            ("retry_after", "754", Some(754.0)),
            ("Retry-After-Ms", "1500", Some(1.5)),
            ("retry_after_seconds", "0.5", Some(0.5)),
            ("estimated_time", "20.5", Some(20.5)),
            ("reset_at", "2026-11-29T10:00:30Z", Some(30.0)),
            ("X-RateLimit-Reset", "1795946460000", Some(60.0)),
            ("X-RateLimit-Reset", "7m12s", Some(432.0)),
            ("retryAfter", "PT1M", Some(60.0)),
            ("X-RateLimit-Reset", "3", None),
            ("retry_after", "0", None),
            ("retry_after", "-5", None),
            ("reset_at", "2026-11-29T09:00:00Z", None),
            ("preset", "x", None),
            ("created", "1795946460", None),
        ] {
            let found = wait_in_field_at(name, value, now).map(|wait| wait.as_secs_f64());
            assert_eq!(found, seconds, "{name}: {value}");
        }
    }
}
