//! Time for which requests had to wait before they were sent: [`HeldBack`].

use std::fmt;
use std::time::Duration;

/// Cause of a wait before a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PaceCause {
    /// The user's limits.
    Quota,
    /// Requests that the endpoint refused.
    Refusals,
    /// Limits that the endpoint reports in its headers.
    ReportedLimits,
}

/// As a remark on what limits the speed.
impl fmt::Display for PaceCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Quota => "--rpm or --tpm limits the speed",
            Self::Refusals => {
                "the endpoint turns requests away (status 429 or 503), which limits the speed: a higher limit of the account, or a server \
                 with more capacity, would help"
            }
            Self::ReportedLimits => {
                "the limits per minute that the endpoint states limit the speed: a higher limit of the account would help"
            }
        })
    }
}

/// Time for which the first request of the queue had to wait, by cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct HeldBack([Duration; 3]);

impl HeldBack {
    const CAUSES: [PaceCause; 3] = [PaceCause::Quota, PaceCause::Refusals, PaceCause::ReportedLimits];

    /// Adds a wait.
    pub(super) fn add(&mut self, cause: PaceCause, time: Duration) {
        self.0[cause as usize] += time;
    }

    /// The longer wait for each cause, of two queues that waited at the same time.
    #[must_use]
    pub(crate) fn longest(self, other: Self) -> Self {
        Self(std::array::from_fn(|cause| self.0[cause].max(other.0[cause])))
    }

    /// The cause of the longest wait, with its time.
    #[must_use]
    pub(crate) fn main_cause(self) -> (PaceCause, Duration) {
        let waits = Self::CAUSES.into_iter().zip(self.0);
        waits.max_by_key(|(_, time)| *time).unwrap_or((PaceCause::Quota, Duration::ZERO))
    }
}

#[cfg(test)]
impl HeldBack {
    /// A wait of this many seconds for one cause.
    pub(crate) fn seconds(cause: PaceCause, seconds: u64) -> Self {
        let mut held_back = Self::default();
        held_back.add(cause, Duration::from_secs(seconds));
        held_back
    }
}
