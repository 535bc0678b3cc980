//! Where a reply names a choice by its letter.

use std::sync::LazyLock;

use regex::Regex;

use super::clean::compiled;
use super::names::{Delimiting, Name, index_of, joins};

/// Words that follow the letter A, never the article.
pub(super) static AFTER_A: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\A(?:and|or|but|because|since|as|is|isn't|was|are|would|could|can|cannot|must|should|may|might|seems|appears|has|shows|does|doesn't|fits|for|due|not|nor|if|then|&|/|=|[a-z])(?:[^\w-]|\z)",
    )
});

/// Words that follow the letter I, never the pronoun.
pub(super) static AFTER_I: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)\A(?:is|isn't|because|or|&|/|=)(?:\W|\z)"));

/// Every letter that is named as one, from left to right; one beyond the choices only where it is held firmly.
pub(super) fn letters(text: &str, choices: usize) -> Vec<Name> {
    let candidates = text
        .bytes()
        .enumerate()
        .filter(|(_, byte)| byte.is_ascii_alphabetic());
    let named = candidates.filter_map(|(at, byte)| {
        let letter = char::from(byte);
        let grip = grip(text, at, letter)?;
        let choice = index_of(letter).filter(|index| *index < choices);
        (choice.is_some() || grip == Delimiting::Firm).then_some(Name {
            start: at,
            end: at + 1,
            choice,
            grip,
        })
    });
    named.collect()
}

/// How surely the letter at a byte is meant as a choice; `None` for a part of a word, an article, a pronoun.
fn grip(text: &str, at: usize, letter: char) -> Option<Delimiting> {
    let (left, right) = (&text[..at], &text[at + 1..]);
    let (before, after) = (left.chars().next_back(), right.chars().next());
    if joins(before) || joins(after) || before == Some('\'') || after == Some('\'') {
        return None;
    }
    if hyphenated(left, right) || abbreviated(left, right) {
        return None;
    }
    if matches!(before, Some('(' | '[')) && matches!(after, Some(')' | ']')) {
        return Some(Delimiting::Firm);
    }
    let leading = at == 0 || left == "(" || left == "[";
    let label = matches!(after, Some('.' | ')' | ':' | ']'));
    if letter.is_ascii_lowercase() {
        return (leading && label).then_some(Delimiting::Firm);
    }
    let words = right.trim_start_matches(' ');
    let ends = words.is_empty() || words.starts_with(['\n', '-', '–', '—']);
    let marked = after.is_some_and(|c| ".):,;!?]}、。，：；/&=".contains(c))
        && !(letter == 'I' && after == Some(','));
    let bracket = matches!(before, Some('(' | '['));
    let name = match letter {
        _ if called_letter(left) => true,
        'A' => AFTER_A.is_match(words),
        'I' => AFTER_I.is_match(words),
        // One-letter words of other languages: "E", "O", "Y", "U", "W", "Z".
        'E' | 'O' | 'Y' | 'U' | 'W' | 'Z' => !leading || AFTER_A.is_match(words),
        _ => true,
    };
    match (ends || marked || bracket, name) {
        (false, false) => None,
        _ if leading => Some(Delimiting::Firm),
        (true, _) => Some(Delimiting::Plain),
        (false, true) => Some(Delimiting::Loose),
    }
}

/// "T-shirt", "Plan-B".
pub(super) fn hyphenated(left: &str, right: &str) -> bool {
    let dash = |c: Option<char>| matches!(c, Some('-' | '‐' | '‑'));
    let (mut before, mut after) = (left.chars().rev(), right.chars());
    (dash(before.next()) && joins(before.next())) || (dash(after.next()) && joins(after.next()))
}

/// Whether the words before a letter say that it is one: "option A".
pub(super) fn called_letter(left: &str) -> bool {
    const WORDS: [&str; 8] = [
        "option",
        "choice",
        "letter",
        "opción",
        "opção",
        "opzione",
        "optie",
        "вариант",
    ];
    let words = left.trim_end();
    let word = words
        .rsplit(|c: char| !c.is_alphabetic())
        .next()
        .unwrap_or_default();
    word.len() <= WORDS[7].len() && WORDS.contains(&word.to_lowercase().as_str())
}

/// "U.S.", "e.g.": single letters, each with its period; "N/A".
fn abbreviated(left: &str, right: &str) -> bool {
    let mut before = left.chars().rev();
    let mut after = right.chars();
    let preceded = before.next() == Some('.') && joins(before.next()) && !joins(before.next());
    let followed = after.next() == Some('.') && joins(after.next()) && after.next() == Some('.');
    preceded || followed || left.ends_with("N/") || right.starts_with("/A")
}
