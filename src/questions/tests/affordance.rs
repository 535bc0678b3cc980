//! "Is this room suitable for this?"

use super::*;

fn ask(frame: &FrameStatistics, activity: &str, answer: &str) -> Option<Reason> {
    candidate(frame, &Family::Affordance, activity, answer).err()
}

#[test]
fn yes_needs_the_room_and_an_enabler() {
    let bedroom = frame(&BEDROOM);
    assert_eq!(ask(&bedroom, "sleep", "yes"), None);
    assert_eq!(ask(&bedroom, "cook a meal", "yes"), Some(Reason::OtherRoom));
    let bathroom = frame(&[("toilet", "toilet", 60_000), ("towel", "towel", 9_000)]);
    assert_eq!(ask(&bathroom, "use the toilet", "yes"), None);
    assert_eq!(ask(&bathroom, "take a shower", "yes"), Some(Reason::Unseen));
    assert_eq!(ask(&frame(&[("wall", "", 9_000)]), "sleep", "yes"), Some(Reason::NoRoom));
    for (segments, activity) in [
        (vec![("bathtub", "bathtub", 60_000)], "take a shower"),
        (vec![("toilet", "", 60_000), ("sink", "sink", 9_000)], "wash my hands"),
        (vec![("cabinet", "kitchen cabinet", 60_000), ("sink", "sink", 9_000)], "wash my hands"),
        (vec![("appliances", "stove", 60_000)], "cook a meal"),
        (vec![("appliances", "toaster", 60_000), ("counter", "", 60_000)], "cook a meal"),
        (vec![("sofa", "sofa", 60_000), ("tv_monitor", "tv", 9_000)], "watch TV on the sofa"),
        (vec![("sofa", "sofa", 60_000)], "relax on a sofa"),
        (vec![("table", "dining table", 60_000), ("chair", "chair", 9_000)], "have dinner with my family"),
        (vec![("table", "desk", 60_000), ("chair", "office chair", 9_000)], "work at a desk"),
        // A room type that questions do not ask about is still one in which something is done.
        (vec![("appliances", "washing machine", 60_000)], "do the laundry"),
        (vec![("toilet", "toilet", 60_000), ("appliances", "laundry machine", 9_000)], "do the laundry"),
    ] {
        assert_eq!(ask(&frame(&segments), activity, "yes"), None, "{activity}");
    }
}

/// Why questions about the laundry are rejected.
fn laundry_reasons(labels: &Labels, frames: &[FrameStatistics]) -> Vec<Option<Reason>> {
    let rules = Rules::built_in().unwrap();
    run_rules_of(frames, |_| {}, &rules, labels)
        .candidates
        .iter()
        .filter_map(|result| match result {
            RuleResult::Viable(candidate) if candidate.about == "do the laundry" => Some(None),
            RuleResult::Rejected(rejected) if rejected.about == "do the laundry" => Some(Some(rejected.reason)),
            _ => None,
        })
        .collect()
}

#[test]
fn an_activity_that_the_data_set_cannot_enable_is_not_asked_about() {
    let bedroom = [frame(&BEDROOM)];
    let knows = labels();
    assert_eq!(laundry_reasons(&knows, &bedroom), [Some(Reason::OtherRoom), None]);
    let mut knows_none = knows.clone();
    let named = &mut knows_none.labels;
    named.retain(|_, label| label.name != "washing machine");
    let (other, cannot) = (Some(Reason::OtherRoom), Some(Reason::Inexpressible));
    assert_eq!(laundry_reasons(&knows_none, &bedroom), [other, cannot]);
    // A word of one frame is a word of the data set.
    let mut laundry = frame(&[("appliances", "clothes dryer", 9_000)]);
    laundry.frame = FrameId("scene/1".into());
    let both = [bedroom[0].clone(), laundry];
    assert_eq!(laundry_reasons(&knows_none, &both), [other, None]);
}

#[test]
fn the_sofa_of_a_coarse_label_may_be_an_armchair() {
    let mut room = frame(&[("sofa", "sofa", 60_000)]);
    assert_eq!(ask(&room, "relax on a sofa", "yes"), None);
    room.segments[0].source = WordSource::Coarse;
    assert_eq!(ask(&room, "relax on a sofa", "yes"), Some(Reason::Unseen));
    // It shows a living room all the same.
    assert_eq!(candidate(&room, &Family::RoomType, "", "").unwrap().answer(), "living room");
}

#[test]
fn no_needs_that_no_enabler_and_no_substitute_is_visible() {
    let bathroom = [("toilet", "toilet", 60_000), ("towel", "towel", 9_000)];
    assert_eq!(ask(&frame(&bathroom), "sleep", "no"), None);
    assert_eq!(ask(&frame(&bathroom), "use the toilet", "no"), Some(Reason::OtherRoom));
    for (activity, class, word) in [
        ("sleep", "bed", "bed"),
        ("sleep", "sofa", "sofa"),
        ("sleep", "seating", "bench"),
        ("cook a meal", "appliances", "stove"),
        ("cook a meal", "misc", "oven and stove"),
        ("cook a meal", "appliances", "microwave"),
        ("watch TV on the sofa", "tv_monitor", "tv"),
        ("relax on a sofa", "sofa", "sofa"),
        ("have dinner with my family", "table", "table"),
        ("work at a desk", "table", "side table"),
    ] {
        let seen = frame(&[&bathroom[..], &[(class, word, 1)]].concat());
        assert_eq!(ask(&seen, activity, "no"), Some(Reason::Seen), "{activity} {word}");
        assert_eq!(ask(&frame(&bathroom), activity, "no"), None, "{activity}");
    }
}

#[test]
fn no_needs_a_frame_that_can_show_absence() {
    let bedroom = frame(&BEDROOM);
    assert_eq!(ask(&bedroom, "cook a meal", "no"), None);
    let void = [50_000, 50_001].map(|effective_void| {
        let frame = FrameStatistics { effective_void, ..bedroom.clone() };
        ask(&frame, "cook a meal", "no")
    });
    assert_eq!(void, [None, Some(Reason::Void)]);
    let mirror = [30_000, 30_001].map(|area| {
        let frame = frame(&[&BEDROOM[..], &[("mirror", "mirror", area)]].concat());
        ask(&frame, "cook a meal", "no")
    });
    assert_eq!(mirror, [None, Some(Reason::Mirror)]);
}

#[test]
fn substitutes_count_only_if_the_rule_is_strict() {
    let frame = frame(&[("toilet", "toilet", 60_000), ("sofa", "sofa", 9_000)]);
    let rules = rules("strict = true", "strict = false");
    let lenient = candidate_by(&frame, &Family::Affordance, "sleep", "no", &rules);
    assert_eq!(ask(&frame, "sleep", "no"), Some(Reason::Seen));
    assert_eq!(lenient.unwrap().text, "I want to sleep, is this room suitable for this?");
}

#[test]
fn classes_that_cannot_be_labelled_are_not_called_absent() {
    let mut labels = labels();
    labels.expressible.remove("sofa");
    let rules = Rules::built_in().unwrap();
    let results = run_rules(&[frame(&BEDROOM)], |request| request.families = [Family::Affordance].into(), &rules);
    assert!(results.candidates.len() > 10);
    let bathroom = frame(&[("toilet", "toilet", 60_000)]);
    let palette = Palette::built_in().unwrap();
    let request = QuestionRequest {
        dataset: "",
        labels: &labels,
        rules: &rules,
        palette: &palette,
        families: Family::by_rule().collect(),
        room_source: RoomSource::Signature,
        balance: BalanceMode::None,
        rejected: BTreeSet::new(),
    };
    let mut reasons = BTreeSet::new();
    generate(&[bathroom], &request, |_, result| {
        if let RuleResult::Rejected(rejection) = result
            && rejection.answer.as_deref() == Some("no")
            && ["sleep", "relax on a sofa", "sofa"].contains(&rejection.about.as_str())
        {
            reasons.insert(rejection.reason);
        }
    })
    .unwrap();
    assert_eq!(reasons, [Reason::Inexpressible].into());
}
