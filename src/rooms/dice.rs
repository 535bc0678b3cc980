//! Draws that a seed and a name decide: [`Dice`].

use blake3::OutputReader;

use crate::types::Digest;

/// A row of numbers that its parts decide: the output stream of BLAKE3 over their digest.
#[derive(Debug, Clone)]
pub(super) struct Dice(OutputReader);

impl Dice {
    /// The row of a seed, for one use of it.
    pub(super) fn new(seed: u64, parts: &[&str]) -> Self {
        let seed = seed.to_le_bytes();
        let all = [&b"darkqa-eval rooms"[..], &seed]
            .into_iter()
            .chain(parts.iter().map(|part| part.as_bytes()));
        let digest = Digest::of_parts(all);
        Self(blake3::Hasher::new_keyed(digest.as_bytes()).finalize_xof())
    }

    fn word(&mut self) -> u32 {
        let mut bytes = [0; 4];
        self.0.fill(&mut bytes);
        u32::from_le_bytes(bytes)
    }

    /// A number from 0 to 1, 1 left out.
    pub(super) fn unit(&mut self) -> f32 {
        (self.word() >> 8) as f32 / (1_u32 << 24) as f32
    }

    /// A number between two.
    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A whole number below another, which is above 0.
    pub(super) fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.word()) * count as u64) >> 32) as usize
    }

    /// Whether something of this probability happens.
    pub(super) fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// One of several, of which there is at least one.
    pub(super) fn pick<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_decide_the_row() {
        let row = |seed, parts: &[&str]| -> Vec<u32> {
            let mut dice = Dice::new(seed, parts);
            (0..4).map(|_| dice.word()).collect()
        };
        assert_eq!(row(1, &["a", "b"]), row(1, &["a", "b"]));
        assert_ne!(row(1, &["a", "b"]), row(1, &["ab"]));
        assert_ne!(row(1, &["a"]), row(2, &["a"]));
    }

    #[test]
    fn draws_keep_to_their_bounds() {
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
