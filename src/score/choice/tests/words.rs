//! Tests that every entry of `words.toml` changes the parsing of a reply.

use super::by_rule::choices;
use super::choices_of;
use crate::choice::choice_views::{ChoiceViews, Naming};
use crate::choice::text::tokens::{Role, Roles, lists, phrase_at};
use crate::choice::text::{fold, tokens};
use crate::choice::{ParsingMode, read};
use darkqa_base::types::questions::Answer;

/// A role, a set of choices, a reply in which an entry of the role replaces `{}`, the choice in it, a reply without
/// such an entry, and the choice in that reply.
type Example = (Role, &'static str, &'static str, Option<usize>, &'static str, Option<usize>);

#[rustfmt::skip]
const EXAMPLES: [Example; 42] = [
    (Role::Exclude, "home", "{} the kitchen.", None, "the kitchen.", Some(1)),
    (Role::Not, "home", "{} the kitchen.", None, "the kitchen.", Some(1)),
    (Role::Excluded, "home", "The kitchen is {}.", None, "The kitchen is out of focus.", Some(1)),
    (Role::ExcludedLast, "home", "The kitchen is {}.", None, "The kitchen is out of focus.", Some(1)),
    (Role::Untrue, "home", "The {} answer is B.", None, "The true answer is B.", Some(1)),
    (Role::Candidate, "home", "The wrong {} is B.", None, "The wrong lens. B.", Some(1)),
    (Role::NotBehind, "home", "The kitchen {}.", None, "The kitchen fits.", Some(1)),
    (Role::Absent, "home", "The kitchen is {}.", None, "The kitchen is there.", Some(1)),
    (Role::Cut, "home", "I rule out the bathroom {} the kitchen.", Some(1), "I rule out the bathroom and the kitchen.", None),
    (Role::Subordinate, "home", "It is not clear {} the kitchen.", Some(1), "It is not clear and the kitchen.", None),
    (Role::Assertion, "home", "I rule out the bathroom, {} the kitchen.", Some(1), "I rule out the bathroom, and the kitchen.", None),
    (Role::Apposition, "home", "I choose B, {} the bathroom.", None, "I choose B, it has a bath.", Some(1)),
    (Role::Copula, "home", "The kitchen {} unlikely.", None, "The kitchen. Hm.", Some(1)),
    (Role::Modal, "home", "The kitchen {} not fit.", None, "The kitchen alone, not more.", Some(1)),
    (Role::Adverb, "home", "The kitchen is {} unlikely.", None, "The kitchen is blue unlikely.", Some(1)),
    (Role::Leaves, "home", "I rule out the bathroom and the bedroom, {} the kitchen.", Some(1), "I rule out the bathroom and the bedroom, also the kitchen.", None),
    (Role::Remains, "home", "After ruling out the bathroom, only the kitchen {}.", Some(1), "After ruling out the bathroom, only the kitchen shines.", None),
    (Role::Or, "home", "The answer is B {} C.", None, "The answer is B.", Some(1)),
    (Role::And, "home", "The answer is B {} C.", None, "The answer is B.", Some(1)),
    (Role::Hedge, "home", "The answer is B or {} C.", None, "The answer is B or blue C.", Some(1)),
    (Role::Question, "home", "{} the kitchen.", None, "the kitchen.", Some(1)),
    (Role::Condition, "home", "{} the kitchen.", None, "the kitchen.", Some(1)),
    (Role::If, "home", "{} it is lit, the kitchen.", None, "it is lit, the kitchen.", Some(1)),
    (Role::ModalPast, "home", "The kitchen {} fit, if lit.", None, "The kitchen may fit, if lit.", Some(1)),
    (Role::Given, "home", "{} more light, the kitchen.", None, "of more light, the kitchen.", Some(1)),
    (Role::Better, "home", "with {} light, the kitchen.", None, "with this light, the kitchen.", Some(1)),
    (Role::LightNoun, "home", "with more {}, the kitchen.", None, "with more tiles, the kitchen.", Some(1)),
    (Role::Inverted, "home", "{} lit, the kitchen.", None, "It is lit, the kitchen.", Some(1)),
    (Role::Expected, "home", "The kitchen {} stove.", None, "The kitchen has a stove.", Some(1)),
    (Role::Forced, "home", "{}, the kitchen.", Some(1), "if I see it, the kitchen.", None),
    (Role::Retraction, "home", "A\n{} it is the bathroom.", None, "A\nNearby it is the bathroom.", Some(0)),
    (Role::NoIdiom, "yes_no", "{}, that is it.", None, "no, that is it.", Some(1)),
    (Role::ClauseStart, "yes_no", "No {} lamp.", Some(1), "No bright lamp.", None),
    (Role::Preposition, "yes_no", "Yes for me, no {} you.", None, "Yes for me, no bright lamp.", Some(0)),
    (Role::Head, "home", "A kitchen {}.", None, "A kitchen view.", Some(1)),
    (Role::Image, "colors", "The {} is black.", None, "The sofa is black.", Some(0)),
    (Role::Pronoun, "colors", "{} is fully black.", None, "The sofa is fully black.", Some(0)),
    (Role::Entirely, "colors", "It is {} black.", None, "It is truly black.", Some(0)),
    (Role::See, "colors", "{} black.", None, "I want black.", Some(0)),
    (Role::Noise, "colors", "A black {}.", None, "A black sofa.", Some(0)),
    (Role::Within, "colors", "The sofa {} the image is black.", Some(0), "The sofa near the image is black.", None),
    (Role::Portion, "colors", "The {} of the image is black.", None, "The sofa of the image is black.", Some(0)),
];

/// The roles of words in choices, which have a separate test.
const CHOICE_ROLES: [Role; 4] = [Role::Color, Role::Shade, Role::Place, Role::Number];

fn lenient(set: &str, reply: &str) -> Option<usize> {
    match read(reply, &choices(set), ParsingMode::Lenient) {
        Answer::Chosen(index) => Some(index),
        Answer::Unparsed(_) => None,
    }
}

#[test]
fn every_entry_decides_a_reply() {
    let mut wrong = Vec::new();
    for (role, list) in lists() {
        assert!(!list.is_empty(), "{role:?}");
        if role == Role::Neutral || CHOICE_ROLES.contains(&role) {
            continue;
        }
        let (_, set, reply, found, control, other) =
            EXAMPLES.iter().find(|(of, ..)| *of == role).unwrap_or_else(|| panic!("{role:?}"));
        for word in list {
            // "It's" already contains the verb.
            let reply = reply.replace("{}", &word).replace("'s is ", "'s ");
            for (reply, found) in [(reply.as_str(), found), (control, other)] {
                let read = lenient(set, reply);
                if read != *found {
                    wrong.push(format!("{role:?} {word:?} {reply:?}: {read:?}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
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
        let hides = (0..words.len())
            .flat_map(|start| (start + 1..=words.len()).map(move |end| (start, end)))
            .filter(|(start, end)| end - start < words.len())
            .filter_map(|(start, end)| phrase_at(&folded, &words[start..end]))
            .any(|(_, roles)| roles != Roles::from_role(Role::Neutral) && roles.has_any(&ACTIVE));
        assert!(hides, "{phrase:?} hides nothing");
        assert_eq!(lenient("home", &format!("{phrase} the kitchen.")), Some(1), "{phrase:?}");
    }
}

#[test]
fn colors_and_places_are_not_things() {
    let lists = lists();
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

/// The kinds of a choice with this text and of "kitchen".
fn naming(word: &str) -> Vec<Naming> {
    ChoiceViews::new(&choices_of(&[word, "kitchen"])).naming
}

/// Last words of object names that are not in the list of heads, each with an object whose name keeps its meaning
/// before that word.
const NO_HEADS: [(&str, &str); 4] =
    [("photo", "kitchen"), ("monitor", "TV"), ("oven", "microwave"), ("machine", "dishwasher")];

/// The last word of every object name in the question rules is in the list of heads.
#[test]
fn object_names_end_in_a_head() {
    let rules: toml::Table = include_str!("../../../questions/rules.toml").parse().unwrap();
    let heads = &lists()[&Role::Head];
    let (mut known, mut missing) = (0, Vec::new());
    for (_, class) in rules["class"].as_table().unwrap() {
        for word in class.get("words").and_then(toml::Value::as_array).into_iter().flatten() {
            let last = word.as_str().unwrap().split(' ').next_back().unwrap();
            let is_head = heads.contains(&last.to_lowercase());
            if NO_HEADS.iter().any(|(word, _)| *word == last) {
                assert!(!is_head, "{last}");
            } else if is_head {
                known += 1;
            } else {
                missing.push(last.to_owned());
            }
        }
    }
    assert_eq!(missing, Vec::<String>::new());
    assert!(known > 60, "{known}");
    for (word, thing) in NO_HEADS {
        let choices = choices_of(&[thing, "sofa"]);
        let [object, other] =
            [word, "cupboard"].map(|next| read(&format!("A {thing} {next}."), &choices, ParsingMode::Lenient));
        assert_eq!(object, Answer::Chosen(0), "{thing} {word}");
        assert!(matches!(other, Answer::Unparsed(_)), "{thing}");
    }
}
