//! The remaining limits that a server reports in its headers: [`Allowance`].

use std::time::{Duration, SystemTime};

use jiff::{SignedDuration, Timestamp};
use reqwest::header::HeaderMap;

/// The rest of one limit, and the time until the limit is full again.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Remainder {
    limit: Option<f64>,
    remaining: f64,
    reset: Duration,
}

/// The rest of the limits on requests and on tokens.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::ask) struct Allowance {
    requests: Option<Remainder>,
    tokens: Option<Remainder>,
}

/// The advice that follows from an allowance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asks {
    Nothing,
    /// Keep this spacing between requests.
    Spacing(Duration),
    /// Send no request for this time.
    Pause(Duration),
}

impl Allowance {
    /// Reads the headers of a reply: `x-ratelimit-{limit,remaining,reset}-{requests,tokens}` (OpenAI and similar servers), the
    /// same without an ending (OpenRouter), and `anthropic-ratelimit-{requests,tokens}-{limit,remaining,reset}`. A limit
    /// without `remaining` and `reset` is ignored.
    pub(in crate::ask) fn read(headers: &HeaderMap, now: SystemTime) -> Self {
        let text = |name: &str| headers.get(name)?.to_str().ok().map(str::trim);
        let remainder = |name: &dyn Fn(&str) -> String| {
            let number = |field| text(&name(field))?.parse::<f64>().ok();
            let remaining = number("remaining").filter(|n| n.is_finite())?;
            Some(Remainder {
                limit: number("limit").filter(|n| n.is_finite() && *n > 0.0),
                remaining: remaining.max(0.0),
                reset: duration(text(&name("reset"))?, now)?,
            })
        };
        let of = |kind: &str| {
            remainder(&|field| format!("x-ratelimit-{field}-{kind}"))
                .or_else(|| remainder(&|field| format!("anthropic-ratelimit-{kind}-{field}")))
        };
        Self {
            requests: of("requests").or_else(|| remainder(&|field| format!("x-ratelimit-{field}"))),
            tokens: of("tokens"),
        }
    }

    /// The time until a limit of which nothing is left is full again; `None` if something is left of each.
    pub(in crate::ask) fn pause(&self) -> Option<Duration> {
        [self.requests, self.tokens]
            .into_iter()
            .flatten()
            .filter(|limit| limit.remaining < 1.0 && !limit.reset.is_zero())
            .map(|limit| limit.reset)
            .max()
    }

    /// The advice for requests of `tokens` tokens each.
    pub(super) fn asks(&self, tokens: f64) -> Asks {
        let requests = self
            .requests
            .map_or(Asks::Nothing, |remainder| remainder.asks(1.0));
        let tokens = self
            .tokens
            .map_or(Asks::Nothing, |remainder| remainder.asks(tokens));
        match (requests, tokens) {
            (Asks::Pause(a), Asks::Pause(b)) => Asks::Pause(a.max(b)),
            (Asks::Spacing(a), Asks::Spacing(b)) => Asks::Spacing(a.max(b)),
            (Asks::Pause(wait), _) | (_, Asks::Pause(wait)) => Asks::Pause(wait),
            (Asks::Spacing(wait), _) | (_, Asks::Spacing(wait)) => Asks::Spacing(wait),
            (Asks::Nothing, Asks::Nothing) => Asks::Nothing,
        }
    }
}

impl Remainder {
    /// The advice for requests that use `each` of the limit. Above half of the limit there is none; below, the rest is spread
    /// over the time until the limit is full again. If the limit refills continuously (OpenAI), this is the refill rate at
    /// half and less below, so the rest settles at half. If it refills at the end of each minute, the rest lasts until then.
    fn asks(self, each: f64) -> Asks {
        if self.reset.is_zero() || self.limit.is_some_and(|limit| self.remaining > limit / 2.0) {
            return Asks::Nothing;
        }
        if self.remaining < each {
            return Asks::Pause(self.reset);
        }
        let spacing = self.reset.as_secs_f64() * each / self.remaining;
        Asks::Spacing(Duration::try_from_secs_f64(spacing).unwrap_or(Duration::MAX))
    }
}

/// The number of seconds from which a number is a date and not a duration.
const DATES: f64 = 1e9;

/// A duration (`6m0s`, `17ms`, or seconds), or the time until a date (RFC 3339, or seconds or milliseconds since 1970).
fn duration(text: &str, now: SystemTime) -> Option<Duration> {
    let until = |date: SystemTime| date.duration_since(now).unwrap_or(Duration::ZERO);
    if let Ok(number) = text.parse::<f64>() {
        let seconds = Duration::try_from_secs_f64(if number >= DATES * 1e3 {
            number / 1e3
        } else {
            number
        })
        .ok()?;
        let date = || SystemTime::UNIX_EPOCH.checked_add(seconds);
        return if number >= DATES {
            date().map(until)
        } else {
            Some(seconds)
        };
    }
    if let Ok(date) = text.parse::<Timestamp>() {
        return Some(until(date.into()));
    }
    text.parse::<SignedDuration>().ok()?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: u64 = 1_767_225_600; // 2026-01-01T00:00:00Z

    fn read(pairs: &[(&'static str, &str)]) -> Allowance {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.insert(*name, value.parse().unwrap());
        }
        Allowance::read(&headers, SystemTime::UNIX_EPOCH + Duration::from_secs(NOW))
    }

    #[test]
    fn durations_of_every_form_are_read() {
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
            assert_eq!(duration(text, now), ms.map(Duration::from_millis), "{text}");
        }
    }

    #[test]
    fn the_rest_is_spread_over_the_time_left() {
        let openai = |remaining, reset| {
            read(&[
                ("x-ratelimit-limit-requests", "500"),
                ("x-ratelimit-remaining-requests", remaining),
                ("x-ratelimit-reset-requests", reset),
            ])
            .asks(1000.0)
        };
        assert_eq!(openai("499", "120ms"), Asks::Nothing);
        // Half of 500 a minute: the spacing is the refill rate, 120 ms.
        assert_eq!(
            openai("250", "30s"),
            Asks::Spacing(Duration::from_millis(120))
        );
        assert_eq!(
            openai("100", "48s"),
            Asks::Spacing(Duration::from_millis(480))
        );
        assert_eq!(openai("0", "1m0s"), Asks::Pause(Duration::from_mins(1)));
        let tokens = read(&[
            ("anthropic-ratelimit-tokens-limit", "40000"),
            ("anthropic-ratelimit-tokens-remaining", "10000"),
            ("anthropic-ratelimit-tokens-reset", "2026-01-01T00:00:30Z"),
        ]);
        assert_eq!(tokens.asks(1000.0), Asks::Spacing(Duration::from_secs(3)));
        assert_eq!(tokens.asks(20_000.0), Asks::Pause(Duration::from_secs(30)));
        // A rest without a reset time is ignored.
        assert_eq!(
            read(&[
                ("x-ratelimit-limit-requests", "500"),
                ("x-ratelimit-remaining-requests", "400")
            ]),
            Allowance::default()
        );
    }
}
