//! Tests of the findings over all models, [`super::comparisons`], on synthetic records.

use std::collections::BTreeSet;

use super::answers::confusion::{Collapse, FalseAnswer, confusions};
use super::choice::ParsingMode;
use super::cluster::{Clusters, FrameTies};
use super::comparisons::paired::PairedComparison;
use super::comparisons::{
    Comparison, ComparisonKind, PooledFinding, PooledKind, best_in_the_dark, comparisons, pooled,
};
use super::findings::Findings;
use super::grid::Grid;
use super::model_in_condition::ModelInCondition;
use super::significance::Verdict;
use darkqa_base::types::{
    ChoiceDetail, Condition, Digest, Family, FrameId, ParsedAnswer, QuestionId, Record, TrialOutcome,
};

/// Number of frames, each with two questions.
const FRAMES: usize = 12;

/// Whether a model is right about an item; `None` if the trial failed.
pub(super) type Answers = fn(usize) -> Option<bool>;

/// The records of a model in a condition; without images if the condition is empty.
pub(super) fn records(model: &str, condition: &str, answers: Answers) -> Vec<Record> {
    let condition: Option<Condition> = (!condition.is_empty()).then(|| condition.parse().unwrap());
    (0..2 * FRAMES)
        .map(|item: usize| {
            let right = answers(item);
            let chosen = right.map(|right| ParsedAnswer { chosen: Some(usize::from(!right)), why: None });
            let detail = ChoiceDetail {
                frame: FrameId(format!("f{:02}", item / 2)),
                family: [Family::Color, Family::RoomType][item % 2].clone(),
                choices: ["a", "b", "c"].map(str::to_owned).to_vec(),
                truth: Some(0),
                repeat: 0,
                wording: None,
                order: 0,
                strict: chosen,
                lenient: chosen,
                outcome: match right {
                    None => TrialOutcome::Failed,
                    Some(true) => TrialOutcome::Right,
                    Some(false) => TrialOutcome::Wrong,
                },
                image: None,
                more_images: Vec::new(),
                shown_frame: None,
                observed: None,
                options: None,
            };
            let key = Digest::from_bytes(format!("{item} {model} {condition:?}").as_bytes()).into();
            let question = QuestionId(format!("q{item:02}"));
            Record::blank(key, question, model, condition.clone(), detail)
        })
        .collect()
}

/// Runs a check on the grid of records.
pub(super) fn with_grid<T>(records: &[Record], check: impl FnOnce(&Grid<'_>) -> T) -> T {
    let asked = records.iter().map(|record| (&record.question, &record.detail.frame));
    let clusters = Clusters::new(asked, &FrameTies::default());
    check(&Grid::new(&records.iter().cloned().collect(), &clusters))
}

fn find<'f>(findings: &'f [PooledFinding], kind: PooledKind, condition: &str) -> Vec<&'f PooledFinding> {
    findings
        .iter()
        .filter(|finding| {
            let name = format!("{}-{}", finding.level, finding.variant);
            finding.kind == kind && finding.family.is_none() && name == condition
        })
        .collect()
}

#[test]
fn one_model_pooled_is_its_own_comparison() {
    let records = [
        records("m", "L0", |item| Some(item % 7 != 0)),
        records("m", "L3-noise", |item| (item != 5).then_some(item % 3 == 0)),
        records("m", "L5-noise", |item| Some(item == 4)),
        records("observer", "L0", |_| Some(true)),
        records("observer", "L3-noise", |_| Some(true)),
    ]
    .concat();
    with_grid(&records, |grid| {
        let (findings, _) = pooled(grid);
        let dark = find(&findings, PooledKind::Darkness, "L3-noise")[0];
        // The subjects are sorted: L0, L3-noise, L5-noise of the model, then the observer.
        let own = PairedComparison::new(grid, 1, 0, None, ParsingMode::Strict).unwrap();
        assert_eq!(dark.models, ["m"]);
        assert_eq!(dark.strict.tested.difference, own.tested.difference);
        assert!((dark.strict.tested.p - own.tested.p).abs() < 1e-15);
        assert!((dark.strict.first - own.first).abs() < 1e-12);
        assert_eq!((dark.items, dark.dropped, dark.clusters), (23, 1, 12));
        // Two levels: the smaller p counts twice.
        let darkest = find(&findings, PooledKind::Darkness, "L5-noise")[0];
        assert!((darkest.strict.tested.holm - 2.0 * darkest.strict.tested.p).abs() < 1e-15 && darkest.levels == 2);
        assert_eq!(darkest.strict.tested.verdict, Verdict::Worse);
        // By family the clusters are the same, and the sets are corrected apart.
        let by_family = findings.iter().filter(|finding| finding.family.is_some()).count();
        assert_eq!(by_family, 4);
    });
}

#[test]
fn of_many_models_the_best_in_the_dark_are_compared() {
    /// A model that is right about the first questions.
    fn right_about(count: usize, model: &str, condition: &str) -> Vec<Record> {
        let mut records = records(model, condition, |_| Some(true));
        for record in &mut records[count..] {
            let wrong = Some(ParsedAnswer { chosen: Some(1), why: None });
            (record.detail.strict, record.detail.lenient, record.detail.outcome) = (wrong, wrong, TrialOutcome::Wrong);
        }
        records
    }
    let compared = |models: usize| {
        // Each model is right about one question more in the dark than the one before, and about one less at L0.
        let of = |model: usize| {
            let name = format!("m{model:02}");
            [right_about(24 - model, &name, "L0"), right_about(model, &name, "L3-ev")].concat()
        };
        let records: Vec<Record> = (0..models).flat_map(of).collect();
        with_grid(&records, |grid| {
            let pairs = comparisons(grid).into_iter().filter(|one| one.kind == ComparisonKind::Model);
            let pairs: Vec<Comparison> = pairs.filter(|one| one.family.is_none()).collect();
            let names: BTreeSet<String> =
                pairs.iter().flat_map(|pair| [pair.first.model.clone(), pair.second.model.clone()]).collect();
            (names.len(), names.first().cloned(), pairs.len())
        })
    };
    // 66 pairs of 12 models, in two conditions.
    assert_eq!(compared(12), (12, Some("m00".to_owned()), 2 * 66));
    assert_eq!(compared(14), (12, Some("m02".to_owned()), 2 * 66));
}

#[test]
fn items_are_those_that_every_model_answered_on_both_sides() {
    let records = [
        records("a", "L3-ev", |_| Some(true)),
        records("a", "L3-noise", |item| (item != 0).then_some(item > 11)),
        records("b", "L3-ev", |item| (item != 1).then_some(true)),
        records("b", "L3-noise", |item| Some(item > 11)),
        records("c", "L3-ev", |_| Some(true)),
        records("c", "L3-noise", |item| Some(item > 11)),
        // Asked of one model only: no finding of the pool.
        records("b", "L5-noise", |_| Some(true)),
        records("b", "L5-ev", |_| Some(true)),
    ]
    .concat();
    with_grid(&records, |grid| {
        let (findings, _) = pooled(grid);
        let noise = find(&findings, PooledKind::Noise, "L3-noise")[0];
        assert_eq!((noise.items, noise.dropped), (22, 2));
        assert_eq!(noise.models, ["a", "b", "c"]);
        assert!((noise.strict.tested.difference.value + 10.0 / 22.0).abs() < 1e-12);
        assert!((noise.strict.second - 1.0).abs() < 1e-12);
        // Frames 1 to 5 lose all, frame 0 has no item: 5 of 11 clusters differ, all in one direction. The swaps do not
        // reject 0, so that the interval holds it.
        assert!((noise.strict.tested.p - 2.0 / 32.0).abs() < 1e-12 && noise.clusters == 11);
        assert!(noise.strict.tested.difference.high.abs() < 1e-12);
        assert!(find(&findings, PooledKind::Noise, "L5-noise").is_empty());
    });
}

#[test]
fn models_are_compared_with_their_own_words_if_some_were_asked() {
    let right: Answers = |_| Some(true);
    let base = [records("a", "L3-noise", |item| Some(item % 2 == 0)), records("b", "L3-noise", right)].concat();
    let own = [base.clone(), records("a", "", right), records("c", "", right)].concat();
    with_grid(&own, |grid| {
        let (findings, _) = pooled(grid);
        let blind = find(&findings, PooledKind::Blind, "L3-noise")[0];
        assert_eq!((&*blind.models, &*blind.blind_models), (&["a".to_owned()][..], &["a".to_owned()][..]));
        assert_eq!(blind.strict.tested.verdict, Verdict::Worse);
    });
    let other = [base, records("c", "", right), records("random", "", right)].concat();
    with_grid(&other, |grid| {
        let (findings, _) = pooled(grid);
        let blind = find(&findings, PooledKind::Blind, "L3-noise")[0];
        assert_eq!(blind.models, ["a", "b"]);
        assert_eq!(blind.blind_models, ["c"]);
        assert!((blind.strict.tested.difference.value + 0.25).abs() < 1e-12);
    });
}

#[test]
fn few_clusters_give_no_verdict() {
    let mut all = [records("m", "L0", |_| Some(true)), records("m", "L3-noise", |_| Some(false))].concat();
    // Five frames: 2 / 2⁵ is above 0.05.
    all.retain(|record| *record.detail.frame.0 < *"f05");
    with_grid(&all, |grid| {
        let (findings, _) = pooled(grid);
        let dark = find(&findings, PooledKind::Darkness, "L3-noise")[0];
        assert_eq!(dark.strict.tested.verdict, Verdict::TooFewClusters);
        assert!((dark.strict.tested.p - 0.0625).abs() < 1e-12 && (dark.least_p - 0.0625).abs() < 1e-15);
    });
}

#[test]
fn the_best_is_shown_better_than_every_other() {
    let mut all = Vec::new();
    let models: [(&str, Answers, Answers); 4] = [
        // At chance it loses nothing, and is not the best.
        ("guess", |item| Some(item % 3 == 0), |item| Some(item % 3 == 0)),
        ("good", |_| Some(true), |item| (item != 0).then_some(item % 8 != 0)),
        ("same", |_| Some(true), |item| Some(item % 8 != 1)),
        ("random", |_| Some(true), |_| Some(true)),
    ];
    for (name, clean, dark) in models {
        all.extend(records(name, "L0", clean));
        all.extend(records(name, "L5-ev", clean));
        all.extend(records(name, "L5-noise", dark));
    }
    // Not asked of all models: not a level of the comparison.
    all.extend(records("good", "L3-noise", |_| Some(true)));
    with_grid(&all, |grid| {
        let best = best_in_the_dark(grid, ParsingMode::Strict).unwrap();
        assert_eq!(best.variant.to_string(), "noise");
        assert_eq!((best.levels.len(), best.lighter.len()), (1, 1));
        assert_eq!((best.items, best.dropped, best.clusters), (23, 1, 12));
        let names: Vec<&str> = best.models.iter().map(|model| &*model.model).collect();
        assert_eq!(names, ["good", "same", "guess"]);
        // 21 and 20 of 23 items are right in the dark; L0 does not count.
        assert!((best.models[0].mean.value - 21.0 / 23.0).abs() < 1e-12);
        assert!((best.models[1].mean.value - 20.0 / 23.0).abs() < 1e-12);
        let loss = best.models[0].loss.unwrap().value;
        assert!((loss + 2.0 / 23.0).abs() < 1e-12);
        assert_eq!(best.models[2].loss, None);
        assert_eq!(best.not_shown_better_than, ["same"]);
        assert!(!best.is_shown() && best.pairs.len() == 3);
        assert_eq!(best.leader().model, "good");
        assert_eq!(best.pairs[1].tested.verdict, Verdict::Better);
    });
    all.retain(|record| record.model != "same");
    with_grid(&all, |grid| {
        let best = best_in_the_dark(grid, ParsingMode::Strict).unwrap();
        assert!(best.is_shown() && best.pairs.len() == 1);
    });
    all.retain(|record| record.model != "guess");
    assert!(with_grid(&all, |grid| best_in_the_dark(grid, ParsingMode::Strict).is_none()));
}

#[test]
fn crossing_is_corrected_for_model_pairs() {
    let mut all = [
        records("bright", "L0", |_| Some(true)),
        records("bright", "L5-noise", |item| Some(item < 4)),
        records("steady", "L0", |item| Some(item % 4 < 2)),
        records("steady", "L5-noise", |item| Some(item % 4 < 2)),
    ]
    .concat();
    let two = crossing_p(&all);
    all.extend(records("weak", "L0", |item| Some(item < 8)));
    all.extend(records("weak", "L5-noise", |_| Some(false)));
    // Three models have three pairs.
    let three = crossing_p(&all);
    assert!((three - 3.0 * two).abs() < 1e-12, "{two} {three}");
}

/// The p-value of the difference between `bright` and `steady` at L0.
fn crossing_p(records: &[Record]) -> f64 {
    with_grid(records, |grid| {
        let best = best_in_the_dark(grid, ParsingMode::Strict).unwrap();
        let crossing = best.crossing.unwrap();
        assert_eq!((&*crossing.light, &*crossing.dark), ("bright", "steady"));
        assert_eq!(crossing.levels.len(), 2);
        crossing.levels[0].tested.p
    })
}

#[test]
fn leader_is_compared_with_its_own_replies_without_images() {
    let dark = |item: usize| Some(!item.is_multiple_of(4));
    let mut all = [
        records("a", "L0", |_| Some(true)),
        records("a", "L5-noise", dark),
        records("b", "L0", |_| Some(true)),
        records("b", "L5-noise", |item| Some(item % 4 == 0)),
    ]
    .concat();
    // Without replies without images, the choices decide what chance is.
    with_grid(&all, |grid| {
        let gain = best_in_the_dark(grid, ParsingMode::Strict).unwrap().gain;
        let choices = grid.items[0].asked.choices.len() as f64;
        assert!(!gain.is_against_blind);
        assert!((gain.tested.difference.value - (0.75 - 1.0 / choices)).abs() < 1e-12);
    });
    all.extend(records("a", "", dark));
    with_grid(&all, |grid| {
        let gain = best_in_the_dark(grid, ParsingMode::Strict).unwrap().gain;
        assert!(gain.is_against_blind);
        assert!(gain.tested.difference.value.abs() < 1e-12 && gain.tested.p > 0.99, "{gain:?}");
    });
}

#[test]
fn families_are_compared_by_a_test() {
    let contrast = |dark: Answers| {
        let all = [records("m", "L0", |_| Some(true)), records("m", "L5-noise", dark)].concat();
        let trials = all.iter().cloned().collect();
        let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
        findings.contrasts[0].clone()
    };
    // The questions of a frame are of two families, of which only one is lost.
    let one = contrast(|item| Some(item % 2 == 0));
    assert_eq!(one.pairs, 1);
    assert!((one.strict.difference.value + 1.0).abs() < 1e-12, "{one:?}");
    assert!(one.is_detected() && one.most != one.least, "{one:?}");
    let both = contrast(|item| Some(item % 8 < 2));
    assert!(both.strict.difference.value.abs() < 1e-12, "{both:?}");
    assert!(both.strict.p > 0.5 && !both.is_detected(), "{both:?}");
}

#[test]
fn rows_of_one_model_have_the_verdict_of_the_sentences() {
    let one = [records("m", "L0", |_| Some(true)), records("m", "L5-noise", |_| Some(false))].concat();
    let two = [one.clone(), records("n", "L0", |_| Some(true)), records("n", "L5-noise", |_| Some(false))].concat();
    let verdicts = |all: &[Record]| {
        let trials = all.iter().cloned().collect();
        let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
        let level = findings.comparisons.iter().find(|one| one.kind == ComparisonKind::Level && one.family.is_none());
        let pooled = &find(&findings.pooled, PooledKind::Darkness, "L5-noise")[0];
        (level.unwrap().verdict(), pooled.verdict())
    };
    let worse = Some(Verdict::Worse);
    assert_eq!(verdicts(&one), (worse, worse));
    // With two models, the sentences are about their mean.
    assert_eq!(verdicts(&two), (None, worse));
}

#[test]
fn enhancers_are_compared_with_each_other() {
    let all = [
        records("m", "L5-noise", |item| Some(item % 2 == 0)),
        records("m", "L5-noise+a", |_| Some(true)),
        records("m", "L5-noise+b", |item| Some(item % 3 != 0)),
        records("m", "L5-noise+c", |_| Some(false)),
    ]
    .concat();
    let trials = all.iter().cloned().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let names = |finding: &PooledFinding| {
        let against = finding.against.as_ref().unwrap().as_str();
        format!("{}-{against}", finding.enhancer.as_ref().unwrap())
    };
    let pooled: Vec<&PooledFinding> = findings
        .pooled
        .iter()
        .filter(|finding| finding.kind == PooledKind::EnhancerPair && finding.family.is_none())
        .collect();
    let pairs: Vec<String> = pooled.iter().map(|finding| names(finding)).collect();
    assert_eq!(pairs, ["a-b", "a-c", "b-c"]);
    assert!((pooled[1].strict.tested.difference.value - 1.0).abs() < 1e-12);
    // Holm's correction is over the three pairs, and no sentence is about them.
    assert!((pooled[1].strict.tested.holm - 3.0 * pooled[1].strict.tested.p).abs() < 1e-12);
    assert!(pooled.iter().all(|finding| finding.strict.tested.p_report.is_none()));
    let single: Vec<&Comparison> = findings
        .comparisons
        .iter()
        .filter(|one| one.kind == ComparisonKind::EnhancerPair && one.family.is_none())
        .collect();
    assert_eq!(single.len(), 3);
    assert!(single.iter().all(|one| one.verdict().is_none()));
}

#[test]
fn below_blind_is_what_the_corrected_test_shows() {
    let records = [
        records("m", "", |item| Some(item != 3)),
        records("m", "L3-noise", |item| Some(item % 8 != 0)),
        records("m", "L5-noise", |_| Some(false)),
    ]
    .concat();
    let trials = records.iter().cloned().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let [two_points_less, dark] = ["L3-noise", "L5-noise"].map(|condition| {
        let condition: Condition = condition.parse().unwrap();
        findings.below_blind(&ModelInCondition::new("m", Some(&condition)), None)
    });
    assert!(two_points_less.is_empty(), "a difference, but not detected");
    assert_eq!(dark, ["m"]);
}

/// Records of a model about presence, two questions a frame: an object is present in the first, and absent in the
/// second. `reply` gives the answer to a question; `true` means present.
fn presence(model: &str, condition: &str, reply: fn(usize, bool) -> Option<bool>) -> Vec<Record> {
    let mut records = records(model, condition, |_| Some(true));
    for (item, record) in records.iter_mut().enumerate() {
        let detail = &mut record.detail;
        let is_there = item % 2 == 0;
        detail.family = Family::Presence;
        detail.choices = ["Yes", "no"].map(str::to_owned).to_vec();
        detail.truth = Some(usize::from(!is_there));
        let chosen = reply(item / 2, is_there).map(|yes| usize::from(!yes));
        detail.strict = Some(ParsedAnswer { chosen, why: None });
    }
    records
}

#[test]
fn false_answers_are_the_other_word_and_not_a_missing_one() {
    let all = [
        presence("m", "L0", |frame, is_there| Some(is_there && frame != 0)),
        // In the dark: “no” to eleven of twelve.
        presence("m", "L3-noise", |frame, _| Some(frame == 3)),
        // Nothing can be read: wrong, and no “no”.
        presence("m", "L5-noise", |_, _| None),
        records("m", "L0", |_| Some(true)),
    ]
    .concat();
    with_grid(&all[..6 * FRAMES], |grid| {
        let (findings, _) = pooled(grid);
        let [said_no, said_yes] = [FalseAnswer::No, FalseAnswer::Yes].map(|answer| {
            let kind = PooledKind::Hallucination(answer);
            findings.iter().filter(|finding| finding.kind == kind).collect::<Vec<&PooledFinding>>()
        });
        assert_eq!(said_no.len(), 2);
        let (dark, darkest) = (said_no[0], said_no[1]);
        assert_eq!(dark.family, Some(Family::Presence));
        assert_eq!((dark.items, dark.clusters, dark.levels), (12, 12, 2));
        assert!((dark.strict.first - 11.0 / 12.0).abs() < 1e-12, "{dark:?}");
        assert!((dark.strict.second - 1.0 / 12.0).abs() < 1e-12, "{dark:?}");
        // Ten frames change, all in one direction, and frame 0 does not; two levels.
        let (dark, darkest) = (&dark.strict, &darkest.strict);
        assert!((dark.tested.p - 2.0 / 1024.0).abs() < 1e-12 && (dark.tested.holm - 2.0 * dark.tested.p).abs() < 1e-12);
        assert_eq!(dark.tested.verdict, Verdict::Worse);
        assert!((darkest.first - 0.0).abs() < 1e-12 && darkest.tested.verdict == Verdict::NotShown);
        let said_yes = &said_yes[0].strict;
        assert!((said_yes.first - 1.0 / 12.0).abs() < 1e-12 && said_yes.second < 1e-12);
        assert_eq!(said_yes.tested.verdict, Verdict::NotShown);
        // Accuracy counts what cannot be read as wrong.
        let accuracy = find(&findings, PooledKind::Darkness, "L5-noise")[0];
        assert_eq!(accuracy.strict.tested.verdict, Verdict::Worse);
    });
    with_grid(&all[6 * FRAMES..], |grid| {
        let (findings, _) = pooled(grid);
        assert!(findings.iter().all(|finding| finding.kind.only_family().is_none()));
    });
}

/// The most frequent answer of a model to 24 questions, to four of which it is true.
fn collapse(reply: fn(usize, bool) -> Option<bool>) -> Collapse {
    let mut all = presence("m", "L3-noise", reply);
    for (item, record) in all.iter_mut().enumerate() {
        record.detail.truth = Some(usize::from(item % 2 == 1 || item > 7));
    }
    with_grid(&all, |grid| confusions(grid)[0].collapse.clone().unwrap())
}

#[test]
fn a_collapse_is_more_than_its_truth_and_more_than_a_guess() {
    let all = collapse(|_, _| Some(true));
    assert_eq!((&*all.top, all.share.n, all.clusters), ("Yes", 24, 12));
    assert!((all.share.value - 1.0).abs() < 1e-12 && (all.truth - 4.0 / 24.0).abs() < 1e-12);
    assert!((all.guess - 0.5).abs() < 1e-12 && all.is_far_too_frequent());
    // Half of all: 33 points above the truth, and what a guess gives.
    let half = collapse(|frame, first| Some(first == (frame % 2 == 0)));
    assert!((half.share.value - 0.5).abs() < 1e-12 && !half.is_far_too_frequent());
    // Unreadable replies count in the share.
    let some = collapse(|frame, _| (frame < 6).then_some(true));
    assert!((some.share.value - 0.5).abs() < 1e-12 && !some.is_far_too_frequent());
    assert!(some.entropy.abs() < 1e-12);
}
