//! Time limit for one image: [`TimeLimit`], [`ImageClock`].

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use darkqa_base::types::flags::seconds;

/// Time limit for one image (`--llie-options timeout`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeLimit(Option<Duration>);

/// Number of images in a row that exceed a limit of time or memory after which the enhancer is not run any more;
/// chosen.
pub(crate) const MAX_CONSECUTIVE_OVERRUNS: usize = 3;

/// Multiple of the time limit after which a stopped run counts as stuck; chosen. ONNX Runtime ends a run only between
/// two nodes of its graph.
pub(crate) const PATIENCE: u32 = 10;

impl TimeLimit {
    /// No limit.
    pub const NONE: Self = Self(None);

    /// A limit; a duration of 0 means no limit.
    #[must_use]
    pub fn new(limit: Duration) -> Self {
        Self((!limit.is_zero()).then_some(limit))
    }

    /// The limit as a duration; `None` for no limit.
    pub(crate) fn get(self) -> Option<Duration> {
        self.0
    }
}

impl Default for TimeLimit {
    /// A limit of ten minutes; chosen.
    fn default() -> Self {
        Self(Some(Duration::from_mins(10)))
    }
}

impl fmt::Display for TimeLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.unwrap_or_default().as_secs_f64())
    }
}

impl FromStr for TimeLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            Ok(0.0) => Ok(Self::NONE),
            _ => seconds(text).map(Self::new),
        }
    }
}

/// Time used by the runs of one image, with its limit.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ImageClock {
    limit: TimeLimit,
    used: Duration,
}

impl ImageClock {
    /// A clock at the start of an image.
    pub(crate) fn new(limit: TimeLimit) -> Self {
        Self { limit, used: Duration::ZERO }
    }

    /// Remaining time; `None` without a limit.
    pub(crate) fn remaining(self) -> Option<Duration> {
        Some(self.limit.get()?.saturating_sub(self.used))
    }

    /// Time limit for the whole image.
    pub(crate) fn time_limit(self) -> TimeLimit {
        self.limit
    }

    /// Time limit for the whole image as a duration; `None` for no limit.
    pub(crate) fn limit(self) -> Option<Duration> {
        self.limit.get()
    }

    /// Adds the time of one run.
    pub(crate) fn add(&mut self, time: Duration) {
        self.used += time;
    }

    /// Time used so far.
    pub(crate) fn used(self) -> Duration {
        self.used
    }

    /// Sets the time used so far; zero for another image or trial.
    pub(crate) fn set_used(&mut self, used: Duration) {
        self.used = used;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_seconds_and_zero_is_none() {
        for (text, limit) in [("600", Some(600.0)), ("0.5", Some(0.5)), ("0", None)] {
            let read: TimeLimit = text.parse().unwrap();
            assert_eq!(read.get(), limit.map(Duration::from_secs_f64));
            assert_eq!(read.to_string(), text);
        }
        for wrong in ["-1", "long", "nan", "inf", "1e99"] {
            assert!(wrong.parse::<TimeLimit>().is_err(), "{wrong}");
        }
        assert_eq!(TimeLimit::default().to_string(), "600");
    }

    #[test]
    fn runs_of_an_image_share_its_time() {
        let mut clock = ImageClock::new("2".parse().unwrap());
        clock.add(Duration::from_millis(1500));
        assert_eq!(clock.remaining(), Some(Duration::from_millis(500)));
        clock.add(Duration::from_secs(9));
        assert_eq!(clock.remaining(), Some(Duration::ZERO));
        clock.set_used(Duration::ZERO);
        assert_eq!(clock.remaining(), Some(Duration::from_secs(2)));
        assert_eq!(ImageClock::new(TimeLimit::NONE).remaining(), None);
    }
}
