//! Sentences from made records, through all tests: what is named, counted, and left out.

use super::checked;
use crate::report::sentences::{Sentence, sentences};
use crate::score::cluster::FrameTies;
use crate::score::findings::Findings;
use crate::types::{
    AnswerReading, ChoiceDetail, Condition, Digest, Family, FrameId, LightGroup, QuestionId,
    Record, TrialOutcome,
};

/// Number of frames, each with two questions: one about colour and one about the room.
const FRAMES: usize = 12;

/// The records of a model in some conditions, about `frames` frames. The share of right replies is 0 or 1, or alternates for 0.5.
fn asked(model: &str, frames: usize, conditions: &[(&str, f64)]) -> Vec<Record> {
    let mut records = Vec::new();
    for (name, share) in conditions {
        let condition: Option<Condition> = (*name != "blind").then(|| name.parse().unwrap());
        for item in 0..2 * frames {
            let wrong = usize::from(((item / 2 % 2) as f64) >= 2.0 * share);
            let reading = Some(AnswerReading {
                chosen: Some(wrong),
                why: None,
            });
            let detail = ChoiceDetail {
                frame: FrameId(format!("f{:02}", item / 2)),
                family: [Family::Color, Family::RoomType][item % 2].clone(),
                choices: ["a", "b", "c"].map(str::to_owned).to_vec(),
                truth: Some(0),
                repeat: 0,
                strict: reading,
                lenient: reading,
                outcome: if wrong == 0 {
                    TrialOutcome::Right
                } else {
                    TrialOutcome::Wrong
                },
                image: None,
                more_images: Vec::new(),
                shown_frame: None,
                observed: None,
                options: None,
            };
            let key = Digest::of(format!("{item} {model} {name}").as_bytes()).into();
            let question = QuestionId(format!("q{item:02}"));
            records.push(Record::blank(
                key,
                question,
                model,
                condition.clone(),
                detail,
            ));
        }
    }
    records
}

/// All sentences about records.
fn said(records: &[Record]) -> Vec<Sentence> {
    let trials = records.iter().cloned().collect();
    sentences(&Findings::new(&trials, &FrameTies::default(), [], &[]))
}

/// The sentences of a kind, each with its detail.
fn of_kind(said: &[Sentence], kind: &str) -> Vec<String> {
    let of_kind = said.iter().filter(|sentence| sentence.kind == kind);
    of_kind.map(checked).collect()
}

#[test]
fn references_are_neither_ranked_nor_mixed() {
    let levels = [("L0", 1.0), ("L3-noise", 1.0), ("L5-noise", 1.0)];
    let dark = [("L0", 0.5), ("L3-noise", 0.0), ("L5-noise", 0.0)];
    let mut all = [
        asked("observer", FRAMES, &levels),
        asked("random", FRAMES, &dark),
    ]
    .concat();
    let alone = said(&all);
    assert!(of_kind(&alone, "best").is_empty());
    let darkness = of_kind(&alone, "darkness");
    assert!(
        darkness[0].starts_with("· It is not shown that darkness costs anything at any level")
            && darkness[0].contains(" (observer: 0.0 "),
        "{darkness:?}"
    );
    all.extend(asked("a", FRAMES, &levels));
    assert!(of_kind(&said(&all), "best").is_empty());
    all.extend(asked("b", FRAMES, &dark));
    let best = of_kind(&said(&all), "best");
    assert!(
        best[0].starts_with("+ a sees best in the dark. ("),
        "{best:?}"
    );
}

#[test]
fn what_images_give_over_the_words_alone_is_said_at_l0() {
    let say = |with: f64, without: f64| {
        let all = asked("m", FRAMES, &[("blind", without), ("L0", with)]);
        let images = of_kind(&said(&all), "images");
        assert_eq!(images.len(), 1, "{images:?}");
        images[0].clone()
    };
    for (with, without, start) in [
        (
            1.0,
            0.0,
            "+ At L0 images give 100.0 points over the words alone: 100.0 % with them, 0.0 % without. (",
        ),
        (
            0.0,
            1.0,
            "− At L0 images cost 100.0 points against the words alone: 0.0 % with them, 100.0 % without. (",
        ),
        (
            0.5,
            0.5,
            "· It is not shown that images help at L0: 50.0 % with them, 50.0 % without. (",
        ),
    ] {
        let said = say(with, without);
        assert!(said.starts_with(start), "{said}");
    }
    // Without a model that was asked without images, there is nothing to say.
    let seen = said(&asked("m", FRAMES, &[("L0", 1.0)]));
    assert!(of_kind(&seen, "images").is_empty());
}

#[test]
fn darkness_names_the_variant_that_shows_it() {
    let say = |ev: f64, noise: f64| {
        let all = asked(
            "m",
            FRAMES,
            &[("L0", 1.0), ("L5-ev", ev), ("L5-noise", noise)],
        );
        of_kind(&said(&all), "darkness")
    };
    let both = say(0.0, 0.5);
    assert!(
        both.len() == 1
            && both[0].starts_with("− Darkness costs 50.0 points at L5, from 100.0 % at L0. ("),
        "{both:?}"
    );
    let neither = say(1.0, 1.0);
    assert!(
        neither.len() == 1 && neither[0].starts_with("· It is not shown that"),
        "{neither:?}"
    );
    let noise = say(1.0, 0.0);
    assert!(
        noise.len() == 1
            && noise[0].starts_with("− With noise, darkness costs 100.0 points at L5, from"),
        "{noise:?}"
    );
    let ev = say(0.0, 1.0);
    assert_eq!(ev.len(), 2, "{ev:?}");
    assert!(
        ev[0]
            .starts_with("· With noise, it is not shown that darkness costs anything at any level"),
        "{ev:?}"
    );
    assert!(
        ev[1].starts_with(
            "− By the exposure drop alone, darkness costs 100.0 points at L5, from 100.0 % at L0. ("
        ),
        "{ev:?}"
    );
    let one = of_kind(
        &said(&asked("m", FRAMES, &[("L0", 1.0), ("L5-ev", 0.0)])),
        "darkness",
    );
    assert!(
        one[0].starts_with("− Darkness costs 100.0 points"),
        "{one:?}"
    );
}

#[test]
fn too_few_clusters_are_no_verdict_set_by_set() {
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
    // Seven frames: 5 · 2 / 2⁷ is above 0.05, and one level alone is not.
    let few = said(&asked("m", 7, &levels));
    for kind in ["darkness", "noise", "below blind"] {
        assert!(of_kind(&few, kind).is_empty(), "{kind}");
    }
    let without = of_kind(&few, "no verdict");
    assert_eq!(
        without[0],
        "· With 7 frames no verdict on darkness, noise and dark images against the words alone is possible, however large the effect. (the smallest \
         possible p = 0.078; take more frames)"
    );
    let lift = of_kind(&few, "enhancer");
    assert!(
        lift[0].starts_with("+ lift helps at L3, by 100.0 points. ("),
        "{lift:?}"
    );
    let models = [
        asked("a", 4, &levels),
        asked("b", 4, &[("L0", 0.0), ("L3-noise", 0.0)]),
    ]
    .concat();
    let fewer = said(&models);
    assert!(of_kind(&fewer, "best").is_empty());
    let without = of_kind(&fewer, "no verdict");
    assert!(
        without[0].starts_with("· With 4 frames no verdict on darkness, noise, lift, dark images against the words alone and the best model is possible,"),
        "{without:?}"
    );
    let enough = said(&asked("m", 8, &levels));
    assert_eq!(of_kind(&enough, "darkness").len(), 1);
    assert!(of_kind(&enough, "no verdict").is_empty());
}

#[test]
fn levels_that_a_model_lacks_are_named() {
    let all_levels = [
        ("L0", 1.0),
        ("L1-noise", 1.0),
        ("L2-noise", 1.0),
        ("L3-noise", 0.5),
        ("L4-noise", 0.0),
        ("L5-noise", 0.0),
    ];
    let one = asked("a", FRAMES, &all_levels);
    assert!(of_kind(&said(&one), "left out").is_empty());
    // What a reference was asked is no level of the models.
    let with_random = [
        one.clone(),
        asked("random", FRAMES, &[("L0", 1.0), ("L1-ev", 1.0)]),
    ]
    .concat();
    assert!(of_kind(&said(&with_random), "left out").is_empty());
    let two = [one, asked("b", FRAMES, &[("L0", 1.0), ("L3-noise", 1.0)])].concat();
    let both = said(&two);
    assert_eq!(
        of_kind(&both, "left out"),
        [
            "· L1–L2, L4–L5 are not compared: b was not asked there. (left out of the findings about darkness (with noise))"
        ]
    );
    assert!(of_kind(&both, "darkness")[0].contains(" points at L3,"));
    let best = of_kind(&both, "best");
    assert!(
        best[0].starts_with("+ b sees best in the dark over L0, L3. ("),
        "{best:?}"
    );
    // No level in common: nothing can be said about darkness, and why is said.
    let apart = [
        asked("a", FRAMES, &all_levels[..2]),
        asked("b", FRAMES, &[("L0", 1.0), ("L3-noise", 1.0)]),
    ]
    .concat();
    let apart = said(&apart);
    assert!(of_kind(&apart, "darkness").is_empty());
    let left_out = of_kind(&apart, "left out");
    assert!(
        left_out[0].starts_with("· L3 is not compared: a was not asked there. ("),
        "{left_out:?}"
    );
    assert!(
        left_out[1].starts_with("· L1 is not compared: b was not asked there. ("),
        "{left_out:?}"
    );
}

#[test]
fn the_best_model_has_its_light_and_each_level_once() {
    // Two runs show other images: the clean ones and the dark ones stand apart.
    let mut all = Vec::new();
    for (run, name) in ["d0", "d1"].into_iter().enumerate() {
        for (model, dark) in [("a", 1.0), ("b", 0.0)] {
            let mut records = asked(model, FRAMES, &[("L0", 1.0), ("L3-noise", dark)]);
            for record in &mut records {
                let condition = record.condition.as_mut().unwrap();
                condition.group = Some(LightGroup::new(name, &[run]));
            }
            all.extend(records);
        }
    }
    let trials = all.iter().cloned().collect();
    let findings = Findings::new(&trials, &FrameTies::default(), [], &[]);
    let best = findings.best.as_ref().unwrap();
    let names: Vec<String> = best.levels.iter().map(ToString::to_string).collect();
    assert_eq!(names, ["L0", "L3"]);
    let said = of_kind(&sentences(&findings), "best");
    assert!(
        said[0].starts_with("+ with noise @d0: a sees best in the dark. ("),
        "{said:?}"
    );
}

#[test]
fn families_are_compared_two_by_two() {
    let mut all = asked("m", FRAMES, &[("L0", 1.0), ("L5-noise", 0.0)]);
    for record in &mut all {
        let is_dark = record
            .condition
            .as_ref()
            .is_some_and(|condition| condition.degradation().is_some());
        if is_dark && record.detail.family == Family::RoomType {
            let right = Some(AnswerReading {
                chosen: Some(0),
                why: None,
            });
            (record.detail.strict, record.detail.lenient) = (right, right);
        }
    }
    let families = of_kind(&said(&all), "families");
    assert!(
        families[0].starts_with("− Darkness costs more in object colour (−100.0 points at L5) than in room type (0.0). ("),
        "{families:?}"
    );
    assert!(
        families[0].ends_with(
            "the two intervals do not meet; p < 0.001 is that of the loss in object colour)"
        ),
        "{families:?}"
    );
}
