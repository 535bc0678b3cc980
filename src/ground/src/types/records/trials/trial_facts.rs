//! [`TrialFacts`]: one trial as held in memory.

use super::TextPlace;
use crate::types::records::small_number::{SmallNumber, Tokens};

/// Facts of one trial, without its key. Numbers are indices into the tables of its [`Trials`](super::Trials).
#[derive(Debug, Clone)]
pub(super) struct TrialFacts<F> {
    pub(super) text: TextPlace,
    /// Fingerprint that distinguishes replies; see [`reply_digest`].
    pub(super) reply: [u32; 2],
    pub(super) item: u32,
    pub(super) asked: u32,
    pub(super) ending: u32,
    pub(super) tokens: Tokens,
    /// In milliseconds.
    pub(super) latency: SmallNumber,
    pub(super) facts: F,
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
    use crate::types::records::trials::ChoiceFacts;

    #[test]
    fn a_trial_with_choices_takes_60_bytes() {
        assert_eq!(size_of::<TrialFacts<ChoiceFacts>>(), 60);
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
}
