//! The names of choices in a text: where a letter or a text stands, and whether it is denied.

use std::sync::LazyLock;

use regex::Regex;

use super::clean::compiled;

/// How surely a name is meant as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Delimiting {
    /// A letter among words: enough to doubt another, too little to be an answer.
    Loose,
    /// A letter before punctuation or a line's end, or a choice's text.
    Plain,
    /// A letter in brackets, or first in the reply.
    Firm,
}

/// One place where a choice is named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Name {
    /// Its first byte; for a letter, that of the letter itself.
    pub(super) start: usize,
    /// The byte after its last.
    pub(super) end: usize,
    /// Which choice; `None` for a letter beyond them.
    pub(super) choice: Option<usize>,
    /// How surely.
    pub(super) grip: Delimiting,
}

/// The index that a Latin letter stands for.
pub(super) fn index_of(letter: char) -> Option<usize> {
    letter
        .is_ascii_alphabetic()
        .then(|| usize::from(letter.to_ascii_uppercase() as u8 - b'A'))
}

/// Whether a character beside a letter makes it part of a longer word. Scripts without letter case never do: their
/// texts stand beside a Latin letter without a space.
pub(super) fn joins(c: Option<char>) -> bool {
    c.is_some_and(|c| c.is_numeric() || c == '_' || c.is_lowercase() || c.is_uppercase())
}

/// Whether two neighbours are of one word. Scripts that write no spaces have no words to speak of.
pub(super) fn one_word(left: Option<char>, right: Option<char>) -> bool {
    let spaced = |c: char| (c.is_alphanumeric() || c == '_') && !unspaced(c);
    left.is_some_and(spaced) && right.is_some_and(spaced)
}

/// Thai to Khmer, kana, Han, Hangul (whose particles are joined to the word).
fn unspaced(c: char) -> bool {
    matches!(c, '\u{e00}'..='\u{eff}' | '\u{1000}'..='\u{109f}' | '\u{1100}'..='\u{11ff}' | '\u{1780}'..='\u{17ff}'
        | '\u{2e80}'..='\u{9fff}' | '\u{ac00}'..='\u{d7ff}' | '\u{f900}'..='\u{faff}' | '\u{20000}'..='\u{3ffff}')
}

/// Whether the span is a number that goes on outside it: 2 in 12, 2.5, 1,200, 1/2 or -2.
pub(super) fn cut_number(text: &str, start: usize, end: usize) -> bool {
    let digit = |c: Option<char>| c.is_some_and(char::is_numeric);
    let mut before = text[..start].chars().rev();
    let mut after = text[end..].chars();
    let (b1, b2) = (before.next(), before.next());
    let (a1, a2) = (after.next(), after.next());
    let first = digit(text[start..end].chars().next());
    let last = digit(text[start..end].chars().next_back());
    let mark = |c: Option<char>| matches!(c, Some('.' | ',' | '/' | ':' | '\u{2044}'));
    let sign = matches!(b1, Some('-' | '−' | '.')) && b2.is_none_or(char::is_whitespace);
    let worded = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() && !unspaced(c));
    (first && (worded(b1) || sign || (mark(b1) && digit(b2))))
        || (last && (worded(a1) || a1 == Some('%') || (mark(a1) && digit(a2))))
}

/// Where a clause begins anew, so that a "not" before it no longer reaches.
static CLAUSE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"[.;:!?\n,()。,、;—–]|\b(?:but|so|because|since|therefore|thus|hence|although|though|however|sondern",
        r"|aber|mais|donc|sino|pero|ma|mas|maar|но|ale|ama)\b|而是|但是?|所以|因此"
    ))
});

/// Words that deny or doubt what follows them in their clause.
static DENIAL: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\b(?:not|no|never|neither|nor|cannot|without|isnt|dont|whether|unable|unclear|unsure|impossible|hard to|too dark",
        r"|rather than|instead of|other than|unlike|except|nicht|kein|keine|keinen|weder|pas|ni|sans|non|não|nem|niet",
        r"|geen|не|нет|ни|nie|inte|ikke|değil|لا|ليس|ليست|नहीं)\b|n't\b|n'est|\bno es\b",
        r"|不是|不太|并非|並非|不会|不可能|没有|沒有|无法|無法|不像|非"
    ))
});

/// Words that look like a denial and are none.
static NO_DENIAL: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"\b(?:no doubt|without (?:a |any )?doubt|no question|not only|nothing but|none other than|not just)\b|非常",
    )
});

/// Words after a name that deny it.
static DENIAL_AFTER: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"\A[)\].\s]*(?:not\s*(?:\z|[.,;!\n])|(?:is|was|are|does|do|did|would|could|can|should|will|must|seems?|looks?)\s*(?:not\b|n't\b)",
        r"|(?:isn't|wasn't|doesn't|can't|cannot|won't|wouldn't|couldn't)\b",
        r"|(?:is|are|was|seems|looks|would be|can be|must be)\s+(?:clearly |obviously |definitely |probably |likely )?",
        r"(?:incorrect|wrong|false|unlikely|impossible|ruled out|excluded|eliminated|out\b|not\b|absent|missing)",
        r"|ist (?:nicht|falsch|kein)|n'est pas|no es\b|non è\b|não é\b|не\b|is niet\b",
        r"|不是|不对|不對|不正确|不正確|错|錯|排除|ではな|じゃな|ではあり|가 아니|이 아니|는 아니|은 아니|가 아닌|이 아닌|değil)"
    ))
});

/// How far around a name a denial is looked for, in bytes.
const REACH: usize = 96;

/// Whether the words around a span deny it.
pub(super) fn denied(folded: &str, start: usize, end: usize) -> bool {
    let from = folded.ceil_char_boundary(start.saturating_sub(REACH));
    let to = folded.floor_char_boundary(end.saturating_add(REACH));
    let before = folded[from..start].trim_end_matches(['(', '[', ' ']);
    let clause = CLAUSE.find_iter(before).last().map_or(0, |m| m.end());
    let clause = NO_DENIAL.replace_all(&before[clause..], " ");
    DENIAL.is_match(&clause) || DENIAL_AFTER.is_match(&folded[end..to])
}
