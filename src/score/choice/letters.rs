//! [`letters`]: the letters in a reply that name a choice.

use std::sync::LazyLock;

use regex::Regex;

use super::names::{Delimiting, Name, NameState, continues_word, index_of_letter, is_unspaced};
use super::text::{Clauses, RANGE};
use crate::choice::text::plain::compiled;
use crate::choice::text::tokens::Role;

/// Words that can follow the letter A but not the article.
pub(super) static AFTER_A: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\A(?:and|or|but|because|since|as|is|isn't|was|are|would|could|can|cannot|must|should|may|might|seems|appears|has|shows|does|doesn't|fits|for|due|not|nor|if|then|rather than|instead of|as opposed to|unlike|over|&|/|=|[a-z])(?:[^\w-]|\z)",
    )
});

/// Words that can follow the letter I but not the pronoun.
pub(super) static AFTER_I: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)\A(?:is|isn't|because|or|&|/|=)(?:\W|\z)"));

/// Every letter that names a choice, from left to right. A letter beyond the choices is included only if it is firmly
/// delimited.
pub(super) fn letters(text: &str, choices: usize, clauses: &Clauses<'_>) -> Vec<Name> {
    text.bytes()
        .enumerate()
        .filter(|(at, byte)| byte.is_ascii_alphabetic() && !has_neighbour(text.as_bytes(), *at))
        .filter_map(|(start, byte)| {
            let letter = char::from(byte);
            let delimiting = delimiting(text, start, letter, clauses)?;
            let choice = index_of_letter(letter).filter(|index| *index < choices);
            (choice.is_some() || delimiting == Delimiting::Firm).then_some(Name {
                start,
                end: start + 1,
                choice,
                delimiting,
                state: NameState::Affirmed,
            })
        })
        .collect()
}

/// True if an ASCII letter or digit is next to the letter.
fn has_neighbour(text: &[u8], at: usize) -> bool {
    [at.checked_sub(1), Some(at + 1)]
        .into_iter()
        .flatten()
        .filter_map(|next| text.get(next))
        .any(u8::is_ascii_alphanumeric)
}

/// Delimiting of the letter at byte `start`; `None` for a part of a word, an article or a pronoun.
fn delimiting(text: &str, start: usize, letter: char, clauses: &Clauses<'_>) -> Option<Delimiting> {
    let (left, right) = (&text[..start], &text[start + 1..]);
    let (before, after) = (left.chars().next_back(), right.chars().next());
    if continues_word(before) || continues_word(after) || before == Some('\'') || after == Some('\'') {
        return None;
    }
    if is_hyphenated(left, right) || is_abbreviated(left, right) {
        return None;
    }
    if matches!(before, Some('(' | '[')) && matches!(after, Some(')' | ']')) {
        return Some(Delimiting::Firm);
    }
    let is_leading = start == 0 || left == "(" || left == "[";
    let is_label = matches!(after, Some('.' | ')' | ':' | ']'));
    if letter.is_ascii_lowercase() {
        return (is_leading && is_label).then_some(Delimiting::Firm);
    }
    let words = right.trim_start_matches(' ');
    let ends = words.is_empty() || words.starts_with(['\n', '-', '–', '—']);
    let is_marked =
        after.is_some_and(|c| ".):,;!?]}、。，：；/&=".contains(c)) && !(letter == 'I' && after == Some(','));
    let is_bracketed = matches!(before, Some('(' | '['));
    let is_name = match letter {
        _ if is_called_letter(left) || after.is_some_and(is_unspaced) => true,
        'A' | 'I' | 'E' | 'O' | 'Y' | 'U' if joined_to_letter(clauses, start + 1) => true,
        'A' => AFTER_A.is_match(words),
        'I' => AFTER_I.is_match(words),
        // One-letter words of other languages: "E", "O", "Y", "U", "W", "Z".
        'E' | 'O' | 'Y' | 'U' | 'W' | 'Z' => !is_leading || AFTER_A.is_match(words),
        _ => true,
    };
    match (ends || is_marked || is_bracketed, is_name) {
        (false, false) => None,
        _ if is_leading => Some(Delimiting::Firm),
        (true, _) => Some(Delimiting::Plain),
        (false, true) => Some(Delimiting::Loose),
    }
}

/// True if another letter follows as an alternative: "A ou C", "A oder B".
fn joined_to_letter(clauses: &Clauses<'_>, end: usize) -> bool {
    let or = clauses.index(end);
    let other = clauses.elements.get(or + 1);
    clauses.elements.get(or).is_some_and(|element| element.has(Role::Or))
        && other.is_some_and(|other| other.slice(clauses.folded).len() == 1)
}

/// True if a letter is part of a hyphenated word: "T-shirt", "Plan-B".
pub(super) fn is_hyphenated(left: &str, right: &str) -> bool {
    let (mut before, mut after) = (left.chars().rev(), right.chars());
    [(before.next(), before.next()), (after.next(), after.next())]
        .into_iter()
        .any(|(dash, letter)| matches!(dash, Some('-' | '‐' | '‑' | RANGE)) && continues_word(letter))
}

/// True if the words before a letter mark it as a choice: "option A".
pub(super) fn is_called_letter(left: &str) -> bool {
    const WORDS: [&str; 8] = ["option", "choice", "letter", "opción", "opção", "opzione", "optie", "вариант"];
    let words = left.trim_end();
    let word = words.rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default();
    word.len() <= WORDS[7].len() && WORDS.contains(&word.to_lowercase().as_str())
}

/// True if a letter is part of an abbreviation: "U.S.", "e.g.", "N/A".
pub(super) fn is_abbreviated(left: &str, right: &str) -> bool {
    let mut before = left.chars().rev();
    let mut after = right.chars();
    let preceded = before.next() == Some('.') && continues_word(before.next()) && !continues_word(before.next());
    let followed = after.next() == Some('.') && continues_word(after.next()) && after.next() == Some('.');
    preceded || followed || left.ends_with("N/") || right.starts_with("/A")
}
