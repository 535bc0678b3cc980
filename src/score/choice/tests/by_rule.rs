//! Tests of each lenient rule, on replies that must be parsed and on replies that must not.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::choice::{ParsingMode, read};
use darkqa_base::types::questions::{Answer, Choices};

/// One line of the table: the rule, the set of choices, the reply, and the choice that a person finds in it.
#[derive(Deserialize)]
struct RuleCase {
    rule: String,
    of: String,
    reply: String,
    lenient: Option<usize>,
}

const SETS: [(&str, &[&str]); 13] = [
    ("home", &["bedroom", "kitchen", "bathroom", "living room"]),
    ("yes_no", &["yes", "no"]),
    ("colors", &["black", "white", "gray", "brown"]),
    ("shades", &["blue", "dark blue", "light blue", "green"]),
    ("things", &["table", "chair", "TV", "bed"]),
    ("sofas", &["sofa", "sofa bed", "armchair", "chair"]),
    ("tables", &["chair", "dining table", "table", "sofa"]),
    ("places", &["left", "right", "in front", "behind"]),
    ("numbers", &["1", "2", "3", "4"]),
    ("brightness", &["dark", "bright", "dim", "normal"]),
    ("two_rooms", &["kitchen", "bathroom"]),
    ("desks", &["desk", "TV", "microwave", "bed"]),
    ("lamps", &["lamp", "table", "cushion", "shelf"]),
];

pub(super) fn choices(set: &str) -> Choices {
    let (_, texts) = SETS.iter().find(|(name, _)| *name == set).unwrap();
    super::choices_of(texts)
}

/// Minimum number of replies of a rule that are parsed, and of replies that are not.
const EACH_WAY: usize = 3;

#[test]
fn rules_agree_with_a_person() {
    let mut wrong = Vec::new();
    let mut counts = BTreeMap::<String, [usize; 2]>::new();
    for line in include_str!("../../../../tests/data/replies_by_rule.jsonl").lines() {
        let case: RuleCase = serde_json::from_str(line).unwrap();
        let found = match read(&case.reply, &choices(&case.of), ParsingMode::Lenient) {
            Answer::Chosen(index) => Some(index),
            Answer::Unparsed(_) => None,
        };
        if found != case.lenient {
            wrong.push(format!("{line}: {found:?}"));
        }
        counts.entry(case.rule).or_default()[usize::from(found.is_some())] += 1;
    }
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
    for (rule, both) in counts {
        assert!(both.iter().all(|count| *count >= EACH_WAY), "{rule}: {both:?}");
    }
}

/// If the strict parsing finds a choice, the lenient parsing finds the same, whatever the rules.
#[test]
fn rules_do_not_change_the_strict_parsing() {
    for (reply, set, index) in [
        ("no", "yes_no", 1),
        ("black.", "colors", 0),
        ("B", "home", 1),
        ("(B) kitchen", "home", 1),
        ("table", "tables", 2),
        ("dark", "brightness", 0),
    ] {
        for mode in ParsingMode::ALL {
            assert_eq!(read(reply, &choices(set), mode), Answer::Chosen(index), "{reply}");
        }
    }
    for reply in ["No light.", "dining-table", "Grey.", "✅ kitchen", "Kitchen?", "I rule out B."] {
        for (set, _) in SETS {
            let strict = read(reply, &choices(set), ParsingMode::Strict);
            assert!(matches!(strict, Answer::Unparsed(_)), "{reply}");
        }
    }
}
