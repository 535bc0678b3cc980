//! Tests of agreement with a model's own answers in the light, from simulated models.

use std::collections::BTreeMap;

use serde_json::json;

use super::SelfAgreement;
use super::cell::{AgreementCell, CellRole};
use super::evidence::{NoEvidence, NoHalf};
use crate::score::choice::ReadingMode;
use crate::score::comparison::ComparisonKind;
use crate::score::significance::Significance;
use crate::score::split_mix::SplitMix;
use crate::types::run_question::BANK_ID;
use crate::types::{
    AnswerReading, ChoiceDetail, Condition, Digest, Family, FrameId, ModelListing, QuestionId,
    Record, RunQuestion, TrialOutcome, UnreadReason,
};

/// 72 images with 25 questions each: 1,800 items.
const IMAGES: usize = 72;
const QUESTIONS: usize = 25;

/// Random numbers from 0 to 1.
struct Draws(SplitMix);

impl Draws {
    fn next(&mut self) -> f64 {
        (self.0.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// “Yes” (0) with this chance, else “no” (1).
    fn yes(&mut self, share: f64) -> usize {
        usize::from(self.next() >= share)
    }
}

/// The answer of a model: its answer in the light, and random numbers.
type Answer = fn(usize, &mut Draws) -> usize;

/// A simulated model: its share of “yes” in the light, and what it answers without an image, asked again in the light, and in the dark.
struct Simulated {
    yes: f64,
    blind: Answer,
    again: Answer,
    dark: Answer,
}

fn keep(light: usize, _: &mut Draws) -> usize {
    light
}

fn record(
    question: usize,
    image: usize,
    condition: &str,
    repeat: u32,
    chosen: Option<usize>,
) -> Record {
    let condition: Option<Condition> = (!condition.is_empty()).then(|| condition.parse().unwrap());
    let reading = AnswerReading {
        chosen,
        why: chosen.is_none().then_some(UnreadReason::Refused),
    };
    let detail = ChoiceDetail {
        frame: FrameId(format!("i{image:03}")),
        family: [Family::Presence, Family::Other("light".into())][question % 2].clone(),
        choices: ["yes", "no"].map(str::to_owned).to_vec(),
        truth: None,
        repeat,
        strict: Some(reading),
        lenient: Some(reading),
        outcome: chosen.map_or(TrialOutcome::Unparsed, |_| TrialOutcome::Answered),
        image: None,
        shown_frame: None,
        observed: None,
        options: None,
    };
    let key = Digest::of(format!("{question} {image} {condition:?} {repeat}").as_bytes()).into();
    let id = QuestionId(format!("q{question:02}@i{image:03}"));
    Record::blank(key, id, "m", condition, detail)
}

/// The questions as a run stores them.
fn questions() -> Vec<RunQuestion> {
    let ids = (0..IMAGES).flat_map(|image| (0..QUESTIONS).map(move |question| (image, question)));
    let question = |(image, question): (usize, usize)| RunQuestion {
        id: QuestionId(format!("q{question:02}@i{image:03}")),
        place: image * QUESTIONS + question,
        scene: String::new(),
        frame: FrameId(format!("i{image:03}")),
        family: [Family::Presence, Family::Other("light".into())][question % 2].clone(),
        text: format!("Is there thing {question}?"),
        choices: ["yes", "no"].map(str::to_owned).to_vec(),
        answer: None,
        extra_answers: None,
        evidence: json!({ BANK_ID: format!("q{question:02}") }),
        image: None,
    };
    ids.map(question).collect()
}

impl Simulated {
    /// The records: without an image, twice at L0, and at each level with a share of what the light says kept by the first.
    fn records(&self, levels: &[(&str, Answer)]) -> Vec<Record> {
        let mut draws = Draws(SplitMix(7));
        let mut records = Vec::new();
        for image in 0..IMAGES {
            for question in 0..QUESTIONS {
                let light = draws.yes(self.yes);
                records.push(record(question, image, "L0", 0, Some(light)));
                for (condition, repeat, answer) in [
                    ("L0", 1, self.again),
                    ("", 0, self.blind),
                    ("L5-noise", 0, self.dark),
                ] {
                    let chosen = Some(answer(light, &mut draws));
                    records.push(record(question, image, condition, repeat, chosen));
                }
                for (condition, answer) in levels {
                    let chosen = Some(answer(light, &mut draws));
                    records.push(record(question, image, condition, 0, chosen));
                }
            }
        }
        records
    }
}

/// What is found in records.
fn found<T>(records: &[Record], read: impl FnOnce(&SelfAgreement<'_>) -> T) -> T {
    let questions = questions();
    let listing = ModelListing::default();
    read(&SelfAgreement::new(
        records,
        &BTreeMap::new(),
        &questions,
        &listing,
    ))
}

fn cell(records: &[Record], condition: &str) -> AgreementCell {
    found(records, |found| at(found, condition).clone())
}

/// A row of the table of models: name, share of yes, blind, dark, and G in %, κ and the entropies that are expected.
type Row = (
    &'static str,
    f64,
    Answer,
    Answer,
    f64,
    Option<f64>,
    [f64; 2],
);

/// Two choices, 40 % yes but where the name says other.
const MODELS: [Row; 6] = [
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
    (
        "guesses with the same prior",
        0.4,
        |_, d| d.yes(0.4),
        |_, d| d.yes(0.4),
        51.8,
        Some(0.01),
        [0.96, 0.96],
    ),
    (
        "guesses, 90 % yes",
        0.9,
        |_, d| d.yes(0.9),
        |_, d| d.yes(0.9),
        81.1,
        Some(-0.01),
        [0.49, 0.47],
    ),
    (
        "says no to everything in the dark",
        0.4,
        |_, _| 1,
        |_, _| 1,
        58.3,
        Some(0.0),
        [0.97, 0.0],
    ),
    (
        "says no to everything, always",
        0.0,
        |_, _| 1,
        |_, _| 1,
        100.0,
        None,
        [0.0, 0.0],
    ),
];

#[test]
fn six_models_of_which_three_look_better_than_they_are() {
    for (name, yes, blind, dark, agreement, kappa, entropies) in MODELS {
        let model = Simulated {
            yes,
            blind,
            dark,
            again: keep,
        };
        let dark = cell(&model.records(&[]), "L5-noise");
        // Four standard errors of a share of 1,800, and what a prior of 40 % adds to one of 42 %.
        let share = dark.agreement.unwrap();
        assert!(
            (100.0 * share.value - agreement).abs() < 4.0,
            "{name}: {share:?}"
        );
        assert_eq!(share.n, 1800, "{name}");
        match (dark.kappa, kappa) {
            (Some(found), Some(expected)) => {
                assert!((found.value - expected).abs() < 0.06, "{name}: {found:?}");
                assert!(
                    found.low <= found.value && found.value <= found.high,
                    "{name}: {found:?}"
                );
                assert_eq!(found.low > 0.0, expected > 0.1, "{name}: {found:?}");
            }
            (found, expected) => assert_eq!((found, expected), (None, None), "{name}"),
        }
        for (found, expected) in dark.entropies.into_iter().zip(entropies) {
            assert!(
                (found.unwrap() - expected).abs() < 0.05,
                "{name}: {found:?}"
            );
        }
    }
}

#[test]
fn pooled_questions_would_make_kappa_too_large() {
    // Every second question is always yes, the others always no: a model that only remembers the question agrees with itself.
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
    let slips: Answer = |light, d| {
        if d.next() < 0.9 { light } else { 1 - light }
    };
    let half: Answer = |light, d| {
        if d.next() < 0.5 { light } else { d.yes(0.4) }
    };
    let model = Simulated {
        yes: 0.4,
        blind: |_, d| d.yes(0.4),
        again: slips,
        dark: half,
    };
    let records = model.records(&[]);
    let (dark, blind, again) = (
        cell(&records, "L5-noise"),
        cell(&records, "blind"),
        cell(&records, "L0"),
    );
    assert_eq!(
        [&dark, &blind, &again].map(AgreementCell::role),
        [CellRole::Other, CellRole::Floor, CellRole::Ceiling]
    );
    let value = |cell: &AgreementCell| cell.agreement.unwrap().value;
    let expected = (value(&dark) - value(&blind)) / (value(&again) - value(&blind));
    let kept = dark.evidence.unwrap().unwrap();
    assert!((kept.value - expected).abs() < 1e-12);
    assert!(
        kept.low < expected && expected < kept.high && kept.high - kept.low < 0.3,
        "{kept:?}"
    );
    assert!((value(&again) - 0.9).abs() < 0.03);
    assert_eq!((blind.evidence, again.evidence), (None, None));
}

#[test]
fn a_model_that_guesses_yes_in_the_dark_keeps_no_evidence() {
    let model = Simulated {
        yes: 0.9,
        blind: |_, d| d.yes(0.9),
        again: keep,
        dark: |_, d| d.yes(0.9),
    };
    let dark = cell(&model.records(&[]), "L5-noise");
    assert!(dark.agreement.unwrap().value > 0.78);
    let kept = dark.evidence.unwrap().unwrap();
    assert!(
        kept.low < 0.0 && kept.high > 0.0 && kept.value.abs() < 0.15,
        "{kept:?}"
    );
    // One that guesses in the light, too, gives no share at all: floor and ceiling are the same.
    let guess = Simulated {
        again: |_, d| d.yes(0.9),
        ..model
    };
    let dark = cell(&guess.records(&[]), "L5-noise");
    assert!(matches!(dark.evidence, Some(Err(NoEvidence::Close(distance))) if distance < 0.05));
}

#[test]
fn a_bank_to_which_everything_is_no_cannot_tell() {
    let no = Simulated {
        yes: 0.0,
        blind: |_, _| 1,
        again: keep,
        dark: |_, _| 1,
    };
    found(&no.records(&[]), |found| {
        assert!(found.cannot_tell("m"));
        assert_eq!(found.informative("m"), (0, QUESTIONS));
        assert!(found.whole().all(|cell| cell.informative.is_none()));
        let curve = &found.curves[0];
        assert!(matches!(
            curve.threshold,
            Err(NoHalf::NoEvidence(NoEvidence::Close(_)))
        ));
    });
    let sees = Simulated {
        yes: 0.4,
        blind: |_, d| d.yes(0.4),
        again: keep,
        dark: keep,
    };
    found(&sees.records(&[]), |found| {
        assert!(!found.cannot_tell("m"));
        assert_eq!(found.informative("m"), (QUESTIONS, QUESTIONS));
    });
}

#[test]
fn uninformative_questions_are_named_and_left_out_of_one_share() {
    // Five questions have one answer about all images, and a wrong one in the dark; the others are kept.
    let mut records = Vec::new();
    for image in 0..IMAGES {
        for question in 0..QUESTIONS {
            let light = if question < 5 {
                0
            } else {
                usize::from((image + question) % 2 == 0)
            };
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
        assert_eq!(
            (&*found.questions[0].top, found.questions[0].top_share),
            ("yes", 1.0)
        );
        let dark = at(found, "L5-noise");
        assert!((dark.agreement.unwrap().value - 0.8).abs() < 1e-12);
        let informative = dark.informative.unwrap();
        assert_eq!((informative.value, informative.n), (1.0, 1440));
        assert!(matches!(dark.evidence, Some(Err(NoEvidence::NotAgain))));
    });
}

/// The cell of a condition.
fn at<'f>(found: &'f SelfAgreement<'_>, condition: &str) -> &'f AgreementCell {
    let mut cells = found.whole();
    let cell = cells.find(|cell| cell.subject.condition() == condition);
    cell.unwrap()
}

#[test]
fn only_questions_with_an_answer_in_the_light_are_references_and_an_unread_reply_disagrees() {
    let mut records = Vec::new();
    for image in 0..IMAGES {
        // The first question has no answer in the light; the second none in the dark; the third has both.
        let (yes, no) = (Some(0), Some(1));
        let answers = [
            (None, yes),
            (if image % 2 == 0 { yes } else { no }, None),
            (if image % 2 == 0 { yes } else { no }, yes),
        ];
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
    let half: Answer = |light, d| {
        if d.next() < 0.5 { light } else { d.yes(0.4) }
    };
    let guess: Answer = |_, d| d.yes(0.4);
    let model = Simulated {
        yes: 0.4,
        blind: guess,
        again: keep,
        dark: guess,
    };
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
    let half: Answer = |light, d| {
        if d.next() < 0.5 { light } else { d.yes(0.4) }
    };
    let model = Simulated {
        yes: 0.4,
        blind: |_, d| d.yes(0.4),
        again: keep,
        dark: half,
    };
    let records = model.records(&[("L5-noise+lift", keep), ("L0+lift", half)]);
    found(&records, |found| {
        let of = |kind, condition: &str| {
            let mut all = found.comparisons.iter();
            let found = all
                .find(|c| c.kind == kind && c.family.is_none() && c.first.condition() == condition);
            found.unwrap()
        };
        let dark = of(ComparisonKind::Level, "L5-noise");
        assert_eq!(
            (dark.second.condition(), dark.significance),
            ("L0".into(), Significance::Worse)
        );
        assert_eq!((dark.paired.second, dark.paired.gained), (1.0, 0));
        let lifted = of(ComparisonKind::Enhancer, "L5-noise+lift");
        assert_eq!(
            (lifted.significance, lifted.paired.lost),
            (Significance::Better, 0)
        );
        assert!(lifted.holm < 0.001 && lifted.paired.mcnemar < 0.001);
        // An enhancer that harms in the light is held against the same images asked again.
        let harmed = of(ComparisonKind::Enhancer, "L0+lift");
        assert_eq!(harmed.significance, Significance::Worse);
        assert!(
            found
                .comparisons
                .iter()
                .all(|c| c.kind != ComparisonKind::Model)
        );
    });
}

#[test]
fn two_models_are_held_against_each_other_in_the_light_alone() {
    let model = Simulated {
        yes: 0.4,
        blind: keep,
        again: keep,
        dark: keep,
    };
    let records = model.records(&[]);
    let other = records
        .iter()
        .cloned()
        .enumerate()
        .map(|(index, mut record)| {
            record.model = "n".into();
            if record.detail.repeat == 0 && index % 10 == 0 {
                let flip = |reading: AnswerReading| AnswerReading {
                    chosen: reading.chosen.map(|chosen| 1 - chosen),
                    ..reading
                };
                record.detail.strict = record.detail.strict.map(flip);
            }
            record
        });
    let both: Vec<Record> = records.iter().cloned().chain(other).collect();
    found(&both, |found| {
        assert_eq!(found.models(), ["m", "n"]);
        let pair = &found.between[0];
        assert_eq!((&*pair.first, &*pair.second, pair.same.n), ("m", "n", 1800));
        assert!(
            pair.same.value < 0.9 && pair.kappa.unwrap().value < 0.85,
            "{pair:?}"
        );
        // Each has its own reference.
        for model in ["m", "n"] {
            let mut cells = found.whole().filter(|cell| cell.subject.model == model);
            assert!(cells.all(|cell| cell.replies() == 1800));
        }
    });
}

#[test]
fn nothing_without_a_truth_is_scored_as_an_accuracy() {
    use crate::score::findings::Findings;
    let model = Simulated {
        yes: 0.4,
        blind: keep,
        again: keep,
        dark: keep,
    };
    let records = model.records(&[]);
    let findings = Findings::new(&records, &BTreeMap::new(), [], &[]);
    assert!(findings.grid.items.is_empty());
    let mut cells = findings.summary.cells.iter();
    assert!(cells.all(|cell| cell.accuracy.is_none() && cell.right == 0));
    found(&records, |found| {
        assert!(!found.grid.items.is_empty());
        assert_eq!(
            found
                .grid
                .counts(0, None, ReadingMode::Strict)
                .iter()
                .map(|c| c.right)
                .sum::<u32>(),
            0
        );
    });
}

/// Records of 30 images with eight questions each. The share of its answers that a model keeps differs from image to image, evenly from 0 to
/// 1, so that items of an image are far from independent; asked again it keeps 95 %.
fn clustered(seed: u64) -> Vec<Record> {
    let mut draws = Draws(SplitMix(seed));
    let mut records = Vec::new();
    for image in 0..30 {
        let kept = draws.next();
        for question in 0..8 {
            let light = draws.yes(0.4);
            records.push(record(question, image, "L0", 0, Some(light)));
            for (condition, repeat, kept) in [("L0", 1, 0.95), ("", 0, 0.0), ("L5-noise", 0, kept)]
            {
                let chosen = if draws.next() < kept {
                    light
                } else {
                    draws.yes(0.4)
                };
                records.push(record(question, image, condition, repeat, Some(chosen)));
            }
        }
    }
    records
}

#[test]
fn intervals_of_evidence_and_kappa_hold_the_truth() {
    const RUNS: u64 = 60;
    // Half of the answers are kept, and the others agree as those without an image do.
    let (evidence, kappa) = (0.5 / 0.95, 0.5);
    let mut held = [0_u32; 2];
    for seed in 0..RUNS {
        let dark = cell(&clustered(seed), "L5-noise");
        let intervals = [
            (dark.evidence.unwrap().unwrap(), evidence),
            (dark.kappa.unwrap(), kappa),
        ];
        for (held, (interval, truth)) in held.iter_mut().zip(intervals) {
            *held += u32::from(interval.low <= truth && truth <= interval.high);
        }
    }
    // Three standard errors below 95 in a hundred. Of 400 runs 382 and 385 held it.
    assert!(held.iter().all(|held| *held >= 52), "{held:?}");
}
