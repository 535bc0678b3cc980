//! Random numbers determined by a seed and names: [`SeededRng`].

use blake3::OutputReader;

use darkqa_base::types::Digest;

/// A sequence of random numbers: the output stream of BLAKE3, keyed by the digest of a seed and names.
#[derive(Debug, Clone)]
pub(super) struct SeededRng(OutputReader);

impl SeededRng {
    /// Creates the sequence of a seed for one purpose, such as `["kitchen-0001", "furniture"]`.
    pub(super) fn new(seed: u64, purpose: &[&str]) -> Self {
        let digest = Digest::from_parts(
            [&b"darkqa-eval rooms"[..], &seed.to_le_bytes()]
                .into_iter()
                .chain(purpose.iter().map(|name| name.as_bytes())),
        );
        Self(blake3::Hasher::new_keyed(digest.as_bytes()).finalize_xof())
    }

    fn next_u32(&mut self) -> u32 {
        let mut bytes = [0; 4];
        self.0.fill(&mut bytes);
        u32::from_le_bytes(bytes)
    }

    /// Returns a number from 0 (inclusive) to 1 (exclusive).
    pub(super) fn unit(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 / (1_u32 << 24) as f32
    }

    /// Returns a number from `low` (inclusive) to `high` (exclusive).
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Returns an integer from 0 to `count` − 1; `count` must be above 0.
    pub(super) fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.next_u32()) * count as u64) >> 32) as usize
    }

    /// Returns true with this probability.
    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// Returns a random entry of a list, which must not be empty.
    pub(super) fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(seed: u64, purpose: &[&str]) -> [u32; 4] {
        let mut rng = SeededRng::new(seed, purpose);
        std::array::from_fn(|_| rng.next_u32())
    }

    #[test]
    fn sequence_depends_on_seed_and_purpose() {
        assert_eq!(sequence(1, &["a", "b"]), sequence(1, &["a", "b"]));
        assert_ne!(sequence(1, &["a", "b"]), sequence(1, &["ab"]));
        assert_ne!(sequence(1, &["a"]), sequence(2, &["a"]));
    }

    #[test]
    fn numbers_stay_within_their_bounds() {
        let mut rng = SeededRng::new(0, &[]);
        let mut counts = [0; 3];
        for _ in 0..3000 {
            counts[rng.below(3)] += 1;
            assert!((2.0..3.0).contains(&rng.between(2.0, 3.0)));
        }
        // Five standard deviations of a fair draw are 129.
        assert!(counts.iter().all(|count: &i32| count.abs_diff(1000) < 130));
    }
}
