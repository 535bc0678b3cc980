//! The part of a run that a shard does: [`part`].

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ops::Range;

use crate::error::{Error, Result};
use crate::runs::shard::Shard;
use crate::types::manifests::PartPlace;

/// The questions about the sources of a shard, with the place of these sources; the place is `None` for everything.
///
/// Sources are numbered in the order of their first question. A shard has neighbouring ones, which cost about as much as those of
/// any other. Neighbours of one scene stay together where they cost at most as much as a shard. `source` returns the source of a
/// question, `scene` its scene, which is empty where there is none, and `cost` the cost of a source, in any unit.
///
/// # Errors
/// If the shard has no question.
pub(crate) fn part<Q>(
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
    let mut divided = Vec::new();
    for question in &questions {
        let next = positions.len();
        if let Entry::Vacant(place) = positions.entry(source(question)) {
            divided.push(Divided {
                scene: scene(question),
                cost: cost(place.key()),
            });
            place.insert(next);
        }
    }
    let own = own_sources(&divided, shard);
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: there are {} frames or walks; use at most as many shards",
            positions.len()
        );
        return Err(Error::usage("--shard", problem));
    }
    let place = PartPlace {
        first: own.start,
        count: own.len(),
        of: positions.len(),
    };
    let questions = questions
        .into_iter()
        .filter(|question| own.contains(&positions[&source(question)]));
    Ok((questions.collect(), Some(place)))
}

/// A source as it is divided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Divided {
    /// Its scene; empty if there is none.
    pub(crate) scene: String,
    /// Its cost, in any unit; 0 counts as 1.
    pub(crate) cost: u64,
}

/// The positions of a shard's sources among all of them; empty only if there are more shards than sources.
pub(crate) fn own_sources(sources: &[Divided], shard: Shard) -> Range<usize> {
    let count = sources.len();
    let parts = shard.count().get() as usize;
    let starts = starts(sources, parts);
    let index = shard.index() as usize;
    let start = |index: usize| starts.get(index).copied().unwrap_or(count);
    start(index)..start(index + 1)
}

/// The position of the first source of each part.
fn starts(sources: &[Divided], parts: usize) -> Vec<usize> {
    let cost = |source: &Divided| u128::from(source.cost.max(1));
    let total: u128 = sources.iter().map(cost).sum();
    // A source is in the part in whose equal share of the cost it begins.
    let part_of = |before: u128| (before * parts as u128 / total.max(1)) as usize;
    let mut part_of_source = Vec::with_capacity(sources.len());
    let mut before = 0;
    for together in sources.chunk_by(|one, next| !one.scene.is_empty() && one.scene == next.scene) {
        let own: u128 = together.iter().map(cost).sum();
        let (is_kept, first) = (own * parts as u128 <= total, part_of(before));
        for source in together {
            part_of_source.push(if is_kept { first } else { part_of(before) });
            before += cost(source);
        }
    }
    let mut starts: Vec<usize> = (0..parts)
        .map(|part| part_of_source.partition_point(|of| *of < part))
        .collect();
    // What costs more than a part leaves none empty beside it, as long as there are as many sources as parts.
    if parts <= sources.len() {
        for part in 1..parts {
            starts[part] = starts[part].max(starts[part - 1] + 1);
        }
        for part in (1..parts).rev() {
            starts[part] = starts[part].min(sources.len() - (parts - part));
        }
    }
    starts
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;

    fn cuts(scenes: &str, count: u32) -> Vec<Range<usize>> {
        let scene = |letter: char| match letter {
            '-' => String::new(),
            letter => letter.to_string(),
        };
        let sources = scenes.chars().map(|letter| Divided {
            scene: scene(letter),
            cost: 1,
        });
        divided(&sources.collect::<Vec<Divided>>(), count)
    }

    fn divided(sources: &[Divided], count: u32) -> Vec<Range<usize>> {
        let shards = Shard::all(NonZeroU32::new(count).unwrap());
        shards.map(|shard| own_sources(sources, shard)).collect()
    }

    fn divided_costs(costs: &[u64]) -> Vec<Divided> {
        costs
            .iter()
            .map(|cost| Divided {
                scene: String::new(),
                cost: *cost,
            })
            .collect()
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
    fn parts_cost_about_the_same() {
        // One source is as dear as all others together.
        assert_eq!(divided(&divided_costs(&[4, 1, 1, 1, 1]), 2), [0..1, 1..5]);
        assert_eq!(divided(&divided_costs(&[1, 1, 1, 1, 4]), 2), [0..4, 4..5]);
        assert_eq!(
            divided(&divided_costs(&[2, 2, 1, 1, 1, 1]), 2),
            [0..2, 2..6]
        );
        // A dear source leaves no part empty.
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
