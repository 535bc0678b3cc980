//! [`Name`]: a mention of a choice in a text, by its letter or its text, with its state.

/// How clearly a name is delimited from the text around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Delimiting {
    /// A letter among words: enough to make another choice ambiguous, but not enough for an answer.
    Loose,
    /// A letter before punctuation or at the end of a line, or a choice's text.
    Plain,
    /// A letter in brackets, or at the beginning of the reply.
    Firm,
}

/// How a text refers to a choice that it names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum NameState {
    /// The choice is named without reservation.
    #[default]
    Affirmed,
    /// Denied; still a rival that makes another choice ambiguous ("not A but C").
    Denied,
    /// Ruled out, so that the answer is among the other choices ("I rule out A").
    Excluded,
    /// A color that describes the image, not an object.
    ImageColor,
    /// Named in a condition, or in a description of expectations.
    Conditional,
    /// Named in a question.
    Questioned,
    /// Named in a list of all choices.
    Repeated,
}

impl NameState {
    /// True for an affirmed name, and for a denied one, which is a rival of other names.
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
    /// True if the choice is named without reservation.
    pub(super) fn is_affirmed(&self) -> bool {
        self.state == NameState::Affirmed
    }
}

/// Index of the choice with a Latin letter: 0 for A.
pub(super) fn index_of_letter(letter: char) -> Option<usize> {
    letter.is_ascii_alphabetic().then(|| usize::from(letter.to_ascii_uppercase() as u8 - b'A'))
}

/// True if a character next to a letter makes it part of a longer word. Characters of scripts without letter case do
/// not, because these scripts have no space next to a Latin letter.
pub(super) fn continues_word(c: Option<char>) -> bool {
    c.is_some_and(|c| c.is_numeric() || c == '_' || c.is_lowercase() || c.is_uppercase())
}

/// True if two neighbouring characters belong to the same word; false for scripts without spaces between words.
pub(super) fn is_same_word(left: Option<char>, right: Option<char>) -> bool {
    [left, right].iter().all(|c| c.is_some_and(|c| (c.is_alphanumeric() || c == '_') && !is_unspaced(c)))
}

/// True if a character belongs to a script without spaces between words: Thai to Khmer, kana, Han, and Hangul, whose
/// particles are joined to the word.
pub(super) fn is_unspaced(c: char) -> bool {
    matches!(c, '\u{e00}'..='\u{eff}' | '\u{1000}'..='\u{109f}' | '\u{1100}'..='\u{11ff}' | '\u{1780}'..='\u{17ff}'
        | '\u{2e80}'..='\u{9fff}' | '\u{ac00}'..='\u{d7ff}' | '\u{f900}'..='\u{faff}' | '\u{20000}'..='\u{3ffff}')
}

/// True if the span is part of a longer number: 2 in 12, 2.5, 1,200, 1/2 or -2.
pub(super) fn is_part_of_number(text: &str, start: usize, end: usize) -> bool {
    let mut before = text[..start].chars().rev();
    let mut after = text[end..].chars();
    let (b1, b2) = (before.next(), before.next());
    let (a1, a2) = (after.next(), after.next());
    let begins_with_digit = is_digit(text[start..end].chars().next());
    let ends_with_digit = is_digit(text[start..end].chars().next_back());
    let sign = matches!(b1, Some('-' | '−' | '.')) && b2.is_none_or(char::is_whitespace);
    (begins_with_digit && (sign || continues_number(b1, b2)))
        || (ends_with_digit && (a1 == Some('%') || continues_number(a1, a2)))
}

/// True if the next characters continue a number: a letter or digit, or a separator before a digit.
fn continues_number(next: Option<char>, second: Option<char>) -> bool {
    next.is_some_and(|c| c.is_alphanumeric() && !is_unspaced(c))
        || (matches!(next, Some('.' | ',' | '/' | ':' | '\u{2044}')) && is_digit(second))
}

fn is_digit(c: Option<char>) -> bool {
    c.is_some_and(char::is_numeric)
}
