//! Classes that are common in each type of room: [`Frequency`].

use std::collections::{BTreeMap, BTreeSet};

use super::rules::{ClassFlag, RuleBook};
use super::statistics::FrameStatistics;

/// Number of frames in which each asked class is evidence, by room type and scene.
#[derive(Debug, Default)]
pub struct Frequency {
    /// Counts by room type, scene and class. The room type `""` stands for all frames.
    counts: BTreeMap<String, BTreeMap<String, BTreeMap<String, u64>>>,
}

impl Frequency {
    /// Counts the classes of a frame.
    pub fn add(&mut self, statistics: &FrameStatistics, room: Option<&str>, book: &RuleBook) {
        let classes: BTreeSet<&str> = statistics
            .evidence(book)
            .map(|segment| segment.class.as_str())
            .filter(|class| book.has_flag(class, ClassFlag::Asked))
            .collect();
        for room in [Some(""), room].into_iter().flatten() {
            let scenes = self.counts.entry(room.to_owned()).or_default();
            let counts = scenes.entry(statistics.scene.clone()).or_default();
            for class in &classes {
                *counts.entry((*class).to_owned()).or_insert(0) += 1;
            }
        }
    }

    /// Classes to expect in a room of a scene: the `max` most common ones in such rooms of other scenes, or in all
    /// frames if no other scene has such a room. `None` if fewer than `max` classes occur, which is too little
    /// evidence.
    #[must_use]
    pub fn expected(&self, room: &str, scene: &str, max: usize) -> Option<BTreeSet<String>> {
        let elsewhere = self.total(room, Some(scene));
        let counts = if elsewhere.is_empty() { self.total("", None) } else { elsewhere };
        if counts.len() < max {
            return None;
        }
        let mut ranked: Vec<(&str, u64)> = counts.into_iter().collect();
        ranked.sort_by_key(|&(class, count)| (std::cmp::Reverse(count), class));
        Some(ranked.into_iter().take(max).map(|(class, _)| class.to_owned()).collect())
    }

    /// Number of frames that show each class in a type of room, over all scenes but one.
    fn total(&self, room: &str, except: Option<&str>) -> BTreeMap<&str, u64> {
        let mut total = BTreeMap::new();
        for (_, counts) in
            self.counts.get(room).into_iter().flatten().filter(|(scene, _)| Some(scene.as_str()) != except)
        {
            for (class, count) in counts {
                *total.entry(class.as_str()).or_insert(0) += count;
            }
        }
        total
    }
}
