//! What is common in which rooms: [`Frequency`].

use std::collections::{BTreeMap, BTreeSet};

use super::rules::{ClassFlag, RuleBook};
use super::statistics::FrameStatistics;

/// In how many frames each asked class is well seen, by room and scene.
#[derive(Debug, Default)]
pub(crate) struct Frequency {
    /// By room, then by scene; the room `""` is all frames.
    counts: BTreeMap<String, BTreeMap<String, BTreeMap<String, u64>>>,
}

impl Frequency {
    /// Counts a frame.
    pub(crate) fn add(
        &mut self,
        statistics: &FrameStatistics,
        room: Option<&str>,
        book: &RuleBook,
    ) {
        let evidence = statistics.evidence(book);
        let classes: BTreeSet<&str> = evidence
            .map(|segment| segment.class.as_str())
            .filter(|class| book.is(class, ClassFlag::Asked))
            .collect();
        for room in [Some(""), room].into_iter().flatten() {
            let scenes = self.counts.entry(room.to_owned()).or_default();
            let counts = scenes.entry(statistics.scene.clone()).or_default();
            for class in &classes {
                *counts.entry((*class).to_owned()).or_insert(0) += 1;
            }
        }
    }

    /// The classes that may be expected in a room of a scene: the `most` commonest of that room in other scenes; where there
    /// is no such room elsewhere, of all frames. `None` where fewer than `most` classes are seen there: too little to tell.
    #[must_use]
    pub(crate) fn expected(
        &self,
        room: &str,
        scene: &str,
        most: usize,
    ) -> Option<BTreeSet<String>> {
        let elsewhere = self.total(room, Some(scene));
        let counts = if elsewhere.is_empty() {
            self.total("", None)
        } else {
            elsewhere
        };
        if counts.len() < most {
            return None;
        }
        let mut ranked: Vec<(&str, u64)> = counts.into_iter().collect();
        ranked.sort_by_key(|&(class, count)| (std::cmp::Reverse(count), class));
        Some(
            ranked
                .into_iter()
                .take(most)
                .map(|(class, _)| class.to_owned())
                .collect(),
        )
    }

    fn total(&self, room: &str, but: Option<&str>) -> BTreeMap<&str, u64> {
        let mut total = BTreeMap::new();
        let scenes = self.counts.get(room).into_iter().flatten();
        for (_, counts) in scenes.filter(|(scene, _)| Some(scene.as_str()) != but) {
            for (class, count) in counts {
                *total.entry(class.as_str()).or_insert(0) += count;
            }
        }
        total
    }
}
