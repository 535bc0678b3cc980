//! The word "no" as an answer or as a determiner ("no light reaches the sensor"): [`is_answer`].

use crate::choice::text::words::{Role, phrase_at};
use crate::choice::text::{Token, TokenKind, tokens};

/// Number of bytes that are examined after the start of "no".
const LOOK_AHEAD: usize = 64;

/// True if the "no" at `start..end` can be an answer: it is followed by the end, a line break, a punctuation mark or,
/// at the beginning of a clause, another clause ("No there is none"); and it is not part of an idiom ("no doubt").
pub(crate) fn is_answer(folded: &str, start: usize, end: usize) -> bool {
    let to = folded.floor_char_boundary(end + LOOK_AHEAD);
    let around = &folded[start..to];
    let words = tokens(around);
    let Some(next) = words.get(1) else {
        return true;
    };
    if phrase_at(around, &words).is_some_and(|(_, roles)| roles.has(Role::NoIdiom)) {
        return false;
    }
    if next.kind != TokenKind::Word {
        return next.kind == TokenKind::Break || ends_word(around, next);
    }
    let before = folded[..start].trim_end_matches(' ');
    let leads = before.is_empty() || before.ends_with(['.', ',', ';', ':', '!', '\n', '-', '–', '—', '(']);
    let leads_after_another =
        !before.is_empty() && (leads || [" and", " but", " a", " the"].iter().any(|word| before.ends_with(word)));
    phrase_at(around, std::slice::from_ref(next)).is_some_and(|(_, roles)| {
        (leads && roles.has(Role::ClauseStart)) || (leads_after_another && roles.has(Role::Preposition))
    })
}

/// True if a sign ends the word before it.
fn ends_word(text: &str, sign: &Token) -> bool {
    sign.is_sign(text, &['.', ',', ';', ':', '!', '?', ')', ']', '(', '-', '–', '—', '。', '→', '='])
}
