//! Division of a run's sources into shards: [`shard_questions`], [`shard_range`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ops::Range;

use crate::error::{Error, Result};
use crate::runs::shard::Shard;
use crate::types::manifests::PartPlace;
use crate::types::text::plural;

/// The questions about the sources of a shard, with the place of these sources. The place is `None` if the run is not
/// divided.
///
/// Sources are numbered in the order of their first question. A shard has consecutive sources, and all shards cost
/// about the same. Consecutive sources of one scene stay in one shard if they cost at most as much as a shard. `source`
/// returns the source of a question, `scene` its scene (empty if it has none), and `cost` the cost of a source in any
/// unit.
///
/// # Errors
/// If the shard is empty.
pub(crate) fn shard_questions<Q>(
    questions: Vec<Q>,
    shard: Shard,
    source: impl Fn(&Q) -> String,
    scene: impl Fn(&Q) -> String,
    cost: impl Fn(&str) -> u64,
) -> Result<(Vec<Q>, Option<PartPlace>)> {
    if !shard.is_part() {
        return Ok((questions, None));
    }
    let mut positions = HashMap::<String, usize>::new();
    let mut sources = Vec::new();
    for question in &questions {
        let next = positions.len();
        if let Entry::Vacant(place) = positions.entry(source(question)) {
            sources.push(WeightedSource { scene: scene(question), cost: cost(place.key()) });
            place.insert(next);
        }
    }
    let own = shard_range(&sources, shard);
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: only {}; use at most as many shards",
            plural(positions.len(), "frame or walk", "frames or walks")
        );
        return Err(Error::usage("--shard", problem));
    }
    let place = PartPlace { first: own.start, count: own.len(), of: positions.len() };
    let questions = questions.into_iter().filter(|question| own.contains(&positions[&source(question)]));
    Ok((questions.collect(), Some(place)))
}

/// The scene and the cost of a source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct WeightedSource {
    /// Empty if the source has no scene.
    pub(crate) scene: String,
    /// Cost in any unit; 0 counts as 1.
    pub(crate) cost: u64,
}

impl WeightedSource {
    /// A source without a scene and with the same cost as all others.
    pub(crate) fn equal() -> Self {
        Self { scene: String::new(), cost: 1 }
    }
}

/// The indices of a shard's sources; empty only if there are more shards than sources.
pub(crate) fn shard_range(sources: &[WeightedSource], shard: Shard) -> Range<usize> {
    let mut starts = shard_starts(sources, shard.count().get() as usize);
    starts.push(sources.len());
    let index = shard.index() as usize;
    starts[index]..starts[index + 1]
}

/// The index of the first source of each shard.
fn shard_starts(sources: &[WeightedSource], count: usize) -> Vec<usize> {
    let total: u128 = sources.iter().map(cost).sum();
    // The total cost is cut into equal shares. A source belongs to the share in which it starts.
    let shard_at = |cost_before: u128| (cost_before * count as u128 / total.max(1)) as usize;
    let mut shards = Vec::with_capacity(sources.len());
    let mut cost_before = 0;
    for scene in sources.chunk_by(|one, next| !one.scene.is_empty() && one.scene == next.scene) {
        let scene_cost: u128 = scene.iter().map(cost).sum();
        let fits_in_shard = scene_cost * count as u128 <= total;
        let first = shard_at(cost_before);
        for source in scene {
            shards.push(if fits_in_shard { first } else { shard_at(cost_before) });
            cost_before += cost(source);
        }
    }
    let mut starts: Vec<usize> = (0..count).map(|shard| shards.partition_point(|other| *other < shard)).collect();
    // If there are enough sources, give each shard at least one, although a source may cost more than a share.
    if count <= sources.len() {
        for shard in 1..count {
            starts[shard] = starts[shard].max(starts[shard - 1] + 1);
        }
        for shard in (1..count).rev() {
            starts[shard] = starts[shard].min(sources.len() - (count - shard));
        }
    }
    starts
}

fn cost(source: &WeightedSource) -> u128 {
    u128::from(source.cost.max(1))
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;

    fn cuts(scenes: &str, count: u32) -> Vec<Range<usize>> {
        let sources = scenes.chars().map(|letter| WeightedSource {
            scene: match letter {
                '-' => String::new(),
                letter => letter.to_string(),
            },
            cost: 1,
        });
        divided(&sources.collect::<Vec<WeightedSource>>(), count)
    }

    fn divided(sources: &[WeightedSource], count: u32) -> Vec<Range<usize>> {
        let shards = Shard::all(NonZeroU32::new(count).unwrap());
        shards.map(|shard| shard_range(sources, shard)).collect()
    }

    fn divided_costs(costs: &[u64]) -> Vec<WeightedSource> {
        costs.iter().map(|cost| WeightedSource { scene: String::new(), cost: *cost }).collect()
    }

    #[test]
    fn every_source_is_in_one_shard_and_no_shard_is_empty() {
        for count in 1..=20 {
            for scenes in [
                "-".repeat(20),
                "aabbccddeeffgghhiijj".to_owned(),
                "aaaaaaaaaaabbbcddddd".to_owned(),
                "aaaaaaaaaaaaaaaaaaaa".to_owned(),
                "abbbccddddeeeeefffff".to_owned(),
            ] {
                let cuts = cuts(&scenes, count);
                let mut end = 0;
                for cut in &cuts {
                    assert_eq!(cut.start, end, "{scenes} {count}: {cuts:?}");
                    assert!(!cut.is_empty(), "{scenes} {count}: {cuts:?}");
                    end = cut.end;
                }
                assert_eq!(end, 20, "{scenes} {count}: {cuts:?}");
            }
        }
        // More shards than sources: some have none.
        assert_eq!(cuts("--", 3).iter().filter(|cut| cut.is_empty()).count(), 1);
    }

    #[test]
    fn a_scene_is_divided_only_if_it_is_larger_than_a_shard() {
        assert_eq!(cuts("------", 4), [0..2, 2..3, 3..5, 5..6]);
        assert_eq!(cuts("aabbcc", 2), [0..4, 4..6]);
        assert_eq!(cuts("aabbcc", 3), [0..2, 2..4, 4..6]);
        assert_eq!(cuts("aaaaab", 2), [0..3, 3..6]);
    }

    #[test]
    fn shards_cost_about_the_same() {
        // One source costs as much as all others together.
        assert_eq!(divided(&divided_costs(&[4, 1, 1, 1, 1]), 2), [0..1, 1..5]);
        assert_eq!(divided(&divided_costs(&[1, 1, 1, 1, 4]), 2), [0..4, 4..5]);
        assert_eq!(divided(&divided_costs(&[2, 2, 1, 1, 1, 1]), 2), [0..2, 2..6]);
        // An expensive source leaves no shard empty.
        assert_eq!(divided(&divided_costs(&[100, 1, 1]), 3), [0..1, 1..2, 2..3]);
        assert_eq!(divided(&divided_costs(&[1, 1, 100]), 3), [0..1, 1..2, 2..3]);
        assert_eq!(divided(&divided_costs(&[0, 0, 0]), 3), [0..1, 1..2, 2..3]);
        let costs: Vec<u64> = (0..50).map(|i| 1 + i * i % 17).collect();
        let sum: u64 = costs.iter().sum();
        let parts = divided(&divided_costs(&costs), 7);
        assert_eq!(parts.iter().map(Range::len).sum::<usize>(), 50);
        for part in parts {
            let own: u64 = costs[part].iter().sum();
            assert!(own.abs_diff(sum / 7) <= 17, "{own} of {sum}");
        }
    }
}
