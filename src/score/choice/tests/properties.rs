//! Properties of the lenient parsing that hold for any reply.

use std::time::{Duration, Instant};

use proptest::prelude::*;

use super::by_rule::choices;
use super::reply;
use crate::choice::text::tokens::{Role, lists};
use crate::choice::{ParsingMode, read};
use darkqa_base::types::questions::Answer;

const SETS: [&str; 6] = ["home", "yes_no", "colors", "things", "sofas", "numbers"];

fn lenient(reply: &str, set: &str) -> Answer {
    read(reply, &choices(set), ParsingMode::Lenient)
}

/// Sentences around a lone name.
const SENTENCES: [&str; 6] = [
    "{}.",
    "It is the {}.",
    "I see a {} here.",
    "We are in front of a {}",
    "This looks like the {}!",
    "the {}, I think",
];

/// The replies of the table that end with a sentence and have no markup, which could enclose an appended question.
fn whole_sentences() -> Vec<String> {
    let mut replies = super::table_of_replies();
    replies.retain(|reply| reply.ends_with(['.', '!']) && !reply.contains(['{', '<', '[', '`', '\\', '?', '◁']));
    replies
}

proptest! {
    #[test]
    fn denied_lone_names_are_not_chosen(
        set in prop::sample::select(vec!["home", "things", "sofas"]),
        pick in 0..100usize,
        denial in 0..1000usize,
    ) {
        let lists = lists();
        let denials: Vec<&String> = [Role::Exclude, Role::Not].iter().flat_map(|role| &lists[role]).collect();
        let denial = denials[denial % denials.len()];
        let texts = choices(set);
        let name = &texts.texts()[pick % texts.len()];
        for reply in [
            format!("{denial} {name}"),
            format!("{denial} the {name}."),
            format!("It is {denial} a {name}."),
            format!("I think that this is {denial} a {name}!"),
            format!("{denial} {}", darkqa_base::types::questions::letter(pick % texts.len())),
        ] {
            prop_assert!(matches!(lenient(&reply, set), Answer::Unparsed(_)), "{}", reply);
        }
    }

    #[test]
    fn hyphens_in_names_change_nothing(
        sentence in prop::sample::select(&SENTENCES[..]),
        hyphen in prop::sample::select(&["-", "\u{2010}", "\u{2011}", "\u{2012}", "\u{2013}", "\u{2212}"][..]),
        name in prop::sample::select(&["living room", "sofa bed", "dining table", "dark blue"][..]),
    ) {
        let set = match name {
            "living room" => "home",
            "sofa bed" => "sofas",
            "dining table" => "tables",
            _ => "shades",
        };
        let [blank, hyphenated, joined] =
            [" ", hyphen, ""].map(|gap| lenient(&sentence.replace("{}", &name.replace(' ', gap)), set));
        prop_assert!(matches!(blank, Answer::Chosen(_)), "{} {:?}", name, blank);
        prop_assert_eq!(hyphenated, blank);
        prop_assert_eq!(joined, blank);
    }

    #[test]
    fn appended_questions_change_nothing(
        reply in prop::sample::select(whole_sentences()),
        question in prop::sample::select(&["Is it a kitchen?", "Could this be B?", "Do you agree?", "Or is it the bathroom?"][..]),
    ) {
        let before = lenient(&reply, "home");
        if let Answer::Chosen(index) = before {
            prop_assert_eq!(lenient(&format!("{reply} {question}"), "home"), Answer::Chosen(index));
        } else {
            let after = lenient(&format!("{reply} {question}"), "home");
            prop_assert!(matches!(after, Answer::Unparsed(_)), "{} {}", reply, question);
        }
    }

    #[test]
    fn chosen_text_parses_as_the_choice(reply in reply(), set in prop::sample::select(&SETS[..])) {
        if let Answer::Chosen(index) = lenient(&reply, set) {
            let texts = choices(set);
            for mode in ParsingMode::ALL {
                prop_assert_eq!(read(&texts.texts()[index], &texts, mode), Answer::Chosen(index));
            }
        }
    }
}

/// A step with quadratic run time would take hours.
#[test]
fn parsing_takes_linear_time() {
    /// Time limit for one reply in a build without optimization; a release build takes less than a second.
    const LIMIT: Duration = Duration::from_secs(30);
    const LENGTH: usize = 2_000_000;
    let signs = ["✅ kitchen\n", "A\n", "B, ", "kitchen ", "bedroom, kitchen, ", "no, ", "(", "[x] A ", "? "];
    let lists = lists();
    // One entry of each list; all of them are looked up in the same way.
    let words = lists.values().map(|list| list[0].clone() + " ");
    for piece in signs.into_iter().map(str::to_owned).chain(words) {
        let long = piece.repeat(LENGTH / piece.len() / if cfg!(debug_assertions) { 10 } else { 1 });
        let start = Instant::now();
        let _ = lenient(&long, "home");
        assert!(start.elapsed() < LIMIT, "{piece:?}: {:?}", start.elapsed());
    }
}
