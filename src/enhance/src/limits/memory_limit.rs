//! Memory that an enhancer may take: [`MemoryLimit`].

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use super::memory::{available, resident};

/// The most memory of this process while an enhancer runs (`--llie-options max-memory`), in bytes. On systems without Linux's `/proc` nothing
/// is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MemoryLimit(Option<u64>);

/// Share of the memory that is free at the start which an enhancer may take by default; chosen: the rest is for what else runs.
const FREE_SHARE: f64 = 0.8;

/// Time between two looks at the memory; chosen. A process gets some 1 GB in that time, and a look costs some 20 µs.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

const GIGABYTE: f64 = 1e9;

impl MemoryLimit {
    /// No limit.
    pub const NONE: Self = Self(None);

    /// Memory of the process now, plus four fifths of the free memory.
    #[must_use]
    pub fn automatic() -> Self {
        let now = resident().zip(available());
        Self(now.map(|(resident, free)| resident + (FREE_SHARE * free as f64) as u64))
    }

    /// The time after which to look at the memory again; `None` without a limit.
    pub(crate) fn poll_interval(self) -> Option<Duration> {
        self.0.map(|_| POLL_INTERVAL)
    }

    /// Whether the process takes more.
    pub(crate) fn is_exceeded(self) -> bool {
        self.0.zip(resident()).is_some_and(|(most, now)| now > most)
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
            Ok(number) if number > 0.0 && number.is_finite() => {
                Ok(Self(Some((number * GIGABYTE) as u64)))
            }
            _ => Err("expected a number of GB (10⁹ bytes), or 0 for no limit".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_gigabytes_and_zero_is_none() {
        for (text, limit) in [
            ("4", Some(4_000_000_000)),
            ("0.5", Some(500_000_000)),
            ("0", None),
        ] {
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
    fn the_process_is_held_against_the_limit() {
        assert!("0.000001".parse::<MemoryLimit>().unwrap().is_exceeded());
        assert!(!"1000000".parse::<MemoryLimit>().unwrap().is_exceeded());
        assert!(!MemoryLimit::NONE.is_exceeded());
        assert!(MemoryLimit::automatic().0.is_some());
    }
}
