//! Ticks, crosses and task lists: [`ticked`], [`without_unknown`].

use std::borrow::Cow;
use std::sync::LazyLock;

use regex::Regex;

use crate::choice::text::clean::compiled;
use darkqa_base::types::questions::{Answer, UnreadReason};

/// A mark for yes or no.
static MARK: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?P<yes>[✓✔✅☑👍]|\[[xX]\])|(?P<no>[✗✘❌❎✖👎☐]|\[ \])"));

/// A mark that may mean either yes or no.
const UNKNOWN: char = '☒';

/// Meaning of a mark for the item next to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mark {
    Yes,
    No,
}

/// The choices that a text ticks and crosses.
#[derive(Debug, Default)]
pub(super) struct Ticks {
    ticked: Vec<usize>,
    crossed: Vec<usize>,
    /// True if the text contains more than [`MAX_MARKS`] marks.
    has_too_many: bool,
}

/// Maximum number of marks that are parsed. A reply with more repeats itself and is not evaluated.
const MAX_MARKS: usize = 100;

impl Ticks {
    /// The only choice that is ticked. Without ticks, `stated` if it is not crossed. Several ticks, or a tick and
    /// another stated answer, are ambiguous. `None` if no item with a mark names a choice.
    pub(super) fn answer(&self, stated: Option<Answer>) -> Option<Answer> {
        let stated = stated.filter(|answer| matches!(answer, Answer::Chosen(_)));
        let ambiguous = Some(Answer::Unparsed(UnreadReason::Ambiguous));
        match (self.ticked.first(), stated) {
            _ if self.has_too_many => ambiguous,
            (None, _) if self.crossed.is_empty() => None,
            (None, Some(Answer::Chosen(index))) if !self.crossed.contains(&index) => stated,
            (None, _) => Some(Answer::Unparsed(UnreadReason::Negated)),
            (Some(first), _) if self.ticked.iter().any(|other| other != first) => ambiguous,
            (Some(first), _) if self.crossed.contains(first) => ambiguous,
            (Some(first), Some(answer)) if answer != Answer::Chosen(*first) => ambiguous,
            (Some(first), _) => Some(Answer::Chosen(*first)),
        }
    }
}

/// Removes the lines with a mark of unknown meaning.
pub(super) fn without_unknown(tidy: &str) -> Cow<'_, str> {
    if !tidy.contains(UNKNOWN) {
        return Cow::Borrowed(tidy);
    }
    let lines: Vec<&str> = tidy.lines().filter(|line| !line.contains(UNKNOWN)).collect();
    Cow::Owned(lines.join("\n"))
}

/// The ticked and crossed choices of a text; `read` parses an item. `None` without marks.
///
/// A line with one mark is one item. In a line with several marks, the items follow the marks if the line begins with a
/// mark, otherwise they precede the marks.
pub(super) fn ticked(tidy: &str, read: impl Fn(&str) -> Answer) -> Option<Ticks> {
    if !MARK.is_match(tidy) {
        return None;
    }
    let mut ticks = Ticks::default();
    if MARK.find_iter(tidy).nth(MAX_MARKS).is_some() {
        ticks.has_too_many = true;
        return Some(ticks);
    }
    for line in tidy.lines() {
        for (mark, item) in items(line) {
            let Answer::Chosen(index) = read(item.trim_matches([' ', '|', ':', ',', '-', '\t'])) else {
                continue;
            };
            match mark {
                Mark::Yes => ticks.ticked.push(index),
                Mark::No => ticks.crossed.push(index),
            }
        }
    }
    Some(ticks)
}

/// The items of a line, each with its mark.
fn items(line: &str) -> Vec<(Mark, &str)> {
    let marks: Vec<(Mark, usize, usize)> = MARK
        .captures_iter(line)
        .filter_map(|found| {
            let whole = found.get(0)?;
            let mark = if found.name("yes").is_some() { Mark::Yes } else { Mark::No };
            Some((mark, whole.start(), whole.end()))
        })
        .collect();
    let leads = marks.first().is_some_and(|(_, start, _)| is_blank(&line[..*start]));
    if let [(mark, start, end)] = *marks {
        let item = if leads {
            &line[end..]
        } else if is_blank(&line[end..]) {
            &line[..start]
        } else {
            line
        };
        return vec![(mark, item)];
    }
    let mut items = Vec::with_capacity(marks.len());
    for (at, (mark, start, end)) in marks.iter().enumerate() {
        let item = if leads {
            &line[*end..marks.get(at + 1).map_or(line.len(), |(_, next, _)| *next)]
        } else {
            &line[at.checked_sub(1).map_or(0, |before| marks[before].2)..*start]
        };
        items.push((*mark, item));
    }
    items
}

/// True if a text contains only spaces, bullets and table rules.
fn is_blank(text: &str) -> bool {
    text.trim_matches([' ', '\t', '|', '-', '*', '+', '•']).is_empty()
}
