//! Alerts about questions and the sample.
//!
//! Alerts about questions that differ between runs or models: [`question_alerts`], [`repeat_alert`],
//! [`item_alerts`]; and about their true answers: [`balance_alert`].
//!
//! Alerts about the sample: few clusters, copies of a picture, and scenes ([`cluster_alerts`], [`rare_loss_alert`]).

use std::collections::{BTreeMap, BTreeSet, HashSet};

use crate::joined::combine::{CombinedRuns, frame_ties};
use crate::joined::join::Joined;
use crate::joined::settings::{has_human_answers, joined_with_and};
use crate::text::alert::{Alert, AlertKind};
use crate::text::words::family as family_name;
use darkqa_base::types::text::{counted, excerpt};
use darkqa_base::types::{Digest, FrameId, QuestionId, RunQuestion, TrialRef, View};
use darkqa_score::answers::record::Detail;
use darkqa_score::cluster::{ClusterUnit, MIN_CLUSTERS};
use darkqa_score::comparisons::PooledKind;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::is_control;
use darkqa_score::significance::Verdict;
use darkqa_score::suggested_scenes::SuggestedScenes;

/// Alerts about differences between the questions of the runs, and between their image files.
pub(super) fn question_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut asked = Vec::<BTreeMap<&QuestionId, Option<&RunQuestion>>>::new();
    for run in &joined.runs {
        // A control gets its own choice of frames, and in a shard other frames than the models.
        let ids: HashSet<&QuestionId> =
            joined.trials_of(run).filter(|trial| !is_control(trial.model())).map(TrialRef::question).collect();
        let mut ids: BTreeMap<&QuestionId, Option<&RunQuestion>> = ids.into_iter().map(|id| (id, None)).collect();
        for question in &run.questions {
            if let Some(place) = ids.get_mut(&question.id) {
                *place = Some(question);
            }
        }
        asked.push(ids);
    }
    let mut alerts = Vec::new();
    let shared: Vec<&&QuestionId> =
        asked[0].keys().filter(|id| asked.iter().all(|ids| ids.contains_key(*id))).collect();
    if asked.iter().any(|ids| ids.len() != shared.len()) {
        let counts: Vec<String> =
            joined.runs.iter().zip(&asked).map(|(run, ids)| format!("{} of {}", ids.len(), run.name)).collect();
        let text =
            format!("The questions differ: {} share {}.", joined_with_and(&counts), counted(shared.len(), "question"));
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    // Each question is compared with the same one in the first run that has it.
    let mut firsts = BTreeMap::<&QuestionId, &RunQuestion>::new();
    let mut pairs = Vec::<(&QuestionId, &RunQuestion, &RunQuestion)>::new();
    for (id, question) in asked.iter().flatten() {
        if let Some(question) = question {
            match firsts.get(id) {
                Some(first) => pairs.push((id, first, question)),
                None => {
                    firsts.insert(id, question);
                }
            }
        }
    }
    let count = |differs: &dyn Fn(&RunQuestion, &RunQuestion) -> bool| {
        let ids: BTreeSet<&QuestionId> =
            pairs.iter().filter(|(_, one, other)| differs(one, other)).map(|(id, ..)| *id).collect();
        ids.len()
    };
    let words = count(&|one, other| one.text != other.text);
    if words > 0 {
        let text = format!("The words of {} differ.", counted(words, "shared question"));
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    let files = count(&|one, other| one.image.zip(other.image).is_some_and(|(a, b)| a != b));
    if files > 0 {
        let text = format!("The frames of {} are other files under the same names.", counted(files, "shared question"));
        alerts.push(Alert::new(AlertKind::Data, text));
    }
    let groups = count(&|one, other| {
        let groups = one.group.as_ref().zip(other.group.as_ref());
        groups.is_some_and(|(group, other)| group != other)
    });
    if groups > 0 {
        let text = format!(
            "The groups of {} differ; those of the first run by name count.",
            counted(groups, "shared question")
        );
        alerts.push(Alert::new(AlertKind::Questions, text));
    }
    alerts
}

/// The alert about runs that asked the same questions a different number of times.
pub(super) fn repeat_alert(combined: &CombinedRuns) -> Option<Alert> {
    let times: Vec<(&String, u32)> = combined
        .runs
        .iter()
        .filter(|run| !has_human_answers(&run.manifest))
        .map(|run| {
            let times = combined.trials_of(run).map(|trial| trial.repeat().saturating_add(1)).max();
            (&run.name, times.unwrap_or(1))
        })
        .collect();
    let differs = times.iter().any(|(_, times_here)| *times_here != times[0].1);
    differs.then(|| {
        let times: Vec<String> = times.iter().map(|(run, times)| format!("{times} in {run}")).collect();
        let text =
            format!("Questions were asked a different number of times: --repeats is {}.", joined_with_and(&times));
        Alert::new(AlertKind::Questions, text)
    })
}

/// The alert about families of which one answer is true so often that a constant reply scores well.
pub(super) fn balance_alert(findings: &Findings<'_>) -> Option<Alert> {
    let has_blind = findings.grid.subjects.iter().any(|subject| subject.view == Some(View::Blind));
    let remedy =
        if has_blind { "Compare with the accuracy without images" } else { "Ask without images too (--blind)" };
    let families: Vec<String> = findings
        .summary
        .unbalanced
        .iter()
        .map(|one| {
            format!(
                "“{}” is true of {} of {} questions about {}",
                excerpt(&one.answer, 60),
                one.count,
                one.questions,
                family_name(Some(&one.family))
            )
        })
        .collect();
    let text = format!(
        "One answer to everything scores well: {}. {remedy}, and read the balanced accuracy.",
        families.join(", ")
    );
    (!families.is_empty()).then(|| Alert::new(AlertKind::Answers, text))
}

/// The alert about models that did not answer the same questions.
pub(super) fn item_alerts(findings: &Findings<'_>) -> Vec<Alert> {
    let Some(common) = &findings.common else {
        return Vec::new();
    };
    let short: Vec<String> = common
        .asked
        .iter()
        .filter(|asked| asked.questions < common.questions)
        .enumerate()
        .map(|(place, asked)| {
            let blind = if asked.is_blind { " without images" } else { "" };
            let of = match place {
                0 => format!(" of {} questions", common.questions),
                _ => String::new(),
            };
            format!("{}{blind} was asked {}{of}", asked.model, asked.questions)
        })
        .collect();
    if short.is_empty() {
        return Vec::new();
    }
    let text = format!(
        "Models were asked different questions: {}. Compare by the {} shared: the second table has them, --common leaves out all others.",
        joined_with_and(&short),
        common.shared_questions
    );
    vec![Alert::new(AlertKind::Items, text)]
}

/// Share of the questions from which on a scene is large (chosen). Simulated intervals of 20 and 42 scenes of which one
/// had nine tenths of the replies held the truth in 89 to 98 %.
const LARGE_SHARE: f64 = 0.5;

/// Number of scenes from which on one of ten is missed in less than 5 % of samples.
const ENOUGH_FOR_RARE: usize = 30;

/// Alerts about few clusters, copies of a picture, a single frame or scene, missing scenes, and a large one. Without
/// replies, the number of clusters is 0 and gets no alert.
pub(super) fn cluster_alerts(combined: &CombinedRuns, clusters: usize, unit: ClusterUnit) -> Vec<Alert> {
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
fn copies(combined: &CombinedRuns, frames: &BTreeSet<&FrameId>) -> Option<String> {
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
fn named_scenes(combined: &CombinedRuns, frames: &BTreeSet<&FrameId>) -> Option<String> {
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
fn largest_scene(combined: &CombinedRuns) -> Option<String> {
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
            PooledKind::Enhancer => verdict == Some(Verdict::Better),
            PooledKind::EnhancerPair => verdict.is_some_and(Verdict::is_shown),
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
    use crate::sentences::tests::records::{answer, record, unanswered};
    use darkqa_base::types::{Family, Record};
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
