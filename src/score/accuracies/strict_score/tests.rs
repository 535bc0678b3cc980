//! Tests of the strict score against hand-computed values, on 24 questions with three choices, two about each of 12
//! frames.

use super::*;
use crate::tests::{records, with_grid};
use darkqa_base::types::{Evidence, Record};

/// The questions of records, in the groups that `group` names for an item, of the size that the groups have then.
fn questions(records: &[Record], group: impl Fn(usize) -> Option<String>) -> Vec<RunQuestion> {
    let mut questions: Vec<RunQuestion> = Vec::new();
    for record in records {
        if questions.iter().any(|known| known.id == record.question) {
            continue;
        }
        let item: usize = record.question.0[1..].parse().unwrap();
        questions.push(RunQuestion {
            id: record.question.clone(),
            place: item,
            scene: String::new(),
            frame: record.detail.frame.clone(),
            family: record.detail.family.clone(),
            text: "?".to_owned(),
            choices: record.detail.choices.clone(),
            answer: Some("a".to_owned()),
            extra_answers: None,
            evidence: Evidence::default(),
            image: None,
            images: Vec::new(),
            group: group(item).map(|name| StrictGroup { name, size: 0 }),
        });
    }
    let mut sizes = BTreeMap::<String, usize>::new();
    for group in questions.iter().filter_map(|question| question.group.as_ref()) {
        *sizes.entry(group.name.clone()).or_default() += 1;
    }
    for group in questions.iter_mut().filter_map(|question| question.group.as_mut()) {
        group.size = sizes[&group.name];
    }
    questions
}

/// The two questions about a frame.
fn by_frame(item: usize) -> String {
    format!("frame {}", item / 2)
}

fn score(records: &[Record], questions: &[RunQuestion]) -> StrictScore {
    with_grid(records, |grid| StrictScore::new(grid, questions)).unwrap()
}

/// The cell of all groups of a condition, in the strict parsing.
fn strict<'s>(score: &'s StrictScore, condition: &str) -> &'s GroupCell {
    score
        .cells
        .iter()
        .find(|cell| cell.family.is_none() && cell.mode == ParsingMode::Strict && cell.subject.condition() == condition)
        .unwrap()
}

#[test]
fn one_wrong_member_makes_its_group_wrong() {
    let made = [
        records("m", "L0", |_| Some(true)),
        // Items 4 and 5 are one group, 9 and 12 are of two.
        records("m", "L3-noise", |item| Some(![4, 5, 9, 12].contains(&item))),
        records("m", "", |item| Some(item % 2 == 0)),
    ]
    .concat();
    let score = score(&made, &questions(&made, |item| Some(by_frame(item))));
    let light = strict(&score, "L0");
    assert_eq!((light.right, light.incomplete), (12, 0));
    let dark = strict(&score, "L3-noise");
    assert_eq!((dark.right, dark.incomplete, dark.clusters), (9, 0, 12));
    // A group is one unit: its members are not counted apart.
    assert_eq!(dark.share, Estimate::share(9, 12));
    // Half of all replies are right, and no group is.
    assert_eq!(strict(&score, "blind").share, Estimate::share(0, 12));
    assert_eq!((score.groups, score.single, score.across_frames, score.never_complete), (12, 0, 0, 0));
}

#[test]
fn a_group_without_all_replies_is_incomplete_and_not_scored() {
    let made = records("m", "L0", |item| (item != 7).then_some(item != 6 && item != 0));
    let all = questions(&made, |item| Some(by_frame(item)));
    let cell = score(&made, &all);
    let cell = strict(&cell, "L0");
    // Group 3 failed in part, though its other member is wrong; group 0 is wrong.
    assert_eq!((cell.right, cell.incomplete), (10, 1));
    assert_eq!(cell.share, Estimate::share(10, 11));
    // The set holds a third question of group 2, which was not drawn; its record is not there either.
    let mut part = all.clone();
    for question in &mut part {
        let group = question.group.as_mut().unwrap();
        group.size += usize::from(group.name == "frame 2");
    }
    let part = score(&made, &part);
    assert_eq!(part.never_complete, 1);
    assert_eq!(strict(&part, "L0").share, Estimate::share(9, 10));
    assert_eq!(part.chance[0].share.unwrap().n, 11);
    // A question that is known and was not asked of this model.
    let asked: Vec<Record> = made.iter().filter(|record| record.question.0 != "q23").cloned().collect();
    let asked = score(&asked, &all);
    assert_eq!(asked.never_complete, 0);
    assert_eq!(strict(&asked, "L0").incomplete, 2);
}

#[test]
fn chance_is_the_mean_product_of_one_over_the_choices() {
    let made = records("m", "L0", |_| Some(true));
    // Eleven groups of two questions, one of two groups of one question, and the other question has no group.
    let questions_in_groups = questions(&made, |item| match item {
        22 => Some("alone".to_owned()),
        23 => None,
        _ => Some(by_frame(item)),
    });
    let score = score(&made, &questions_in_groups);
    let chance = score.chance[0].share.unwrap();
    assert!((chance.value - (11.0 / 9.0 + 1.0 / 3.0) / 12.0).abs() < 1e-15);
    assert_eq!((score.groups, score.single), (12, 1));
    // Groups of both families are in no row of a family.
    let families: Vec<&GroupChance> = score.chance.iter().skip(1).collect();
    assert_eq!(families.len(), 1);
    assert_eq!(families[0].share, Some(Estimate::exact(1.0 / 3.0, 1)));
    assert_eq!(with_grid(&made, |grid| StrictScore::new(grid, &questions(&made, |_| None))), None);
}

#[test]
fn groups_that_share_a_frame_are_one_cluster() {
    // Frames are wholly right or wholly wrong.
    let made = records("m", "L0", |item| Some(item / 2 % 3 != 0));
    let alone = score(&made, &questions(&made, |item| Some(format!("{item:02}"))));
    let cell = strict(&alone, "L0");
    let counts: Vec<ClusterCount> =
        (0..12).map(|frame| ClusterCount { right: 2 * u32::from(frame % 3 != 0), replies: 2 }).collect();
    assert_eq!(cell.clusters, 12);
    assert_eq!(cell.share, Estimate::clustered(&counts));
    assert_ne!(cell.share, Estimate::share(16, 24));
    // Two groups about the same two frames: one cluster for both.
    let crossed = score(&made, &questions(&made, |item| Some(format!("{} {}", item / 4, item % 2))));
    let cell = strict(&crossed, "L0");
    assert_eq!((cell.clusters, cell.share.unwrap().n), (6, 12));
    assert_eq!(crossed.across_frames, 12);
}

#[test]
fn a_question_asked_again_must_be_right_again() {
    let mut again = records("m", "L0", |item| Some(item != 10));
    for record in &mut again {
        record.detail.repeat = 1;
    }
    let made = [records("m", "L0", |_| Some(true)), again].concat();
    let all = questions(&made, |item| Some(by_frame(item)));
    let twice = score(&made, &all);
    assert_eq!(strict(&twice, "L0").right, 11);
    let chance = twice.chance[0].share.unwrap().value;
    assert!((chance - 1.0 / 81.0).abs() < 1e-15, "{chance}");
    // An order that one model was not asked does not make its groups incomplete.
    let other = records("n", "L0", |_| Some(true));
    let both = [made, other].concat();
    let both = score(&both, &all);
    let cells = both.cells.iter().filter(|cell| cell.subject.model == "n");
    assert!(cells.clone().count() > 0);
    assert!(cells.clone().all(|cell| (cell.right, cell.incomplete) == (12, 0)));
    assert_eq!(both.cells.len(), 4);
}
