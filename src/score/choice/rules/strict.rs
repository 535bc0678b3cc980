//! The strict parsing: a choice's text, its letter, or its letter with its text.

use crate::choice::names::index_of_letter;
use darkqa_base::types::questions::{Answer, UnreadReason};

/// Parses a reply that is exactly one of the strict forms; `None` for any other reply.
///
/// The forms, in upper or lower case, are: a choice's text with or without a final period; `B`, `(B)`, `[B]`, `B.`,
/// `B)`, `B:`, `（B）`, `B．`, `B：`, `B、`; and such a letter, or `B -`, before the text of the same choice.
pub(crate) fn read(text: &str, choices: &[String]) -> Option<Answer> {
    let by_text = position(text, choices);
    let by_letter = label(text).and_then(|(letter, rest)| {
        let index = index_of_letter(letter).filter(|index| *index < choices.len());
        let named = position(rest, choices);
        match (index, named) {
            _ if !rest.is_empty() && named.is_none() => None,
            (None, _) => Some(Answer::Unparsed(UnreadReason::OutOfRange)),
            (Some(index), Some(named)) if index != named => Some(Answer::Unparsed(UnreadReason::Contradiction)),
            (Some(index), _) => Some(Answer::Chosen(index)),
        }
    });
    match (by_text, by_letter) {
        // A reply can be one choice's text and another's letter only if the choices are themselves letters.
        (Some(text), Some(Answer::Chosen(letter))) if text != letter => Some(Answer::Unparsed(UnreadReason::Ambiguous)),
        (Some(text), _) => Some(Answer::Chosen(text)),
        (None, by_letter) => by_letter,
    }
}

/// Index of the choice with this text, ignoring letter case and a final period.
fn position(text: &str, choices: &[String]) -> Option<usize> {
    fn bare(text: &str) -> &str {
        text.strip_suffix('.').unwrap_or(text)
    }
    let text = text.trim();
    if text.is_empty() {
        return None;
    }
    let folded = text.to_lowercase();
    let choices: Vec<String> = choices.iter().map(|choice| choice.trim().to_lowercase()).collect();
    let exact = choices.iter().position(|choice| *choice == folded);
    exact.or_else(|| choices.iter().position(|choice| bare(choice) == bare(&folded)))
}

/// The letter that a reply begins with as a label, and the text after it, which may be empty.
fn label(text: &str) -> Option<(char, &str)> {
    let text = text.trim();
    let mut chars = text.chars();
    let first = chars.next()?;
    let close: Option<&[char]> = match first {
        '(' | '（' => Some(&[')', '）']),
        '[' => Some(&[']']),
        _ => None,
    };
    let letter = if close.is_some() { chars.next()? } else { first };
    if !letter.is_ascii_alphabetic() {
        return None;
    }
    let rest = chars.as_str();
    if let Some(close) = close {
        return Some((letter, rest.strip_prefix(close)?.trim_start()));
    }
    if rest.is_empty() {
        return Some((letter, rest));
    }
    if let Some(rest) = rest.strip_prefix(['.', ')', ':', '．', '：', '、']) {
        return Some((letter, rest.trim_start()));
    }
    let after = rest.trim_start();
    if let Some(named) = after.strip_prefix(['-', '–', '—']) {
        return Some((letter, named.trim_start())).filter(|(_, named)| !named.is_empty());
    }
    // "A kitchen" is a kitchen, "A" on a line of its own is a letter.
    let gap = &rest[..rest.len() - after.len()];
    let word = matches!(letter.to_ascii_uppercase(), 'A' | 'I');
    (gap.contains('\n') || (!gap.is_empty() && !word)).then_some((letter, after))
}
