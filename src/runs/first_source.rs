//! The source of a plan that a process begins with: [`first_source`].

use crate::runs::shard::Shard;
use crate::types::Digest;

/// The place in a plan of `count` sources at which a process begins that asks these models about a part of the data. Processes that share
/// an image store and are started together begin at different places, so that most images are made by one of them only.
pub(crate) fn first_source<'n>(
    models: impl Iterator<Item = &'n str>,
    shard: Shard,
    count: usize,
) -> usize {
    let shard = shard.to_string();
    let mut parts: Vec<&[u8]> = models.map(str::as_bytes).collect();
    parts.push(shard.as_bytes());
    let digest = Digest::from_parts(parts);
    let bytes = digest.as_bytes();
    let number = bytes
        .iter()
        .take(8)
        .fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
    match count {
        0 => 0,
        count => (number % count as u64) as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_and_parts_begin_at_different_places_and_each_at_the_same_again() {
        let whole: Shard = "1/1".parse().unwrap();
        let of = |model: &str, shard| first_source([model].into_iter(), shard, 1000);
        assert_eq!(of("a", whole), of("a", whole));
        assert_ne!(of("a", whole), of("b", whole));
        assert_ne!(
            of("a", "1/2".parse().unwrap()),
            of("a", "2/2".parse().unwrap())
        );
        assert_eq!(first_source(["a"].into_iter(), whole, 0), 0);
        for model in ["a", "b", "c", "d"] {
            assert!(first_source([model].into_iter(), whole, 3) < 3);
        }
    }
}
