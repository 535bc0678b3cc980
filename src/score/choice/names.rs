//! Names of choices in a text: the position of a letter or a choice's text, and whether it is denied.

use std::sync::LazyLock;

use regex::Regex;

use super::clean::compiled;

/// How clearly a name is delimited from the text around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Delimiting {
    /// A letter among words: enough to make another choice ambiguous, but not enough for an answer.
    Loose,
    /// A letter before punctuation or a line's end, or a choice's text.
    Plain,
    /// A letter in brackets, or at the beginning of the reply.
    Firm,
}

/// One name of a choice in a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Name {
    /// First byte of the name; for a letter in brackets, that of the letter.
    pub(super) start: usize,
    /// The byte after its last byte.
    pub(super) end: usize,
    /// Index of the choice; `None` for a letter beyond the choices.
    pub(super) choice: Option<usize>,
    pub(super) delimiting: Delimiting,
}

/// Index of the choice with a Latin letter: 0 for A.
pub(super) fn index_of(letter: char) -> Option<usize> {
    letter
        .is_ascii_alphabetic()
        .then(|| usize::from(letter.to_ascii_uppercase() as u8 - b'A'))
}

/// Whether a character next to a letter makes it part of a longer word. Characters of scripts without letter case do not,
/// because these scripts write no space next to a Latin letter.
pub(super) fn continues_word(c: Option<char>) -> bool {
    c.is_some_and(|c| c.is_numeric() || c == '_' || c.is_lowercase() || c.is_uppercase())
}

/// Whether two neighbouring characters belong to the same word; false for scripts that write no spaces.
pub(super) fn same_word(left: Option<char>, right: Option<char>) -> bool {
    let spaced = |c: char| (c.is_alphanumeric() || c == '_') && !unspaced(c);
    left.is_some_and(spaced) && right.is_some_and(spaced)
}

/// Whether a character belongs to a script without spaces: Thai to Khmer, kana, Han, and Hangul, whose particles are joined
/// to the word.
fn unspaced(c: char) -> bool {
    matches!(c, '\u{e00}'..='\u{eff}' | '\u{1000}'..='\u{109f}' | '\u{1100}'..='\u{11ff}' | '\u{1780}'..='\u{17ff}'
        | '\u{2e80}'..='\u{9fff}' | '\u{ac00}'..='\u{d7ff}' | '\u{f900}'..='\u{faff}' | '\u{20000}'..='\u{3ffff}')
}

/// Whether the span is part of a longer number: 2 in 12, 2.5, 1,200, 1/2 or -2.
pub(super) fn part_of_number(text: &str, start: usize, end: usize) -> bool {
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

/// The beginning of a clause. A "not" before it does not deny names after it.
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

/// Words that look like a denial but are not one.
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

/// Maximum distance of a denial from a name, in bytes.
const MAX_DISTANCE: usize = 96;

/// Whether the words around a span deny it.
pub(super) fn denied(folded: &str, start: usize, end: usize) -> bool {
    let from = folded.ceil_char_boundary(start.saturating_sub(MAX_DISTANCE));
    let to = folded.floor_char_boundary(end.saturating_add(MAX_DISTANCE));
    let before = folded[from..start].trim_end_matches(['(', '[', ' ']);
    let clause = CLAUSE.find_iter(before).last().map_or(0, |m| m.end());
    let clause = NO_DENIAL.replace_all(&before[clause..], " ");
    DENIAL.is_match(&clause) || DENIAL_AFTER.is_match(&folded[end..to])
}
