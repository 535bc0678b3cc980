//! [`repetitions`]: lists of all choices in a text, which only repeat the prompt.

use std::ops::Range;

use crate::choice::choice_views::ChoiceViews;
use crate::choice::name_index::Names;
use crate::choice::names::Name;
use crate::choice::text::Ranges;

/// Maximum number of bytes between two choices of a list.
const MAX_GAP: usize = 24;

/// Ranges that list all choices in the order shown, by text or letter, with only labels and separators between them. A
/// question with two choices needs more evidence of a list ([`is_list_of_two`]).
pub(crate) fn repetitions(names: &Names<'_>, offered: &ChoiceViews) -> Ranges {
    let count = offered.texts.len();
    let by_text = lists(names, &names.texts, count, offered);
    let by_letter = lists(names, &names.letters, count, offered);
    Ranges::new(by_text.into_iter().chain(by_letter).collect())
}

/// The lists among names of one kind.
fn lists(names: &Names<'_>, all: &[Name], count: usize, offered: &ChoiceViews) -> Vec<(usize, usize)> {
    let mut lists = Vec::new();
    // Index of the first name of the current list, and number of its names so far.
    let (mut first, mut length) = (0, 0);
    for (at, name) in all.iter().enumerate() {
        let follows =
            length > 0 && name.choice == Some(length) && is_separator(names.folded, all[at - 1].end, name.start);
        if follows {
            length += 1;
        } else {
            (first, length) = (at, usize::from(name.choice == Some(0)));
        }
        if length == count {
            let (start, end) = with_labels(names.folded, all[first].start, name.end);
            if count > 2 || is_list_of_two(names, offered, &all[first..=at], start..end) {
                lists.push((start, end));
            }
            length = 0;
        }
    }
    lists
}

/// True if the text between two bytes consists of separators, labels and words such as "and".
fn is_separator(folded: &str, start: usize, end: usize) -> bool {
    let Some(gap) = folded.get(start..end).filter(|gap| gap.len() <= MAX_GAP) else {
        return false;
    };
    !gap.is_empty()
        && !gap.contains(['?', '!'])
        && gap
            .split(|c: char| !c.is_alphabetic())
            .all(|word| word.len() <= 1 || matches!(word, "and" | "or" | "the" | "an" | "option" | "choice"))
}

/// The range of a list, extended by the label before its first choice and the one after its last.
fn with_labels(folded: &str, start: usize, end: usize) -> (usize, usize) {
    let before = folded[..start].trim_end_matches(['(', '[', ')', ']', '.', ':', '-', ' ']);
    let label = before.ends_with('a') && !before[..before.len() - 1].ends_with(char::is_alphanumeric);
    let after = &folded[end..];
    let label_after = after
        .trim_start_matches(' ')
        .strip_prefix(['(', '['])
        .and_then(|rest| rest.get(1..2))
        .is_some_and(|close| matches!(close, ")" | "]"));
    (
        if label { before.len() - 1 } else { start },
        if label_after { end + after.len() - after.trim_start_matches(' ').len() + 3 } else { end },
    )
}

/// True if two choices are listed rather than stated in a sentence: with a heading or labels, alone on a line, or as
/// "yes or no".
fn is_list_of_two(names: &Names<'_>, offered: &ChoiceViews, list: &[Name], span: Range<usize>) -> bool {
    let Range { start, end } = span;
    let folded = names.folded;
    let (before, after) = (folded[..start].trim_end_matches(' '), folded[end..].trim_start_matches(['.', ' ']));
    let last_word = before.trim_end_matches(':').rsplit(|c: char| !c.is_alphabetic()).next();
    let headed = before.ends_with(':') && matches!(last_word, Some("options" | "choices" | "answers"));
    let labels = names
        .letters
        .iter()
        .filter(|letter| (start..end).contains(&letter.start))
        .filter(|letter| names.labelled_text(letter).is_some());
    let labelled = start < list[0].start && labels.count() >= 2;
    let gap = folded[list[0].end..list[1].start].trim();
    let paired = offered.yes_no.is_some() && matches!(gap, "or" | "/" | "and/or");
    let whole = (before.is_empty() || before.ends_with('\n')) && (after.is_empty() || after.starts_with('\n'));
    headed || labelled || paired || (whole && !gap.is_empty() && !gap.contains('.'))
}
