//! Random numbers that a seed and names decide: [`Dice`].

use blake3::OutputReader;

use darkqa_ground::types::Digest;

/// A sequence of random numbers: the output stream of BLAKE3, keyed by the digest of a seed and names.
#[derive(Debug, Clone)]
pub(super) struct Dice(OutputReader);

impl Dice {
    /// The sequence of a seed for one use, which `parts` name.
    pub(super) fn new(seed: u64, parts: &[&str]) -> Self {
        let seed = seed.to_le_bytes();
        let all = [&b"darkqa-eval rooms"[..], &seed]
            .into_iter()
            .chain(parts.iter().map(|part| part.as_bytes()));
        let digest = Digest::from_parts(all);
        Self(blake3::Hasher::new_keyed(digest.as_bytes()).finalize_xof())
    }

    fn word(&mut self) -> u32 {
        let mut bytes = [0; 4];
        self.0.fill(&mut bytes);
        u32::from_le_bytes(bytes)
    }

    /// A number from 0 to 1, without 1.
    pub(super) fn unit(&mut self) -> f32 {
        (self.word() >> 8) as f32 / (1_u32 << 24) as f32
    }

    /// A number from `low` to `high`, without `high`.
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A whole number below `count`, which must be above 0.
    pub(super) fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.word()) * count as u64) >> 32) as usize
    }

    /// `true` with this probability.
    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// One entry of a list, which must not be empty.
    pub(super) fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_decide_the_sequence() {
        let sequence = |seed, parts: &[&str]| -> Vec<u32> {
            let mut dice = Dice::new(seed, parts);
            (0..4).map(|_| dice.word()).collect()
        };
        assert_eq!(sequence(1, &["a", "b"]), sequence(1, &["a", "b"]));
        assert_ne!(sequence(1, &["a", "b"]), sequence(1, &["ab"]));
        assert_ne!(sequence(1, &["a"]), sequence(2, &["a"]));
    }

    #[test]
    fn numbers_stay_within_their_bounds() {
        let mut dice = Dice::new(0, &[]);
        let mut counts = [0; 3];
        for _ in 0..3000 {
            counts[dice.below(3)] += 1;
            assert!((2.0..3.0).contains(&dice.between(2.0, 3.0)));
        }
        // Five standard deviations of a fair draw are 129.
        assert!(counts.iter().all(|count: &i32| count.abs_diff(1000) < 130));
    }
}
