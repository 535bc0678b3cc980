//! Tests of the parsing rules on a table of replies, and of properties that hold for any reply.

#![allow(clippy::unwrap_used)]

mod by_rule;
mod properties;
mod reasoning;
mod words;

use proptest::prelude::*;
use serde::Deserialize;

use super::{ParsingMode, read, readings};
use darkqa_base::types::questions::{Answer, Choices, UnreadReason};
use darkqa_base::types::replies::{Finish, Reply};

/// One line of the table: the set of choices, the reply, and the expected answer in each mode.
#[derive(Deserialize)]
struct Case {
    of: String,
    reply: String,
    strict: Reading,
    lenient: Reading,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(untagged)]
enum Reading {
    Chosen(usize),
    Unparsed(UnreadReason),
}

impl From<Reading> for Answer {
    fn from(reading: Reading) -> Self {
        match reading {
            Reading::Chosen(index) => Self::Chosen(index),
            Reading::Unparsed(why) => Self::Unparsed(why),
        }
    }
}

const SETS: [(&str, &[&str]); 9] = [
    ("rooms", &["bedroom", "kitchen", "bathroom", "garage"]),
    ("yes_no", &["yes", "no"]),
    ("numbers", &["1", "2", "3", "4"]),
    ("tables", &["table", "dining table", "coffee table", "chair"]),
    ("six", &["bed", "sofa", "lamp", "desk", "rug", "none of the above"]),
    ("chinese", &["卧室", "厨房", "浴室", "车库"]),
    ("letters", &["D", "C", "B", "A"]),
    ("signs", &["C++", "C#", ".*", "[a-z]+", "(x)"]),
    ("left_right", &["left", "right", "in front", "behind"]),
];

/// Number of leading sets whose texts are words, so that no letter or sign in them can be read as something else.
const PLAIN_SETS: usize = 6;

fn choices(set: &str) -> Choices {
    let texts = match SETS.iter().find(|(name, _)| *name == set) {
        Some((_, texts)) => texts.iter().map(|&text| text.to_owned()).collect(),
        None => (1..=26).map(|i| format!("item{i}")).collect(),
    };
    Choices::new(texts, 0).unwrap()
}

/// Choices with these texts.
fn choices_of(texts: &[&str]) -> Choices {
    Choices::new(texts.iter().map(|&text| text.to_owned()).collect(), 0).unwrap()
}

/// The replies of the table.
fn table_of_replies() -> Vec<String> {
    include_str!("../../../tests/data/replies.jsonl")
        .lines()
        .map(|line| serde_json::from_str::<Case>(line).unwrap().reply)
        .collect()
}

#[test]
fn replies_of_the_table_are_parsed() {
    let mut wrong = Vec::new();
    for line in include_str!("../../../tests/data/replies.jsonl").lines() {
        let case: Case = serde_json::from_str(line).unwrap();
        for (mode, want) in [(ParsingMode::Strict, case.strict), (ParsingMode::Lenient, case.lenient)] {
            let found = read(&case.reply, &choices(&case.of), mode);
            if found != want.into() {
                wrong.push(format!("{mode:?} {line}: {found:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn full_width_letters_are_read_strictly() {
    let rooms = choices_of(&["厨房", "卧室"]);
    for reply in ["（B）", "B、", "B．", "B：", "（B） 卧室", "B、卧室"] {
        assert_eq!(read(reply, &rooms, ParsingMode::Strict), Answer::Chosen(1), "{reply}");
    }
    let wrong = Answer::Unparsed(UnreadReason::Contradiction);
    assert_eq!(read("（B）厨房", &rooms, ParsingMode::Strict), wrong);
}

#[test]
fn finish_and_refusal_are_considered() {
    let rooms = choices("rooms");
    for (text, finish, refusal, want) in [
        ("B", Finish::Stop, None, Answer::Chosen(1)),
        ("", Finish::Stop, None, Answer::Unparsed(UnreadReason::Empty)),
        ("", Finish::Stop, Some("I cannot."), Answer::Unparsed(UnreadReason::Refused)),
        ("Option B", Finish::Stop, Some("I cannot."), Answer::Unparsed(UnreadReason::Refused)),
        ("", Finish::Filter, None, Answer::Unparsed(UnreadReason::Filtered)),
        ("", Finish::Length, None, Answer::Unparsed(UnreadReason::Truncated)),
        ("B", Finish::Length, None, Answer::Chosen(1)),
        ("The answer is B", Finish::Length, None, Answer::Unparsed(UnreadReason::Truncated)),
        ("", Finish::Filter, Some("400: it violates our policy"), Answer::Unparsed(UnreadReason::Filtered)),
        ("", Finish::Other("x".into()), None, Answer::Unparsed(UnreadReason::Empty)),
        ("B", Finish::Other("x".into()), None, Answer::Chosen(1)),
        ("The answer is B", Finish::Other("x".into()), None, Answer::Unparsed(UnreadReason::NoChoice)),
    ] {
        let reply = Reply { finish, refusal: refusal.map(str::to_owned), ..Reply::local(text.to_owned()) };
        assert_eq!(readings(&reply, &rooms), (want, want), "{reply:?}");
    }
    for finish in [Finish::Stop, Finish::Other("TOOL_CALLS".into())] {
        let sentence = Reply { finish, ..Reply::local("It is B.".to_owned()) };
        assert_eq!(readings(&sentence, &rooms), (Answer::Unparsed(UnreadReason::NoChoice), Answer::Chosen(1)));
    }
}

#[test]
fn long_replies_are_read() {
    let rooms = choices("rooms");
    let answered = format!("There is a stove. {}\nAnswer: B", "It is dim here. ".repeat(10_000));
    let found = read(&answered, &rooms, ParsingMode::Lenient);
    assert_eq!(found, Answer::Chosen(1));
    // Repetitions of the strings that the parser searches for. A quadratic step would make this test very slow.
    for piece in [
        "answer: ",
        "answer is ",
        "option ",
        "is ",
        "\\boxed{",
        "{\"answer\":",
        "<answer>",
        "<|im_end|>",
        "B",
        "B ",
        "B, ",
        "(",
        "kitchen ",
        "kitchen",
        "not ",
        "\n",
        "**",
        "|",
        "\\text{",
        "Question: x\n",
        "答案",
        "A bedroom. ",
    ] {
        let long = piece.repeat(20_000 / piece.len());
        let _ = read(&long, &rooms, ParsingMode::Lenient);
    }
}

/// Fragments that the parser searches for, so that random sequences of them reach every level.
const FRAGMENTS: [&str; 64] = [
    "A",
    "B",
    "C",
    "D",
    "E",
    "I",
    "a",
    "b",
    "(B)",
    "[C]",
    "B.",
    "c)",
    "A:",
    "kitchen",
    "Kitchen.",
    "bathroom",
    "bedroom",
    "garage",
    "kitchens",
    "yes",
    "no",
    "1",
    "2",
    "2.5",
    "answer",
    "Answer:",
    "The answer is",
    "option",
    "correct",
    "I choose",
    "is",
    "not",
    "isn't",
    "or",
    "and",
    ",",
    ".",
    ":",
    "-",
    "?",
    "!",
    "\n",
    "\n\n",
    " ",
    " ",
    "**",
    "`",
    "\"",
    "'",
    "$",
    "\\boxed{",
    "}",
    "{\"answer\": \"",
    "\"}",
    "<answer>",
    "</answer>",
    "<think>",
    "</think>",
    "<|im_end|>",
    "答案",
    "是",
    "Question:",
    "\u{200b}",
    "❌",
];

fn reply() -> impl Strategy<Value = String> {
    let fragments = prop::collection::vec(prop::sample::select(&FRAGMENTS[..]), 0..14);
    let spaced = (fragments.clone(), Just(" ")).prop_map(|(parts, gap)| parts.join(gap));
    prop_oneof![fragments.prop_map(|parts| parts.concat()), spaced, any::<String>(), "\\PC{0,40}"]
}

proptest! {
    #[test]
    fn the_modes_never_disagree(reply in reply(), set in 0..SETS.len()) {
        let choices = choices(SETS[set].0);
        let strict = read(&reply, &choices, ParsingMode::Strict);
        let lenient = read(&reply, &choices, ParsingMode::Lenient);
        match (strict, lenient) {
            (Answer::Chosen(strict), lenient) => {
                prop_assert_eq!(lenient, Answer::Chosen(strict));
                prop_assert!(strict < choices.len());
            }
            (Answer::Unparsed(_), Answer::Chosen(index)) => prop_assert!(index < choices.len()),
            (strict, lenient) => prop_assert_eq!(strict, lenient),
        }
    }

    #[test]
    fn every_form_of_every_choice_is_read(set in 0..PLAIN_SETS, pick in 0..100usize, form in 0..8usize) {
        let choices = choices(SETS[set].0);
        let index = pick % choices.len();
        let letter = darkqa_base::types::questions::letter(index);
        let text = &choices.texts()[index];
        let (reply, strict) = match form {
            0 => (letter.to_string(), true),
            1 => (format!("({letter}) {text}"), true),
            2 => (text.to_uppercase(), true),
            3 => (format!("{letter}.\n{text}."), true),
            4 => (format!("The answer is {letter}."), false),
            5 => (format!("Answer: {text}"), false),
            6 => (format!("{{\"answer\": \"{text}\"}}"), false),
            _ => (format!("**{letter}. {text}**"), false),
        };
        prop_assert_eq!(read(&reply, &choices, ParsingMode::Lenient), Answer::Chosen(index), "{}", reply);
        prop_assert_eq!(read(&reply, &choices, ParsingMode::Strict) == Answer::Chosen(index), strict, "{}", reply);
    }
}
