//! [`TrialFacts`]: one trial as held in memory.

use super::TextPlace;
use crate::types::records::small_number::{SmallNumber, Tokens};

/// Facts of one trial, without its key. Numbers are indices into the tables of its [`Trials`](super::Trials).
#[derive(Debug, Clone)]
pub(super) struct TrialFacts<F> {
    pub(super) text: TextPlace,
    /// Hash of the reply and refusal ([`hash_reply`]).
    pub(super) reply: [u32; 2],
    pub(super) item: u32,
    pub(super) asked: u32,
    pub(super) ending: u32,
    pub(super) tokens: Tokens,
    /// Duration of the last attempt, in milliseconds.
    pub(super) latency: SmallNumber,
    pub(super) facts: F,
}

/// Hashes a reply and a refusal, to compare them between trials. Zero means no reply.
pub(super) fn hash_reply(reply: Option<&str>, refusal: Option<&str>) -> [u32; 2] {
    if reply.is_none() && refusal.is_none() {
        return [0; 2];
    }
    let mut hasher = blake3::Hasher::new();
    for text in [reply, refusal] {
        let length = text.map_or(u64::MAX, |text| text.len() as u64);
        hasher.update(&length.to_le_bytes());
        hasher.update(text.unwrap_or_default().as_bytes());
    }
    let [a, b, c, d, e, f, g, h, ..] = *hasher.finalize().as_bytes();
    [u32::from_le_bytes([a, b, c, d]).max(1), u32::from_le_bytes([e, f, g, h])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::records::trials::ChoiceFacts;

    #[test]
    fn a_trial_with_choices_takes_72_bytes() {
        assert_eq!(size_of::<TrialFacts<ChoiceFacts>>(), 72);
    }

    #[test]
    fn replies_and_refusals_have_different_hashes() {
        let digests =
            [(None, None), (Some(""), None), (None, Some("")), (Some("a"), Some("b")), (Some("ab"), Some(""))]
                .map(|(reply, refusal)| hash_reply(reply, refusal));
        for (place, one) in digests.iter().enumerate() {
            assert!(!digests[place + 1..].contains(one));
        }
    }
}
