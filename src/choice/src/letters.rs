//! Letters in a reply that name a choice.

use std::sync::LazyLock;

use regex::Regex;

use super::names::{Delimiting, Name, NameState, continues_word, index_of, unspaced};
use super::text::clean::compiled;
use super::text::words::Role;
use super::text::{Clauses, RANGE};

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
        .filter(|(at, byte)| byte.is_ascii_alphabetic() && !is_inside(text.as_bytes(), *at))
        .filter_map(|(start, byte)| {
            let letter = char::from(byte);
            let delimiting = delimiting(text, start, letter, clauses)?;
            let choice = index_of(letter).filter(|index| *index < choices);
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

/// Whether a letter has another one beside it.
fn is_inside(text: &[u8], at: usize) -> bool {
    let is_letter = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_alphanumeric);
    is_letter(text.get(at + 1)) || (at > 0 && is_letter(text.get(at - 1)))
}

/// How clearly the letter at byte `start` is delimited as a choice; `None` for a part of a word, an article or a pronoun.
fn delimiting(text: &str, start: usize, letter: char, clauses: &Clauses<'_>) -> Option<Delimiting> {
    let (left, right) = (&text[..start], &text[start + 1..]);
    let (before, after) = (left.chars().next_back(), right.chars().next());
    if continues_word(before)
        || continues_word(after)
        || before == Some('\'')
        || after == Some('\'')
    {
        return None;
    }
    if hyphenated(left, right) || abbreviated(left, right) {
        return None;
    }
    if matches!(before, Some('(' | '[')) && matches!(after, Some(')' | ']')) {
        return Some(Delimiting::Firm);
    }
    let leading = start == 0 || left == "(" || left == "[";
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
        _ if called_letter(left) || after.is_some_and(unspaced) => true,
        'A' | 'I' | 'E' | 'O' | 'Y' | 'U' if joined_to_letter(clauses, start + 1) => true,
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

/// Whether an alternative letter follows a byte: "A ou C", "A oder B".
fn joined_to_letter(clauses: &Clauses<'_>, end: usize) -> bool {
    let or = clauses.index(end);
    let other = clauses.elements.get(or + 1);
    clauses
        .elements
        .get(or)
        .is_some_and(|element| element.has(Role::Or))
        && other.is_some_and(|other| other.slice(clauses.folded).len() == 1)
}

/// Whether a letter is part of a hyphenated word: "T-shirt", "Plan-B".
pub(super) fn hyphenated(left: &str, right: &str) -> bool {
    let dash = |c: Option<char>| matches!(c, Some('-' | '‐' | '‑' | RANGE));
    let (mut before, mut after) = (left.chars().rev(), right.chars());
    (dash(before.next()) && continues_word(before.next()))
        || (dash(after.next()) && continues_word(after.next()))
}

/// True if the words before a letter mark it as a choice: "option A".
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

/// Whether a letter is part of an abbreviation: "U.S.", "e.g.", "N/A".
pub(super) fn abbreviated(left: &str, right: &str) -> bool {
    let mut before = left.chars().rev();
    let mut after = right.chars();
    let preceded = before.next() == Some('.')
        && continues_word(before.next())
        && !continues_word(before.next());
    let followed =
        after.next() == Some('.') && continues_word(after.next()) && after.next() == Some('.');
    preceded || followed || left.ends_with("N/") || right.starts_with("/A")
}
