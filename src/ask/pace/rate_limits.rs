//! Rate limits that a server reports in its response headers: [`RateLimits`].

use std::time::{Duration, SystemTime};

use jiff::{SignedDuration, Timestamp};
use reqwest::header::HeaderMap;

/// Maximum time until the reset of a limit that spaces requests; chosen. Limits per minute reset within a minute. A
/// limit per hour or day is a budget: requests need not be spread over the rest of the day.
const MAX_PERIOD: Duration = Duration::from_mins(2);

/// One rate limit, in requests or in tokens.
#[derive(Debug, Clone, Copy, PartialEq)]
struct RateLimit {
    /// Maximum per period; `None` if the server does not report it.
    limit: Option<f64>,
    /// Amount left.
    remaining: f64,
    /// Time until the limit is full again.
    reset: Duration,
}

/// Rate limits on requests and on tokens; `None` if the server does not report them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct RateLimits {
    requests: Option<RateLimit>,
    tokens: Option<RateLimit>,
}

/// Advice for the next requests, from the rate limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PaceAdvice {
    Nothing,
    /// Leave this much time between requests.
    Spacing(Duration),
    /// Send no request for this time.
    Pause(Duration),
}

impl RateLimits {
    /// Reads the response headers `x-ratelimit-{limit,remaining,reset}-{requests,tokens}` (OpenAI and compatible
    /// servers), `x-ratelimit-{limit,remaining,reset}` (OpenRouter, for requests) and
    /// `anthropic-ratelimit-{requests,tokens}-{limit,remaining,reset}`. A limit without `remaining` or `reset` is
    /// ignored.
    pub(crate) fn read(headers: &HeaderMap, now: SystemTime) -> Self {
        let limit_on = |kind: &str| {
            rate_limit(headers, now, &|field| format!("x-ratelimit-{field}-{kind}"))
                .or_else(|| rate_limit(headers, now, &|field| format!("anthropic-ratelimit-{kind}-{field}")))
        };
        Self {
            requests: limit_on("requests")
                .or_else(|| rate_limit(headers, now, &|field| format!("x-ratelimit-{field}"))),
            tokens: limit_on("tokens"),
        }
    }

    /// Time until every exhausted limit has reset; `None` if no limit is exhausted.
    pub(crate) fn pause(&self) -> Option<Duration> {
        [self.requests, self.tokens]
            .into_iter()
            .flatten()
            .filter(|limit| limit.remaining < 1.0 && !limit.reset.is_zero())
            .map(|limit| limit.reset)
            .max()
    }

    /// Advice for requests of `tokens` tokens each; the stricter limit decides.
    pub(super) fn advice(&self, tokens: f64) -> PaceAdvice {
        let requests = self.requests.map_or(PaceAdvice::Nothing, |limit| limit.advice(1.0));
        let tokens = self.tokens.map_or(PaceAdvice::Nothing, |limit| limit.advice(tokens));
        match (requests, tokens) {
            (PaceAdvice::Pause(a), PaceAdvice::Pause(b)) => PaceAdvice::Pause(a.max(b)),
            (PaceAdvice::Spacing(a), PaceAdvice::Spacing(b)) => PaceAdvice::Spacing(a.max(b)),
            (PaceAdvice::Pause(wait), _) | (_, PaceAdvice::Pause(wait)) => PaceAdvice::Pause(wait),
            (PaceAdvice::Spacing(wait), _) | (_, PaceAdvice::Spacing(wait)) => PaceAdvice::Spacing(wait),
            (PaceAdvice::Nothing, PaceAdvice::Nothing) => PaceAdvice::Nothing,
        }
    }
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name)?.to_str().ok().map(str::trim)
}

/// Reads a rate limit; `name` makes the name of a header from its field.
fn rate_limit(headers: &HeaderMap, now: SystemTime, name: &dyn Fn(&str) -> String) -> Option<RateLimit> {
    let number = |field| text(headers, &name(field))?.parse::<f64>().ok();
    let remaining = number("remaining").filter(|n| n.is_finite())?;
    Some(RateLimit {
        limit: number("limit").filter(|n| n.is_finite() && *n > 0.0),
        remaining: remaining.max(0.0),
        reset: time_until_reset(text(headers, &name("reset"))?, now)?,
    })
}

impl RateLimit {
    /// Advice for requests that each use `cost` of the limit: none above half of the limit, or if the limit resets
    /// after more than [`MAX_PERIOD`]; otherwise the remaining amount is spread evenly over the time until reset.
    ///
    /// If the limit refills continuously (OpenAI), requests at half of the limit match the refill rate, and slow down
    /// below, so the remaining amount settles at half. If it refills at the end of each minute, the remaining amount
    /// lasts until then.
    fn advice(self, cost: f64) -> PaceAdvice {
        if self.reset.is_zero() || self.limit.is_some_and(|limit| self.remaining > limit / 2.0) {
            return PaceAdvice::Nothing;
        }
        if self.remaining < cost {
            return PaceAdvice::Pause(self.reset);
        }
        if self.reset > MAX_PERIOD {
            return PaceAdvice::Nothing;
        }
        let spacing = self.reset.as_secs_f64() * cost / self.remaining;
        PaceAdvice::Spacing(Duration::try_from_secs_f64(spacing).unwrap_or(Duration::MAX))
    }
}

/// Smallest number that is a Unix timestamp in seconds; smaller numbers are durations in seconds.
const MIN_TIMESTAMP: f64 = 1e9;

/// Time until a reset, from a duration (`6m0s`, `17ms` or seconds) or a date (RFC 3339, or a Unix timestamp in seconds
/// or milliseconds); zero for a date in the past, `None` for any other text.
fn time_until_reset(text: &str, now: SystemTime) -> Option<Duration> {
    if let Ok(number) = text.parse::<f64>() {
        let seconds =
            Duration::try_from_secs_f64(if number >= MIN_TIMESTAMP * 1e3 { number / 1e3 } else { number }).ok()?;
        return if number >= MIN_TIMESTAMP {
            SystemTime::UNIX_EPOCH.checked_add(seconds).map(|date| time_until(now, date))
        } else {
            Some(seconds)
        };
    }
    if let Ok(date) = text.parse::<Timestamp>() {
        return Some(time_until(now, date.into()));
    }
    text.parse::<SignedDuration>().ok()?.try_into().ok()
}

fn time_until(now: SystemTime, date: SystemTime) -> Duration {
    date.duration_since(now).unwrap_or(Duration::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: u64 = 1_767_225_600; // 2026-01-01T00:00:00Z

    fn read(pairs: &[(&'static str, &str)]) -> RateLimits {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.insert(*name, value.parse().unwrap());
        }
        RateLimits::read(&headers, SystemTime::UNIX_EPOCH + Duration::from_secs(NOW))
    }

    #[test]
    fn reset_times_of_every_form_are_parsed() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(NOW);
        for (text, ms) in [
            ("6m0s", Some(360_000)),
            ("17ms", Some(17)),
            ("1h2m3.5s", Some(3_723_500)),
            ("2", Some(2000)),
            ("0.25", Some(250)),
            ("2026-01-01T00:00:05Z", Some(5000)),
            ("2025-01-01T00:00:05Z", Some(0)),
            ("1767225602", Some(2000)),
            ("1767225602000", Some(2000)),
            ("", None),
            ("soon", None),
            ("5x", None),
            ("-3s", None),
            ("5m3", None),
            ("NaN", None),
            ("inf", None),
        ] {
            assert_eq!(time_until_reset(text, now), ms.map(Duration::from_millis), "{text}");
        }
    }

    fn openai(remaining: &'static str, reset: &'static str) -> PaceAdvice {
        read(&[
            ("x-ratelimit-limit-requests", "500"),
            ("x-ratelimit-remaining-requests", remaining),
            ("x-ratelimit-reset-requests", reset),
        ])
        .advice(1000.0)
    }

    #[test]
    fn remaining_requests_are_spread_until_reset() {
        assert_eq!(openai("499", "120ms"), PaceAdvice::Nothing);
        // 250 left of 500 a minute: the spacing matches the refill rate, one request in 120 ms.
        assert_eq!(openai("250", "30s"), PaceAdvice::Spacing(Duration::from_millis(120)));
        assert_eq!(openai("100", "48s"), PaceAdvice::Spacing(Duration::from_millis(480)));
        assert_eq!(openai("0", "1m0s"), PaceAdvice::Pause(Duration::from_mins(1)));
    }

    #[test]
    fn remaining_tokens_are_spread_until_reset() {
        let tokens = read(&[
            ("anthropic-ratelimit-tokens-limit", "40000"),
            ("anthropic-ratelimit-tokens-remaining", "10000"),
            ("anthropic-ratelimit-tokens-reset", "2026-01-01T00:00:30Z"),
        ]);
        assert_eq!(tokens.advice(1000.0), PaceAdvice::Spacing(Duration::from_secs(3)));
        assert_eq!(tokens.advice(20_000.0), PaceAdvice::Pause(Duration::from_secs(30)));
    }

    #[test]
    fn daily_limits_space_no_requests() {
        let groq = |remaining: &'static str, reset: &'static str| {
            read(&[
                ("x-ratelimit-limit-requests", "14400"),
                ("x-ratelimit-remaining-requests", remaining),
                ("x-ratelimit-reset-requests", reset),
                ("x-ratelimit-limit-tokens", "30000"),
                ("x-ratelimit-remaining-tokens", "29000"),
                ("x-ratelimit-reset-tokens", "2s"),
            ])
            .advice(1000.0)
        };
        assert_eq!(groq("14370", "2m59.56s"), PaceAdvice::Nothing);
        assert_eq!(groq("5000", "15h40m0s"), PaceAdvice::Nothing);
        assert_eq!(groq("3", "23h59m42s"), PaceAdvice::Nothing);
        let none = Duration::from_hours(24);
        assert_eq!(groq("0", "24h0m0s"), PaceAdvice::Pause(none));
        // The same numbers as a limit per minute.
        assert_eq!(groq("100", "50s"), PaceAdvice::Spacing(Duration::from_millis(500)));
    }

    #[test]
    fn limit_without_reset_is_ignored() {
        assert_eq!(
            read(&[("x-ratelimit-limit-requests", "500"), ("x-ratelimit-remaining-requests", "400")]),
            RateLimits::default()
        );
    }
}
