//! Streams in place of replies in one piece that a gateway does not wait for: [`StreamFallback`].

use std::sync::atomic::{AtomicBool, Ordering};

use tracing::warn;

use crate::failures::{AskError, Unfinished};
use crate::requests::{AfterTimeout, Parameters};
use crate::wire_kind::{Wire, WireSetting};
use darkqa_base::types::FailureKind;

/// Remedy if a gateway gives up on a reply in one piece.
const STREAM: &str = "--request wire=chat-stream asks for a stream, which gateways let through";

/// Remedy if the Responses API was used.
const CHAT_STREAM: &str = "if the model takes chat completions, --request wire=chat-stream asks for a stream of them";

/// Remedy if a stream does not help.
const SHORTER: &str = "a shorter reply helps (--thinking off, a lower --reasoning-effort or --max-tokens), or an address without the \
                       gateway";

/// What is known about streams of one model.
#[derive(Debug, Default)]
pub(super) struct StreamFallback {
    /// True after the server refused a stream.
    is_refused: AtomicBool,
    /// True after the warning about the first stream.
    has_warned: AtomicBool,
    /// True after a reply to a request that was asked as a stream.
    is_used: AtomicBool,
}

/// How one question is asked after gateway timeouts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AskedBefore {
    /// Number of requests of the question that were charged, certainly or probably, and gave no reply that counts.
    charged: u32,
    /// True to ask for a stream, if that is possible.
    as_stream: bool,
    /// True if a gateway waited for the reply in one piece, in vain.
    is_too_long: bool,
}

impl AskedBefore {
    /// A question that timed out at a gateway in an earlier call: its next timeout is the last.
    pub(super) fn timed_out(paid_retries: u32) -> Self {
        Self { charged: paid_retries, as_stream: true, is_too_long: false }
    }

    /// The same question after more charged requests.
    pub(super) fn with_charged(self, more: u32) -> Self {
        Self { charged: self.charged + more, ..self }
    }

    /// True if a stream of the question shows that others should be streamed too.
    pub(super) fn is_too_long(self) -> bool {
        self.is_too_long
    }
}

impl StreamFallback {
    /// True if a request that is sent as `wire` may be sent as a stream: nobody has chosen the API, and the server
    /// refuses no stream.
    fn is_possible(&self, parameters: &Parameters, wire: Wire) -> bool {
        parameters.wire == WireSetting::Auto
            && wire == Wire::Chat
            && !parameters.extra.adds("stream")
            && !self.is_refused.load(Ordering::Relaxed)
    }

    /// Records a reply to a request that was asked as a stream.
    pub(super) fn record_reply(&self) {
        self.is_used.store(true, Ordering::Relaxed);
    }

    /// Change to requests, as a phrase for messages; `None` if no reply is from a stream in place of a reply in one
    /// piece.
    pub(super) fn change(&self) -> Option<String> {
        let phrase = "replies that a gateway cut were asked for as streams (--request wire=chat-stream)";
        self.is_used.load(Ordering::Relaxed).then(|| phrase.to_owned())
    }

    /// API of the next request about a question.
    pub(super) fn wire(&self, parameters: &Parameters, wire: Wire, before: AskedBefore) -> Wire {
        if before.as_stream && self.is_possible(parameters, wire) { Wire::ChatStream } else { wire }
    }

    /// Handling of gateway timeouts of a request that is sent as `wire`.
    pub(super) fn after_timeout(
        &self,
        parameters: &Parameters,
        wire: Wire,
        before: AskedBefore,
        paid_retries: u32,
    ) -> AfterTimeout {
        let asks_otherwise = before.charged < paid_retries && self.is_possible(parameters, wire);
        let remedy = match wire {
            Wire::Chat if self.is_refused.load(Ordering::Relaxed) => SHORTER,
            Wire::Chat => STREAM,
            Wire::ChatStream => SHORTER,
            Wire::Responses => CHAT_STREAM,
        };
        AfterTimeout { charged: before.charged, asks_otherwise, remedy }
    }

    /// How to ask a question again after this error of a request that was sent as `sent`; `None` if the error is final.
    /// `wire` is the API of other requests.
    pub(super) fn next(
        &self,
        name: &str,
        error: &AskError,
        (sent, wire): (Wire, Wire),
        before: AskedBefore,
        timeouts: AfterTimeout,
    ) -> Option<AskedBefore> {
        if error.unfinished.is_timeout() && timeouts.asks_otherwise {
            if !self.has_warned.swap(true, Ordering::Relaxed) {
                warn!("{name}: {error}; asked again as a stream, as all would be with --request wire=chat-stream");
            }
            return Some(AskedBefore {
                charged: before.charged + 1,
                as_stream: true,
                is_too_long: error.unfinished == Unfinished::GatewayTimeout,
            });
        }
        // The key and the credit are not about streams.
        let is_refusal =
            error.failure.kind == FailureKind::Request && !matches!(error.failure.status, Some(401 | 402 | 403 | 407));
        if sent != wire && is_refusal {
            self.is_refused.store(true, Ordering::Relaxed);
            return Some(AskedBefore { as_stream: false, ..before });
        }
        None
    }
}
