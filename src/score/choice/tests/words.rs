//! Every entry of `words.toml` in a reply that is read otherwise without it.

use super::by_rule::choices;
use super::choices_of;
use crate::score::choice::choice_views::{ChoiceViews, Naming};
use crate::score::choice::plain::fold;
use crate::score::choice::tokens::tokens;
use crate::score::choice::words::{Role, Roles, lists, phrase_at};
use crate::score::choice::{ReadingMode, read};
use crate::types::question::Answer;

/// A set of choices, a reply with an entry and the choice in it, and a reply without the entry and the choice in that.
type Example = (
    &'static str,
    (String, Option<usize>),
    (&'static str, Option<usize>),
);

/// The examples of denials and clauses; `None` for other roles.
#[expect(clippy::too_many_lines, reason = "one example for each word")]
fn of_denials(role: Role, word: &str) -> Option<Example> {
    let home =
        |reply: String, found, control, other| Some(("home", (reply, found), (control, other)));
    let kitchen = Some(1);
    match role {
        Role::Exclude | Role::Not => home(
            format!("{word} the kitchen."),
            None,
            "the kitchen.",
            kitchen,
        ),
        Role::Excluded | Role::ExcludedLast => home(
            format!("The kitchen is {word}."),
            None,
            "The kitchen is out of focus.",
            kitchen,
        ),
        Role::Untrue => home(
            format!("The {word} answer is B."),
            None,
            "The true answer is B.",
            kitchen,
        ),
        Role::Candidate => home(
            format!("The wrong {word} is B."),
            None,
            "The wrong lens. B.",
            kitchen,
        ),
        Role::NotBehind => home(
            format!("The kitchen {word}."),
            None,
            "The kitchen fits.",
            kitchen,
        ),
        Role::Absent => home(
            format!("The kitchen is {word}."),
            None,
            "The kitchen is there.",
            kitchen,
        ),
        Role::Cut => home(
            format!("I rule out the bathroom {word} the kitchen."),
            kitchen,
            "I rule out the bathroom and the kitchen.",
            None,
        ),
        Role::Subordinate => home(
            format!("It is not clear {word} the kitchen."),
            kitchen,
            "It is not clear and the kitchen.",
            None,
        ),
        Role::Assertion => home(
            format!("I rule out the bathroom, {word} the kitchen."),
            kitchen,
            "I rule out the bathroom, and the kitchen.",
            None,
        ),
        Role::Apposition => home(
            format!("I choose B, {word} the bathroom."),
            None,
            "I choose B, it has a bath.",
            kitchen,
        ),
        Role::Copula => home(
            format!("The kitchen {word} unlikely."),
            None,
            "The kitchen. Hm.",
            kitchen,
        ),
        Role::Modal => home(
            format!("The kitchen {word} not fit."),
            None,
            "The kitchen alone, not more.",
            kitchen,
        ),
        Role::Adverb => home(
            format!("The kitchen is {word} unlikely."),
            None,
            "The kitchen is blue unlikely.",
            kitchen,
        ),
        Role::Leaves => home(
            format!("I rule out the bathroom and the bedroom, {word} the kitchen."),
            kitchen,
            "I rule out the bathroom and the bedroom, also the kitchen.",
            None,
        ),
        Role::Remains => home(
            format!("After ruling out the bathroom, only the kitchen {word}."),
            kitchen,
            "After ruling out the bathroom, only the kitchen shines.",
            None,
        ),
        Role::Or | Role::And => home(
            format!("The answer is B {word} C."),
            None,
            "The answer is B.",
            kitchen,
        ),
        Role::Hedge => home(
            format!("The answer is B or {word} C."),
            None,
            "The answer is B or blue C.",
            kitchen,
        ),
        _ => None,
    }
}

/// The examples of questions and conditions, and of yes and no; `None` for other roles.
fn of_conditions(role: Role, word: &str) -> Option<Example> {
    let home =
        |reply: String, found, control, other| Some(("home", (reply, found), (control, other)));
    let yes_no =
        |reply: String, found, control, other| Some(("yes_no", (reply, found), (control, other)));
    let kitchen = Some(1);
    match role {
        Role::Question | Role::Condition => home(
            format!("{word} the kitchen."),
            None,
            "the kitchen.",
            kitchen,
        ),
        Role::If => home(
            format!("{word} it is lit, the kitchen."),
            None,
            "it is lit, the kitchen.",
            kitchen,
        ),
        Role::ModalPast => home(
            format!("The kitchen {word} fit, if lit."),
            None,
            "The kitchen may fit, if lit.",
            kitchen,
        ),
        Role::Given => home(
            format!("{word} more light, the kitchen."),
            None,
            "of more light, the kitchen.",
            kitchen,
        ),
        Role::Better => home(
            format!("with {word} light, the kitchen."),
            None,
            "with this light, the kitchen.",
            kitchen,
        ),
        Role::LightNoun => home(
            format!("with more {word}, the kitchen."),
            None,
            "with more tiles, the kitchen.",
            kitchen,
        ),
        Role::Inverted => home(
            format!("{word} lit, the kitchen."),
            None,
            "It is lit, the kitchen.",
            kitchen,
        ),
        Role::Expected => home(
            format!("The kitchen {word} stove."),
            None,
            "The kitchen has a stove.",
            kitchen,
        ),
        Role::Forced => home(
            format!("{word}, the kitchen."),
            kitchen,
            "if I see it, the kitchen.",
            None,
        ),
        Role::Retraction => home(
            format!("A\n{word} it is the bathroom."),
            None,
            "A\nNearby it is the bathroom.",
            Some(0),
        ),
        Role::NoIdiom => yes_no(
            format!("{word}, that is it."),
            None,
            "no, that is it.",
            Some(1),
        ),
        Role::ClauseStart => yes_no(format!("No {word} lamp."), Some(1), "No bright lamp.", None),
        Role::Preposition => yes_no(
            format!("Yes for me, no {word} you."),
            None,
            "Yes for me, no bright lamp.",
            Some(0),
        ),
        _ => None,
    }
}

/// The examples of compounds and of words about the image; `None` for other roles.
fn of_image(role: Role, word: &str) -> Option<Example> {
    let colors =
        |reply: String, found, control, other| Some(("colors", (reply, found), (control, other)));
    let black = Some(0);
    match role {
        Role::Head => Some((
            "home",
            (format!("A kitchen {word}."), None),
            ("A kitchen view.", Some(1)),
        )),
        Role::Image => colors(
            format!("The {word} is black."),
            None,
            "The sofa is black.",
            black,
        ),
        // "It's" has its verb.
        Role::Pronoun if word.ends_with("'s") => colors(
            format!("{word} fully black."),
            None,
            "The sofa is fully black.",
            black,
        ),
        Role::Pronoun => colors(
            format!("{word} is fully black."),
            None,
            "The sofa is fully black.",
            black,
        ),
        Role::Entirely => colors(
            format!("It is {word} black."),
            None,
            "It is truly black.",
            black,
        ),
        Role::See => colors(format!("{word} black."), None, "I want black.", black),
        Role::Noise => colors(format!("A black {word}."), None, "A black sofa.", black),
        Role::Within => colors(
            format!("The sofa {word} the image is black."),
            black,
            "The sofa near the image is black.",
            None,
        ),
        Role::Portion => colors(
            format!("The {word} of the image is black."),
            None,
            "The sofa of the image is black.",
            black,
        ),
        _ => None,
    }
}

fn lenient(set: &str, reply: &str) -> Option<usize> {
    match read(reply, &choices(set), ReadingMode::Lenient) {
        Answer::Chosen(index) => Some(index),
        Answer::Unparsed(_) => None,
    }
}

#[test]
fn every_entry_decides_a_reply() {
    let mut wrong = Vec::new();
    for (role, list) in lists() {
        assert!(!list.is_empty(), "{role:?}");
        for word in list {
            let example = of_denials(role, &word)
                .or_else(|| of_conditions(role, &word))
                .or_else(|| of_image(role, &word));
            let Some((set, (reply, found), (control, other))) = example else {
                assert!(
                    matches!(
                        role,
                        Role::Neutral | Role::Color | Role::Shade | Role::Place | Role::Number
                    ),
                    "{role:?} has no example"
                );
                continue;
            };
            for (reply, found) in [(reply.as_str(), found), (control, other)] {
                let read = lenient(set, reply);
                if read != found {
                    wrong.push(format!("{role:?} {word:?} {reply:?}: {read:?}"));
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} wrong:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}

/// A neutral phrase hides a word that would act without it, and denies nothing.
#[test]
fn every_neutral_phrase_hides_an_active_word() {
    const ACTIVE: [Role; 9] = [
        Role::Exclude,
        Role::Not,
        Role::Cut,
        Role::If,
        Role::Expected,
        Role::Condition,
        Role::Subordinate,
        Role::NoIdiom,
        Role::Or,
    ];
    for phrase in &lists()[&Role::Neutral] {
        let folded = fold(phrase);
        let words = tokens(&folded);
        let acts = |start: usize, end: usize| {
            let known = phrase_at(&folded, &words[start..end]);
            known.is_some_and(|(_, roles)| {
                roles != Roles::of(Role::Neutral) && roles.has_any(&ACTIVE)
            })
        };
        let parts = (0..words.len())
            .flat_map(|start| (start + 1..=words.len()).map(move |end| (start, end)));
        let hides = parts
            .filter(|(start, end)| end - start < words.len())
            .any(|(start, end)| acts(start, end));
        assert!(hides, "{phrase:?} hides nothing");
        assert_eq!(
            lenient("home", &format!("{phrase} the kitchen.")),
            Some(1),
            "{phrase:?}"
        );
    }
}

#[test]
fn colors_and_places_are_no_things() {
    let lists = lists();
    let naming = |word: &str| ChoiceViews::new(&choices_of(&[word, "kitchen"])).naming;
    for role in [Role::Color, Role::Shade] {
        for word in &lists[&role] {
            assert_eq!(naming(word), [Naming::Color, Naming::Thing], "{word}");
        }
    }
    for role in [Role::Place, Role::Number] {
        for word in &lists[&role] {
            assert_eq!(naming(word), [Naming::Attribute, Naming::Thing], "{word}");
        }
    }
    assert_eq!(naming("dark blue")[0], Naming::Color);
    assert_eq!(naming("blue chair")[0], Naming::Thing);
    assert_eq!(naming("12")[0], Naming::Attribute);
}

/// The classes of one word in the rulebook of the questions are all nouns that make another thing of a name before them.
#[test]
fn every_class_of_the_questions_is_a_head() {
    let rules: toml::Table = include_str!("../../../questions/rules.toml")
        .parse()
        .unwrap();
    let heads = &lists()[&Role::Head];
    let mut classes = 0;
    for (key, class) in rules["class"].as_table().unwrap() {
        let name = class
            .get("name")
            .and_then(toml::Value::as_str)
            .unwrap_or(key);
        if !name.contains([' ', '_']) {
            classes += 1;
            assert!(heads.contains(&name.to_lowercase()), "{name}");
        }
    }
    assert!(classes > 30, "{classes}");
}
