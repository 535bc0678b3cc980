//! The wait that a server asks for in its response headers: [`retry_after`].

use std::time::{Duration, SystemTime};

use reqwest::header::{DATE, HeaderMap, RETRY_AFTER};

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
