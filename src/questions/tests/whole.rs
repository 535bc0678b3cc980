//! All families together.

use proptest::prelude::*;

use super::*;

fn many() -> Vec<FrameStatistics> {
    let mut frames = Vec::new();
    for i in 0..60 {
        let mut made = match i % 4 {
            0 => frame(&BEDROOM),
            1 => frame(&[("toilet", "toilet", 60_000), ("sink", "sink", 9_000)]),
            2 => frame(&[
                ("sofa", "sofa", 90_000),
                ("table", "coffee table", 9_000),
                ("plant", "plant", 9_000),
            ]),
            _ => frame(&[
                ("cabinet", "kitchen cabinet", 90_000),
                ("appliances", "stove", 9_000),
            ]),
        };
        (made.scene, made.frame) = (
            format!("s{}", i / 12),
            FrameId(format!("s{}/{i:02}", i / 12)),
        );
        frames.push(made);
    }
    frames
}

#[test]
fn order_changes_nothing_and_names_are_of_content() {
    let rules = Rules::built_in().unwrap();
    let frames = many();
    let mut shuffled = frames.clone();
    shuffled.reverse();
    shuffled.swap(3, 40);
    let made = |frames: &[FrameStatistics]| {
        say(frames, |order| order.balance = BalanceMode::Full, &rules).made
    };
    let (one, other) = (made(&frames), made(&shuffled));
    assert_eq!(one.asked, other.asked);
    assert_eq!(one.tallies, other.tallies);
    let names: BTreeSet<&QuestionId> = one.asked.iter().map(|asked| &asked.question.id).collect();
    assert_eq!(names.len(), one.asked.len());
    let wider = crate::questions::tests::rules("gap_mm = 300", "gap_mm = 301");
    let same = say(&frames, |order| order.balance = BalanceMode::Full, &wider).made;
    let ids = |made: &Generated| {
        made.asked
            .iter()
            .map(|asked| asked.question.id.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(ids(&one), ids(&same));
}

#[test]
fn yes_and_no_are_nearly_even_before_anything_is_dropped() {
    let rules = Rules::built_in().unwrap();
    let made = say(&many(), |order| order.balance = BalanceMode::Binary, &rules).made;
    let mut counts: BTreeMap<(&Family, &str), [i64; 2]> = BTreeMap::new();
    let binary = |asked: &&GeneratedQuestion| {
        matches!(asked.question.family, Family::Affordance | Family::Presence)
    };
    for asked in made.asked.iter().filter(binary) {
        counts
            .entry((&asked.question.family, &asked.about))
            .or_default()[asked.question.choices.truth()] += 1;
    }
    assert!(counts.len() > 10);
    for (about, [yes, no]) in counts {
        assert!((yes - no).abs() <= 1, "{about:?}: {yes} {no}");
    }
}

#[test]
fn what_a_person_rejects_is_not_asked_and_nothing_else_changes() {
    let rules = Rules::built_in().unwrap();
    let before = say(&many(), |_| {}, &rules).made;
    let rejected = before.asked[7].question.id.clone();
    let after = say(
        &many(),
        |order| order.rejected = [rejected.clone()].into(),
        &rules,
    )
    .made;
    let mut expected = before.asked.clone();
    expected.retain(|asked| asked.question.id != rejected);
    assert_eq!(after.asked, expected);
}

#[test]
fn black_frames_are_asked_nothing() {
    let dark = |median| {
        let frame = FrameStatistics {
            luma: [0, median, 90],
            ..frame(&BEDROOM)
        };
        let made = say(&[frame], |_| {}, &Rules::built_in().unwrap()).made;
        (made.asked.is_empty(), made.dark.len())
    };
    assert_eq!((dark(15), dark(16)), ((true, 1), (false, 0)));
}

#[test]
fn frames_without_depth_yield_nothing_about_the_closest() {
    let mut frames = many();
    for frame in &mut frames {
        frame.depth = None;
    }
    let made = say(&frames, |_| {}, &Rules::built_in().unwrap()).made;
    assert_eq!(made.tallies[&Family::Closest].viable, 0);
    assert_eq!(
        made.tallies[&Family::Closest].fallen,
        [(Reason::NoDepth, 60)].into()
    );
}

fn any_segment() -> impl Strategy<Value = (usize, usize, u64, u64, u32, u64)> {
    (
        0..40_usize,
        0..12_usize,
        1..400_000_u64,
        0..100_u64,
        0..9_000_u32,
        0..100_u64,
    )
}

proptest! {
    #[test]
    fn any_frames_give_sound_questions(
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
            .map(|(i, (segments, void, deep_frame, scene))| {
                let list: Vec<(&str, &str, u64)> = segments.iter().map(|s| (classes[s.0].as_str(), words[s.1], s.2)).collect();
                let mut made = frame(&list);
                for (segment, (_, _, area, pure, depth, color)) in made.segments.iter_mut().zip(&segments) {
                    segment.pure = area * pure / 100;
                    segment.depth = (*depth > 100).then(|| deep(area * color / 100, *depth + 100));
                    segment.colors.rotate_right(*color as usize % 12);
                }
                made.depth = made.depth.filter(|_| deep_frame);
                (made.effective_void, made.lower_void) = (void, void / 2);
                (made.scene, made.frame) = (format!("s{scene}"), FrameId(format!("s{scene}/{i}")));
                made
            })
            .collect();
        for balance in [BalanceMode::None, BalanceMode::Binary, BalanceMode::Full] {
            let made = say(&frames, |order| order.balance = balance, &rules).made;
            let mut seen = BTreeSet::new();
            for asked in &made.asked {
                let question = &asked.question;
                prop_assert!(question.choices.texts().contains(&asked.answer().to_owned()));
                prop_assert!(seen.insert((question.frame.clone(), question.family.clone())));
            }
            for tally in made.tallies.values() {
                prop_assert_eq!(tally.viable, tally.asked + tally.left.values().sum::<u64>());
            }
        }
    }
}
