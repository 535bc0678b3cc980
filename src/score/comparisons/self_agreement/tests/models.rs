//! Models that look better than they are, and what tells them apart.

use super::simulated::{IMAGES, QUESTIONS, Simulated, SimulatedAnswer, cell, found, keep, record};
use crate::comparisons::self_agreement::cell::{AgreementCell, CellRole};
use crate::comparisons::self_agreement::evidence::{NoEvidence, NoHalf};

/// A row of the table of models: name, share of yes, blind, dark, and G in %, κ and the entropies that are expected.
type ModelRow = (&'static str, f64, SimulatedAnswer, SimulatedAnswer, f64, Option<f64>, [f64; 2]);

/// Models with two choices; 40 % of answers are yes unless the name states another share.
const MODELS: [ModelRow; 6] = [
    (
        "keeps 90 %",
        0.4,
        |_, d| d.yes(0.4),
        |light, d| {
            if d.next() < 0.9 { light } else { d.yes(0.4) }
        },
        94.8,
        Some(0.89),
        [0.97, 0.97],
    ),
    (
        "keeps half",
        0.4,
        |_, d| d.yes(0.4),
        |light, d| {
            if d.next() < 0.5 { light } else { d.yes(0.4) }
        },
        75.4,
        Some(0.48),
        [0.96, 0.96],
    ),
    ("guesses with the same prior", 0.4, |_, d| d.yes(0.4), |_, d| d.yes(0.4), 51.8, Some(0.01), [0.96, 0.96]),
    ("guesses, 90 % yes", 0.9, |_, d| d.yes(0.9), |_, d| d.yes(0.9), 81.1, Some(-0.01), [0.49, 0.47]),
    ("says no to everything in the dark", 0.4, |_, _| 1, |_, _| 1, 58.3, Some(0.0), [0.97, 0.0]),
    ("says no to everything, always", 0.0, |_, _| 1, |_, _| 1, 100.0, None, [0.0, 0.0]),
];

#[test]
fn six_models_of_which_three_look_better_than_they_are() {
    for (name, yes, blind, dark, agreement, kappa, entropies) in MODELS {
        let model = Simulated { yes, blind, dark, again: keep };
        let dark = cell(&model.records(&[]), "L5-noise");
        // Four standard errors of a share of 1,800, and what a prior of 40 % adds to one of 42 %.
        let share = dark.agreement.unwrap();
        assert!((100.0 * share.value - agreement).abs() < 4.0, "{name}: {share:?}");
        assert_eq!(share.n, 1800, "{name}");
        match (dark.kappa, kappa) {
            (Some(found), Some(expected)) => {
                assert!((found.value - expected).abs() < 0.06, "{name}: {found:?}");
                assert!(found.low <= found.value && found.value <= found.high, "{name}: {found:?}");
                assert_eq!(found.low > 0.0, expected > 0.1, "{name}: {found:?}");
            }
            (found, expected) => assert_eq!((found, expected), (None, None), "{name}"),
        }
        for (found, expected) in dark.entropies.into_iter().zip(entropies) {
            assert!((found.unwrap() - expected).abs() < 0.05, "{name}: {found:?}");
        }
    }
}

#[test]
fn pooled_questions_would_make_kappa_too_large() {
    // Every second question is always yes, the others always no: a model that only remembers the question agrees with
    // itself.
    let mut records = Vec::new();
    for image in 0..IMAGES {
        for question in 0..QUESTIONS {
            let chosen = Some(question % 2);
            records.push(record(question, image, "L0", 0, chosen));
            records.push(record(question, image, "L5-noise", 0, chosen));
        }
    }
    let dark = cell(&records, "L5-noise");
    assert!(dark.agreement.unwrap().value > 1.0 - 1e-12);
    assert_eq!(dark.kappa, None);
}

#[test]
fn evidence_is_the_way_from_the_floor_to_the_ceiling() {
    let slips: SimulatedAnswer = |light, d| {
        if d.next() < 0.9 { light } else { 1 - light }
    };
    let half: SimulatedAnswer = |light, d| {
        if d.next() < 0.5 { light } else { d.yes(0.4) }
    };
    let model = Simulated { yes: 0.4, blind: |_, d| d.yes(0.4), again: slips, dark: half };
    let records = model.records(&[]);
    let (dark, blind, again) = (cell(&records, "L5-noise"), cell(&records, "blind"), cell(&records, "L0"));
    assert_eq!([&dark, &blind, &again].map(AgreementCell::role), [CellRole::Other, CellRole::Floor, CellRole::Ceiling]);
    let [here, floor, ceiling] = [&dark, &blind, &again].map(|cell| cell.agreement.unwrap().value);
    let expected = (here - floor) / (ceiling - floor);
    let kept = dark.evidence.unwrap().unwrap();
    assert!((kept.value - expected).abs() < 1e-12);
    assert!(kept.low < expected && expected < kept.high && kept.high - kept.low < 0.3, "{kept:?}");
    assert!((ceiling - 0.9).abs() < 0.03);
    assert_eq!((blind.evidence, again.evidence), (None, None));
}

#[test]
fn a_model_that_guesses_yes_in_the_dark_keeps_no_evidence() {
    let model = Simulated { yes: 0.9, blind: |_, d| d.yes(0.9), again: keep, dark: |_, d| d.yes(0.9) };
    let dark = cell(&model.records(&[]), "L5-noise");
    assert!(dark.agreement.unwrap().value > 0.78);
    let kept = dark.evidence.unwrap().unwrap();
    assert!(kept.low < 0.0 && kept.high > 0.0 && kept.value.abs() < 0.15, "{kept:?}");
    // One that guesses in the light, too, gives no share at all: floor and ceiling are the same.
    let guess = Simulated { again: |_, d| d.yes(0.9), ..model };
    let dark = cell(&guess.records(&[]), "L5-noise");
    assert!(matches!(dark.evidence, Some(Err(NoEvidence::Close(distance))) if distance < 0.05));
}

#[test]
fn a_bank_to_which_everything_is_no_cannot_tell() {
    let no = Simulated { yes: 0.0, blind: |_, _| 1, again: keep, dark: |_, _| 1 };
    found(&no.records(&[]), |found| {
        assert!(found.cannot_tell("m"));
        assert_eq!(found.informative("m"), (0, QUESTIONS));
        assert!(found.whole().all(|cell| cell.informative.is_none()));
        let curve = &found.curves[0];
        assert!(matches!(curve.threshold, Err(NoHalf::NoEvidence(NoEvidence::Close(_)))));
    });
    let sees = Simulated { yes: 0.4, blind: |_, d| d.yes(0.4), again: keep, dark: keep };
    found(&sees.records(&[]), |found| {
        assert!(!found.cannot_tell("m"));
        assert_eq!(found.informative("m"), (QUESTIONS, QUESTIONS));
    });
}
