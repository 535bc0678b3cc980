//! What of a run a shard does: [`part`].

use std::collections::HashMap;
use std::ops::Range;

use super::shard::Shard;
use crate::error::{Error, Result};
use crate::types::manifest::PartPlace;

/// The questions about the sources of a shard, with the place of these sources; the place is `None` for everything.
///
/// Sources are numbered in the order of their first question. A shard has neighbouring ones, about as many as any other. Neighbours
/// of one scene stay together where they are at most as many as a shard has. `source` returns the source of a question, and `scene`
/// its scene; it is empty where there is none.
///
/// # Errors
/// If the shard has no question.
pub(crate) fn part<Q>(
    questions: Vec<Q>,
    shard: Shard,
    source: impl Fn(&Q) -> String,
    scene: impl Fn(&Q) -> String,
) -> Result<(Vec<Q>, Option<PartPlace>)> {
    if !shard.is_part() {
        return Ok((questions, None));
    }
    let mut positions = HashMap::<String, usize>::new();
    let mut scenes = Vec::new();
    for question in &questions {
        let next = positions.len();
        positions.entry(source(question)).or_insert_with(|| {
            scenes.push(scene(question));
            next
        });
    }
    let own = sources(&scenes, shard);
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
    let questions = questions.into_iter();
    let questions = questions.filter(|question| own.contains(&positions[&source(question)]));
    Ok((questions.collect(), Some(place)))
}

/// The positions of a shard's sources, whose scenes are given.
fn sources(scenes: &[String], shard: Shard) -> Range<usize> {
    let parts = shard.count().get() as usize;
    let most = scenes.len() / parts;
    // The shard of a position is the one in whose equal part of the whole it lies.
    let part_of = |position: usize| position * parts / scenes.len();
    let index = shard.index() as usize;
    let (mut first, mut end) = (scenes.len(), 0);
    let mut start = 0;
    for together in scenes.chunk_by(|one, next| !one.is_empty() && one == next) {
        let is_kept = together.len() <= most;
        for position in start..start + together.len() {
            if part_of(if is_kept { start } else { position }) == index {
                first = first.min(position);
                end = position + 1;
            }
        }
        start += together.len();
    }
    first.min(end)..end
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
        let scenes: Vec<String> = scenes.chars().map(scene).collect();
        let shards = Shard::all(NonZeroU32::new(count).unwrap());
        shards.map(|shard| sources(&scenes, shard)).collect()
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
}
