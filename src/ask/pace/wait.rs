//! The wait that a server asks for: [`asked_wait`].

use std::time::{Duration, SystemTime};

use reqwest::header::{DATE, HeaderMap, RETRY_AFTER};

/// The wait that a server asks for in its headers: `retry-after-ms`, which the vendors' clients follow first, else `Retry-After` in
/// seconds (fractions too) or as a date. A date is compared with the server's clock if it sends `Date`. `None` without a header, for no wait, or in an unknown form.
pub(in crate::ask) fn asked_wait(headers: &HeaderMap, now: SystemTime) -> Option<Duration> {
    let text = |name: &str| headers.get(name)?.to_str().ok();
    let after = || text(RETRY_AFTER.as_str());
    let date = |text: &str| httpdate::parse_http_date(text.trim()).ok();
    let until = || {
        let until = date(after()?)?;
        let now = text(DATE.as_str()).and_then(date).unwrap_or(now);
        let wait = until.duration_since(now).ok();
        wait.filter(|wait| !wait.is_zero())
    };
    let exact = text("retry-after-ms").and_then(|ms| seconds(ms, 1e-3));
    let after = after().and_then(|after| seconds(after, 1.0)).or_else(until);
    exact.or(after)
}

/// A duration as Google's services write it, `45.837906927s`.
pub(in crate::ask) fn protobuf_duration(text: &str) -> Option<Duration> {
    seconds(text.trim().strip_suffix('s')?, 1.0)
}

/// A positive number of units as a duration, at most [`Duration::MAX`].
fn seconds(text: &str, unit: f64) -> Option<Duration> {
    let seconds = text.trim().parse::<f64>().ok()? * unit;
    (seconds.is_finite() && seconds > 0.0)
        .then(|| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX))
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
        asked_wait(&headers, now)
    }

    #[test]
    fn waits_of_every_form_are_read() {
        let ms = |ms| Some(Duration::from_millis(ms));
        for (pairs, expected) in [
            (vec![("retry-after", "2")], ms(2000)),
            (vec![("retry-after", " 0.25 ")], ms(250)),
            (
                vec![("retry-after", "30"), ("retry-after-ms", "1500")],
                ms(1500),
            ),
            (vec![("retry-after", "0"), ("retry-after-ms", "50")], ms(50)),
            (
                vec![("retry-after", "2"), ("retry-after-ms", "soon")],
                ms(2000),
            ),
            (
                vec![("retry-after", "Sun, 06 Nov 1994 08:49:47 GMT")],
                ms(10_000),
            ),
            (
                vec![
                    ("retry-after", "Sun, 06 Nov 1994 08:59:47 GMT"),
                    ("date", "Sun, 06 Nov 1994 08:59:45 GMT"),
                ],
                ms(2000),
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
