//! [`image_colors`]: colors that a text attributes to the image and not to an object in it.

use crate::choice::choice_views::{ChoiceViews, Naming};
use crate::choice::names::Name;
use crate::choice::text::words::Role;
use crate::choice::text::{Boundary, Clauses, Ranges, TokenKind};

/// Ranges of the color names that describe the image: "the image is black", "gray noise", "I only see black",
/// "completely black".
pub(crate) fn image_colors(clauses: &Clauses<'_>, texts: &[Name], offered: &ChoiceViews) -> Ranges {
    let described = texts
        .iter()
        .filter(|name| name.choice.is_some_and(|choice| offered.naming[choice] == Naming::Color))
        .filter(|name| describes_image(clauses, name));
    Ranges::new(described.map(|name| (name.start, name.end)).collect())
}

/// Number of elements before and after a color that are examined.
const WITHIN: usize = 12;

fn describes_image(clauses: &Clauses<'_>, name: &Name) -> bool {
    let elements = &clauses.elements;
    let first = elements.partition_point(|element| element.end <= name.start);
    let behind = clauses.index(name.end);
    // "Too dark" is one phrase.
    let denied = elements.get(first).is_some_and(|element| element.has(Role::Not));
    denied || before_noise(clauses, behind) || after_subject(clauses, first, behind)
}

/// True if a noun such as "noise" or "image" follows the color, perhaps after further colors: "gray noise", "black and
/// white image".
fn before_noise(clauses: &Clauses<'_>, behind: usize) -> bool {
    let elements = &clauses.elements;
    let mut at = behind;
    while at < behind + WITHIN {
        let Some(element) = elements.get(at) else {
            return false;
        };
        // "A brown area rug" is a rug.
        let modifies = elements.get(at + 1).is_some_and(|next| next.has(Role::Head));
        if element.has(Role::Noise) {
            return !modifies;
        }
        // "The black part of the image".
        let within = elements.get(at + 1).is_some_and(|next| next.has(Role::Within));
        if element.has(Role::Portion) && within {
            return elements[at + 1..].iter().take(4).any(|element| element.has(Role::Image));
        }
        let joins = element.roles.has_any(&[Role::And, Role::Or]) || clauses.is_sign(at, &[',']);
        let is_color = element.roles.has_any(&[Role::Color, Role::Shade]);
        if !joins && !is_color {
            return false;
        }
        at += 1;
    }
    false
}

/// True if the words before a color attribute it to the image: the subject of the sentence, "I only see", or
/// "completely" alone.
fn after_subject(clauses: &Clauses<'_>, first: usize, behind: usize) -> bool {
    let elements = &clauses.elements;
    let ends = elements.get(behind).is_none_or(|next| next.boundary > Boundary::None);
    let mut entirely = false;
    for at in (first.saturating_sub(WITHIN)..first).rev() {
        let element = &elements[at];
        let word = element.slice(clauses.folded);
        let begins = clauses.begins_part(at);
        entirely |= element.has(Role::Entirely);
        let alone = matches!(word, "only" | "just" | "nothing but");
        let sees_before = at > 0 && elements[at - 1].has(Role::See);
        if word == "pitch" || (element.has(Role::See) && ends && (!alone || begins || sees_before)) {
            return true;
        }
        if element.has(Role::Copula) {
            return element.has(Role::Image)
                || (entirely && element.has(Role::Pronoun))
                || has_image_subject(clauses, at, entirely);
        }
        // "Completely black.", "Picture: black."
        let heading = at > 0 && clauses.is_sign(at, &[':']) && elements[at - 1].has(Role::Image);
        if heading || (entirely && begins) {
            return true;
        }
        let comma = clauses.is_sign(at, &[',']) && at > 0 && is_color(clauses, at - 1);
        let joins = element.roles.has_any(&[Role::And, Role::Or]);
        if !(clauses.is_adverb(at) || is_color(clauses, at) || joins || comma || entirely) {
            return false;
        }
    }
    false
}

fn is_color(clauses: &Clauses<'_>, at: usize) -> bool {
    clauses.elements[at].roles.has_any(&[Role::Color, Role::Shade])
}

/// True if the subject of a verb is the image, or a pronoun in a clause with a word such as "entirely".
fn has_image_subject(clauses: &Clauses<'_>, verb: usize, entirely: bool) -> bool {
    let elements = &clauses.elements;
    let start = (verb.saturating_sub(WITHIN)..verb)
        .rev()
        .find(|at| elements[*at].boundary > Boundary::None || elements[*at].has(Role::And))
        .map_or(verb.saturating_sub(WITHIN), |at| at + 1);
    let subject = start..verb;
    if entirely && subject.len() == 1 && elements[start].has(Role::Pronoun) {
        return true;
    }
    subject.clone().any(|at| elements[at].has(Role::Image) && is_head(clauses, start, at))
}

/// True if an image noun is the head of the subject, as in "most of the image is black", and not a place, as in "the
/// sofa in the image is white".
fn is_head(clauses: &Clauses<'_>, start: usize, noun: usize) -> bool {
    let elements = &clauses.elements;
    let Some(within) = (start..noun)
        .rev()
        .find(|at| !is_determiner_or_color(clauses, *at))
        .filter(|at| elements[*at].has(Role::Within))
    else {
        return true;
    };
    within > start && elements[within - 1].has(Role::Portion)
}

fn is_determiner_or_color(clauses: &Clauses<'_>, at: usize) -> bool {
    const DETERMINERS: [&str; 9] = ["the", "this", "a", "that", "given", "provided", "your", "entire", "whole"];
    let element = &clauses.elements[at];
    is_color(clauses, at) || (element.kind == TokenKind::Word && DETERMINERS.contains(&element.slice(clauses.folded)))
}
