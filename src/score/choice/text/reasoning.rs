//! Separation of the thoughts in a reply from its answer: [`separate`], [`open_answer`]. All experiments use it.
//!
//! The marks of thoughts are recognized by their form: an opening mark at the start, text, a closing mark, and the
//! answer. The words of its name decide what a mark is only if one of the two is missing, or if HTML and tokens of a
//! chat template look alike.
//!
//! Sections of a reply under headings: [`last_section`] finds the answer after a section of thoughts.

use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::LazyLock;

use regex::Regex;
use serde::Deserialize;

use super::marks::{Form, Mark, MarkMeaning, MarkRole, MarkWords, marks};
use super::plain::{compiled, is_blank};
use darkqa_base::types::questions::UnreadReason;

/// Regular expressions for the begin and end of reasoning in one model family, a table of `reasoning.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReasoningMark {
    #[expect(dead_code, reason = "documents the table")]
    family: String,
    #[expect(dead_code, reason = "documents the table")]
    source: String,
    begin: String,
    end: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReasoningMarks {
    mark: Vec<ReasoningMark>,
    words: MarkWords,
}

static TABLE: LazyLock<ReasoningMarks> =
    LazyLock::new(|| toml::from_str(include_str!("../reasoning.toml")).unwrap_or_default());

/// Marks that end a reasoning block of a listed family.
static END: LazyLock<Regex> = LazyLock::new(|| any_of(|mark| &mark.end));

/// Marks that begin a reasoning block of a listed family.
static BEGIN: LazyLock<Regex> = LazyLock::new(|| any_of(|mark| &mark.begin));

/// The name of a reasoning channel alone on the first line. A server that drops special tokens leaves only this name.
static CHANNEL_NAME: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)\A\s*(?:think|thinking|thoughts?|reasoning|analysis|reflection)[ \t]*\r?\n"));

/// The name of a role after a token that begins a turn.
static ROLE_NAME: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?i)\A\s*(?:assistant|model|system)\b"));

/// The most words of an answer in a tag whose name is not known, with nothing after it; chosen: thoughts are longer.
const WRAPPED_WORDS: usize = 5;

/// The most blocks of thoughts with unknown names in a reply; chosen: it bounds the time.
const MAX_BLOCKS: usize = 100;

fn any_of(pattern: fn(&ReasoningMark) -> &String) -> Regex {
    let patterns: Vec<String> = TABLE.mark.iter().map(|mark| format!("(?:{})", pattern(mark))).collect();
    compiled(&format!("(?i){}", patterns.join("|")))
}

/// The words of the names of marks.
pub(super) fn words() -> &'static MarkWords {
    &TABLE.words
}

/// The kind of answer that a reply should hold, which decides about marks with unknown names.
#[derive(Clone, Copy)]
pub(crate) enum Asked<'a> {
    /// A choice. The function tells whether a text is a choice and nothing else.
    Choice(&'a dyn Fn(&str) -> bool),
    /// Any text.
    Open,
    /// A mark of a judge. The function tells whether a text has one.
    Mark(&'a dyn Fn(&str) -> bool),
}

impl Asked<'_> {
    /// True if a text is known to be an answer.
    fn is_answer(self, text: &str) -> bool {
        match self {
            Self::Choice(is_answer) | Self::Mark(is_answer) => is_answer(text.trim_matches(is_blank)),
            Self::Open => false,
        }
    }

    /// True if the only text of a reply, in a tag whose name says nothing, is an answer rather than thoughts.
    fn is_wrapped(self, inner: &str) -> bool {
        match self {
            Self::Choice(_) => self.is_answer(inner),
            Self::Open => inner.split_whitespace().take(WRAPPED_WORDS + 1).count() <= WRAPPED_WORDS,
            Self::Mark(_) => true,
        }
    }
}

/// The part of a reply that is not thoughts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Separated<'t> {
    /// The answer, without blanks and template tokens around it.
    pub(crate) text: &'t str,
    /// True if thoughts were removed.
    pub(crate) has_thoughts: bool,
    /// True if the text follows an opening mark of thoughts whose end is missing. It is an answer only if it is nothing
    /// else.
    pub(crate) is_open: bool,
}

/// Separates the thoughts at the start of a reply from its answer.
///
/// # Errors
/// The reason why no answer can be read, if the thoughts do not end or no text follows.
pub(crate) fn separate<'t>(reply: &'t str, asked: Asked<'_>) -> Result<Separated<'t>, UnreadReason> {
    let listed = without_listed(reply)?;
    let marked = Marked::new(listed, asked).separated()?;
    let text = without_tokens_around(marked.text);
    if text.is_empty() {
        return Err(UnreadReason::Empty);
    }
    Ok(Separated {
        text,
        has_thoughts: marked.has_thoughts || listed.len() < reply.trim_matches(is_blank).len(),
        is_open: marked.is_open,
    })
}

/// As [`separate`], also by the headings of sections, and by the name of a channel whose marks a server dropped.
///
/// # Errors
/// As for [`separate`].
pub(crate) fn separate_sections<'t>(reply: &'t str, asked: Asked<'_>) -> Result<Separated<'t>, UnreadReason> {
    let separated = separate(reply, asked)?;
    if separated.is_open {
        return Ok(separated);
    }
    if let Some(name) = CHANNEL_NAME.find(separated.text) {
        return Ok(Separated {
            text: separated.text[name.end()..].trim_matches(is_blank),
            has_thoughts: true,
            is_open: true,
        });
    }
    Ok(match last_section(separated.text, words(), &|text| asked.is_answer(text))? {
        Some(text) => Separated { text: without_tokens_around(text), has_thoughts: true, is_open: false },
        None => separated,
    })
}

/// The answer to an open question in a reply: without thoughts, template tokens and the tags of an answer. A reply
/// without any of these is returned as it is.
///
/// # Errors
/// The reason why there is no answer, if the thoughts do not end or no text follows.
pub fn open_answer(reply: &str) -> Result<Cow<'_, str>, UnreadReason> {
    if reply.trim_matches(is_blank).is_empty() {
        return Err(UnreadReason::Empty);
    }
    let separated = separate_sections(reply, Asked::Open)?;
    if separated.is_open {
        return Err(UnreadReason::Truncated);
    }
    let text = tagged_answer(separated.text).unwrap_or(separated.text);
    let whole = if text.len() == reply.trim_matches(is_blank).len() { reply } else { text };
    let tokens: Vec<Mark<'_>> = marks(whole, words())
        .into_iter()
        .filter(|mark| mark.form == Form::Special && mark.meaning != MarkMeaning::Other)
        .collect();
    if tokens.is_empty() {
        return Ok(Cow::Borrowed(whole));
    }
    let without = remove(whole, &tokens);
    match without.trim_matches(is_blank) {
        "" => Err(UnreadReason::Empty),
        text => Ok(Cow::Owned(text.to_owned())),
    }
}

/// True if a reply has thoughts before its answer, or nothing else.
#[must_use]
pub fn has_thoughts(reply: &str) -> bool {
    match separate_sections(reply, Asked::Open) {
        Ok(separated) => separated.has_thoughts,
        Err(reason) => reason == UnreadReason::Truncated,
    }
}

/// A text without template tokens, up to the first that ends a turn.
fn remove(text: &str, tokens: &[Mark<'_>]) -> String {
    let (mut without, mut from) = (String::new(), 0);
    for token in tokens {
        without.push_str(&text[from..token.start]);
        from = token.end;
        let ends_turn = token.meaning == MarkMeaning::Template && token.role == MarkRole::End;
        if ends_turn && !without.trim_matches(is_blank).is_empty() {
            return without;
        }
    }
    without + &text[from..]
}

/// The content of the tags of an answer at the end of a text: `<answer>brown</answer>`.
fn tagged_answer(text: &str) -> Option<&str> {
    let marks = marks(text, words());
    let end = marks.last().filter(|mark| mark.end == text.len())?;
    let begin = marks
        .iter()
        .rev()
        .find(|mark| mark.meaning == MarkMeaning::Answer && mark.role != MarkRole::End && end.ends(mark))?;
    let inner = text[begin.end..end.start].trim_matches(is_blank);
    (!inner.is_empty()).then_some(inner)
}

/// The text after the last reasoning block of a listed family, trimmed.
fn without_listed(reply: &str) -> Result<&str, UnreadReason> {
    let text = match END.find_iter(reply).last() {
        Some(mark) => &reply[mark.end()..],
        None => reply,
    };
    if BEGIN.is_match(text.trim_start_matches(is_blank)) {
        return Err(UnreadReason::Truncated);
    }
    match text.trim_matches(is_blank) {
        "" => Err(UnreadReason::Empty),
        text => Ok(text),
    }
}

/// A text with its marks.
struct Marked<'t, 'a> {
    text: &'t str,
    marks: Vec<Mark<'t>>,
    /// True if the text has closing tags.
    has_tags: bool,
    asked: Asked<'a>,
}

impl<'t, 'a> Marked<'t, 'a> {
    fn new(text: &'t str, asked: Asked<'a>) -> Self {
        Self { text, marks: marks(text, words()), has_tags: text.contains("</"), asked }
    }

    /// The text without the thoughts between marks.
    fn separated(&self) -> Result<Separated<'t>, UnreadReason> {
        let whole = Separated { text: self.text, has_thoughts: false, is_open: false };
        let is_choice = || matches!(self.asked, Asked::Choice(_)) && self.asked.is_answer(self.text);
        if self.marks.is_empty() || is_choice() {
            return Ok(whole);
        }
        let thoughts = self.end_of_thoughts();
        let from = thoughts.unwrap_or(0);
        if let Some(answer) = self.marked_answer(from)? {
            return Ok(answer);
        }
        if self.has_unended_thoughts(from) {
            return Err(UnreadReason::Truncated);
        }
        if thoughts.is_some() && self.is_void(from) {
            // The answer may stand before the thoughts.
            let before = self.marks.iter().find(|mark| mark.meaning == MarkMeaning::Thought);
            let before = before.filter(|mark| mark.role != MarkRole::End);
            let before = before.map_or("", |mark| without_tokens_around(&self.text[..mark.start]));
            return match before {
                "" => Err(UnreadReason::Empty),
                text => Ok(Separated { text, has_thoughts: true, ..whole }),
            };
        }
        self.without_unknown(from)
    }

    /// True if there is no text from a byte on: only blanks and tokens.
    fn is_void(&self, from: usize) -> bool {
        let mut at = from;
        for mark in self.after(from) {
            if !self.text[at..mark.start].chars().all(is_blank) || !is_around(mark, self.has_tags) {
                return false;
            }
            at = mark.end;
        }
        self.text[at..].chars().all(is_blank)
    }

    /// The marks from a byte on.
    fn after(&self, from: usize) -> &[Mark<'t>] {
        &self.marks[self.marks.partition_point(|mark| mark.start < from)..]
    }

    /// The end of the last mark that closes thoughts, by the words of its name.
    fn end_of_thoughts(&self) -> Option<usize> {
        let thoughts = || self.marks.iter().filter(|mark| mark.meaning == MarkMeaning::Thought);
        let closing = thoughts().rfind(|mark| mark.role == MarkRole::End);
        let singles: Vec<&Mark<'_>> =
            thoughts().filter(|mark| mark.form == Form::Special && mark.role == MarkRole::Single).collect();
        // The same token before and after the thoughts.
        let repeated = singles.last().filter(|_| closing.is_none() && singles.len().is_multiple_of(2));
        closing.or(repeated.copied()).map(|mark| mark.end)
    }

    /// True if a mark after a byte begins thoughts, by the words of its name. A bracket `[x]` without a closing one is
    /// a heading.
    fn has_unended_thoughts(&self, from: usize) -> bool {
        self.marks.iter().any(|mark| {
            mark.start >= from
                && mark.meaning == MarkMeaning::Thought
                && mark.role != MarkRole::End
                && (mark.form != Form::Bracket || mark.role == MarkRole::Begin)
        })
    }

    /// The text of an answer that a token or `[BEGIN …]` begins; `None` without such a mark, or if nothing stands
    /// before it.
    fn marked_answer(&self, from: usize) -> Result<Option<Separated<'t>>, UnreadReason> {
        let begin = self.marks.iter().rposition(|mark| {
            mark.start >= from
                && mark.meaning == MarkMeaning::Answer
                && mark.role != MarkRole::End
                && !mark.core.contains("box")
                && (mark.form == Form::Special || (mark.form == Form::Bracket && mark.role == MarkRole::Begin))
        });
        let Some(begin) = begin else {
            return Ok(None);
        };
        let mark = &self.marks[begin];
        let has_thoughts = !without_tokens_around(&self.text[..mark.start]).is_empty();
        if !has_thoughts {
            return Ok(None);
        }
        let after = &self.marks[begin + 1..];
        let end = after.iter().find(|mark| mark.meaning == MarkMeaning::Answer && mark.role == MarkRole::End);
        let end = end.map_or(self.text.len(), |mark| mark.start);
        match without_tokens_around(&self.text[mark.end..end]) {
            "" => Err(UnreadReason::Truncated),
            text => Ok(Some(Separated { text, has_thoughts, is_open: false })),
        }
    }

    /// The text after thoughts between marks whose names say nothing.
    fn without_unknown(&self, from: usize) -> Result<Separated<'t>, UnreadReason> {
        let (mut start, mut has_thoughts) = (from, from > 0);
        for _ in 0..MAX_BLOCKS {
            let Some(open) = self.opening(start) else {
                break;
            };
            let Some(close) = self.closing(open) else {
                if !self.must_end(open) {
                    break;
                }
                let text = &self.text[self.marks[open].end..];
                return Ok(Separated { text, has_thoughts: true, is_open: true });
            };
            let inner = &self.text[self.marks[open].end..self.marks[close].start];
            let rest = self.marks[close].end;
            if self.is_void(rest) {
                if !self.asked.is_wrapped(inner) {
                    return Err(UnreadReason::Empty);
                }
                break;
            }
            if self.asked.is_answer(inner) && !self.asked.is_answer(&self.text[rest..]) {
                // An answer in a tag, with its explanation.
                break;
            }
            (start, has_thoughts) = (rest, true);
        }
        if let Some(end) = self.orphan_end(start) {
            (start, has_thoughts) = (end, true);
        }
        Ok(Separated { text: &self.text[start..], has_thoughts, is_open: false })
    }

    /// The index of the mark of unknown meaning with which the text from a byte on begins, after template tokens.
    fn opening(&self, from: usize) -> Option<usize> {
        let mut at = from;
        let first = self.marks.partition_point(|mark| mark.start < from);
        for (index, mark) in self.marks.iter().enumerate().skip(first) {
            if !self.text[at..mark.start].chars().all(is_blank) {
                return None;
            }
            match mark.meaning {
                MarkMeaning::Template if mark.form == Form::Special => {
                    at = mark.end;
                    if let Some(role) = ROLE_NAME.find(&self.text[at..]) {
                        at += role.end();
                    }
                }
                MarkMeaning::Other if mark.role != MarkRole::End && !self.asked.is_answer(mark.name) => {
                    return Some(index);
                }
                _ => return None,
            }
        }
        None
    }

    /// The index of the mark that closes what the mark at an index opens.
    fn closing(&self, open: usize) -> Option<usize> {
        let begin = &self.marks[open];
        let later = || self.marks.iter().enumerate().skip(open + 1);
        let named = later().find(|(_, mark)| mark.ends(begin));
        let of_form = || {
            later().find(|(_, mark)| {
                let is_open_name = matches!(mark.meaning, MarkMeaning::Other | MarkMeaning::Thought);
                let is_pair = match begin.role {
                    MarkRole::Begin => mark.role == MarkRole::End,
                    _ => mark.role != MarkRole::Begin,
                };
                mark.form == Form::Special && is_open_name && is_pair
            })
        };
        named.or_else(|| (begin.form == Form::Special).then(of_form).flatten()).map(|(index, _)| index)
    }

    /// True if thoughts without a closing mark cannot be an answer: after a tag, a reserved token, or a token that
    /// begins something. Text must follow.
    fn must_end(&self, open: usize) -> bool {
        let mark = &self.marks[open];
        let begins = match mark.form {
            Form::Tag => true,
            Form::Special => mark.role == MarkRole::Begin || mark.is_numbered,
            Form::Bracket => mark.role == MarkRole::Begin,
        };
        begins && !matches!(self.asked, Asked::Mark(_)) && !self.is_void(mark.end)
    }

    /// The end of the last closing mark of unknown meaning that has no opening one, if text stands before and after it.
    fn orphan_end(&self, from: usize) -> Option<usize> {
        let mut opened = HashSet::new();
        let mut last = None;
        for mark in self.after(from) {
            let is_end = match mark.role {
                MarkRole::End => !opened.contains(&*mark.core),
                _ => mark.is_numbered && mark.form == Form::Special,
            };
            if mark.meaning == MarkMeaning::Other && is_end {
                last = Some(mark);
            }
            opened.insert(&*mark.core);
        }
        let mark = last?;
        let before = &self.text[from..mark.start];
        let has_text = !without_tokens_around(before).is_empty() && !self.is_void(mark.end);
        let is_remark = self.asked.is_answer(before) && !self.asked.is_answer(&self.text[mark.end..]);
        (has_text && !is_remark).then_some(mark.end)
    }
}

/// A text without blanks, template tokens and names of roles at its ends. The tokens of an answer are removed if they
/// enclose all of it.
fn without_tokens_around(text: &str) -> &str {
    let marks = marks(text, words());
    let has_tags = text.contains("</");
    let (mut start, mut end) = (0, text.len());
    let (mut first, mut last) = (0, marks.len());
    loop {
        let rest = text[start..end].trim_start_matches(is_blank);
        let inner = rest.trim_end_matches(is_blank);
        start = end - rest.len();
        end = start + inner.len();
        let front = marks[first..last].first().filter(|mark| mark.start == start);
        let back = marks[first..last].last().filter(|mark| mark.end == end);
        let is_answer = |mark: &&Mark<'_>| mark.meaning == MarkMeaning::Answer;
        let has_end = || marks[first..last].iter().any(|mark| is_answer(&mark) && mark.role == MarkRole::End);
        if let Some(mark) = front.filter(|mark| is_around(mark, has_tags) && !is_answer(mark)) {
            start = mark.end;
            if let Some(role) = ROLE_NAME.find(&text[start..end]) {
                start += role.end();
            }
            first += 1;
        } else if let Some(mark) = back.filter(|mark| is_around(mark, has_tags) && !is_answer(mark)) {
            end = mark.start;
            last -= 1;
        } else if let Some(mark) =
            front.filter(|mark| mark.is_token() && (back.is_some_and(Mark::is_token) || !has_end()))
        {
            start = mark.end;
            first += 1;
        } else if let Some(mark) =
            back.filter(|mark| mark.is_token() && mark.role == MarkRole::End && !begins_answer(&marks[first..last]))
        {
            end = mark.start;
            last -= 1;
        } else {
            return inner;
        }
    }
}

/// True if a mark begins an answer.
fn begins_answer(marks: &[Mark<'_>]) -> bool {
    marks.iter().any(|mark| mark.meaning == MarkMeaning::Answer && mark.role != MarkRole::End)
}

/// True for a mark at an end of a text that belongs to a template: a token, or a tag such as `<zork_plugh>` in a text
/// without closing tags.
fn is_around(mark: &Mark<'_>, has_tags: bool) -> bool {
    let is_lone_tag = mark.form == Form::Tag && !has_tags && mark.name.contains('_');
    mark.is_token() || is_lone_tag
}

/// A line that is a heading: `### Title`, `**Title:** text`, `[TITLE]`. The text after the colon of a heading belongs
/// to its section.
static HEADING: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?m)^[ \t]*(?:#{1,6}[ \t]+(?P<hash>[^\n:：]{1,60}?)[ \t#]*(?:[:：]|$)",
        r"|\*\*(?P<bold>[^*\n:：]{1,40})(?:[:：][ \t]*\*\*|\*\*[ \t]*[:：]|\*\*[ \t]*$)",
        r"|\[(?P<bracket>[\p{L} _-]{3,40})\][ \t]*$)"
    ))
});

/// A heading with the place of its section.
struct ReasoningHeading {
    start: usize,
    content: usize,
    meaning: MarkMeaning,
    /// True for `**Title**`, which may also be an emphasized answer.
    is_bold: bool,
}

/// The section with the answer, in a text that begins with another section; `None` if the whole text may be the answer.
///
/// The last section under the heading of an answer counts. Without such a heading, the last section counts if it is an
/// answer and nothing else, and no other section is; otherwise the text after a section of thoughts.
///
/// # Errors
/// If nothing follows the heading of the answer.
fn last_section<'t>(
    text: &'t str,
    words: &MarkWords,
    is_answer: &dyn Fn(&str) -> bool,
) -> Result<Option<&'t str>, UnreadReason> {
    let headings = headings(text, words);
    let [first, .., _] = &headings[..] else {
        return Ok(None);
    };
    let is_thought = first.meaning == MarkMeaning::Thought;
    if first.start > 0 || first.meaning == MarkMeaning::Answer || (first.is_bold && !is_thought) {
        return Ok(None);
    }
    let section = |index: usize| {
        let end = headings.get(index + 1).map_or(text.len(), |next| next.start);
        text[headings[index].content..end].trim_matches(is_blank)
    };
    let titled = headings.iter().rposition(|heading| heading.meaning == MarkMeaning::Answer);
    if let Some(titled) = titled {
        return match section(titled) {
            "" => Err(UnreadReason::Truncated),
            answer => Ok(Some(answer)),
        };
    }
    let others = headings.len() - 1;
    if is_answer(section(others)) && !(0..others).any(|index| is_answer(section(index))) {
        return Ok(Some(section(others)));
    }
    Ok(is_thought.then(|| text[headings[1].start..].trim_matches(is_blank)))
}

fn headings(text: &str, words: &MarkWords) -> Vec<ReasoningHeading> {
    // Every heading has one of these.
    if !text.contains(['#', '*', '[']) {
        return Vec::new();
    }
    HEADING
        .captures_iter(text)
        .filter_map(|found| {
            let whole = found.get(0)?;
            let bold = found.name("bold");
            let title = found.name("hash").or(bold).or(found.name("bracket"))?;
            let meaning = words.title_meaning(title.as_str());
            let is_bold = bold.is_some();
            let heading = ReasoningHeading { start: whole.start(), content: whole.end(), meaning, is_bold };
            (!is_bold || meaning != MarkMeaning::Other).then_some(heading)
        })
        .collect()
}
