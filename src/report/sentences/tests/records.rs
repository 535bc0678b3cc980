//! Sentences about synthetic records: which models and levels they name, count and leave out.

use super::checked;
use crate::sentences::{EffectDirection, Sentence, sentences};
use darkqa_base::types::{
    ChoiceDetail, Condition, Digest, Family, FrameId, ModelListing, ParsedAnswer, QuestionId, Record, RunGroup,
    TrialOutcome, UnreadReason,
};
use darkqa_score::cluster::FrameTies;
use darkqa_score::findings::Findings;

/// Number of frames, each with two questions: one about colour and one about the room.
const FRAMES: usize = 12;

/// The records of a model in some conditions, about `frames` frames. The share of right replies is 0 or 1, or
/// alternates for 0.5.
fn asked(model: &str, frames: usize, conditions: &[(&str, f64)]) -> Vec<Record> {
    let mut records = Vec::new();
    for (name, share) in conditions {
        let condition: Option<Condition> = (*name != "blind").then(|| name.parse().unwrap());
        for item in 0..2 * frames {
            let wrong = usize::from(((item / 2 % 2) as f64) >= 2.0 * share);
            let family = [Family::Color, Family::RoomType][item % 2].clone();
            let mut detail = unanswered(format!("f{:02}", item / 2), family, &["a", "b", "c"]);
            answer(&mut detail, wrong);
            records.push(record(item, model, condition.clone(), detail));
        }
    }
    records
}

/// The record of a model about an item in a condition, or without an image.
pub(crate) fn record(item: usize, model: &str, condition: Option<Condition>, detail: ChoiceDetail) -> Record {
    let name = condition.as_ref().map_or_else(String::new, ToString::to_string);
    let key = Digest::from_bytes(format!("{item} {model} {name}").as_bytes()).into();
    Record::blank(key, QuestionId(format!("q{item:04}")), model, condition, detail)
}

/// A question about a frame whose first choice is true, without an answer.
pub(crate) fn unanswered(frame: String, family: Family, choices: &[&str]) -> ChoiceDetail {
    ChoiceDetail {
        frame: FrameId(frame),
        family,
        choices: choices.iter().map(|text| (*text).to_owned()).collect(),
        truth: Some(0),
        repeat: 0,
        wording: None,
        order: 0,
        strict: None,
        lenient: None,
        outcome: TrialOutcome::Wrong,
        image: None,
        more_images: Vec::new(),
        shown_frame: None,
        observed: None,
        options: None,
    }
}

/// Answers a question with a choice, in both parsings.
pub(crate) fn answer(detail: &mut ChoiceDetail, chosen: usize) {
    let parsed = Some(ParsedAnswer { chosen: Some(chosen), why: None });
    (detail.strict, detail.lenient) = (parsed, parsed);
    detail.outcome = if detail.truth == Some(chosen) { TrialOutcome::Right } else { TrialOutcome::Wrong };
}

/// All sentences about records.
pub(super) fn sentences_about(records: &[Record]) -> Vec<Sentence> {
    let trials = records.iter().cloned().collect();
    sentences(&Findings::new(&trials, &FrameTies::default(), [], &[]))
}

/// The sentences of a kind, each with its detail.
pub(super) fn of_kind(said: &[Sentence], kind: &str) -> Vec<String> {
    said.iter().filter(|sentence| sentence.kind == kind).map(checked).collect()
}

#[test]
fn references_are_neither_ranked_nor_mixed() {
    let levels = [("L0", 1.0), ("L3-noise", 1.0), ("L5-noise", 1.0)];
    let dark = [("L0", 0.5), ("L3-noise", 0.0), ("L5-noise", 0.0)];
    let mut all = [asked("observer", FRAMES, &levels), asked("random", FRAMES, &dark)].concat();
    let alone = sentences_about(&all);
    assert!(of_kind(&alone, "best").is_empty());
    let darkness = of_kind(&alone, "darkness");
    assert!(
        darkness[0].starts_with("· No loss by darkness was detected at any level;")
            && darkness[0].contains(" (observer: 0.0 "),
        "{darkness:?}"
    );
    all.extend(asked("a", FRAMES, &levels));
    assert!(of_kind(&sentences_about(&all), "best").is_empty());
    all.extend(asked("b", FRAMES, &dark));
    let best = of_kind(&sentences_about(&all), "best");
    assert!(best[0].starts_with("+ a sees best in the dark (L3–L5). ("), "{best:?}");
}

#[test]
fn gain_from_images_is_reported_at_l0() {
    for (with, without, start) in [
        (1.0, 0.0, "+ At L0 images add 100.0 points: 100.0 % with them, 0.0 % without. ("),
        (0.0, 1.0, "− At L0 images cost 100.0 points: 0.0 % with them, 100.0 % without. ("),
        (0.5, 0.5, "· No gain by images was detected at L0: 50.0 % with them, 50.0 % without. ("),
    ] {
        let said = images_sentence(with, without);
        assert!(said.starts_with(start), "{said}");
    }
    // Without a model that was asked without images, there is nothing to say.
    let seen = sentences_about(&asked("m", FRAMES, &[("L0", 1.0)]));
    assert!(of_kind(&seen, "images").is_empty());
}

fn images_sentence(with: f64, without: f64) -> String {
    let all = asked("m", FRAMES, &[("blind", without), ("L0", with)]);
    let images = of_kind(&sentences_about(&all), "images");
    assert_eq!(images.len(), 1, "{images:?}");
    images[0].clone()
}

#[test]
fn darkness_names_the_detecting_variant() {
    let both = darkness_sentences(0.0, 0.0);
    assert!(
        both.len() == 1 && both[0].starts_with("− Darkness costs 100.0 points at L5, from 100.0 % at L0. ("),
        "{both:?}"
    );
    let neither = darkness_sentences(1.0, 1.0);
    assert!(neither.len() == 1 && neither[0].starts_with("· No loss by darkness was detected"), "{neither:?}");
    let noise = darkness_sentences(1.0, 0.0);
    assert!(
        noise.len() == 1 && noise[0].starts_with("− With noise, darkness costs 100.0 points at L5, from"),
        "{noise:?}"
    );
    let ev = darkness_sentences(0.0, 1.0);
    assert_eq!(ev.len(), 2, "{ev:?}");
    assert!(ev[0].starts_with("· With noise, no loss by darkness was detected at any level;"), "{ev:?}");
    assert!(
        ev[1].starts_with("− By the exposure drop alone, darkness costs 100.0 points at L5, from 100.0 % at L0. ("),
        "{ev:?}"
    );
    let one = of_kind(&sentences_about(&asked("m", FRAMES, &[("L0", 1.0), ("L5-ev", 0.0)])), "darkness");
    assert!(one[0].starts_with("− Darkness costs 100.0 points"), "{one:?}");
}

fn darkness_sentences(ev: f64, noise: f64) -> Vec<String> {
    let all = asked("m", FRAMES, &[("L0", 1.0), ("L5-ev", ev), ("L5-noise", noise)]);
    of_kind(&sentences_about(&all), "darkness")
}

#[test]
fn topics_without_a_verdict_are_listed() {
    let levels = [
        ("blind", 0.0),
        ("L0", 1.0),
        ("L1-ev", 0.0),
        ("L2-ev", 0.0),
        ("L3-ev", 0.0),
        ("L4-ev", 0.0),
        ("L5-ev", 0.0),
        ("L1-noise", 0.0),
        ("L2-noise", 0.0),
        ("L3-noise", 0.0),
        ("L4-noise", 0.0),
        ("L5-noise", 0.0),
        ("L3-noise+lift", 1.0),
    ];
    // With seven frames the smallest corrected p over five levels, 5 · 2 / 2⁷, is above 0.05; for a single level it is
    // below.
    let few = sentences_about(&asked("m", 7, &levels));
    for kind in ["darkness", "noise", "below blind"] {
        assert!(of_kind(&few, kind).is_empty(), "{kind}");
    }
    let without = of_kind(&few, "no verdict");
    assert_eq!(
        without[0],
        "· With 7 frames no verdict on darkness, noise and dark images against no images is possible, however large the effect. (the smallest \
         possible p = 0.078; take more frames)"
    );
    let lift = of_kind(&few, "enhancer");
    assert!(lift[0].starts_with("+ lift helps at L3, by 100.0 points. ("), "{lift:?}");
    let models = [asked("a", 4, &levels), asked("b", 4, &levels)].concat();
    let fewer = sentences_about(&models);
    assert!(of_kind(&fewer, "best").is_empty());
    let without = of_kind(&fewer, "no verdict");
    assert!(
        without[0].starts_with("· With 4 frames no verdict on darkness, noise, lift, dark images against no images and the best model is possible,"),
        "{without:?}"
    );
    let enough = sentences_about(&asked("m", 8, &levels));
    assert_eq!(of_kind(&enough, "darkness").len(), 1);
    assert!(of_kind(&enough, "no verdict").is_empty());
}

/// The sentences except those about models that are left out.
fn about_others(said: &[Sentence]) -> Vec<String> {
    said.iter().filter(|sentence| !["apart", "left out"].contains(&sentence.kind)).map(checked).collect()
}

#[test]
fn models_without_some_levels_are_left_out() {
    let all_levels =
        [("L0", 1.0), ("L1-noise", 1.0), ("L2-noise", 1.0), ("L3-noise", 0.0), ("L4-noise", 0.0), ("L5-noise", 0.0)];
    let one = asked("a", FRAMES, &all_levels);
    let alone = sentences_about(&one);
    assert!(of_kind(&alone, "left out").is_empty() && of_kind(&alone, "apart").is_empty());
    // The levels of a reference do not count as levels of the models.
    let with_random = [one.clone(), asked("random", FRAMES, &[("L0", 1.0), ("L1-ev", 1.0)])].concat();
    assert!(of_kind(&sentences_about(&with_random), "left out").is_empty());
    let both = [one, asked("b", FRAMES, &[("L0", 1.0), ("L3-noise", 0.5)])].concat();
    let both = sentences_about(&both);
    assert_eq!(
        of_kind(&both, "left out"),
        [
            "· b stands apart from the other models: it was not asked at L1–L2, L4–L5. (in no mean about darkness (with noise))"
        ]
    );
    assert_eq!(about_others(&both), about_others(&alone));
    let apart = of_kind(&both, "apart");
    assert!(
        apart.len() == 1
            && apart[0].starts_with(
                "· With noise, b: 100.0 % at L0, 50.0 % at L3; a: 100.0 % and 0.0 % on the same questions. (L0 ["
            ),
        "{apart:?}"
    );
    assert!(apart[0].ends_with("; in no mean about darkness (with noise))"), "{apart:?}");
}

#[test]
fn models_lacking_an_enhancer_stay_in_darkness() {
    let raw = [("L0", 1.0), ("L3-noise", 0.5), ("L5-noise", 0.0)];
    let enhanced = [("L3-noise+lift", 1.0), ("L5-noise+lift", 1.0)];
    let both =
        [asked("a", FRAMES, &[&raw[..], &enhanced].concat()), asked("b", FRAMES, &[&raw[..], &enhanced[..1]].concat())]
            .concat();
    let both = sentences_about(&both);
    let darkness = of_kind(&both, "darkness");
    assert!(darkness[0].contains("(mean of these 2 models: "), "{darkness:?}");
    let left_out = of_kind(&both, "left out");
    assert!(left_out[0].ends_with("(in no mean about lift (with noise))"), "{left_out:?}");
    assert!(of_kind(&both, "apart").is_empty());
}

#[test]
fn models_without_a_common_level_stand_apart() {
    let records =
        [asked("a", FRAMES, &[("L0", 1.0), ("L1-noise", 1.0)]), asked("b", FRAMES, &[("L0", 1.0), ("L3-noise", 1.0)])]
            .concat();
    let seen = sentences_about(&records);
    let darkness = of_kind(&seen, "darkness");
    assert!(darkness[0].contains(" (a: 0.0 "), "{darkness:?}");
    let left_out = of_kind(&seen, "left out");
    assert!(
        left_out[0].starts_with("· b stands apart from the other models: it was not asked at L1. ("),
        "{left_out:?}"
    );
}

#[test]
fn models_with_fewer_questions_are_left_out() {
    let levels = [("L0", 1.0), ("L3-noise", 0.5), ("L5-noise", 0.0)];
    let two = [asked("a", FRAMES, &levels), asked("b", FRAMES, &levels)].concat();
    let part = asked("part", 3, &levels);
    let with_part = sentences_about(&[two.clone(), part].concat());
    let [with, without] = [&with_part, &sentences_about(&two)].map(|sentences| {
        about_others(sentences)
            .into_iter()
            .filter(|line| !line.contains("the highest mean accuracy"))
            .collect::<Vec<_>>()
    });
    assert_eq!(with, without);
    let best = of_kind(&with_part, "best");
    assert!(best[0].contains("n = 24 in 12 frames; without part, which answered less"), "{best:?}");
    let left_out = of_kind(&with_part, "left out");
    assert!(
        left_out[0]
            .starts_with("· part stands apart from the other models: it answered 12 of 48 questions at L3–L5. ("),
        "{left_out:?}"
    );
    let apart = of_kind(&with_part, "apart");
    assert!(
        apart[0].contains(
            "part: 100.0 % at L0, 0.0 % at L5; the mean of 2 models: 100.0 % and 0.0 % on the same questions."
        ),
        "{apart:?}"
    );
}

#[test]
fn people_are_in_no_mean() {
    let levels = [("L0", 1.0), ("L3-noise", 0.5), ("L5-noise", 0.0)];
    let bright = [("L0", 1.0), ("L3-noise", 1.0), ("L5-noise", 1.0)];
    let two = [asked("a", FRAMES, &levels), asked("b", FRAMES, &levels)].concat();
    let mut people = asked("human", FRAMES, &bright);
    let cannot_tell = people.iter_mut().rev().take(3);
    for record in cannot_tell {
        let reading = Some(ParsedAnswer { chosen: None, why: Some(UnreadReason::CannotTell) });
        (record.detail.strict, record.detail.lenient) = (reading, reading);
        record.detail.outcome = TrialOutcome::Unparsed;
    }
    let with_people = sentences_with_people(&[two.clone(), people.clone()].concat());
    assert_eq!(about_others(&with_people), about_others(&sentences_with_people(&two)));
    let apart = of_kind(&with_people, "apart");
    assert!(
        apart[0].starts_with("· With noise, human: 100.0 % at L0, 87.5 % at L5; the mean of 2 models: 100.0 % and 0.0 % on the same questions. (people; L0 ["),
        "{apart:?}"
    );
    assert!(apart[0].contains(", n = 24, 3 “I cannot tell”; in no mean)"), "{apart:?}");
    // Without models the report is about the people.
    assert!(of_kind(&sentences_with_people(&people), "darkness")[0].contains("human: "));
}

fn sentences_with_people(records: &[Record]) -> Vec<Sentence> {
    let mut listing = ModelListing::default();
    listing.add_people("human".to_owned());
    let trials = records.iter().cloned().collect();
    let findings = Findings::with_listing(&trials, &FrameTies::default(), [], &[], &listing);
    assert!(findings.common.is_none());
    sentences(&findings)
}

#[test]
fn best_model_has_its_variant_and_levels() {
    // Two runs with different images, so that their conditions are separate.
    let mut all = Vec::new();
    for (run, name) in ["d0", "d1"].into_iter().enumerate() {
        for (model, dark) in [("a", 1.0), ("b", 0.0)] {
            let mut records = asked(model, FRAMES, &[("L0", 1.0), ("L3-noise", dark)]);
            for record in &mut records {
                let condition = record.condition.as_mut().unwrap();
                condition.group = Some(RunGroup::new(name, &[run]));
            }
            all.extend(records);
        }
    }
    let trials = all.iter().cloned().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let best = findings.best.as_ref().unwrap();
    let names: Vec<String> = best.levels.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["L3"]);
    let said = of_kind(&sentences(&findings), "best");
    assert!(said[0].starts_with("+ with noise @d0: a sees best in the dark (L3). ("), "{said:?}");
}

#[test]
fn two_families_are_compared() {
    let mut all = asked("m", FRAMES, &[("L0", 1.0), ("L5-noise", 0.0)]);
    for record in &mut all {
        let is_dark = record.condition.as_ref().is_some_and(|condition| condition.degradation().is_some());
        if is_dark && record.detail.family == Family::RoomType {
            let right = Some(ParsedAnswer { chosen: Some(0), why: None });
            (record.detail.strict, record.detail.lenient) = (right, right);
        }
    }
    let families = of_kind(&sentences_about(&all), "families");
    assert!(
        families[0]
            .starts_with("· Darkness costs more in object colour (−100.0 points at L5) than in room type (0.0). ("),
        "{families:?}"
    );
    assert!(
        families[0].ends_with("difference −100.0 [−117.2, −54.3], p < 0.001; the only pair of families)"),
        "{families:?}"
    );
}

/// The records of a model about 60 frames, right in a percentage of the replies of each condition.
pub(super) fn scripted(model: &str, conditions: &[(&str, usize)]) -> Vec<Record> {
    let names: Vec<(&str, f64)> = conditions.iter().map(|(name, _)| (*name, 1.0)).collect();
    let mut records = asked(model, 60, &names);
    for (answers, (_, percent)) in records.chunks_mut(120).zip(conditions) {
        for (item, record) in answers.iter_mut().enumerate() {
            // A step of 37 visits all hundredths in a mixed order.
            let chosen = usize::from(item * 37 % 100 >= *percent);
            let reading = Some(ParsedAnswer { chosen: Some(chosen), why: None });
            (record.detail.strict, record.detail.lenient) = (reading, reading);
        }
    }
    records
}

/// Makes every fifth reply of a condition readable by the lenient parsing only.
pub(super) fn wordy(records: &mut [Record], condition: &str) {
    let condition: Condition = condition.parse().unwrap();
    let own = records.iter_mut().filter(|record| record.condition.as_ref() == Some(&condition));
    for record in own.step_by(5) {
        record.detail.strict = Some(ParsedAnswer { chosen: None, why: Some(UnreadReason::NoChoice) });
    }
}

pub(super) const SEEING: [(&str, usize); 7] = [
    ("blind", 40),
    ("L0", 100),
    ("L3-ev", 100),
    ("L5-ev", 100),
    ("L3-noise", 100),
    ("L5-noise", 100),
    ("L5-noise+lift", 100),
];

/// The sentences with a sign, except the one about the gain from images.
fn signed(said: &[Sentence]) -> Vec<String> {
    said.iter()
        .filter(|sentence| {
            matches!(sentence.tone, EffectDirection::Better | EffectDirection::Worse) && sentence.kind != "images"
        })
        .map(checked)
        .collect()
}

#[test]
fn format_changes_are_not_losses() {
    let mut one = scripted("m", &SEEING);
    wordy(&mut one, "L5-noise");
    let seen = sentences_about(&one);
    assert_eq!(signed(&seen), Vec::<String>::new());
    let format = of_kind(&seen, "format");
    assert!(
        format[0].starts_with(
            "· At L5 with noise, 20.0 % fewer replies keep to the answer format; no loss of accuracy was detected (0.0 [−"
        ),
        "{format:?}"
    );
    assert!(of_kind(&seen, "darkness").is_empty(), "{seen:?}");
    // Replies to the enhanced images of that level keep the format, which is not a gain either.
    assert!(
        format.iter().any(|said| said.starts_with(
            "· With lift at L5, 20.0 % more replies keep to the answer format; no gain of accuracy was detected"
        )),
        "{format:?}"
    );
    // Several models, and a loss that both parsings show.
    let mut several: Vec<Record> = ["a", "b", "c"].into_iter().flat_map(|model| scripted(model, &SEEING)).collect();
    wordy(&mut several, "L5-noise");
    let seen = sentences_about(&several);
    assert_eq!(signed(&seen), Vec::<String>::new());
    assert!(of_kind(&seen, "format")[0].contains("(mean of these 3 models: 80.0 % keep to it"));
    let mut lost = SEEING;
    lost[5].1 = 50;
    let mut blind = scripted("m", &lost);
    wordy(&mut blind, "L5-noise");
    let darkness = of_kind(&sentences_about(&blind), "darkness");
    assert!(darkness[0].starts_with("− With noise, darkness costs "), "{darkness:?}");
}

#[test]
fn format_changes_by_enhancers_are_not_harm() {
    let mut records = scripted("m", &SEEING);
    wordy(&mut records, "L5-noise+lift");
    let seen = sentences_about(&records);
    assert!(of_kind(&seen, "enhancer").is_empty(), "{seen:?}");
    let format = of_kind(&seen, "format");
    assert!(
        format.len() == 1
            && format[0].starts_with("· With lift at L5, 20.0 % fewer replies keep to the answer format;"),
        "{format:?}"
    );
}
