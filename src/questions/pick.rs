//! Picks that look random but depend only on the frame and the purpose: [`Picker`].

use darkqa_base::types::{Digest, FrameId};

/// Prefix of every digest; changing it changes all questions.
const DOMAIN: &[u8] = b"darkqa-eval questions 1";

/// Pseudo-random picks for one frame.
///
/// There is no state: a pick is the BLAKE3 digest of seed, data set, frame, family and purpose, scaled to the range.
/// The order of the frames therefore does not matter.
#[derive(Debug, Clone, Copy)]
pub struct Picker<'a> {
    /// Seed of the rulebook.
    pub seed: u64,
    /// Name of the data set.
    pub dataset: &'a str,
    pub frame: &'a FrameId,
}

impl Picker<'_> {
    /// Returns the first 64 bits of the digest for a purpose.
    #[must_use]
    pub fn bits(&self, family: &str, purpose: &str) -> u64 {
        let seed = self.seed.to_le_bytes();
        let parts =
            [DOMAIN, &seed, self.dataset.as_bytes(), self.frame.0.as_bytes(), family.as_bytes(), purpose.as_bytes()];
        Digest::from_parts(parts).as_bytes().iter().take(8).fold(0, |bits, byte| (bits << 8) | u64::from(*byte))
    }

    /// Picks a number from 0 to `count` − 1; `count` must be above 0.
    #[must_use]
    pub fn pick(&self, family: &str, purpose: &str, count: usize) -> usize {
        ((u128::from(self.bits(family, purpose)) * count as u128) >> 64) as usize
    }

    /// Shuffles a list; all orders are equally likely (Fisher–Yates).
    pub fn shuffle<T>(&self, family: &str, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            let other = self.pick(family, &format!("shuffle {last}"), last + 1);
            list.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_are_even_and_pinned() {
        let mut counts = [0; 6];
        let mut orders = std::collections::BTreeMap::new();
        for i in 0..6_000 {
            let frame = FrameId(format!("scene/{i}"));
            let picker = Picker { seed: 0, dataset: "d", frame: &frame };
            counts[picker.pick("color", "segment", 6)] += 1;
            let mut list = [0, 1, 2];
            picker.shuffle("closest", &mut list);
            *orders.entry(list).or_insert(0) += 1;
        }
        // Expected: 1,000 each, with a standard deviation of 29.
        assert!(counts.iter().all(|count| (880..1120).contains(count)), "{counts:?}");
        assert_eq!(orders.len(), 6);
        assert!(orders.values().all(|count| (880..1120).contains(count)), "{orders:?}");
        let frame = FrameId("scene/0".into());
        let picker = Picker { seed: 0, dataset: "d", frame: &frame };
        assert_eq!(picker.bits("color", "segment"), 13977079698431977642);
    }

    #[test]
    fn every_part_counts() {
        let (here, there) = (FrameId("a".into()), FrameId("b".into()));
        let one = Picker { seed: 0, dataset: "d", frame: &here };
        let bits = one.bits("color", "x");
        for other in [Picker { seed: 1, ..one }, Picker { dataset: "e", ..one }, Picker { frame: &there, ..one }] {
            assert_ne!(bits, other.bits("color", "x"));
        }
        assert_ne!(bits, one.bits("closest", "x"));
        assert_ne!(bits, one.bits("color", "y"));
    }
}
