//! Tests of all families together.

use proptest::prelude::*;

use super::*;

fn many() -> Vec<FrameStatistics> {
    let mut frames = Vec::new();
    for i in 0..60 {
        let mut statistics = match i % 4 {
            0 => frame(&BEDROOM),
            1 => frame(&[("toilet", "toilet", 60_000), ("sink", "sink", 9_000)]),
            2 => frame(&[("sofa", "sofa", 90_000), ("table", "coffee table", 9_000), ("plant", "plant", 9_000)]),
            _ => frame(&[("cabinet", "kitchen cabinet", 90_000), ("appliances", "stove", 9_000)]),
        };
        (statistics.scene, statistics.frame) = (format!("s{}", i / 12), FrameId(format!("s{}/{i:02}", i / 12)));
        frames.push(statistics);
    }
    frames
}

/// Questions about frames, with all answers balanced.
fn balanced(frames: &[FrameStatistics], rules: &Rules) -> Generated {
    run_rules(frames, |request| request.balance = BalanceMode::Full, rules).generated
}

#[test]
fn the_order_of_frames_does_not_matter_and_ids_depend_on_content() {
    let rules = Rules::built_in().unwrap();
    let frames = many();
    let mut shuffled = frames.clone();
    shuffled.reverse();
    shuffled.swap(3, 40);
    let [one, other] = [&frames, &shuffled].map(|frames| balanced(frames, &rules));
    assert_eq!(one.asked, other.asked);
    assert_eq!(one.counts, other.counts);
    let names: BTreeSet<&QuestionId> = one.asked.iter().map(|asked| &asked.question.id).collect();
    assert_eq!(names.len(), one.asked.len());
    let wider = crate::tests::rules("gap_mm = 300", "gap_mm = 301");
    let same = balanced(&frames, &wider);
    assert!(one.asked.iter().map(|asked| &asked.question.id).eq(same.asked.iter().map(|asked| &asked.question.id)));
}

#[test]
fn yes_and_no_are_nearly_even_before_anything_is_dropped() {
    let rules = Rules::built_in().unwrap();
    let generated = run_rules(&many(), |request| request.balance = BalanceMode::Binary, &rules).generated;
    let mut counts: BTreeMap<(&Family, &str), [i64; 2]> = BTreeMap::new();
    for asked in
        generated.asked.iter().filter(|asked| matches!(asked.question.family, Family::Affordance | Family::Presence))
    {
        counts.entry((&asked.question.family, &asked.about)).or_default()[asked.question.choices.truth().unwrap()] += 1;
    }
    assert!(counts.len() > 10);
    for (about, [yes, no]) in counts {
        assert!((yes - no).abs() <= 1, "{about:?}: {yes} {no}");
    }
}

#[test]
fn questions_that_a_person_rejects_are_not_asked_and_nothing_else_changes() {
    let rules = Rules::built_in().unwrap();
    let before = run_rules(&many(), |_| {}, &rules).generated;
    let rejected = before.asked[7].question.id.clone();
    let after = run_rules(&many(), |request| request.rejected = [rejected.clone()].into(), &rules).generated;
    let mut expected = before.asked.clone();
    expected.retain(|asked| asked.question.id != rejected);
    assert_eq!(after.asked, expected);
}

#[test]
fn no_question_is_asked_about_black_frames() {
    for (median, is_dark) in [(15, true), (16, false)] {
        let frame = FrameStatistics { luma: [0, median, 90], ..frame(&BEDROOM) };
        let generated = run_rules(&[frame], |_| {}, &Rules::built_in().unwrap()).generated;
        assert_eq!(generated.asked.is_empty(), is_dark, "{median}");
        assert_eq!(generated.dark.len(), usize::from(is_dark), "{median}");
    }
}

#[test]
fn frames_without_depth_get_no_closest_question() {
    let mut frames = many();
    for frame in &mut frames {
        frame.depth = None;
    }
    let generated = run_rules(&frames, |_| {}, &Rules::built_in().unwrap()).generated;
    assert_eq!(generated.counts[&Family::Closest].viable, 0);
    assert_eq!(generated.counts[&Family::Closest].rejections, [(Reason::NoDepth, 60)].into());
}

fn any_segment() -> impl Strategy<Value = (usize, usize, u64, u64, u32, u64)> {
    (0..40_usize, 0..12_usize, 1..400_000_u64, 0..100_u64, 0..9_000_u32, 0..100_u64)
}

proptest! {
    #[test]
    fn any_frames_give_valid_questions(
        frames in prop::collection::vec(
            (prop::collection::vec(any_segment(), 0..12), 0..300_000_u64, any::<bool>(), 0..3_usize), 1..8,
        ),
    ) {
        let rules = Rules::built_in().unwrap();
        let classes: Vec<&String> = rules.book().class.keys().collect();
        let words = ["", "desk", "stove", "nightstand", "rug", "toilet paper", "dog bed", "washing machine", "office chair", "bed/otherroom", "vase", "kitchen cabinet"];
        let frames: Vec<FrameStatistics> = frames
            .into_iter()
            .enumerate()
            .map(|(i, (segments, void, has_depth, scene))| {
                let list: Vec<(&str, &str, u64)> = segments.iter().map(|s| (classes[s.0].as_str(), words[s.1], s.2)).collect();
                let mut statistics = frame(&list);
                for (segment, (_, _, area, pure, depth, color)) in statistics.segments.iter_mut().zip(&segments) {
                    segment.pure = area * pure / 100;
                    segment.depth = (*depth > 100).then(|| depth_at(area * color / 100, *depth + 100));
                    segment.colors.rotate_right(*color as usize % 12);
                }
                statistics.depth = statistics.depth.filter(|_| has_depth);
                (statistics.effective_void, statistics.lower_void) = (void, void / 2);
                (statistics.scene, statistics.frame) = (format!("s{scene}"), FrameId(format!("s{scene}/{i}")));
                statistics
            })
            .collect();
        for balance in [BalanceMode::None, BalanceMode::Binary, BalanceMode::Full] {
            let generated = run_rules(&frames, |request| request.balance = balance, &rules).generated;
            let mut seen = BTreeSet::new();
            for asked in &generated.asked {
                let question = &asked.question;
                prop_assert!(question.choices.texts().contains(&asked.answer().to_owned()));
                prop_assert!(seen.insert((question.frame.clone(), question.family.clone())));
            }
            for counts in generated.counts.values() {
                prop_assert_eq!(counts.viable, counts.asked + counts.omitted.values().sum::<u64>());
            }
        }
    }
}

#[test]
fn every_family_has_its_rule_its_tests_and_its_description() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("../docs/questions.md")).unwrap();
    let mut missing = Vec::new();
    for family in Family::by_rule() {
        for file in [format!("{family}.rs"), format!("tests/{family}.rs")] {
            if !root.join(&file).is_file() {
                missing.push(file);
            }
        }
        if !page.contains(&format!("`{family}`")) {
            missing.push(format!("{family} in src/docs/questions.md"));
        }
    }
    assert!(missing.is_empty(), "{missing:?}");
}
