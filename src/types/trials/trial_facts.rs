//! What is held of one trial: [`TrialFacts`].

use super::TextPlace;
use crate::types::{TrialKey, Usage};

/// What is held of one trial. Numbers are those of the tables of its [`Trials`](super::Trials).
#[derive(Debug, Clone)]
pub(super) struct TrialFacts<F> {
    pub(super) key: TrialKey,
    pub(super) text: TextPlace,
    /// What tells replies apart; see [`reply_digest`].
    pub(super) reply: [u32; 2],
    pub(super) item: u32,
    pub(super) asked: u32,
    pub(super) server: u32,
    pub(super) tokens: Tokens,
    /// In milliseconds; [`NONE`] if it is not known.
    pub(super) latency: u32,
    pub(super) attempts: u16,
    /// The number of the failure; the largest number if a reply came.
    pub(super) failure: u16,
    pub(super) facts: F,
}

/// A number that is not known.
const NONE: u32 = u32::MAX;

/// The tokens that a server charged. A number above 4,294,967,294 is taken as that.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tokens {
    prompt: u32,
    completion: u32,
    cached: u32,
}

impl Tokens {
    pub(super) fn of(usage: Option<Usage>) -> Self {
        let usage = usage.unwrap_or_default();
        let [prompt, completion, cached] = [
            usage.prompt_tokens,
            usage.completion_tokens,
            usage.cached_tokens,
        ]
        .map(|tokens| small(tokens));
        Self {
            prompt,
            completion,
            cached,
        }
    }

    /// `None` if the server stated no number.
    pub(super) fn usage(self) -> Option<Usage> {
        let [prompt_tokens, completion_tokens, cached_tokens] =
            [self.prompt, self.completion, self.cached].map(large);
        let usage = Usage {
            prompt_tokens,
            completion_tokens,
            cached_tokens,
        };
        (usage != Usage::default()).then_some(usage)
    }
}

impl<F> TrialFacts<F> {
    pub(super) fn latency(ms: Option<u64>) -> u32 {
        small(ms)
    }

    pub(super) fn latency_ms(&self) -> Option<u64> {
        large(self.latency)
    }
}

fn small(number: Option<u64>) -> u32 {
    number.map_or(NONE, |number| number.min(u64::from(NONE) - 1) as u32)
}

fn large(number: u32) -> Option<u64> {
    (number != NONE).then_some(u64::from(number))
}

/// A hash of a reply and a refusal, that tells whether two trials have the same. Zero stands for no reply.
pub(super) fn reply_digest(reply: Option<&str>, refusal: Option<&str>) -> [u32; 2] {
    if reply.is_none() && refusal.is_none() {
        return [0; 2];
    }
    let mut hasher = blake3::Hasher::new();
    for text in [reply, refusal] {
        let length = text.map_or(u64::MAX, |text| text.len() as u64);
        hasher.update(&length.to_le_bytes());
        hasher.update(text.unwrap_or_default().as_bytes());
    }
    let hash = *hasher.finalize().as_bytes();
    let part = |at: usize| u32::from_le_bytes([hash[at], hash[at + 1], hash[at + 2], hash[at + 3]]);
    [part(0).max(1), part(4)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::trials::ChoiceFacts;

    #[test]
    fn a_trial_with_choices_takes_80_bytes() {
        assert_eq!(size_of::<TrialFacts<ChoiceFacts>>(), 80);
    }

    #[test]
    fn replies_and_refusals_are_told_apart() {
        let digests = [
            (None, None),
            (Some(""), None),
            (None, Some("")),
            (Some("a"), Some("b")),
            (Some("ab"), Some("")),
        ]
        .map(|(reply, refusal)| reply_digest(reply, refusal));
        for (place, one) in digests.iter().enumerate() {
            assert!(!digests[place + 1..].contains(one));
        }
    }

    #[test]
    fn tokens_are_read_back() {
        let usage = Usage {
            prompt_tokens: Some(1200),
            completion_tokens: None,
            cached_tokens: Some(0),
        };
        assert_eq!(Tokens::of(Some(usage)).usage(), Some(usage));
        assert_eq!(Tokens::of(None).usage(), None);
        let large = Usage {
            prompt_tokens: Some(u64::MAX),
            ..usage
        };
        let read = Tokens::of(Some(large)).usage().unwrap();
        assert_eq!(read.prompt_tokens, Some(u64::from(u32::MAX) - 1));
    }
}
