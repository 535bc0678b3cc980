//! The source at which a process starts in its plan: [`first_source`].

use crate::runs::shard::Shard;
use crate::types::Digest;

/// The index of the first source that a process works on, in a plan of `count` sources. It depends on the models and
/// the shard, so that processes that share an image store start at different sources, and most images are made by only
/// one of them.
pub(crate) fn first_source<'n>(models: impl Iterator<Item = &'n str>, shard: Shard, count: usize) -> usize {
    let shard = shard.to_string();
    let mut parts: Vec<&[u8]> = models.map(str::as_bytes).collect();
    parts.push(shard.as_bytes());
    let number =
        Digest::from_parts(parts).as_bytes().iter().take(8).fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
    match count {
        0 => 0,
        count => (number % count as u64) as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(model: &str, shard: Shard) -> usize {
        first_source([model].into_iter(), shard, 1000)
    }

    #[test]
    fn first_source_depends_on_models_and_shard_only() {
        let whole: Shard = "1/1".parse().unwrap();
        assert_eq!(first("a", whole), first("a", whole));
        assert_ne!(first("a", whole), first("b", whole));
        assert_ne!(first("a", "1/2".parse().unwrap()), first("a", "2/2".parse().unwrap()));
        assert_eq!(first_source(["a"].into_iter(), whole, 0), 0);
        for model in ["a", "b", "c", "d"] {
            assert!(first_source([model].into_iter(), whole, 3) < 3);
        }
    }
}
