//! Tests of agreement with a model's own answers in the light, from simulated models.

mod intervals;
mod models;
mod simulated;

use self::simulated::{IMAGES, QUESTIONS, Simulated, SimulatedAnswer, at, found, keep, record};
use super::evidence::NoEvidence;
use crate::choice::ParsingMode;
use crate::cluster::FrameTies;
use crate::comparisons::comparison::ComparisonKind;
use crate::significance::Verdict;
use darkqa_base::types::{ParsedAnswer, Record};

#[test]
fn uninformative_questions_are_named_and_left_out_of_one_share() {
    // Five questions have one answer about all images, and a wrong one in the dark; the others are kept.
    let mut records = Vec::new();
    for image in 0..IMAGES {
        for question in 0..QUESTIONS {
            let light = if question < 5 { 0 } else { usize::from((image + question) % 2 == 0) };
            let dark = if question < 5 { 1 } else { light };
            records.push(record(question, image, "L0", 0, Some(light)));
            records.push(record(question, image, "L5-noise", 0, Some(dark)));
        }
    }
    found(&records, |found| {
        let without: Vec<&str> = found
            .questions
            .iter()
            .filter(|question| !question.is_informative())
            .map(|question| &*question.bank_id)
            .collect();
        assert_eq!(without, ["q00", "q01", "q02", "q03", "q04"]);
        assert_eq!((&*found.questions[0].top, found.questions[0].top_share), ("yes", 1.0));
        let dark = at(found, "L5-noise");
        assert!((dark.agreement.unwrap().value - 0.8).abs() < 1e-12);
        let informative = dark.informative.unwrap();
        assert_eq!((informative.value, informative.n), (1.0, 1440));
        assert!(matches!(dark.evidence, Some(Err(NoEvidence::NotAgain))));
    });
}

#[test]
fn only_questions_with_an_answer_in_the_light_are_references_and_an_unread_reply_disagrees() {
    let mut records = Vec::new();
    for image in 0..IMAGES {
        // The first question has no answer in the light; the second none in the dark; the third has both.
        let (yes, no) = (Some(0), Some(1));
        let answers =
            [(None, yes), (if image % 2 == 0 { yes } else { no }, None), (if image % 2 == 0 { yes } else { no }, yes)];
        for (question, (light, dark)) in answers.into_iter().enumerate() {
            records.push(record(question, image, "L0", 0, light));
            records.push(record(question, image, "L5-noise", 0, dark));
        }
    }
    found(&records, |found| {
        let light = found.light_of("m").unwrap();
        assert_eq!((light.asked, light.refused), (3 * IMAGES, IMAGES));
        assert!((light.read.unwrap().value - 2.0 / 3.0).abs() < 1e-12);
        let dark = at(found, "L5-noise");
        let agreement = dark.agreement.unwrap();
        assert_eq!((agreement.value, agreement.n), (0.25, 2 * IMAGES));
        assert_eq!((dark.unread.unwrap().value, dark.refused), (0.5, IMAGES));
    });
}

#[test]
fn the_threshold_is_where_half_of_the_evidence_is_lost() {
    // Without an image: guesses. Kept at L1: all; at L3: half of it; at L5: nothing.
    let half: SimulatedAnswer = |light, d| {
        if d.next() < 0.5 { light } else { d.yes(0.4) }
    };
    let guess: SimulatedAnswer = |_, d| d.yes(0.4);
    let model = Simulated { yes: 0.4, blind: guess, again: keep, dark: guess };
    let records = model.records(&[("L1-noise", keep), ("L3-noise", half)]);
    found(&records, |found| {
        let threshold = found.curves[0].threshold.unwrap();
        // L3 is 6 EV.
        assert!((threshold.value - 6.0).abs() < 0.5, "{threshold:?}");
        assert!(threshold.low < 6.1 && threshold.high > 5.9, "{threshold:?}");
    });
}

#[test]
fn dark_and_enhanced_images_are_compared_pair_by_pair() {
    let half: SimulatedAnswer = |light, d| {
        if d.next() < 0.5 { light } else { d.yes(0.4) }
    };
    let model = Simulated { yes: 0.4, blind: |_, d| d.yes(0.4), again: keep, dark: half };
    let records = model.records(&[("L5-noise+lift", keep), ("L0+lift", half)]);
    found(&records, |found| {
        // An enhancer that harms in the light is compared with the same images asked again.
        let [dark, lifted, harmed] = [
            (ComparisonKind::Level, "L5-noise"),
            (ComparisonKind::Enhancer, "L5-noise+lift"),
            (ComparisonKind::Enhancer, "L0+lift"),
        ]
        .map(|(kind, condition)| {
            found
                .comparisons
                .iter()
                .find(|c| c.kind == kind && c.family.is_none() && c.first.condition() == condition)
                .unwrap()
        });
        assert_eq!((dark.second.condition(), dark.strict.tested.verdict), ("L0".into(), Verdict::Worse));
        assert_eq!((dark.strict.second, dark.strict.gained), (1.0, 0));
        assert_eq!((lifted.strict.tested.verdict, lifted.strict.lost), (Verdict::Better, 0));
        assert!(lifted.strict.tested.holm < 0.001 && lifted.strict.mcnemar < 0.001);
        assert_eq!(harmed.strict.tested.verdict, Verdict::Worse);
        assert!(found.comparisons.iter().all(|c| c.kind != ComparisonKind::Model));
    });
}

#[test]
fn two_models_are_held_against_each_other_in_the_light_alone() {
    let model = Simulated { yes: 0.4, blind: keep, again: keep, dark: keep };
    let records = model.records(&[]);
    let other = records.iter().cloned().enumerate().map(|(index, mut record)| {
        record.model = "n".into();
        if record.detail.repeat == 0 && index % 10 == 0 {
            record.detail.strict = record
                .detail
                .strict
                .map(|reading| ParsedAnswer { chosen: reading.chosen.map(|chosen| 1 - chosen), ..reading });
        }
        record
    });
    let both: Vec<Record> = records.iter().cloned().chain(other).collect();
    found(&both, |found| {
        assert_eq!(found.models(), ["m", "n"]);
        let pair = &found.between[0];
        assert_eq!((&*pair.first, &*pair.second, pair.same.n), ("m", "n", 1800));
        assert!(pair.same.value < 0.9 && pair.kappa.unwrap().value < 0.85, "{pair:?}");
        // Each has its own reference.
        for model in ["m", "n"] {
            let mut cells = found.whole().filter(|cell| cell.subject.model == model);
            assert!(cells.all(|cell| cell.replies() == 1800));
        }
    });
}

#[test]
fn nothing_without_a_truth_is_scored_as_an_accuracy() {
    use crate::findings::Findings;
    let model = Simulated { yes: 0.4, blind: keep, again: keep, dark: keep };
    let records = model.records(&[]);
    let trials = records.iter().cloned().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    assert!(findings.grid.items.is_empty());
    assert!(findings.summary.cells.iter().all(|cell| cell.accuracy.is_none() && cell.right == 0));
    found(&records, |found| {
        assert!(!found.grid.items.is_empty());
        assert_eq!(found.grid.counts(0, None, ParsingMode::Strict).iter().map(|c| c.right).sum::<u32>(), 0);
    });
}
