//! The user's limits per minute ([`Quota`]), and the requests of the last minute that count toward them
//! ([`QuotaWindow`]).

use std::collections::VecDeque;
use std::num::NonZeroU32;

use clap::Args;
use tokio::time::{Duration, Instant};

use crate::types::Decides;

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
