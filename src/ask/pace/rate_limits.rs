//! Rate limits that a server reports in its response headers: [`RateLimits`].
//!
//! The user's limits per minute ([`Quota`]), and the requests of the last minute that count toward them
//! ([`QuotaWindow`]).
//!
//! The wait that a server asks for in its response headers: [`retry_after`].

use std::collections::VecDeque;
use std::num::NonZeroU32;
use std::time::{Duration, SystemTime};

use clap::Args;
use jiff::{SignedDuration, Timestamp};
use reqwest::header::{DATE, HeaderMap, RETRY_AFTER};
use tokio::time::Instant;

use darkqa_base::types::Decides;

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

/// The user's limits per minute; `None` for no limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Args)]
#[command(next_help_heading = "Sending")]
pub struct Quota {
    /// Maximum requests in any 60 seconds, retries included; default: no limit
    #[arg(id = "rpm", long, value_name = "N", add = Decides::Nothing)]
    pub requests: Option<NonZeroU32>,
    /// Maximum tokens in any 60 seconds, prompts and replies; default: no limit
    #[arg(id = "tpm", long, value_name = "N", add = Decides::Nothing)]
    pub tokens: Option<NonZeroU32>,
}

/// Length of the sliding window of a quota: one minute, plus half a second of tolerance for clock and network
/// differences.
const WINDOW: Duration = Duration::from_millis(60_500);

/// Assumed number of tokens of a request until a reply reports one: an image and a letter.
pub(super) const INITIAL_TOKENS: f64 = 1200.0;

/// Maximum number of tokens of a request. A server that reports more is wrong; its number is cut to this one.
pub(super) const MAX_TOKENS: f64 = 1e7;

/// Sliding window of the requests and tokens of the last minute.
///
/// In any 60 seconds of a run at most the quota is sent, whether or not requests fail. Quota that a pause leaves unused
/// is lost.
#[derive(Debug)]
pub(super) struct QuotaWindow {
    quota: Quota,
    /// Requests of the last [`WINDOW`].
    sent: VecDeque<SentRequest>,
    /// Sum of the tokens of these requests.
    tokens: f64,
    /// Largest number of tokens reported for a request so far; `None` before the first.
    largest: Option<f64>,
    /// Earliest time of the next request, so that requests are spread evenly over the minute.
    next_at: Instant,
}

/// A request in the window.
#[derive(Debug, Clone, Copy)]
struct SentRequest {
    at: Instant,
    tokens: f64,
    /// True if the reply reported the tokens; false if they are an estimate.
    is_reported: bool,
}

impl QuotaWindow {
    pub(super) fn new(quota: Quota, now: Instant) -> Self {
        Self { quota, sent: VecDeque::new(), tokens: 0.0, largest: None, next_at: now }
    }

    /// Half of the quota on requests, in requests per second; 0 without a quota. A learned rate need not be lower.
    pub(super) fn half_rate(quota: Quota) -> f64 {
        quota.requests.map_or(0.0, |max| f64::from(max.get()) / 120.0)
    }

    /// Earliest time at which the next request may be sent.
    pub(super) fn next_turn(&mut self, now: Instant) -> Instant {
        self.drop_expired(now);
        let mut turn = self.next_at;
        if let Some(max) = self.quota.requests {
            let max = max.get() as usize;
            // The oldest request that must leave the window first.
            let oldest = self.sent.len().checked_sub(max);
            if let Some(sent) = oldest.and_then(|index| self.sent.get(index)) {
                turn = turn.max(sent.at + WINDOW);
            }
        }
        if let Some(max) = self.quota.tokens {
            // A request that is larger than the whole quota is sent alone.
            let room = (f64::from(max.get()) - self.expected_tokens()).max(0.0);
            let mut left = self.tokens;
            for sent in &self.sent {
                if left <= room {
                    break;
                }
                left -= sent.tokens;
                turn = turn.max(sent.at + WINDOW);
            }
        }
        turn
    }

    /// Records that a request is sent.
    pub(super) fn record_sent(&mut self, now: Instant) {
        if self.quota == Quota::default() {
            return;
        }
        let tokens = self.expected_tokens();
        self.sent.push_back(SentRequest { at: now, tokens, is_reported: false });
        self.tokens += tokens;
        if let Some(max) = self.quota.requests {
            self.next_at = now + Duration::from_mins(1) / max.get();
        }
    }

    /// Records the tokens that the reply to the request sent at `sent` reports.
    pub(super) fn record_tokens(&mut self, sent: Instant, tokens: u64) {
        let tokens = (tokens as f64).min(MAX_TOKENS);
        self.largest = Some(self.largest.map_or(tokens, |largest| largest.max(tokens)));
        // Several requests may have been sent at the same instant.
        let end = self.sent.partition_point(|request| request.at <= sent);
        let request = self
            .sent
            .iter_mut()
            .take(end)
            .rev()
            .take_while(|request| request.at == sent)
            .find(|request| !request.is_reported);
        if let Some(request) = request {
            self.tokens += tokens - request.tokens;
            (request.tokens, request.is_reported) = (tokens, true);
        }
    }

    /// Estimated tokens of the next request: the largest number reported so far, so that the quota is not exceeded.
    fn expected_tokens(&self) -> f64 {
        self.largest.unwrap_or(INITIAL_TOKENS)
    }

    /// Drops requests that have left the window.
    fn drop_expired(&mut self, now: Instant) {
        while let Some(request) = self.sent.front()
            && now.saturating_duration_since(request.at) >= WINDOW
        {
            self.tokens -= request.tokens;
            self.sent.pop_front();
        }
    }
}

/// Wait from the headers `retry-after-ms` or `Retry-After`; the former has priority, as in the vendors' clients.
///
/// `Retry-After` is a number of seconds, possibly with a fraction, or a date. A date is relative to the server's clock
/// if the response has a `Date`. `None` without a valid header, or for a wait of zero.
pub(crate) fn retry_after(headers: &HeaderMap, now: SystemTime) -> Option<Duration> {
    if let Some(wait) = header(headers, "retry-after-ms").and_then(|ms| parse_duration(ms, 1e-3)) {
        return Some(wait);
    }
    let retry_after = header(headers, RETRY_AFTER.as_str())?;
    parse_duration(retry_after, 1.0).or_else(|| {
        let now = header(headers, DATE.as_str()).and_then(parse_date).unwrap_or(now);
        let wait = parse_date(retry_after)?.duration_since(now).ok()?;
        (!wait.is_zero()).then_some(wait)
    })
}

fn header<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name)?.to_str().ok()
}

fn parse_date(text: &str) -> Option<SystemTime> {
    httpdate::parse_http_date(text.trim()).ok()
}

/// Parses a positive number of units of `unit` seconds; values beyond [`Duration::MAX`] are cut to it.
fn parse_duration(text: &str, unit: f64) -> Option<Duration> {
    let seconds = text.trim().parse::<f64>().ok()? * unit;
    (seconds.is_finite() && seconds > 0.0).then(|| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: u64 = 1_767_225_600;

    // 2026-01-01T00:00:00Z

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

    fn wait(pairs: &[(&'static str, &str)]) -> Option<Duration> {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.insert(*name, value.parse().unwrap());
        }
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(784_111_777);
        retry_after(&headers, now)
    }

    #[test]
    fn waits_of_every_form_are_parsed() {
        for (pairs, expected) in [
            (vec![("retry-after", "2")], Some(Duration::from_secs(2))),
            (vec![("retry-after", " 0.25 ")], Some(Duration::from_millis(250))),
            (vec![("retry-after", "30"), ("retry-after-ms", "1500")], Some(Duration::from_millis(1500))),
            (vec![("retry-after", "0"), ("retry-after-ms", "50")], Some(Duration::from_millis(50))),
            (vec![("retry-after", "2"), ("retry-after-ms", "soon")], Some(Duration::from_secs(2))),
            (vec![("retry-after", "Sun, 06 Nov 1994 08:49:47 GMT")], Some(Duration::from_secs(10))),
            (
                vec![("retry-after", "Sun, 06 Nov 1994 08:59:47 GMT"), ("date", "Sun, 06 Nov 1994 08:59:45 GMT")],
                Some(Duration::from_secs(2)),
            ),
            (vec![("retry-after", "Sun, 06 Nov 1994 08:49:37 GMT")], None),
            (vec![("retry-after", "Sun, 06 Nov 1904 08:49:37 GMT")], None),
            (vec![("retry-after", "1e300")], Some(Duration::MAX)),
            (vec![("retry-after", "NaN")], None),
            (vec![("retry-after", "inf")], None),
            (vec![("retry-after", "-1")], None),
            (vec![("retry-after", "0")], None),
            (vec![("retry-after", "")], None),
            (vec![], None),
        ] {
            assert_eq!(wait(&pairs), expected, "{pairs:?}");
        }
    }
}
