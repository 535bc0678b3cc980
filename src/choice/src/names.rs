//! Names of choices in a text: the position of a letter or a choice's text, and its state.

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

/// Attitude of a text to a choice that it names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum NameState {
    /// The choice is said to be there.
    #[default]
    Affirmed,
    /// It is denied, and makes another choice ambiguous ("not A but C").
    Denied,
    /// Ruled out, so that the answer is among the other choices ("I rule out A").
    Excluded,
    /// It is a color of the image.
    OfImage,
    /// Named in a condition, or in a description of expectations.
    Conditional,
    /// It stands in a question.
    Questioned,
    /// It stands in a list of all choices.
    Repeated,
}

impl NameState {
    /// Whether the name counts: it is said, or stands in the way of another one.
    pub(super) fn counts(self) -> bool {
        self <= Self::Denied
    }
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
    pub(super) state: NameState,
}

impl Name {
    /// Whether the choice is said to be there.
    pub(super) fn is_affirmed(&self) -> bool {
        self.state == NameState::Affirmed
    }
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
pub(super) fn unspaced(c: char) -> bool {
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
