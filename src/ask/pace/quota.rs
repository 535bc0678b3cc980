//! The user's limits per minute: [`Quota`], and what was sent under them, [`QuotaWindow`].

use std::collections::VecDeque;
use std::num::NonZeroU32;

use clap::Args;
use tokio::time::{Duration, Instant};

use crate::types::Decides;

/// The user's limits per minute; `None` for no limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Args)]
#[command(next_help_heading = "Sending")]
pub struct Quota {
    /// The maximum number of requests in any 60 seconds, retries included; default: as many as the server takes
    #[arg(id = "rpm", long, value_name = "N", add = Decides::Nothing)]
    pub requests: Option<NonZeroU32>,
    /// The maximum number of tokens in any 60 seconds, of prompts and replies; default: as many as the server takes
    #[arg(id = "tpm", long, value_name = "N", add = Decides::Nothing)]
    pub tokens: Option<NonZeroU32>,
}

/// The time over which a quota counts: a minute, and half a second for clocks and networks that do not agree.
const WINDOW: Duration = Duration::from_millis(60_500);

/// The assumed number of tokens of a request until a reply states one: an image and a letter.
const FIRST_TOKENS: f64 = 1200.0;

/// The maximum number of tokens of a request; a larger number from a server is wrong and is cut to this one.
const MOST_TOKENS: f64 = 1e7;

/// Requests and tokens of the last minute. In any 60 seconds, from the first request to the last, at most the quota is sent, whatever fails:
/// what a pause leaves unused is lost, not made up.
#[derive(Debug)]
pub(super) struct QuotaWindow {
    quota: Quota,
    /// Requests of the last [`WINDOW`].
    sent: VecDeque<SentRequest>,
    /// Sum of the tokens in `sent`.
    tokens: f64,
    /// The largest number of tokens of a reply so far; `None` before the first.
    largest: Option<f64>,
    /// The time of the next request by the spacing of the quota on requests.
    next: Instant,
}

/// A request and its tokens.
#[derive(Debug, Clone, Copy)]
struct SentRequest {
    at: Instant,
    tokens: f64,
    /// Whether the tokens are those that its reply states; else they are expected.
    is_stated: bool,
}

impl QuotaWindow {
    pub(super) fn new(quota: Quota, now: Instant) -> Self {
        Self {
            quota,
            sent: VecDeque::new(),
            tokens: 0.0,
            largest: None,
            next: now,
        }
    }

    /// Half of the quota on requests, per second; 0 without one. A learned rate need not be lower.
    pub(super) fn half_rate(quota: Quota) -> f64 {
        quota
            .requests
            .map_or(0.0, |most| f64::from(most.get()) / 120.0)
    }

    /// The time from which the next request may be sent.
    pub(super) fn turn(&mut self, now: Instant) -> Instant {
        self.forget(now);
        let mut turn = self.next;
        if let Some(most) = self.quota.requests {
            let most = most.get() as usize;
            let before = self.sent.len().checked_sub(most);
            if let Some(sent) = before.and_then(|index| self.sent.get(index)) {
                turn = turn.max(sent.at + WINDOW);
            }
        }
        if let Some(most) = self.quota.tokens {
            let room = f64::from(most.get()) - self.expected();
            let mut left = self.tokens;
            let mut sent = self.sent.iter();
            // A request that is larger than the whole quota is sent alone.
            while left > room.max(0.0) {
                let Some(sent) = sent.next() else {
                    break;
                };
                left -= sent.tokens;
                turn = turn.max(sent.at + WINDOW);
            }
        }
        turn
    }

    /// Notes that a request is sent.
    pub(super) fn sends(&mut self, now: Instant) {
        if self.quota == Quota::default() {
            return;
        }
        let tokens = self.expected();
        self.sent.push_back(SentRequest {
            at: now,
            tokens,
            is_stated: false,
        });
        self.tokens += tokens;
        if let Some(most) = self.quota.requests {
            self.next = now + Duration::from_mins(1) / most.get();
        }
    }

    /// Notes the tokens of the reply to a request that was sent at a time.
    pub(super) fn used(&mut self, sent: Instant, tokens: u64) {
        let tokens = (tokens as f64).min(MOST_TOKENS);
        self.largest = Some(self.largest.map_or(tokens, |largest| largest.max(tokens)));
        // Several may have been sent at one instant.
        let behind = self.sent.partition_point(|request| request.at <= sent);
        let requests = self.sent.iter_mut().take(behind).rev();
        let mut same = requests.take_while(|request| request.at == sent);
        if let Some(request) = same.find(|request| !request.is_stated) {
            self.tokens += tokens - request.tokens;
            (request.tokens, request.is_stated) = (tokens, true);
        }
    }

    /// The expected tokens of a request: those of the largest reply so far, so that the quota is kept.
    fn expected(&self) -> f64 {
        self.largest.unwrap_or(FIRST_TOKENS)
    }

    fn forget(&mut self, now: Instant) {
        while let Some(request) = self.sent.front()
            && now.saturating_duration_since(request.at) >= WINDOW
        {
            self.tokens -= request.tokens;
            self.sent.pop_front();
        }
    }
}
