//! "Is there a chair in the image?"

use super::*;

fn ask(frame: &FrameStatistics, class: &str, answer: &str) -> Option<Reason> {
    candidate(frame, &Family::Presence, class, answer).err()
}

fn chair(change: impl FnOnce(&mut Segment)) -> FrameStatistics {
    let mut frame = frame(&[("wall", "wall", 500_000), ("chair", "chair", 20_000)]);
    change(&mut frame.segments[1]);
    frame
}

#[test]
fn yes_needs_one_good_segment() {
    let question = candidate(&chair(|_| {}), &Family::Presence, "chair", "yes").unwrap();
    assert_eq!(question.text, "Is there a chair in the image?");
    assert_eq!(question.evidence["segments"][0]["id"], 2);
    for (change, expected) in [
        ((|c: &mut Segment| (c.area, c.pure) = (5_000, 5_000)) as fn(&mut Segment), None),
        (|c| (c.area, c.pure) = (4_999, 4_999), Some(Reason::Small)),
        (|c| c.pure = 18_000, None),
        (|c| c.pure = 17_999, Some(Reason::Mixed)),
        (|c| c.rim_on_border = 500, None),
        (|c| c.rim_on_border = 501, Some(Reason::Cut)),
        (|c| (c.rim_on_border, c.area, c.pure) = (1000, 99_999, 99_999), Some(Reason::Cut)),
        (|c| (c.rim_on_border, c.area, c.pure) = (1000, 100_000, 100_000), None),
        (|c| c.bbox = [0, 0, 20, 900], None),
        (|c| c.bbox = [0, 0, 19, 900], Some(Reason::Thin)),
        (|c| c.place = SegmentPlace::Elsewhere, Some(Reason::Elsewhere)),
    ] {
        assert_eq!(ask(&chair(change), "chair", "yes"), expected);
    }
    let pet = frame(&[("bed", "dog bed", 90_000)]);
    assert_eq!(ask(&pet, "bed", "yes"), Some(Reason::Unlike));
    // A tiny chair in addition to a good one does not matter.
    let two = frame(&[("chair", "chair", 600), ("chair", "chair", 20_000)]);
    assert_eq!(ask(&two, "chair", "yes"), None);
}

#[test]
fn words_fit_their_classes() {
    for (class, word, object) in [
        ("appliances", "fridge", "Is there a refrigerator"),
        ("appliances", "oven", "Is there an oven"),
        ("tv_monitor", "tv", "Is there a TV"),
        ("chest_of_drawers", "night stand", "Is there a nightstand"),
        ("lighting", "ceiling light", "Is there a ceiling light"),
        ("cushion", "pillow", "Is there a pillow"),
        ("table", "desk", "Is there a desk"),
        ("chair", "armchair", "Is there an armchair"),
        ("curtain", "curtain", "Is there a curtain"),
        ("curtain", "curtains", "Are there curtains"),
        ("shelving", "shelves", "Are there shelves"),
        ("plant", "flowers", "Are there flowers"),
    ] {
        let frame = frame(&[(class, word, 20_000)]);
        let question = candidate(&frame, &Family::Presence, class, "yes").unwrap();
        assert_eq!(question.text, format!("{object} in the image?"));
    }
}

#[test]
fn things_without_a_word_of_their_own_are_not_asked_about() {
    let mut sofa = frame(&[("sofa", "sofa", 20_000)]);
    assert_eq!(ask(&sofa, "sofa", "yes"), None);
    sofa.segments[0].source = WordSource::Coarse;
    assert_eq!(ask(&sofa, "sofa", "yes"), Some(Reason::Wordless));
    for (class, word) in [("bed", "bed sheet"), ("lighting", "light fixture"), ("sofa", "Sessel")] {
        let frame = frame(&[(class, word, 20_000)]);
        assert_eq!(ask(&frame, class, "yes"), Some(Reason::Wordless), "{word}");
    }
    // Each word that a class has in the frame is asked about.
    let both = frame(&[("chair", "armchair", 20_000), ("chair", "dining chair", 9_000)]);
    let results = run_rules(&[both], |_| {}, &Rules::built_in().unwrap());
    let texts = results.candidates.iter().filter_map(|result| match result {
        RuleResult::Viable(found) if found.about == "chair" && found.family == Family::Presence => {
            Some(found.text.as_str())
        }
        _ => None,
    });
    let expected = ["Is there a dining chair in the image?", "Is there an armchair in the image?"];
    assert_eq!(texts.collect::<BTreeSet<_>>(), expected.into());
}

#[test]
fn nothing_is_denied_that_a_coarse_class_may_hide() {
    let rules = Rules::built_in().unwrap();
    for (class, rule) in &rules.book().class {
        for other in &rule.hidden {
            let mut seen = frame(&[("wall", "wall", 500_000)]);
            assert_eq!(ask(&seen, class, "no"), None, "{class}");
            seen.unnamed.insert(other.clone(), 1);
            let hidden = Some(Reason::Hidden);
            assert_eq!(ask(&seen, class, "no"), hidden, "{class} in {other}");
        }
    }
    // Named, the same things hide nothing; but a name may be another word for the class.
    for (word, expected) in [
        ("vase", None),
        ("lamp base", None),
        ("salt lamp", Some(Reason::Confusable)),
        // One word.
        ("headlamp", None),
    ] {
        let frame = frame(&[("wall", "wall", 500_000), ("objects", word, 9_000)]);
        assert_eq!(ask(&frame, "lighting", "no"), expected, "{word}");
    }
}

/// Questions about lighting whose answer is no.
fn denied(frames: &[FrameStatistics]) -> BTreeSet<String> {
    run_rules(frames, |_| {}, &Rules::built_in().unwrap())
        .candidates
        .into_iter()
        .filter_map(|result| match result {
            RuleResult::Viable(found) if found.about == "lighting" && found.answer() == "no" => Some(found.text),
            _ => None,
        })
        .collect()
}

#[test]
fn only_words_of_the_data_set_are_denied() {
    let wall = frame(&[("wall", "wall", 500_000)]);
    let lamp = "Is there a lamp in the image?".to_owned();
    assert_eq!(denied(std::slice::from_ref(&wall)), [lamp.clone()].into());
    let mut lit = frame(&[("lighting", "ceiling light", 9_000)]);
    lit.frame = FrameId("scene/1".into());
    let ceiling = "Is there a ceiling light in the image?".to_owned();
    assert_eq!(denied(&[wall.clone(), lit.clone()]), [lamp, ceiling.clone()].into());
    // Where segments have names, only names count.
    lit.segments[0].source = WordSource::Name;
    assert_eq!(denied(&[wall, lit]), [ceiling].into());
}

#[test]
fn no_needs_that_no_confusable_class_is_visible() {
    let wall = frame(&[("wall", "wall", 500_000)]);
    assert_eq!(ask(&wall, "bathtub", "no"), None);
    let bathtub = frame(&[("wall", "wall", 500_000), ("bathtub", "bathtub", 1)]);
    assert_eq!(ask(&bathtub, "bathtub", "yes"), Some(Reason::Small));
    let rules = Rules::built_in().unwrap();
    for group in &rules.book().confusable {
        for class in group.classes.iter().filter(|class| rules.book().has_flag(class, crate::rules::ClassFlag::Asked)) {
            for other in group.classes.iter().filter(|other| *other != class) {
                let seen = frame(&[("wall", "wall", 500_000), (other, "", 1)]);
                assert_eq!(ask(&seen, class, "no"), Some(Reason::Confusable), "{class} {other}");
            }
            for word in &group.names {
                let seen = frame(&[("wall", "wall", 500_000), ("misc", word, 1)]);
                assert_eq!(ask(&seen, class, "no"), Some(Reason::Confusable), "{class} {word}");
            }
        }
    }
}

#[test]
fn no_needs_a_frame_that_can_show_absence() {
    let wall = frame(&[("wall", "wall", 500_000)]);
    let void = [50_000, 50_001].map(|effective_void| {
        let frame = FrameStatistics { effective_void, ..wall.clone() };
        ask(&frame, "bathtub", "no")
    });
    assert_eq!(void, [None, Some(Reason::Void)]);
    let mirror = [30_000, 30_001].map(|area| ask(&frame(&[("mirror", "mirror", area)]), "bathtub", "no"));
    assert_eq!(mirror, [None, Some(Reason::Mirror)]);
}

#[test]
fn no_is_asked_about_classes_common_in_such_rooms_elsewhere() {
    // The bedroom of another scene has twelve classes; bathtub is not one of them.
    let common = [
        "bed",
        "cabinet",
        "chair",
        "chest_of_drawers",
        "curtain",
        "cushion",
        "lighting",
        "picture",
        "plant",
        "shelving",
        "table",
        "towel",
    ];
    let mut other = frame(&common.map(|class| (class, "", 20_000)));
    (other.frame, other.scene) = (FrameId("other/0".into()), "other".into());
    let rules = Rules::built_in().unwrap();
    let results = run_rules(&[frame(&BEDROOM), other], |_| {}, &rules);
    for (class, expected) in [("plant", None), ("towel", None), ("bathtub", Some(Reason::Implausible))] {
        let reason = results.candidates.iter().find_map(|result| match result {
            RuleResult::Rejected(rejection) if rejection.family == Family::Presence && rejection.about == class => {
                Some(Some(rejection.reason))
            }
            RuleResult::Viable(candidate) if candidate.family == Family::Presence && candidate.about == class => {
                Some(None)
            }
            _ => None,
        });
        assert_eq!(reason, Some(expected), "{class}");
    }
}
