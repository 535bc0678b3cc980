//! Limit of the process's memory while an enhancer runs: [`MemoryLimit`].

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use super::memory::{available, resident};

/// Maximum memory of this process, in bytes, while an enhancer runs (`--llie-options max-memory`). Without Linux's
/// `/proc`, memory is not limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MemoryLimit(Option<u64>);

/// Share of the memory free at the start that an enhancer may take by default; chosen, to leave the rest to other
/// programs.
const FREE_SHARE: f64 = 0.8;

/// Interval between checks of the memory; chosen. A process can allocate about 1 GB in that time; a check takes about
/// 20 µs.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

const GIGABYTE: f64 = 1e9;

impl MemoryLimit {
    /// No limit.
    pub const NONE: Self = Self(None);

    /// Present memory of the process plus 80 % of the free memory.
    #[must_use]
    pub fn automatic() -> Self {
        match (resident(), available()) {
            (Some(resident), Some(free)) => Self(Some(resident + (FREE_SHARE * free as f64) as u64)),
            _ => Self::NONE,
        }
    }

    /// Interval after which to check the memory again; `None` without a limit.
    pub(crate) fn poll_interval(self) -> Option<Duration> {
        self.0.map(|_| POLL_INTERVAL)
    }

    /// True if the process takes more memory than the limit.
    pub(crate) fn is_exceeded(self) -> bool {
        match (self.0, resident()) {
            (Some(limit), Some(resident)) => resident > limit,
            _ => false,
        }
    }
}

impl fmt::Display for MemoryLimit {
    /// The limit in GB; 0 is none.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gigabytes = self.0.unwrap_or_default() as f64 / GIGABYTE;
        write!(f, "{}", (100.0 * gigabytes).round() / 100.0)
    }
}

impl FromStr for MemoryLimit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            Ok(0.0) => Ok(Self::NONE),
            Ok(number) if number > 0.0 && number.is_finite() => Ok(Self(Some((number * GIGABYTE) as u64))),
            _ => Err("expected a number of GB (10⁹ bytes), or 0 for no limit".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_gigabytes_and_zero_is_none() {
        for (text, limit) in [("4", Some(4_000_000_000)), ("0.5", Some(500_000_000)), ("0", None)] {
            let read: MemoryLimit = text.parse().unwrap();
            assert_eq!(read.0, limit);
            assert_eq!(read.to_string(), text);
        }
        for wrong in ["-1", "much", "nan", "inf", ""] {
            assert!(wrong.parse::<MemoryLimit>().is_err(), "{wrong}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn limit_is_compared_with_the_process() {
        assert!("0.000001".parse::<MemoryLimit>().unwrap().is_exceeded());
        assert!(!"1000000".parse::<MemoryLimit>().unwrap().is_exceeded());
        assert!(!MemoryLimit::NONE.is_exceeded());
        assert!(MemoryLimit::automatic().0.is_some());
    }
}
