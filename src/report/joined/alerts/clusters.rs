//! Alerts about the sample: few clusters, copies of a picture, and scenes ([`cluster_alerts`], [`rare_loss_alert`]).

use std::collections::{BTreeMap, BTreeSet};

use crate::report::joined::combine::{Combined, frame_ties};
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::text::counted;
use crate::types::{Digest, FrameId};
use darkqa_score::cluster::{ClusterUnit, MIN_CLUSTERS};
use darkqa_score::comparisons::PooledKind;
use darkqa_score::findings::Findings;
use darkqa_score::significance::Significance;
use darkqa_score::suggested_scenes::SuggestedScenes;

/// Share of the questions from which on a scene is large (chosen). Simulated intervals of 20 and 42 scenes of which one
/// had nine tenths of the replies held the truth in 89 to 98 %.
const LARGE_SHARE: f64 = 0.5;
/// Number of scenes from which on one of ten is missed in less than 5 % of samples.
const ENOUGH_FOR_RARE: usize = 30;

/// Alerts about few clusters, copies of a picture, a single frame or scene, missing scenes, and a large one. Without
/// replies, the number of clusters is 0 and gets no alert.
pub(super) fn cluster_alerts(combined: &Combined, clusters: usize, unit: ClusterUnit) -> Vec<Alert> {
    let frames: BTreeSet<&FrameId> = combined.questions.iter().map(|one| &one.frame).collect();
    let few_clusters = if clusters == 0 {
        None
    } else if clusters < MIN_CLUSTERS {
        Some(format!(
            "Only {} ({MIN_CLUSTERS} are needed): wide intervals, few possible verdicts.",
            counted(clusters, &unit.to_string())
        ))
    } else if frames.len() == 1 {
        let text = "Only 1 frame: intervals and tests are by question, and say nothing about other frames.";
        Some(text.to_owned())
    } else {
        None
    };
    few_clusters
        .into_iter()
        .chain(copies(combined, &frames))
        .chain(named_scenes(combined, &frames))
        .chain(largest_scene(combined))
        .map(|text| Alert::new(AlertKind::Clusters, text))
        .collect()
}

/// Sentence about frames that show the same picture; `None` if all pictures differ. A frame without a known digest
/// counts as a picture.
fn copies(combined: &Combined, frames: &BTreeSet<&FrameId>) -> Option<String> {
    let digests = frame_ties(&combined.questions).digests;
    let pictures: BTreeSet<&Digest> = digests.values().collect();
    let pictures = pictures.len() + frames.len() - digests.len();
    (pictures < frames.len()).then(|| {
        format!(
            "{} show {}: equal pictures count as one frame.",
            counted(frames.len(), "frame"),
            counted(pictures, "different picture")
        )
    })
}

/// Sentence about scenes: if no question has one, but the frame names suggest some; if only some frames have one; or if
/// all frames have the same one.
fn named_scenes(combined: &Combined, frames: &BTreeSet<&FrameId>) -> Option<String> {
    let scenes: BTreeMap<&FrameId, &String> =
        combined.questions.iter().filter(|one| !one.scene.is_empty()).map(|one| (&one.frame, &one.scene)).collect();
    if scenes.is_empty() {
        let suggested = SuggestedScenes::new(frames.iter().copied())?;
        return Some(format!(
            "{}: intervals may be too narrow. Give each question a \"scene\" and repeat the run's command; nothing is asked again.",
            suggested.sentence()
        ));
    }
    let without = frames.len() - scenes.len();
    if without > 0 {
        let count = if without == 1 { "counts as a scene" } else { "count as scenes" };
        return Some(format!(
            "{without} of {} have no scene and {count} of their own.",
            counted(frames.len(), "frame")
        ));
    }
    let names: BTreeSet<&String> = scenes.into_values().collect();
    (names.len() == 1 && frames.len() > 1).then(|| {
        format!(
            "All {} frames are of one scene and count as independent: the results are about this scene alone. Take more scenes.",
            frames.len()
        )
    })
}

/// Sentence about a scene with at least [`LARGE_SHARE`] of the questions, if there are others.
fn largest_scene(combined: &Combined) -> Option<String> {
    let mut sizes = BTreeMap::<&str, usize>::new();
    let scenes = combined.questions.iter().map(|one| one.scene.as_str());
    for scene in scenes.filter(|scene| !scene.is_empty()) {
        *sizes.entry(scene).or_default() += 1;
    }
    let (scene, size) = sizes.iter().max_by_key(|(_, size)| **size)?;
    let share = *size as f64 / combined.questions.len() as f64;
    (sizes.len() > 2 && share >= LARGE_SHARE).then(|| {
        format!(
            "Scene {scene} has {:.0} % of the questions: the results are mostly about it, and intervals may be too narrow.",
            100.0 * share
        )
    })
}

/// Alert for an enhancer that is called better although a scene in ten that it ruins may not be in the sample.
pub(super) fn rare_loss_alert(findings: &Findings<'_>) -> Option<Alert> {
    let clusters = findings.grid.clusters;
    let is_better = findings.pooled.iter().any(|finding| {
        let verdict = finding.verdict();
        match finding.kind {
            PooledKind::Enhancer => verdict == Some(Significance::Better),
            PooledKind::EnhancerPair => verdict.is_some_and(Significance::is_shown),
            _ => false,
        }
    });
    (is_better && clusters < ENOUGH_FOR_RARE).then(|| {
        let missed = 100.0 * 0.9_f64.powi(clusters as i32);
        let text = format!(
            "An enhancer is called better in {}. If it ruins one in ten, such a sample has none of them in {missed:.0} % of cases: take \
             {ENOUGH_FOR_RARE} or more.",
            counted(clusters, &findings.unit.to_string())
        );
        Alert::new(AlertKind::Clusters, text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sentences::tests::records::{answer, record, unanswered};
    use crate::types::{Family, Record};
    use darkqa_score::cluster::FrameTies;

    /// The record of an answer to a question whose first choice is true.
    fn answered(item: usize, condition: &str, is_right: bool) -> Record {
        let mut detail = unanswered(format!("f{:02}", item / 4), Family::Color, &["a", "b", "c"]);
        answer(&mut detail, usize::from(!is_right));
        record(item, "model", Some(condition.parse().unwrap()), detail)
    }

    /// The alert about an enhancer that makes a share of the wrong answers right, with a number of frames.
    fn alert(frames: usize, better: bool) -> Option<String> {
        let items = 0..4 * frames;
        let trials = items
            .flat_map(|item| {
                [
                    answered(item, "L0", true),
                    answered(item, "L3-ev", item % 4 == 0),
                    answered(item, "L3-ev+lift", item % 4 == 0 || better),
                ]
            })
            .collect();
        let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
        rare_loss_alert(&findings).map(|alert| alert.text)
    }

    #[test]
    fn a_better_enhancer_may_ruin_frames_that_were_not_drawn() {
        // 0.9 to the power of 20 is 0.12.
        let text = "An enhancer is called better in 20 frames. If it ruins one in ten, such a sample has none of them in 12 % of cases: take \
                    30 or more.";
        assert_eq!(alert(20, true).as_deref(), Some(text));
        assert_eq!(alert(20, false), None);
        assert_eq!(alert(30, true), None);
    }
}
